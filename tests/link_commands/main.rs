//! `host-sim link` against a board that runs in this process.

mod playing;
mod self_test;

use std::fs;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use dea_driver::wire::{Answer, Command, FRAME_LEN, Identity, Message, Receiver, Request, VERSION, boards, encode};
use host_sim::link::{Client, Port};
use tempfile::TempDir;
use tests::tool::{Tool, names, text};
use tests::virtual_board::{Scene, VirtualBoard};
use tests::{crc32, recordings};

const TOOL: Tool = Tool(env!("CARGO_BIN_EXE_host-sim-under-test"));

fn link<'a>(board: &'a VirtualBoard, verb: &[&'a str]) -> Vec<&'a str> {
    [&["link", "--port", board.port.as_str()], verb].concat()
}

fn upload(board: &VirtualBoard) {
    TOOL.json(&link(board, &["upload", "--params", "preset:table3-n2", "--bench"]));
}

/// Two seconds of a half wave up to 3 kV.
fn profile(folder: &TempDir) -> PathBuf {
    let path = folder.path().join("profile.csv");
    let rows = (0..=20).map(|k| format!("{},{}\n", f64::from(k) / 10.0, 300 * (10 - (k - 10i32).abs())));
    fs::write(&path, "time_s,voltage_v\n".to_owned() + &rows.collect::<String>()).expect("written");
    path
}

#[test]
fn a_board_reports_identity_and_status() {
    let board = VirtualBoard::start(Scene::CALM);
    let who = TOOL.json(&link(&board, &["identify"]));
    assert_eq!((who["firmware"].as_str(), who["board"].as_u64()), (Some("virtual"), Some(0x0405)));
    assert!(who["parameters"].is_null());
    let how = TOOL.json(&link(&board, &["status"]));
    assert_eq!(how["state"], "disarmed");
    assert!(how["rate_hz"].is_null());
    assert_eq!(how["stack_peak_bytes"], 1234);
    let parts = &how["parts"];
    assert_eq!((&parts["interlock_closed"], &parts["sensor"]), (&true.into(), &"answers".into()));
    assert!((0.99..1.01).contains(&parts["sensor_adc_v"].as_f64().expect("a number")), "{parts}");
    assert_eq!(parts["monitor_adc_v"], 0.0);
    let line = TOOL.with(&link(&board, &["status"])).assert().success().get_output().stdout.clone();
    names(
        &String::from_utf8(line).expect("UTF-8"),
        &["interlock closed", "sensor: 1.0", "monitor: 0.000 V", "damaged"],
    );
    names(&TOOL.fails(&link(&board, &["arm"])), &[&board.port, "no parameters yet", "upload"]);

    upload(&board);
    assert_eq!(TOOL.json(&link(&board, &["identify"]))["parameters"], "karner-2022-table3-n2");
    assert_eq!(TOOL.json(&link(&board, &["status"]))["rate_hz"], 1000.0);
    assert!(TOOL.json(&link(&board, &["panic"]))["message"].is_null());
    // It injects no faults: what was armed for one ends at 0 V.
    names(&TOOL.fails(&link(&board, &["drill", "bus"])), &["bus", "no faults on purpose", "cargo xtask board"]);
    assert_eq!(board.voltage().1, 0.0);
    assert_eq!(TOOL.json(&link(&board, &["status"]))["state"], "disarmed");
    names(&TOOL.fails(&link(&board, &["drill", "--voltage", "5"])), &["--voltage", "100"]);
}

/// A part that is not connected is shown as such.
#[test]
fn the_status_reports_what_does_not_answer() {
    let parts = [dea_driver::wire::Part::Answers, dea_driver::wire::Part::Bus, dea_driver::wire::Part::Answers];
    let board = VirtualBoard::start(Scene { interlock_closed: false, parts, ..Scene::CALM });
    let line = TOOL.with(&link(&board, &["status"])).assert().success().get_output().stdout.clone();
    names(&String::from_utf8(line).expect("UTF-8"), &["interlock open", "monitor: does not answer"]);
    let parts = TOOL.json(&link(&board, &["status"]))["parts"].clone();
    assert_eq!((&parts["interlock_closed"], &parts["monitor_adc_v"]), (&false.into(), &serde_json::Value::Null));
}

#[test]
fn each_verb_has_its_effect() {
    // Slow, so that the next command comes within its 500 ticks on a busy machine as well.
    let board = VirtualBoard::start(Scene { tick: Duration::from_millis(4), ..Scene::CALM });
    upload(&board);
    names(&TOOL.fails(&link(&board, &["start", "voltage"])), &["not while it is disarmed"]);
    names(&TOOL.fails(&link(&board, &["set", "--voltage", "6300"])), &["beyond the limits"]);
    names(&TOOL.fails(&link(&board, &["set", "--voltage", "NaN"])), &["--voltage", "must be finite"]);
    names(&TOOL.fails(&link(&board, &["set"])), &["--voltage", "--reference"]);
    names(&TOOL.fails(&link(&board, &["set", "--voltage", "1", "--reference", "1"])), &["cannot be used with"]);
    // What would act in a later run is not taken.
    names(&TOOL.fails(&link(&board, &["set", "--voltage", "1500"])), &["not while it is disarmed"]);
    let armed = TOOL.json(&link(&board, &["arm"]));
    let token = armed["token"].as_u64().expect("a number").to_string();
    // Who did not arm it can neither start nor move it.
    names(&TOOL.fails(&link(&board, &["start", "voltage"])), &["another host armed it", "--token"]);
    TOOL.json(&link(&board, &["start", "voltage", "--token", &token]));
    names(&TOOL.fails(&link(&board, &["set", "--voltage", "1500"])), &["another host armed it", "--token"]);
    TOOL.json(&link(&board, &["set", "--voltage", "1500", "--token", &token]));
    // No host talks to it any more: 0 V after 500 of its ticks.
    board.wait_for_voltage(|(largest, now)| (largest, now) == (1500.0, 0.0));
    assert_eq!(TOOL.json(&link(&board, &["status"]))["state"], "tripped: Heartbeat");
    names(&TOOL.fails(&link(&board, &["arm"])), &["tripped (Heartbeat)", "acknowledge"]);
    TOOL.json(&link(&board, &["acknowledge"]));
    TOOL.json(&link(&board, &["arm"]));
    TOOL.json(&link(&board, &["disarm"]));
    assert_eq!(TOOL.json(&link(&board, &["status"]))["state"], "disarmed");
}

/// A recording is played, what the board measures comes back as a recording, and the film is left at 0 V.
#[test]
fn play_follows_a_recording_and_ends_at_0_v() {
    let folder = TempDir::new().expect("a folder");
    let (played, out) = (profile(&folder), folder.path().join("out.csv"));
    let board = VirtualBoard::start(Scene::CALM);
    upload(&board);
    let report = TOOL.json(&link(&board, &["play", text(&played), "--out", text(&out), "--every", "5"]));
    assert_eq!(report["state"], "disarmed");
    assert!(report["samples"].as_u64().expect("a number") > 200, "{report}");
    let (largest, now) = board.voltage();
    assert!((2900.0..=3000.0).contains(&largest) && now == 0.0, "{largest} V, then {now} V");
    // The file is a recording, which any command reads.
    let replayed = TOOL.json(&["replay", "--params", "preset:table3-n2", text(&out)]);
    assert!(replayed["recordings"][0]["samples"].as_u64().expect("a number") > 200);
    let header = fs::read_to_string(&out).expect("written");
    assert!(header.starts_with("time_s,tick,command_v,voltage_v,displacement_m,predicted_m,reference_m,"));
}

/// A recording as it is measured: its voltage is noise about 0 V at first.
#[test]
fn play_takes_recordings_as_they_are() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("out.csv");
    let [recording, ..] = recordings("hossain");
    let board = VirtualBoard::start(Scene::CALM);
    upload(&board);
    TOOL.json(&link(&board, &["play", text(&recording), "--out", text(&out), "--duration", "1"]));
    assert!(board.voltage().0 > 500.0);
    // What is beyond the limits is refused before anything is enabled.
    let high = folder.path().join("high.csv");
    fs::write(&high, "time_s,voltage_v\n0,0\n1,6500\n2,0\n").expect("written");
    let board = VirtualBoard::start(Scene::CALM);
    upload(&board);
    names(&TOOL.fails(&link(&board, &["play", text(&high), "--out", text(&out)])), &["high.csv", "6500", "limits"]);
    assert_eq!(board.voltage(), (0.0, 0.0));
}

/// A player that is killed leaves what it has seen, but for the last second; the next one says where it is. The board ends at 0 V.
#[test]
fn a_killed_player_leaves_its_samples() {
    let folder = TempDir::new().expect("a folder");
    let (long, out) = (folder.path().join("long.csv"), folder.path().join("out.csv"));
    let rows = (0..=60).map(|second| format!("{second},{}\n", if second < 2 { 1000 * second } else { 2000 }));
    fs::write(&long, "time_s,voltage_v\n".to_owned() + &rows.collect::<String>()).expect("written");
    let board = VirtualBoard::start(Scene::CALM);
    upload(&board);
    let play = link(&board, &["play", text(&long), "--out", text(&out)]);
    let mut player = std::process::Command::new(TOOL.0).args(&play).spawn().expect("runs");
    let part = folder.path().join("out.csv.part");
    let seen = || fs::read_to_string(&part).map_or(0, |text| text.lines().count());
    while seen() < 150 {
        assert!(player.try_wait().expect("waits").is_none(), "it ends by itself");
        thread::sleep(Duration::from_millis(20));
    }
    player.kill().expect("runs");
    player.wait().expect("killed");
    assert!(!out.exists());
    board.wait_for_voltage(|(_, now)| now == 0.0);
    TOOL.json(&link(&board, &["acknowledge"]));
    let short = [play.as_slice(), &["--duration", "0.3"]].concat();
    let output = TOOL.with(&short).assert().success().get_output().clone();
    let printed = String::from_utf8(output.stderr).expect("UTF-8");
    names(&printed, &["out.csv", "was killed", "samples are kept", "out.recovered-1.csv"]);
    let recovered = folder.path().join("out.recovered-1.csv");
    let replayed = TOOL.json(&["replay", "--params", "preset:table3-n2", text(&recovered)]);
    assert!(replayed["recordings"][0]["samples"].as_u64().expect("a number") > 145);
    assert!(out.exists() && !part.exists());
}

/// A run that does not begin leaves the file of the one before, and what others have left half written is not touched.
#[test]
fn files_of_earlier_runs_stay() {
    let folder = TempDir::new().expect("a folder");
    let (played, out) = (profile(&folder), folder.path().join("out.csv"));
    fs::write(&out, "an earlier run").expect("written");
    let board = VirtualBoard::start(Scene { interlock_closed: false, ..Scene::CALM });
    upload(&board);
    let play = link(&board, &["play", text(&played), "--out", text(&out)]);
    names(&TOOL.fails(&play), &["the interlock is open"]);
    assert_eq!(fs::read_to_string(&out).expect("kept"), "an earlier run");
    let part = folder.path().join("out.csv.part");
    assert!(!part.exists());
    // Refused before it is armed, and after that: samples of a film at rest are no run.
    let high = folder.path().join("high.csv");
    fs::write(&high, "time_s,voltage_v\n0,0\n1,6500\n2,0\n").expect("written");
    let calm = VirtualBoard::start(Scene::CALM);
    upload(&calm);
    names(&TOOL.fails(&link(&calm, &["play", text(&high), "--out", text(&out)])), &["6500", "limits"]);
    let carried = ["play", text(&played), "--out", text(&out), "--carry-over", "--every", "1"];
    names(&TOOL.fails(&link(&calm, &carried)), &[&calm.port]);
    assert_eq!(calm.voltage(), (0.0, 0.0));
    assert_eq!(fs::read_to_string(&out).expect("kept"), "an earlier run");
    assert!(!part.exists());
    fs::write(&part, "notes\nof another program\n").expect("written");
    names(&TOOL.fails(&play), &["out.csv.part", "move it away"]);
    assert_eq!(fs::read_to_string(&part).expect("kept"), "notes\nof another program\n");
}

/// After a reset a board may run other parameters than were uploaded last: `play` reports which, and compares them if it is given any.
#[test]
fn play_compares_the_parameters() {
    let folder = TempDir::new().expect("a folder");
    let (played, out) = (profile(&folder), folder.path().join("out.csv"));
    let board = VirtualBoard::start(Scene::CALM);
    upload(&board);
    let who = TOOL.json(&link(&board, &["identify"]));
    let checksum = who["checksum"].as_str().expect("known");
    let options = ["play", text(&played), "--out", text(&out), "--duration", "0.2", "--bench", "--params"];
    let play = |preset| link(&board, &[options.as_slice(), &[preset]].concat());
    names(&TOOL.fails(&play("preset:table3-n3")), &["karner-2022-table3-n2", checksum, "upload"]);
    assert_eq!(board.voltage(), (0.0, 0.0));
    let report = TOOL.json(&play("preset:table3-n2"));
    assert_eq!((&report["parameters"], &report["checksum"]), (&who["parameters"], &who["checksum"]));
}

/// References are followed with and without the sensor.
#[test]
fn play_follows_references() {
    let folder = TempDir::new().expect("a folder");
    let (reference, out) = (folder.path().join("reference.csv"), folder.path().join("out.csv"));
    let shape = ["--shape", "sine", "--low", "0.3e-3", "--high", "0.5e-3", "--period", "10", "--out", text(&reference)];
    TOOL.json(&[["reference"].as_slice(), &shape].concat());
    for mode in ["feedforward", "tracking"] {
        let board = VirtualBoard::start(Scene::CALM);
        upload(&board);
        let play = ["play", text(&reference), "--mode", mode, "--duration", "3", "--out", text(&out)];
        let report = TOOL.json(&link(&board, &play));
        assert_eq!(report["state"], "disarmed");
        let (largest, now) = board.voltage();
        assert!(largest > 500.0 && now == 0.0, "{mode}: {largest} V, then {now} V");
    }
}

/// The interlock opens halfway: the command reports it, keeps what was measured, and the film is at 0 V.
#[test]
fn a_trip_ends_the_playback() {
    let folder = TempDir::new().expect("a folder");
    let (played, out) = (profile(&folder), folder.path().join("out.csv"));
    let board = VirtualBoard::start(Scene { opens_above_v: Some(2000.0), ..Scene::CALM });
    upload(&board);
    let line = TOOL.fails(&link(&board, &["play", text(&played), "--out", text(&out)]));
    names(&line, &["tripped (Interlock)", "acknowledge"]);
    assert_eq!(board.voltage().1, 0.0);
    assert!(fs::read_to_string(&out).expect("kept").lines().count() > 20);
    // Not even armed while it is open.
    let board = VirtualBoard::start(Scene { interlock_closed: false, ..Scene::CALM });
    upload(&board);
    let line = TOOL.fails(&link(&board, &["play", text(&played), "--out", text(&out)]));
    names(&line, &["the interlock is open"]);
    assert_eq!(board.voltage(), (0.0, 0.0));
}

/// Disabled, and still at 3 kV: what no command can fix is reported in every way there is.
#[test]
fn a_film_that_stays_live_is_reported() {
    let folder = TempDir::new().expect("a folder");
    let (high, out) = (folder.path().join("high.csv"), folder.path().join("out.csv"));
    fs::write(&high, "time_s,voltage_v\n0,0\n0.5,3000\n1,3000\n").expect("written");
    let board = VirtualBoard::start(Scene { enable_welded: true, ..Scene::CALM });
    upload(&board);
    let line = TOOL.fails(&link(&board, &["play", text(&high), "--out", text(&out)]));
    names(&line, &["the film is live", "monitor: 3000 V", "Do not touch it"]);
    assert!(fs::read_to_string(&out).expect("kept").lines().count() > 20);
    let how = TOOL.json(&link(&board, &["status"]));
    assert_eq!((&how["state"], &how["live"]), (&"tripped: LiveFilm".into(), &true.into()));
    assert_eq!((&how["command_v"], how["monitor_v"].as_f64().map(f64::round)), (&0.0.into(), Some(3000.0)));
    names(&TOOL.fails(&link(&board, &["disarm"])), &["the film is live"]);
    names(&TOOL.fails(&link(&board, &["acknowledge"])), &["does not read 0 V"]);
    names(&TOOL.fails(&link(&board, &["arm"])), &["the film is live"]);
}

#[test]
fn a_panic_before_the_start_stays_until_it_is_acknowledged() {
    let board = VirtualBoard::start(Scene { panic_message: "a panic at src/faults.rs:75", ..Scene::CALM });
    assert_eq!(TOOL.json(&link(&board, &["panic"]))["message"], "a panic at src/faults.rs:75");
    assert_eq!(TOOL.json(&link(&board, &["status"]))["state"], "tripped: Panic");
    // New parameters do not clear it.
    upload(&board);
    assert_eq!(TOOL.json(&link(&board, &["status"]))["state"], "tripped: Panic");
    names(&TOOL.fails(&link(&board, &["arm"])), &["tripped (Panic)"]);
    TOOL.json(&link(&board, &["acknowledge"]));
    TOOL.json(&link(&board, &["arm"]));
}

/// A board takes what `export` writes, for it and no other, at rates that it can.
#[test]
fn blobs_are_checked_before_they_are_sent_and_after() {
    let folder = TempDir::new().expect("a folder");
    let blob = folder.path().join("p.bin");
    TOOL.json(&["export", "--params", "preset:table4-f7", "--rate", "500", "--out", text(&blob)]);
    let board = VirtualBoard::start(Scene::CALM);
    TOOL.json(&link(&board, &["upload", "--blob", text(&blob), "--try"]));
    assert_eq!(TOOL.json(&link(&board, &["identify"]))["parameters"], "karner-2022-table4-f7");

    let mut bytes = fs::read(&blob).expect("written");
    bytes[6] ^= 1;
    let end = bytes.len() - 4;
    let checksum = crc32(&bytes[..end]).to_le_bytes();
    bytes[end..].copy_from_slice(&checksum);
    fs::write(&blob, &bytes).expect("written");
    names(&TOOL.fails(&link(&board, &["upload", "--blob", text(&blob)])), &["made for this board"]);
    fs::write(&blob, &bytes[..end]).expect("written");
    names(&TOOL.fails(&link(&board, &["upload", "--blob", text(&blob)])), &["p.bin", "truncated"]);
    let fast = link(&board, &["upload", "--params", "preset:table3-n1", "--rate", "6000", "--bench"]);
    names(&TOOL.fails(&fast), &["cannot tick at that rate", "--rate"]);
    names(&TOOL.fails(&link(&board, &["upload"])), &["--params"]);
    // Calibrations of another bench are refused unless --bench is given.
    let bare = link(&board, &["upload", "--params", "preset:table3-n1"]);
    names(&TOOL.fails(&bare), &["preset:table3-n1", "[board]", "--bench"]);
    assert_eq!(TOOL.json(&link(&board, &["identify"]))["parameters"], "karner-2022-table4-f7", "the old ones stay");
}

/// A peer that sends without end, but no valid frame, ends in a timeout after a few seconds. The message names another device.
#[test]
fn a_port_that_sends_garbage_ends_in_a_timeout() {
    let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
    let port = format!("tcp:{}", listener.local_addr().expect("bound"));
    let garbage = thread::spawn(move || {
        let (mut line, _) = listener.accept().expect("connects");
        // Until the other side closes the connection.
        while line.write_all(b"ABCDEFG").is_ok() {
            thread::sleep(Duration::from_millis(2));
        }
    });
    names(
        &TOOL.fails(&["link", "--port", &port, "status"]),
        &[&port, "check that this is the controller", "bytes such as", "ABCDEFG"],
    );
    garbage.join().expect("the connection was closed");
}

/// The verbs over a serial port, and the message when its plug is pulled.
#[cfg(target_os = "linux")]
#[test]
fn a_serial_port_is_as_good() {
    let board = VirtualBoard::at_a_serial_port(Scene::CALM);
    upload(&board);
    assert_eq!(TOOL.json(&link(&board, &["identify"]))["parameters"], "karner-2022-table3-n2");
    TOOL.json(&link(&board, &["arm"]));
    TOOL.json(&link(&board, &["disarm"]));
    let how = TOOL.json(&link(&board, &["status"]));
    assert_eq!((&how["state"], &how["damaged_frames"]), (&"disarmed".into(), &0.into()));

    let (mut client, identity) = Client::new(Port::open(&board.port).expect("opens")).expect("answers");
    assert_eq!(identity.firmware, "virtual");
    drop(board);
    let gone = client.status().expect_err("unplugged").to_string();
    assert!(gone.contains("the connection is gone"), "{gone}");
}

/// A controller at a port of its own. To each request but its identification `react` gives the answer, by their number from 1 on: none with
/// `Continue(None)`, and it hangs up with `Break`. Ends with the requests.
fn peer(react: fn(usize, &Command) -> ControlFlow<(), Option<Answer>>) -> (Port, JoinHandle<Vec<Request>>) {
    let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
    let port = format!("tcp:{}", listener.local_addr().expect("bound"));
    let peer = thread::spawn(move || {
        let (line, _) = listener.accept().expect("connects");
        let (mut receiver, mut requests) = (Receiver::new(), Vec::new());
        for byte in Read::bytes(&line) {
            let Some(request) = receiver.push::<Request>(byte.expect("read")) else { continue };
            let request = request.expect("whole");
            let sequence = request.sequence;
            let answer = if request.command == Command::Identify {
                Answer::Identity(Identity {
                    protocol: VERSION,
                    schema: dea_driver::SCHEMA,
                    board: boards::STM32F405,
                    firmware: "peer".try_into().expect("short"),
                })
            } else {
                requests.push(request.clone());
                match react(requests.len(), &request.command) {
                    ControlFlow::Continue(Some(answer)) => answer,
                    ControlFlow::Continue(None) => continue,
                    ControlFlow::Break(()) => break,
                }
            };
            let mut frame = [0; FRAME_LEN + 1];
            let length = encode(&Message::Answer { sequence, answer }, &mut frame).expect("fits");
            (&line).write_all(&frame[..length]).expect("sent");
        }
        requests
    });
    (Port::open(&port).expect("opens"), peer)
}

/// A controller that answers later than it is asked again, such as an emulator on a busy machine, is understood; one that hangs up is not
/// waited for; a request that changes something is sent once.
#[test]
fn a_late_answer_counts_and_a_closed_connection_does_not_wait() {
    let (port, peer) = peer(|_, command| match command {
        Command::Rest => {
            // Longer than the first two calls wait.
            thread::sleep(Duration::from_millis(900));
            ControlFlow::Continue(Some(Answer::Done))
        }
        _ => ControlFlow::Break(()),
    });
    let (mut client, identity) = Client::new(port).expect("answers");
    assert_eq!(identity.firmware, "peer");
    client.order(Command::Rest).expect("done");
    let gone = client.status().expect_err("hung up").to_string();
    assert!(gone.contains("the connection is gone"), "{gone}");
    let requests = peer.join().expect("no fault");
    assert_eq!(requests.iter().filter(|request| request.command == Command::Rest).count(), 1);
}

/// Who has armed and gets no answer asks again, since the board trips without a heartbeat: under another number, with its token.
#[test]
fn an_answer_that_is_lost_while_armed_is_asked_for_again() {
    let (port, peer) = peer(|number, command| {
        ControlFlow::Continue(match command {
            Command::Arm => Some(Answer::Armed { token: 4711 }),
            // The first two answers are lost.
            _ => (number > 3).then_some(Answer::Done),
        })
    });
    let (mut client, _) = Client::new(port).expect("answers");
    assert_eq!(client.arm().expect("armed"), 4711);
    client.order(Command::Heartbeat).expect("done");
    drop(client);
    let requests = peer.join().expect("no fault");
    let heartbeats = &requests[1..];
    // A busy machine may ask once more before it reads the answer.
    assert!(heartbeats.len() >= 3, "{heartbeats:?}");
    assert!(heartbeats.windows(2).all(|pair| pair[0].sequence != pair[1].sequence), "{heartbeats:?}");
    assert!(heartbeats.iter().all(|request| request.token == 4711), "{heartbeats:?}");
}

#[test]
fn a_missing_port_is_named() {
    names(&TOOL.fails(&["link", "--port", "tcp:127.0.0.1:1", "status"]), &["tcp:127.0.0.1:1"]);
    names(&TOOL.fails(&["link", "--port", "/dev/there-is-none", "status"]), &["/dev/there-is-none", "serial port"]);
    names(&TOOL.fails(&["link", "status"]), &["--port"]);
    let [recording, ..] = recordings("hossain");
    let pil = ["pil", "--params", "preset:table3-n2", text(&recording)];
    names(&TOOL.fails(&[pil.as_slice(), &["--image", "none.elf"]].concat()), &["none.elf", "cargo xtask image"]);
    names(&TOOL.fails(&[pil.as_slice(), &["--duration", "0"]].concat()), &["--duration"]);
}
