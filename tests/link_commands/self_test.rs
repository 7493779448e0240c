//! `springpot link self-test` on a board that runs in this process: sound, and with what newcomers meet.

use std::io::{BufRead, BufReader};
use std::process::Child;
use std::thread;

use dea_driver::wire::Part;
use host_sim::files::parameters::{Board, Parameters};
use serde_json::Value;
use tests::tool::{names, rows};
use tests::virtual_board::Scene;

use crate::{Linked, ctrl_c};

/// A self-test of a board with parameters: the checks that failed, with what was found, and the highest voltage commanded.
fn failed(scene: Scene, more: &str) -> (Vec<(String, String)>, f32) {
    let board = Linked::ready(scene);
    let (code, report, errors) = board.ends(&format!("self-test --json {more}"));
    let report: Value = serde_json::from_str(&report).expect("a report");
    let failed: Vec<(String, String)> = rows(&report["checks"])
        .iter()
        .filter(|check| check["passed"] == false)
        .map(|check| (text(&check["what"]), text(&check["found"])))
        .collect();
    assert_eq!(report["passed"] == true, failed.is_empty(), "{report}");
    assert_eq!(code == Some(0), failed.is_empty(), "{errors}");
    let (highest_v, now_v) = board.voltage();
    assert_eq!(now_v, 0.0, "it ends at 0 V");
    (failed, highest_v)
}

fn text(value: &Value) -> String {
    value.as_str().expect("a text").to_owned()
}

fn whats(failed: &[(String, String)]) -> Vec<&str> {
    failed.iter().map(|(what, _)| what.as_str()).collect()
}

#[test]
fn a_sound_board_passes() {
    let (failed, highest_v) = failed(Scene::CALM, "--watchdog");
    assert!(failed.is_empty(), "{failed:?}");
    assert_eq!(highest_v, 50.0);
}

/// A fault that is found before anything is enabled ends the test there.
#[test]
fn nothing_is_enabled_before_all_answers() {
    let wrong = |found| Part::Wrong { wanted: 9, found };
    for (scene, what, found) in [
        (Scene { interlock_closed: false, ..Scene::CALM }, "interlock", "open"),
        (Scene { parts: [wrong(0), Part::Answers, Part::Answers], ..Scene::CALM }, "DAC", "0x0000 for 0x0009"),
        (
            Scene { parts: [Part::NoReference, Part::Answers, Part::Answers], ..Scene::CALM },
            "DAC",
            "has no internal reference",
        ),
        (Scene { parts: [Part::Answers, Part::Answers, wrong(8)], ..Scene::CALM }, "sensor's ADC", "0x0008 for 0x0009"),
        (Scene { panic_message: "a panic", ..Scene::CALM }, "state", "tripped: Panic"),
    ] {
        let (failed, highest_v) = failed(scene, "");
        assert!(failed.contains(&(what.to_owned(), found.to_owned())), "{what}: {failed:?}");
        assert_eq!(highest_v, 0.0, "{what}");
    }
    let (failed, highest_v) = failed(Scene { parts: [Part::Answers, wrong(0xffff), Part::Answers], ..Scene::CALM }, "");
    assert_eq!((whats(&failed), highest_v), (vec!["monitor's ADC", "monitor, disarmed"], 0.0));
}

#[test]
fn what_shows_only_while_it_is_enabled_is_found() {
    // Each waits for its board, most of the time.
    let faults: [(Scene, &str); 5] = [
        (Scene { enable_held_down: true, ..Scene::CALM }, ""),
        (Scene { monitor_gain: 0.5, ..Scene::CALM }, ""),
        (Scene { enable_welded: true, ..Scene::CALM }, ""),
        (Scene { stays_up: true, ..Scene::CALM }, ""),
        (Scene { watchdog: false, ..Scene::CALM }, "--watchdog"),
    ];
    let [(held, _), (gain, highest_v), (welded, _), (late, _), (watchdog, _)] = thread::scope(|scope| {
        let tests = faults.map(|(scene, options)| scope.spawn(move || failed(scene, options)));
        tests.map(|test| test.join().expect("it ran to its end"))
    });
    assert_eq!(whats(&held), ["enable, armed"]);
    assert_eq!((whats(&gain), highest_v), (vec!["monitor"], 50.0));
    // The board has noticed it as well, and has tripped.
    assert_eq!(whats(&welded), ["state", "enable, disarmed"]);
    assert_eq!(whats(&late), ["monitor, at the end"]);
    assert_eq!(whats(&watchdog), ["watchdog"]);
}

/// All at once, and whether the bench was tested since the start; what the run before did, up to its last tick.
#[test]
fn preflight_and_the_flight_recorder() {
    let board = Linked::ready(Scene::CALM);
    let in_the_way = || {
        let (code, _, errors) = board.ends("preflight");
        assert_eq!(code, Some(2));
        errors
    };
    names(&in_the_way(), &["not ready: self-test"]);
    names(&board.prints("flight-recorder"), &["nothing is recorded"]);
    // The reset at its end does not make it forgotten.
    board.prints("self-test --watchdog");
    let report: Value = serde_json::from_str(&board.prints("preflight --json")).expect("a report");
    assert_eq!(report["passed"], true, "{report}");

    // The self-test was a run.
    let out = board.bench.path("last.csv");
    names(&board.prints(&format!("flight-recorder --out {}", out.display())), &["the last run ended", "disarmed"]);
    let table = std::fs::read_to_string(&out).expect("written");
    let ticks: Vec<&str> = table.lines().skip(1).collect();
    assert_eq!(ticks.len(), 64);
    assert!(ticks.iter().all(|row| row.split(',').count() == 8), "{table}");
    // The tick that ended it is the last; whether one was armed between, after the run, depends on when the host comes.
    let ended: Vec<bool> = ticks.iter().map(|row| row.ends_with(",disarmed")).collect();
    assert_eq!(ended.iter().position(|ended| *ended), Some(63), "{table}");

    let out = out.parent().expect("a folder").join("none").join("last.csv");
    names(&board.fails(&format!("flight-recorder --out {}", out.display())), &["none"]);
    board.prints("arm");
    names(&board.fails("flight-recorder"), &["armed", "after the run"]);
    board.prints("disarm");
    board.open_interlock(true);
    names(&in_the_way(), &["not ready: interlock, arming"]);
}

/// Parameters that ask for a self-test: the board is not armed before it, and is after it, until the next start.
#[test]
fn a_board_that_asks_for_a_self_test_is_played_to_after_it() {
    let board = Linked::new(Scene::CALM);
    let parameters = Parameters::preset("table3-n2").expect("a preset");
    let asks = Board { self_test_above_v: 1000.0, ..Board::bench(&parameters.actuator) };
    board.bench.write("p.bin", parameters.to_blob(&asks, 1000.0).expect("valid"));
    board.json("upload --blob p.bin --try");
    names(&board.fails("arm"), &["no self-test", "self_test_above_v"]);
    let (_, preflight, _) = board.ends("preflight --json");
    names(&preflight, &["no self-test of the bench has passed since the start"]);
    board.prints("self-test");
    board.prints("arm");
    board.prints("disarm");
    board.prints("preflight");
}

/// The table is for people, the error names what failed, and a voltage that moves a film is refused.
#[test]
fn it_ends_in_a_table() {
    let board = Linked::ready(Scene { interlock_closed: false, ..Scene::CALM });
    let (code, table, line) = board.ends("self-test");
    assert_eq!(code, Some(2));
    assert!(table.lines().any(|line| line.starts_with("FAILED  interlock ")), "{table}");
    assert!(table.lines().filter(|line| line.starts_with("ok ")).count() >= 7, "{table}");
    names(&line, &["the self-test failed: interlock"]);
    names(&board.fails("self-test --voltage 3000"), &["--voltage", "500 V"]);
}

/// Reads standard error line by line until `what` is in one.
fn printed(lines: &mut impl Iterator<Item = std::io::Result<String>>, what: &str) {
    let found = lines.map(|line| line.expect("UTF-8")).find(|line| line.contains(what));
    assert!(found.is_some(), "{what:?} was never printed");
}

/// A self-test that waits for the interlock to be opened, and what else it will say on standard error.
fn waiting_for_a_hand(board: &Linked) -> (Child, impl Iterator<Item = std::io::Result<String>> + use<>) {
    let mut test = board.spawn("--json self-test --interlock");
    let mut lines = BufReader::new(test.stderr.take().expect("piped")).lines();
    printed(&mut lines, "open the interlock within");
    (test, lines)
}

/// A hand opens the interlock while the amplifier is enabled, and closes it again.
#[test]
fn the_interlock_is_tried_by_hand() {
    let board = Linked::ready(Scene::CALM);
    let (test, mut lines) = waiting_for_a_hand(&board);
    board.open_interlock(true);
    printed(&mut lines, "close the interlock within");
    board.open_interlock(false);
    let output = test.wait_with_output().expect("ends");
    let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
    assert_eq!((report["passed"] == true, output.status.success()), (true, true), "{report}");
    let opened = |check: &Value| check["what"] == "interlock, opened" && check["found"] == "tripped: Interlock";
    assert!(rows(&report["checks"]).iter().any(opened));
    assert_eq!(board.state(), "disarmed");
}

/// Ctrl-C ends at 0 V, and what was asked for has not passed.
#[test]
fn ctrl_c_is_no_pass() {
    let board = Linked::ready(Scene::CALM);
    let (test, mut lines) = waiting_for_a_hand(&board);
    ctrl_c(&test);
    printed(&mut lines, "stopped by Ctrl-C");
    let output = test.wait_with_output().expect("ends");
    let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
    assert_eq!((report["passed"] == false, output.status.code()), (true, Some(2)), "{report}");
    assert_eq!(board.state(), "disarmed");
}

/// A trip in the middle ends it, and is named.
#[test]
fn a_trip_ends_it() {
    let board = Linked::ready(Scene { opens_above_v: Some(30.0), ..Scene::CALM });
    let (code, _, errors) = board.ends("self-test");
    names(&errors, &["tripped (Interlock)"]);
    assert_eq!((code, board.voltage().1), (Some(2), 0.0));
}
