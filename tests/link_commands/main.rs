//! `springpot link` against a board that runs in this process.

mod adaptation;
mod commission;
mod control;
mod page;
mod page_served;
mod page_tool;
mod playing;
mod self_test;
#[cfg(target_os = "linux")]
mod supply;

use std::fs;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::ops::{ControlFlow, Deref};
use std::process::{Child, Output, Stdio};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use dea_driver::wire::{Answer, Command, FRAME_LEN, Identity, Message, Receiver, Request, VERSION, boards, encode};
use host_sim::link::{Client, Port};
use serde_json::Value;
use tests::crc32;
use tests::tool::{Bench, Tool, failed, names, number};
use tests::virtual_board::{Scene, VirtualBoard};

const TOOL: Tool = Tool(env!("CARGO_BIN_EXE_host-sim-under-test"));

/// A board, and a folder in which its commands run. Their lines begin behind `link --port PORT`.
pub struct Linked {
    board: VirtualBoard,
    pub bench: Bench,
}

impl Linked {
    fn at(board: VirtualBoard) -> Self {
        let bench = Bench::new(TOOL);
        // Two seconds of a half wave up to 3 kV, and what is beyond the limits.
        let rows = (0..=20).map(|k| format!("{},{}\n", f64::from(k) / 10.0, 300 * (10 - (k - 10i32).abs())));
        bench.write("profile.csv", "time_s,voltage_v\n".to_owned() + &rows.collect::<String>());
        bench.write("high.csv", "time_s,voltage_v\n0,0\n1,6500\n2,0\n");
        Self { board, bench }
    }

    fn new(scene: Scene) -> Self {
        Self::at(VirtualBoard::start(scene))
    }

    /// The same with parameters.
    fn ready(scene: Scene) -> Self {
        let board = Self::new(scene);
        board.upload();
        board
    }

    fn upload(&self) {
        self.json("upload --params preset:table3-n2 --bench");
    }

    fn line(&self, verb: &str) -> String {
        format!("link --port {} {verb}", self.port)
    }

    fn json(&self, verb: &str) -> Value {
        self.bench.json(&self.line(verb))
    }

    fn prints(&self, verb: &str) -> String {
        self.bench.prints(&self.line(verb))
    }

    /// The one line of a verb that fails; what was measured may stay.
    fn fails(&self, verb: &str) -> String {
        failed(self.bench.with(&self.line(verb)))
    }

    /// How a verb ends: its exit status, output and standard error.
    fn ends(&self, verb: &str) -> (Option<i32>, String, String) {
        ended(&self.bench.run(&self.line(verb)))
    }

    /// A verb that goes on, with its standard error.
    fn spawn(&self, verb: &str) -> Child {
        let mut command = std::process::Command::new(TOOL.0);
        command.args(self.line(verb).split(' ')).current_dir(self.bench.path(""));
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("runs")
    }

    fn state(&self) -> Value {
        self.json("status")["state"].clone()
    }
}

impl Deref for Linked {
    type Target = VirtualBoard;

    fn deref(&self) -> &VirtualBoard {
        &self.board
    }
}

/// Exit status, output and standard error.
fn ended(output: &Output) -> (Option<i32>, String, String) {
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    (output.status.code(), out, err)
}

fn ctrl_c(child: &Child) {
    let kill = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(kill.expect("runs").success());
}

#[test]
fn a_board_reports_identity_and_status() {
    let board = Linked::new(Scene::CALM);
    let who = board.json("identify");
    assert_eq!((who["firmware"].as_str(), who["board"].as_u64()), (Some("virtual"), Some(0x0405)));
    assert!(who["parameters"].is_null());
    let how = board.json("status");
    assert_eq!(how["state"], "disarmed");
    assert!(how["rate_hz"].is_null());
    assert_eq!((&how["stack_peak_bytes"], &how["falls"]), (&1234.into(), &0.into()));
    let parts = &how["parts"];
    assert_eq!((&parts["interlock_closed"], &parts["sensor"]), (&true.into(), &"answers".into()));
    assert!((0.99..1.01).contains(&parts["sensor_adc_v"].as_f64().expect("a number")), "{parts}");
    assert_eq!(parts["monitor_adc_v"], 0.0);
    let line = board.prints("status");
    names(&line, &["interlock closed", "sensor: 1.0", "monitor: 0.000 V", "damaged"]);
    names(&board.fails("arm"), &[&board.port, "no parameters yet", "upload"]);

    board.upload();
    assert_eq!(board.json("identify")["parameters"], "karner-2022-table3-n2");
    assert_eq!(board.json("status")["rate_hz"], 1000.0);
    assert!(board.json("panic")["message"].is_null());
    // It injects no faults: what was armed for one ends at 0 V.
    names(&board.fails("drill bus"), &["bus", "no faults on purpose", "cargo xtask board"]);
    assert_eq!(board.voltage().1, 0.0);
    assert_eq!(board.state(), "disarmed");
    names(&board.fails("drill --voltage 5"), &["--voltage", "100"]);
}

/// A part that is not connected is shown as such.
#[test]
fn the_status_reports_what_does_not_answer() {
    let parts = [dea_driver::wire::Part::Answers, dea_driver::wire::Part::Bus, dea_driver::wire::Part::Answers];
    let board = Linked::new(Scene { interlock_closed: false, parts, ..Scene::CALM });
    let line = board.prints("status");
    names(&line, &["interlock open", "monitor: does not answer"]);
    let parts = board.json("status")["parts"].clone();
    assert_eq!((&parts["interlock_closed"], &parts["monitor_adc_v"]), (&false.into(), &serde_json::Value::Null));
}

#[test]
fn each_verb_has_its_effect() {
    // Slow, so that the next command comes within its 500 ticks on a busy machine as well.
    let board = Linked::ready(Scene { tick: Duration::from_millis(4), ..Scene::CALM });
    names(&board.fails("start voltage"), &["not while it is disarmed"]);
    names(&board.fails("set --voltage 6300"), &["beyond the limits"]);
    names(&board.fails("set --voltage NaN"), &["--voltage", "must be finite"]);
    names(&board.fails("set"), &["--voltage", "--reference"]);
    names(&board.fails("set --voltage 1 --reference 1"), &["cannot be used with"]);
    // What would act in a later run is not taken.
    names(&board.fails("set --voltage 1500"), &["not while it is disarmed"]);
    let armed = board.json("arm");
    let token = armed["token"].as_u64().expect("a number").to_string();
    // Who did not arm it can neither start nor move it.
    names(&board.fails("start voltage"), &["another host armed it", "--token"]);
    board.json(&format!("start voltage --token {token}"));
    names(&board.fails("set --voltage 1500"), &["another host armed it", "--token"]);
    board.json(&format!("set --voltage 1500 --token {token}"));
    // No host talks to it any more: 0 V after 500 of its ticks.
    board.wait_for_voltage(|(largest, now)| (largest, now) == (1500.0, 0.0));
    assert_eq!(board.state(), "tripped: Heartbeat");
    names(&board.fails("arm"), &["tripped (Heartbeat)", "acknowledge"]);
    board.json("acknowledge");
    board.json("arm");
    board.json("disarm");
    assert_eq!(board.state(), "disarmed");
}

/// A recording is played, what the board measures comes back as a recording, and the film is left at 0 V.
#[test]
fn play_follows_a_recording_and_ends_at_0_v() {
    let board = Linked::ready(Scene::CALM);
    let report = board.json("play profile.csv --out out.csv --every 5");
    assert_eq!(report["state"], "disarmed");
    assert!(number(&report["samples"]) > 200.0, "{report}");
    let (largest, now) = board.voltage();
    assert!((2900.0..=3000.0).contains(&largest) && now == 0.0, "{largest} V, then {now} V");
    // The file is a recording, which any command reads.
    let replayed = board.bench.json("replay --params preset:table3-n2 out.csv");
    assert!(number(&replayed["recordings"][0]["samples"]) > 200.0);
    let header = "time_s,tick,command_v,voltage_v,displacement_m,predicted_m,reference_m,";
    assert!(board.bench.read("out.csv").starts_with(header));
}

/// A player that is killed leaves what it has seen, but for the last second; the next one says where it is. The board ends at 0 V.
#[test]
fn a_killed_player_leaves_its_samples() {
    let board = Linked::ready(Scene::CALM);
    let rows = (0..=60).map(|second| format!("{second},{}\n", if second < 2 { 1000 * second } else { 2000 }));
    board.bench.write("long.csv", "time_s,voltage_v\n".to_owned() + &rows.collect::<String>());
    let play = "play long.csv --out out.csv";
    let mut player = board.spawn(play);
    let [out, part] = ["out.csv", "out.csv.part"].map(|name| board.bench.path(name));
    while fs::read_to_string(&part).map_or(0, |text| text.lines().count()) < 150 {
        assert!(player.try_wait().expect("waits").is_none(), "it ends by itself");
        thread::sleep(Duration::from_millis(20));
    }
    player.kill().expect("runs");
    player.wait().expect("killed");
    assert!(!out.exists());
    board.wait_for_voltage(|(_, now)| now == 0.0);
    board.json("acknowledge");
    let (code, _, errors) = board.ends(&format!("{play} --duration 0.3"));
    names(&errors, &["out.csv", "was killed", "samples are kept", "out.recovered-1.csv"]);
    let replayed = board.bench.json("replay --params preset:table3-n2 out.recovered-1.csv");
    assert!(number(&replayed["recordings"][0]["samples"]) > 145.0);
    assert!(code == Some(0) && out.exists() && !part.exists());
}

/// A run that does not begin leaves the file of the one before, and what others have left half written is not touched.
#[test]
fn files_of_earlier_runs_stay() {
    let open = Scene { interlock_closed: false, ..Scene::CALM };
    for (scene, play, words) in [
        (open, "play profile.csv", "the interlock is open"),
        // Refused before it is armed, and after that: samples of a film at rest are no run.
        (Scene::CALM, "play high.csv", "limits"),
        (Scene::CALM, "play profile.csv --carry-over --every 1", "tcp:"),
    ] {
        let board = Linked::ready(scene);
        board.bench.write("out.csv", "an earlier run");
        let before = board.bench.files();
        names(&board.fails(&format!("{play} --out out.csv")), &[words]);
        assert_eq!(board.voltage(), (0.0, 0.0));
        assert_eq!((board.bench.files(), board.bench.read("out.csv")), (before, "an earlier run".to_owned()));
        board.bench.write("out.csv.part", "notes\nof another program\n");
        names(&board.fails("play profile.csv --out out.csv"), &["out.csv.part", "move it away"]);
        assert_eq!(board.bench.read("out.csv.part"), "notes\nof another program\n");
    }
}

/// After a reset a board may run other parameters than were uploaded last: `play` reports which, and compares them if it is given any.
#[test]
fn play_compares_the_parameters() {
    let board = Linked::ready(Scene::CALM);
    let who = board.json("identify");
    let checksum = who["checksum"].as_str().expect("known");
    let play = "play profile.csv --out out.csv --duration 0.2 --bench --params preset:";
    names(&board.fails(&format!("{play}table3-n3")), &["karner-2022-table3-n2", checksum, "upload"]);
    assert_eq!(board.voltage(), (0.0, 0.0));
    let report = board.json(&format!("{play}table3-n2"));
    assert_eq!((&report["parameters"], &report["checksum"]), (&who["parameters"], &who["checksum"]));
}

/// References are followed with and without the sensor.
#[test]
fn play_follows_references() {
    for mode in ["feedforward", "tracking"] {
        let board = Linked::ready(Scene::CALM);
        board.bench.json("reference --shape sine --low 0.3e-3 --high 0.5e-3 --period 10 --out reference.csv");
        let report = board.json(&format!("play reference.csv --mode {mode} --duration 3 --out out.csv"));
        assert_eq!(report["state"], "disarmed");
        let (largest, now) = board.voltage();
        assert!(largest > 500.0 && now == 0.0, "{mode}: {largest} V, then {now} V");
    }
}

/// The interlock opens halfway: the command reports it, keeps what was measured, and the film is at 0 V.
#[test]
fn a_trip_ends_the_playback() {
    let board = Linked::ready(Scene { opens_above_v: Some(2000.0), ..Scene::CALM });
    names(&board.fails("play profile.csv --out out.csv"), &["tripped (Interlock)", "acknowledge"]);
    assert_eq!(board.voltage().1, 0.0);
    assert!(board.bench.read("out.csv").lines().count() > 20);
}

/// Disabled, and still at 3 kV: what no command can fix is reported in every way there is.
#[test]
fn a_film_that_stays_live_is_reported() {
    let board = Linked::ready(Scene { stays_up: true, ..Scene::CALM });
    board.bench.write("high.csv", "time_s,voltage_v\n0,0\n0.5,3000\n1,3000\n");
    let line = board.fails("play high.csv --out out.csv");
    names(&line, &["the film is live", "monitor: 3000 V", "Do not touch it"]);
    assert!(board.bench.read("out.csv").lines().count() > 20);
    let how = board.json("status");
    assert_eq!((&how["state"], &how["live"]), (&"tripped: LiveFilm".into(), &true.into()));
    assert_eq!((&how["command_v"], number(&how["monitor_v"]).round()), (&0.0.into(), 3000.0));
    names(&board.fails("disarm"), &["the film is live"]);
    names(&board.fails("acknowledge"), &["does not read 0 V"]);
    names(&board.fails("arm"), &["the film is live"]);
}

#[test]
fn a_panic_before_the_start_stays_until_it_is_acknowledged() {
    let board = Linked::new(Scene { panic_message: "a panic at src/faults.rs:75", ..Scene::CALM });
    assert_eq!(board.json("panic")["message"], "a panic at src/faults.rs:75");
    assert_eq!(board.state(), "tripped: Panic");
    // New parameters do not clear it.
    board.upload();
    assert_eq!(board.state(), "tripped: Panic");
    names(&board.fails("arm"), &["tripped (Panic)"]);
    board.json("acknowledge");
    board.json("arm");
}

/// A board takes what `export` writes, for it and no other, at rates that it can.
#[test]
fn blobs_are_checked_before_they_are_sent_and_after() {
    let board = Linked::new(Scene::CALM);
    board.bench.json("export --params preset:table4-f7 --rate 500 --out p.bin");
    board.json("upload --blob p.bin --try");
    assert_eq!(board.json("identify")["parameters"], "karner-2022-table4-f7");

    let mut bytes = fs::read(board.bench.path("p.bin")).expect("written");
    bytes[6] ^= 1;
    let end = bytes.len() - 4;
    let checksum = crc32(&bytes[..end]).to_le_bytes();
    bytes[end..].copy_from_slice(&checksum);
    board.bench.write("p.bin", &bytes);
    names(&board.fails("upload --blob p.bin"), &["made for this board"]);
    board.bench.write("p.bin", &bytes[..end]);
    names(&board.fails("upload --blob p.bin"), &["p.bin", "truncated"]);
    let fast = board.fails("upload --params preset:table3-n1 --rate 6000 --bench");
    names(&fast, &["cannot tick at that rate", "--rate"]);
    names(&board.fails("upload"), &["--params"]);
    // Calibrations of another bench are refused unless --bench is given.
    let bare = board.fails("upload --params preset:table3-n1");
    names(&bare, &["preset:table3-n1", "[board]", "--bench"]);
    assert_eq!(board.json("identify")["parameters"], "karner-2022-table4-f7", "the old ones stay");
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
    let board = Linked::at(VirtualBoard::at_a_serial_port(Scene::CALM));
    board.upload();
    assert_eq!(board.json("identify")["parameters"], "karner-2022-table3-n2");
    board.json("arm");
    board.json("disarm");
    let how = board.json("status");
    assert_eq!((&how["state"], &how["damaged_frames"]), (&"disarmed".into(), &0.into()));

    let (mut client, identity) = Client::new(Port::open(&board.port).expect("opens")).expect("answers");
    assert_eq!(identity.firmware, "virtual");
    // It is this program's alone, whether the other one only asks or not.
    names(&board.fails("status"), &["another program has this port open"]);
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

/// Firmware of another version of the link does not answer later either: it is named, and not waited for.
#[test]
fn firmware_of_another_version_is_named_at_once() {
    let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
    let port = Port::open(&format!("tcp:{}", listener.local_addr().expect("bound"))).expect("opens");
    let peer = thread::spawn(move || {
        let (line, _) = listener.accept().expect("connects");
        let mut bytes = Read::bytes(&line).map_while(Result::ok).skip_while(|byte| *byte == 0);
        let mut requests = 0;
        while bytes.by_ref().any(|byte| byte == 0) {
            requests += 1;
            // `Done` to request 1, in version 6.
            (&line).write_all(&[2, 6, 2, 1, 5, 129, 177, 52, 29, 0]).expect("sent");
        }
        requests
    });
    let Err(error) = Client::new(port).map(drop) else { panic!("another version") };
    let error = error.to_string();
    assert!(error.contains(&format!("version 6 of the link, this tool needs {VERSION}: flash")), "{error}");
    assert_eq!(peer.join().expect("ended"), 1, "asked again");
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
    let bench = Bench::new(TOOL);
    bench.recordings("hossain");
    let pil = "pil --params preset:table3-n2 hossain-5s.csv";
    for (line, words) in [
        ("link --port tcp:127.0.0.1:1 status", ["tcp:127.0.0.1:1", ""]),
        ("link --port /dev/there-is-none status", ["/dev/there-is-none", "serial port"]),
        ("link status", ["--port", ""]),
        (&format!("{pil} --image none.elf"), ["none.elf", "cargo xtask image"]),
        (&format!("{pil} --duration 0"), ["--duration", ""]),
    ] {
        names(&bench.fails(line), &words);
    }
}
