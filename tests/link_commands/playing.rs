//! `springpot link play` of recordings as they are, on a board that is slow, and on one that is left with Ctrl-C.

use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStderr};
use std::time::Duration;

use tests::tool::names;
use tests::virtual_board::Scene;

use crate::{Linked, ctrl_c};

const SLOW: Scene = Scene { tick: Duration::from_millis(5), ..Scene::CALM };

/// A recording as it is measured: its voltage is noise about 0 V at first. What is beyond the limits is refused before anything is enabled.
#[test]
fn play_takes_recordings_as_they_are() {
    let board = Linked::ready(Scene::CALM);
    names(&board.fails("play high.csv --out out.csv"), &["high.csv", "6500", "limits"]);
    assert_eq!(board.voltage(), (0.0, 0.0));
    board.bench.recordings("hossain");
    board.json("play hossain-5s.csv --out out.csv --duration 1");
    assert!(board.voltage().0 > 500.0);
}

/// A board whose clock is five times as slow plays what a recording says in its own time: the log lasts as long as the recording, and
/// the peak is where it is there.
#[test]
fn a_slow_board_is_played_to_in_its_own_time() {
    let board = Linked::ready(SLOW);
    board.json("play profile.csv --out out.csv");
    let [time_s, command_v] = ["time_s", "command_v"].map(|title| board.bench.column("out.csv", title));
    let (last_s, peak_v) = (time_s[time_s.len() - 1], command_v.iter().copied().fold(0.0, f64::max));
    let at_peak = command_v.iter().position(|&volts| volts == peak_v).expect("a peak");
    println!("{last_s} s, {peak_v} V at {} s", time_s[at_peak]);
    // By the host's clock they would be 0.4 s and 0.2 s. Disarming and the first values take some ticks more.
    assert!((1.9..2.4).contains(&last_s), "{last_s} s");
    assert!((0.9..1.3).contains(&time_s[at_peak]) && peak_v > 2900.0, "{peak_v} V at {} s", time_s[at_peak]);

    // What only listens does so for as long by the board's time.
    board.json("stream --out out.csv --duration 0.6");
    let last_s = board.bench.column("out.csv", "time_s").last().copied().expect("samples");
    assert!((0.5..0.8).contains(&last_s), "{last_s} s");
}

/// A board without parameters does not tick, and has no time: a stream ends by the host's.
#[test]
fn a_stream_without_ticks_ends() {
    let board = Linked::new(Scene::CALM);
    assert_eq!(board.json("stream --out out.csv --duration 0.1")["samples"], 0);
    assert!(!board.bench.path("out.csv").exists());
}

/// A board that answers and whose samples do not come: its state is unknown, so the playback ends at 0 V and says so.
#[test]
fn a_playback_without_samples_ends_at_0_v() {
    let board = Linked::ready(Scene { mute: true, ..Scene::CALM });
    board.bench.write("long.csv", "time_s,voltage_v\n0,1000\n60,1000\n");
    names(&board.fails("play long.csv --out out.csv"), &["its stream has stopped"]);
    let (largest, now) = board.voltage();
    assert!(largest > 900.0 && now == 0.0, "{largest} V, then {now} V");
    assert_eq!(board.state(), "disarmed");
}

/// A playback of a minute that stays at 3 kV, and its standard error.
fn playing(board: &Linked) -> (Child, impl Iterator<Item = String> + use<>) {
    board.bench.write("long.csv", "time_s,voltage_v\n0,0\n0.1,3000\n60,3000\n");
    let mut player = board.spawn("play long.csv --out out.csv");
    let printed: BufReader<ChildStderr> = BufReader::new(player.stderr.take().expect("piped"));
    board.wait_for_voltage(|(_, now)| now >= 3000.0);
    (player, printed.lines().map(|line| line.expect("UTF-8")))
}

/// The second Ctrl-C neither ends a playback before the film is at 0 V nor keeps it from reporting that it stays live.
#[test]
fn a_second_ctrl_c_does_not_leave_a_live_film() {
    // Its discharge is watched for a second of its time, five of the host's.
    let board = Linked::ready(Scene { stays_up: true, ..SLOW });
    let (mut player, mut printed) = playing(&board);
    ctrl_c(&player);
    names(&printed.next().expect("printed"), &["bringing the film to 0 V"]);
    ctrl_c(&player);
    let rest: Vec<String> = printed.collect();
    assert_eq!(player.wait().expect("ends").code(), Some(2), "{rest:?}");
    names(&rest[0], &["still bringing the film to 0 V", "again to leave it"]);
    names(rest.last().expect("printed"), &["the film is live", "Do not touch it"]);
    assert!(board.bench.path("out.csv").exists(), "what was measured is kept");
}

/// Only the third leaves, and says what it leaves.
#[test]
fn a_third_ctrl_c_says_what_it_leaves() {
    // Its discharge is watched for five seconds.
    let board = Linked::ready(Scene { stays_up: true, ..SLOW });
    let (mut player, mut printed) = playing(&board);
    for expected in ["bringing the film to 0 V", "still bringing the film", "leaving a film that may be live"] {
        ctrl_c(&player);
        names(&printed.next().expect("printed"), &[expected]);
    }
    assert_eq!(player.wait().expect("ends").code(), Some(130));
}

/// Where all is well, any number of them ends at 0 V, disarmed, and not by the board's heartbeat.
#[test]
fn ctrl_c_twice_ends_at_0_v() {
    let board = Linked::ready(Scene::CALM);
    let (mut player, mut printed) = playing(&board);
    ctrl_c(&player);
    printed.next().expect("printed");
    // It may have ended already, which is not known before it is waited for.
    ctrl_c(&player);
    assert_eq!(player.wait().expect("ends").code(), Some(130));
    assert_eq!(board.voltage().1, 0.0);
    assert_eq!(board.state(), "disarmed");
}
