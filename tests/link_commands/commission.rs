//! `springpot commission` on a board.

use std::time::Duration;

use dea_driver::Limits;
use serde_json::Value;
use tests::tool::{names, rows};
use tests::virtual_board::Scene;

use crate::{Linked, ctrl_c};

/// A board file, and the same with a model.
pub fn files(board: &Linked) {
    board.bench.json("reduce --params preset:table3-n1 --tolerance 1e-9 --out model.toml");
    let Limits { max_voltage_v, .. } = Limits::bench(160e-6);
    assert_eq!(max_voltage_v, 6000.0);
    let own = "id = 1029\ncommand_range = \"ten-volts\"\namplifier = { offset = 0.0, gain = 1000.0, quadratic = 0.0 }\nmonitor = { offset = 0.0, gain = 1000.0, quadratic = 0.0 }\n\
               sensor = { offset = -1e-3, gain = 1e-3, quadratic = 0.0 }\n";
    let model = board.bench.read("model.toml");
    board.bench.write("b.toml", format!("{model}\n[board]\n{own}{LIMITS}"));
}

const LIMITS: &str = "[board.limits]\nmax_voltage_v = 5000.0\nmax_field_v_per_m = 4.2e7\nthickness_m = 160e-6\nmax_slew_v_per_s = 50e3\n\
    max_displacement_m = 8e-3\nmonitor = { slew_v_per_s = 100e3, band_v = 60.0, band_share = 0.03, settle_s = 0.02 }\n\
    sensor = { low = -0.5e-3, high = 9e-3, jump = 0.5e-3, stuck_ticks = 500 }\non_sensor_fault = \"trip\"\nheartbeat_s = 2.0\n";

fn line(board: &Linked, out: &str, rest: &str) -> String {
    format!("commission --board b.toml --port {} --out {out} {rest}", board.port)
}

fn cause(record: &Value) -> &str {
    record["findings"][0]["cause"].as_str().unwrap_or("none")
}

/// Self-test, upload, and what is read back; a dry run leaves the old parameters.
#[test]
fn a_board_is_tested_and_given_parameters_that_are_read_back() {
    let board = Linked::ready(Scene::CALM);
    files(&board);
    let sitting = |rest: &str| board.bench.says_no(&line(&board, "sitting", rest));
    let record = sitting("--only self-test --gauge 2mm:2.01mm");
    assert_eq!(cause(&record), "none", "{record}");
    let checks = rows(&record["self_test"]);
    assert!(checks.len() > 10 && checks.iter().all(|check| check["passed"] == true), "{record}");
    assert_eq!(cause(&sitting("--only self-test --gauge 2mm:2.1mm")), "sensor scale");

    let before = board.json("identify")["checksum"].clone();
    std::fs::copy(board.bench.path("b.toml"), board.bench.path("sitting/film.toml")).expect("copied");
    let uploaded = |record: &Value| format!("{:08x}", record["checksum"].as_u64().expect("read back"));
    let dry = sitting("--only upload --dry-run");
    assert_ne!(before, uploaded(&dry).as_str());
    assert_eq!(board.json("identify")["checksum"], before);
    let record = sitting("--only upload");
    assert_eq!(board.json("identify")["checksum"], uploaded(&record).as_str());
}

/// A board whose clock runs at four times the rate that it states: the ramp runs, each step as predicted, and the clock is named.
#[test]
fn a_ramp_on_a_board_with_another_clock_names_the_clock() {
    let board = Linked::ready(Scene { tick: Duration::from_micros(250), ..Scene::CALM });
    files(&board);
    let record = board.bench.says_no(&line(&board, "sitting", "--only ramp"));
    assert_eq!(cause(&record), "clock", "{record}");
    let (largest, now) = board.voltage();
    assert!((largest - 4500.0).abs() < 10.0 && now == 0.0, "{largest} V, then {now} V");
    for step in rows(&record["ramp"]["steps"]).iter().skip(4) {
        let [predicted, measured] = ["predicted_m", "measured_m"].map(|key| step[key].as_f64().expect("a number"));
        assert!((predicted - measured).abs() < 0.1 * measured, "{step}");
    }
}

/// Ended by Ctrl-C, or killed: 0 V, and no record.
#[test]
fn a_sitting_that_is_ended_leaves_no_record() {
    let board = Linked::ready(Scene::CALM);
    files(&board);
    for (out, is_killed) in [("ended", false), ("killed", true)] {
        let mut command = std::process::Command::new(crate::TOOL.0);
        command.args(line(&board, out, "--only ramp").split(' ')).current_dir(board.bench.path(""));
        let mut child = command.stderr(std::process::Stdio::null()).spawn().expect("runs");
        board.wait_for_voltage(|(_, now)| now > 300.0);
        if is_killed {
            child.kill().expect("killed");
        } else {
            ctrl_c(&child);
        }
        child.wait().expect("ends");
        board.wait_for_voltage(|(_, now)| now == 0.0);
        assert!(!board.bench.path(out).join("record.json").exists());
    }
    names(&board.prints("status"), &["tripped: Heartbeat"]);
}
