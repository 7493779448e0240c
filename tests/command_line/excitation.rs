//! `profile` and `check`: voltages that identify a film, and whether recordings do.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;
use tests::table::column;
use tests::tool::{names, text};

use crate::TOOL;

/// A film that is not fitted yet: no model. 4.2e7 V/m on 100 µm are 4200 V, below the 6000 V of the amplifier.
const BOARD: &str = "schema = 1\n[actuator]\nrelative_permittivity = 4.7\nlength_m = 0.04\nwidth_m = 0.06\nthickness_m = 100e-6\n\
    mass_kg = 0.3\n[board.limits]\nmax_voltage_v = 6000.0\nmax_field_v_per_m = 4.2e7\nthickness_m = 100e-6\n\
    max_slew_v_per_s = 5000.0\nmax_displacement_m = 8e-3\non_sensor_fault = \"trip\"\nheartbeat_s = 0.5\n\
    monitor = { slew_v_per_s = 1e5, band_v = 60.0, band_share = 0.03, settle_s = 0.02 }\n\
    sensor = { low = -0.5e-3, high = 9e-3, jump = 0.5e-3, stuck_ticks = 500, stuck_band = 2e-6 }\n";

struct Bench(TempDir);

impl Bench {
    fn new() -> Self {
        Self(TempDir::new().expect("a folder"))
    }

    fn path(&self, name: &str) -> String {
        text(&self.0.path().join(name)).to_owned()
    }

    fn file(&self, name: &str, content: &str) -> String {
        let path = self.path(name);
        fs::write(&path, content).expect("written");
        path
    }
}

fn checked(files: &[&str]) -> (Value, i32) {
    let output = TOOL.with(&[&["check", "--json"], files].concat()).output().expect("runs");
    let report = serde_json::from_slice(&output.stdout).expect("one document");
    (report, output.status.code().expect("ends"))
}

#[test]
fn a_profile_keeps_the_limits_of_its_board() {
    let bench = Bench::new();
    let (board, out) = (bench.file("board.toml", BOARD), bench.path("profile.csv"));
    let report = TOOL.json(&["profile", "--board", &board, "--out", &out]);
    assert_eq!((&report["limit"], &report["peak_v"]), (&"max_field_v_per_m".into(), &3780.0.into()));
    let [time, voltage] = ["time_s", "voltage_v"].map(|name| column(Path::new(&out), name));
    assert!(voltage.iter().all(|volts| (0.0..=3780.0).contains(volts)));
    let slew = voltage.windows(2).map(|pair| (pair[1] - pair[0]).abs() * 100.0).fold(0.0, f64::max);
    assert!(slew <= 5000.0 && slew > 1000.0, "{slew}");
    // 5 s of rest, then V/2 (1 - cos 2 pi f t) of 0.2 Hz.
    let at = |t: f64| voltage[time.iter().position(|time| (time - t).abs() < 1e-9).expect("a row")];
    assert!(voltage[..=500].iter().all(|volts| *volts == 0.0));
    assert!((at(6.25) - 1890.0).abs() < 1e-6 && (at(7.5) - 3780.0).abs() < 1e-6 && at(10.0).abs() < 1e-6);
    // A hold of a minute at one voltage, and rest at the end.
    let held = voltage.iter().filter(|volts| (**volts - 0.8 * 3780.0).abs() < 1e-9).count();
    assert!((6000..=6200).contains(&held), "{held}");
    assert_eq!(voltage.last(), Some(&0.0));
}

/// The file that the page shows to copy makes a profile, within its own limit: 3.5e7 V/m on 100 µm.
#[test]
fn the_bench_file_of_the_page_makes_a_profile() {
    let page = include_str!("../../docs/matlab.md");
    let (_, toml) = page.split_once("```toml\n# bench.toml\n").expect("the page shows it");
    let (toml, _) = toml.split_once("```").expect("the block ends");
    let bench = Bench::new();
    let (board, out) = (bench.file("bench.toml", toml), bench.path("profile.csv"));
    let report = TOOL.json(&["profile", "--board", &board, "--out", &out]);
    assert_eq!((&report["limit"], &report["peak_v"]), (&"max_field_v_per_m".into(), &3150.0.into()), "{report}");
    assert!(report.get("notes").is_none(), "{report}");
    // Without the limits they are those of the paper's bench, which is reported.
    let (film, _) = toml.split_once("[board.limits]").expect("limits");
    let report = TOOL.json(&["profile", "--board", &bench.file("film.toml", film), "--out", &out]);
    names(&report["notes"].to_string(), &["no [board.limits]", "the paper's bench", "4200 V"]);
}

/// The whole way: a profile, played to a film, identifies it: the fit predicts another voltage of another frequency.
#[test]
fn what_a_profile_excites_identifies_a_film() {
    let bench = Bench::new();
    let (board, profile) = (bench.file("board.toml", BOARD), bench.path("profile.csv"));
    TOOL.with(&["profile", "--board", &board, "--out", &profile]).assert().success();
    let recording = bench.path("recording.csv");
    let simulate =
        ["simulate", "--params", "preset:table3-n2", "--rate", "100", "--profile", &profile, "--out", &recording];
    TOOL.with(&simulate).assert().success();
    let (report, status) = checked(&[&recording]);
    assert_eq!((&report["identifies"], status), (&true.into(), 0), "{report}");
    assert_eq!(report["findings"], serde_json::json!([]));
    let drive = &report["recordings"][0]["drive"];
    let frequencies: Vec<f64> =
        drive["frequencies_hz"].as_array().expect("a list").iter().filter_map(Value::as_f64).collect();
    assert_eq!(frequencies.len(), 3, "{drive}");
    for (found, made) in frequencies.iter().zip([0.077, 0.14, 0.2]) {
        assert!((found / made - 1.0).abs() < 0.02, "{found} {made}");
    }
    assert!((drive["rest_s"].as_f64().expect("a number") - 5.0).abs() < 0.3, "{drive}");
    assert!((drive["hold_s"].as_f64().expect("a number") - 61.0).abs() < 2.0, "{drive}");
    let printed = TOOL.with(&["check", &recording]).assert().success().get_output().stdout.clone();
    names(
        &String::from_utf8(printed).expect("UTF-8"),
        &["these recordings identify a film", "cycles of 0.0770, 0.1400, 0.2000 Hz"],
    );

    let (film, other) = (bench.path("film.toml"), bench.path("other.csv"));
    let structure = ["--topology", "eq11", "--branches", "2", "--curve", "none"];
    TOOL.json(&[&["fit", &recording, "--out", &film, "--actuator", "preset:table3-n2"][..], &structure].concat());
    let volts = |t: f64| if t < 1.0 { 0.0 } else { 1250.0 * (1.0 - (std::f64::consts::TAU * 0.1 * (t - 1.0)).cos()) };
    let rows: String = (0..=6000).map(|k| 0.01 * f64::from(k)).map(|t| format!("{t},{}\n", volts(t))).collect();
    let voltage = bench.file("voltage.csv", &format!("time_s,voltage_v\n{rows}"));
    let truth = ["simulate", "--params", "preset:table3-n2", "--rate", "100", "--memory", "full", "--precision", "f64"];
    TOOL.json(&[&truth[..], &["--profile", &voltage, "--out", &other]].concat());
    let report = TOOL.json(&["replay", "--params", &film, "--rate", "100", &other]);
    let nrmse_pct = report["recordings"][0]["nrmse_pct"].as_f64().expect("compared");
    assert!(nrmse_pct < 0.5, "{nrmse_pct} %");
}

/// The committed recordings: three frequencies of one amplitude together, one frequency alone.
#[test]
fn recordings_are_judged_together() {
    let recordings = tests::recordings("wang");
    let paths: Vec<&str> = recordings.iter().map(|path| text(path)).collect();
    let (report, status) = checked(&paths);
    assert_eq!((&report["identifies"], status), (&true.into(), 0), "{report}");
    names(&report["findings"].to_string(), &["one amplitude only"]);
    let (report, status) = checked(&paths[..1]);
    assert_eq!((&report["identifies"], status), (&false.into(), 1), "{report}");
}
