//! The firmware in QEMU: it gives the host's bits, and every fault ends at 0 V with its cause latched.
//!
//! `cargo xtask firmware` builds the images and runs this.

mod readme;

use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use dea_driver::wire::{Answer, BAUD, Command, Drill, Mode, Reject, Status, boards};
use dea_driver::{Cause, DriverState, SensorFault};
use documents::{Documents, Tolerance};
use host_sim::files::parameters::{Board, ElasticCurve, Parameters};
use host_sim::link::{Client, Emulator, Port};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::Curve;
use tests::bench::bench_limits;
use tests::recordings;
use tests::sweep::full_sweep;
use tests::tool::{Tool, text};

const TOOL: Tool = Tool(env!("CARGO_BIN_EXE_host-sim-under-test"));

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the project")
}

/// The image that `cargo xtask firmware` has built, or one of its siblings.
fn image(folder: &str) -> PathBuf {
    root().join(folder).join("thumbv7em-none-eabihf/release/firmware")
}

/// A number of docs/results.md, by the name of its row and the title of its column.
fn stated(row: &str, column: &str) -> f64 {
    Documents::read().expect("readable").number(&[row], column).expect("a number in the table")
}

/// Three recordings at 1 kHz: displacement, state and voltage of every step are the host's, bit for bit. The first 20 s of each,
/// and in a full sweep all 155 s.
#[test]
fn every_step_of_three_recordings_has_the_hosts_bits() {
    let image = image("firmware/target");
    let recordings = recordings("hossain");
    let [fast, middle, slow] = recordings.each_ref().map(|path| text(path));
    let (seconds, steps) = if full_sweep() { ("155", 465_003) } else { ("20", 60_003) };
    let report = TOOL.json(&[
        "pil",
        "--params",
        "preset:table3-n2",
        "--image",
        text(&image),
        "--duration",
        seconds,
        fast,
        middle,
        slow,
    ]);
    println!("{report}");
    assert_eq!((report["steps"].as_u64(), report["mismatches"].as_u64()), (Some(steps), Some(0)));
    let counted = report["instructions_per_step"].as_f64().expect("counted");
    let stated = stated("pil", "Cortex-M4F");
    assert!(Tolerance::COUNT.holds(counted, stated), "{stated} instructions are stated, counted {counted}");
}

/// The demo runs the image where it is: all steps have the host's bits.
#[test]
fn the_demo_runs_the_image() {
    let folder = tempfile::TempDir::new().expect("a folder");
    let report = TOOL.json(&["demo", "--out", text(folder.path())]);
    let ran = &report["firmware"]["ran"];
    assert_eq!((&ran["steps"], &ran["mismatches"]), (&10_001.into(), &0.into()), "{}", report["firmware"]);
}

/// Whole ticks, codes of the converters in and out, along three recordings: command, state and estimate are the host's, bit for bit, and
/// the run is still on at its end. The first 20 s of each, and in a full sweep all 155 s.
#[test]
fn whole_ticks_of_three_recordings_have_the_hosts_bits() {
    let image = image("firmware/target");
    let recordings = recordings("hossain");
    let [fast, middle, slow] = recordings.each_ref().map(|path| text(path));
    let (seconds, steps) = if full_sweep() { ("155", 465_003) } else { ("20", 60_003) };
    let options = ["--params", "preset:table3-n2", "--law", "tick", "--image", text(&image), "--duration", seconds];
    let report = TOOL.json(&[["pil"].as_slice(), &options, &[fast, middle, slow]].concat());
    println!("{report}");
    assert_eq!((report["steps"].as_u64(), report["mismatches"].as_u64()), (Some(steps), Some(0)));
    for recording in report["recordings"].as_array().expect("three") {
        assert_eq!(recording["state"], "running", "{recording}");
    }
}

/// The three laws of control: feedforward and tracking with their loop closed around the firmware, the simulated film as
/// plant, and the observer along a recording. Every voltage, estimate and disturbance has the host's bits, and the film
/// follows.
#[test]
fn the_laws_of_control_have_the_hosts_bits() {
    let folder = tempfile::TempDir::new().expect("a folder");
    let (image, film, sine) =
        (image("firmware/target"), folder.path().join("film.toml"), folder.path().join("sine.csv"));
    let recordings = recordings("hossain");
    let [fast, middle, slow] = recordings.each_ref().map(|path| text(path));
    let structure = ["--topology", "parallel", "--branches", "2"];
    TOOL.json(&[&["fit", fast, middle, slow, "--out", text(&film)], structure.as_slice()].concat());
    let shape = ["--shape", "sine", "--low", "1.5e-3", "--high", "4e-3", "--period", "10", "--out", text(&sine)];
    TOOL.json(&[["reference"].as_slice(), &shape].concat());
    let pil = |more: &[&str]| {
        let all = ["pil", "--params", text(&film), "--image", text(&image), "--duration", "10"];
        let report = TOOL.json(&[all.as_slice(), more].concat());
        println!("{report}");
        assert_eq!((report["steps"].as_u64(), report["mismatches"].as_u64()), (Some(10_001), Some(0)));
        report["recordings"][0]["tracking_rms_pct"].as_f64()
    };
    let closed = ["--plant", "hossain", text(&sine)];
    let feedforward = pil(&[["--law", "feedforward"].as_slice(), &closed].concat()).expect("a closed loop");
    let tracking = pil(&[["--law", "tracking"].as_slice(), &closed].concat()).expect("a closed loop");
    assert!(feedforward < 1.0 && tracking < 0.25, "{feedforward} %, {tracking} %");
    assert_eq!(pil(&["--law", "observer", fast]), None);
}

/// A film behind a curve of sixteen pieces, on an actuator that saturates, of either order: the model's step, every law of control, and
/// whole ticks.
#[test]
fn a_film_behind_a_curve_has_the_hosts_bits() {
    let folder = tempfile::TempDir::new().expect("a folder");
    let (film, sine) = (folder.path().join("film.toml"), folder.path().join("sine.csv"));
    // A quarter stiffer at 1 mm and three times as stiff at 3 mm; the strokes here are 1 to 4 mm.
    let points = std::array::from_fn::<_, 17, _>(|k| {
        let x = 2.5e-4 * (k as f64 - 2.0);
        (x, x * (1.0 + x * (8e4 * x - 30.0)))
    });
    let mut parameters = Parameters::preset("table3-n2").expect("a preset");
    parameters.curve = Some(ElasticCurve::free(Curve::through(&points).expect("rises")));
    parameters.actuator.saturation_v = Some(9000.0);
    std::fs::write(&film, parameters.to_toml()).expect("written");
    let shape = ["--shape", "sine", "--low", "1.5e-3", "--high", "4e-3", "--period", "10", "--out", text(&sine)];
    TOOL.json(&[["reference"].as_slice(), &shape].concat());
    let image = image("firmware/target");
    let [fast, ..] = &recordings("hossain");
    for (law, file, method) in [
        ("step", fast, "gl"),
        ("step", fast, "bdf2"),
        ("tick", fast, "gl"),
        ("tick", fast, "bdf2"),
        ("observer", fast, "gl"),
        ("feedforward", &sine, "gl"),
        ("tracking", &sine, "gl"),
    ] {
        let plant = if file == &sine { ["--plant", "hossain"].as_slice() } else { &[] };
        let options = ["pil", "--params", text(&film), "--image", text(&image), "--duration", "5", "--method", method];
        let report = TOOL.json(&[options.as_slice(), &["--law", law], plant, &[text(file)]].concat());
        println!("{law}, {method}: {report}");
        assert_eq!((report["steps"].as_u64(), report["mismatches"].as_u64()), (Some(5001), Some(0)), "{law}, {method}");
        if law == "tick" {
            assert_eq!(report["recordings"][0]["state"], "running", "{report}");
        }
    }
}

/// Bits are compared, not merely printed: with other parameters on the chip than on the host, the test fails.
#[test]
fn another_model_is_noticed() {
    let (_emulator, port) = Emulator::start(&image("firmware/target")).expect("starts");
    let (mut client, _) = Client::new(port).expect("answers");
    for (preset, same) in [("table3-n2", true), ("table3-n3", false)] {
        let parameters = Parameters::preset(preset).expect("a preset");
        let blob = parameters.to_blob(&Board::bench(&parameters.actuator), 1000.0).expect("valid");
        client.upload(&blob, false).expect("taken");
        let (steps, cycles) = client.step(&[3000.0; 24]).expect("steps");
        let host = Parameters::preset("table3-n2").expect("a preset");
        let law = host_sim::replay::memory::compressed_law::<f32>(host.film(), 1000.0).expect("valid");
        let drive = springpot::VoltageDrive::new(&host.actuator, 6000.0, law.stiffness()).expect("valid");
        let mut film = law.state();
        let here: Vec<u32> = (0..24).map(|_| law.displacement_under(&mut film, drive.load(3000.0)).to_bits()).collect();
        let there: Vec<u32> = steps.iter().map(|step| step.displacement_m.to_bits()).collect();
        assert_eq!(here == there, same, "{preset}");
        assert!(cycles > 0);
    }
}

/// What docs/results.md states of flash and RAM is what the images take, within 2 %: the one for a board, and the one for QEMU, which
/// has the loop test as well. The linker holds the budget of both.
#[test]
fn the_images_take_what_is_stated() {
    for (folder, rows) in [("firmware/target", ["flash/qemu", "ram/qemu"]), ("firmware/target/board", ["flash", "ram"])]
    {
        let elf = std::fs::read(image(folder)).expect("built");
        let (flash, ram) = taken(&elf);
        println!("{folder}: {flash} bytes of flash, {ram} of RAM");
        assert!(flash <= 98_304.0 && ram <= 20_480.0);
        for (row, taken) in rows.into_iter().zip([flash, ram]) {
            let stated = stated(row, "bytes");
            assert!(
                Tolerance::COUNT.holds(taken, stated),
                "{stated} bytes of {row} are stated, {folder} takes {taken}"
            );
        }
    }
}

/// Bytes of flash and of RAM in an image: 32-bit ELF, little-endian, its section headers.
fn taken(elf: &[u8]) -> (f64, f64) {
    let word = |at: usize| u32::from_le_bytes([elf[at], elf[at + 1], elf[at + 2], elf[at + 3]]);
    let half = |at: usize| usize::from(u16::from_le_bytes([elf[at], elf[at + 1]]));
    let (start, size, count) = (word(0x20) as usize, half(0x2e), half(0x30));
    let (mut flash, mut ram) = (0, 0);
    for section in (0..count).map(|index| start + index * size) {
        let (kind, flags, address, bytes) =
            (word(section + 4), word(section + 8), word(section + 12), word(section + 20));
        // What is loaded is allocated and has contents; statics are allocated in the SRAM.
        let allocated = flags & 2 != 0;
        if allocated && kind == 1 {
            flash += bytes;
        }
        if allocated && (0x2000_0000..0x2001_fc00).contains(&address) {
            ram += bytes;
        }
    }
    (f64::from(flash), f64::from(ram))
}

/// The image for use, without anything connected: it says so, refuses to be armed, and rejects drills. QEMU's flash cannot be
/// written: the parameters are refused as the flash refuses them, and what ran before goes on.
#[test]
fn without_a_bench_nothing_is_enabled() {
    let (_emulator, port) = Emulator::start(&image("firmware/target")).expect("starts");
    let (mut client, identity) = Client::new(port).expect("answers");
    assert_eq!(identity.board, boards::STM32F405);
    assert_eq!(client.ask(Command::Arm).expect("answers"), Answer::Rejected(Reject::NoParameters));
    client.upload(&blob(ANY_SILENCE_S), false).expect("taken");
    let before = client.ask(Command::Query).expect("answers");
    let refused = client.upload(&blob(ANY_SILENCE_S), true).expect_err("QEMU's flash cannot be written").to_string();
    assert!(refused.contains("flash"), "{refused}");
    assert_eq!(client.ask(Command::Query).expect("answers"), before);
    let open = client.ask(Command::Arm).expect("answers");
    assert_eq!(open, Answer::Refused(dea_driver::Refusal::InterlockOpen));
    assert_eq!(client.ask(Command::Drill(Drill::Panic)).expect("answers"), Answer::Rejected(Reject::Unknown));
    assert_eq!(client.ask(Command::PanicMessage).expect("answers"), Answer::PanicMessage(Default::default()));

    // The stack, after all that the link can ask for.
    client.step(&[1000.0; 24]).expect("steps");
    let peak = f64::from(client.status().expect("answers").stack_peak);
    println!("stack: {peak} bytes at the most");
    let stated = stated("stack", "bytes");
    assert!(peak <= stated, "{stated} bytes of stack are stated, {peak} were used");
}

/// A test that has failed ends after this time. Nothing else depends on it.
const DEADLINE: Duration = Duration::from_secs(600);
/// The longest silence of a host that parameters may allow, s. A host that is silent for as long as that has been stopped: no
/// test that is about something else ends in a trip because this machine is busy with other work.
const ANY_SILENCE_S: f32 = 60.0;
/// The silence that ends in a trip where a test is about it, s. The board has been armed and started by then, in four exchanges
/// which may take so long each.
const SHORT_SILENCE_S: f32 = 3.0;
/// Ticks between two samples while a test waits for that trip.
const EVERY: u16 = 20;

/// Parameters of the virtual bench, with the silence of the host that ends in a trip.
fn blob(heartbeat_s: f32) -> Vec<u8> {
    let parameters = Parameters::preset("table3-n2").expect("a preset");
    let limits = dea_driver::Limits { heartbeat_s, ..bench_limits() };
    let sensor = dea_driver::chips::Calibration::Parabola { offset: -1e-3, gain: 1e-3, quadratic: 0.0 };
    let board = Board { limits, sensor, ..Board::bench(&parameters.actuator) };
    parameters.to_blob(&board, 1000.0).expect("valid")
}

/// The virtual board with 3 kV on its simulated film.
fn live(heartbeat_s: f32) -> (Emulator, Client) {
    let (emulator, port) = Emulator::start(&image("firmware/target/virtual-board")).expect("starts");
    let (mut client, _) = Client::new(port).expect("answers");
    client.upload(&blob(heartbeat_s), false).expect("taken");
    let status = start(&mut client);
    assert_eq!(status.state, DriverState::Running);
    (emulator, client)
}

/// 3 kV, once the sensors have been looked at.
fn start(client: &mut Client) -> Status {
    wait(client, |status| status.ticks > 1);
    client.arm().expect("done");
    client.order(Command::Start(Mode::Voltage)).expect("done");
    client.order(Command::SetVoltage(3000.0)).expect("done");
    wait(client, |status| status.command_v == 3000.0)
}

/// Asks until the board is as it should be. What is waited for takes ticks, not time on this machine: the deadline only ends a
/// test that has failed.
fn wait(client: &mut Client, until: impl Fn(&Status) -> bool) -> Status {
    let start = Instant::now();
    loop {
        let status = client.status().expect("answers");
        if until(&status) {
            return status;
        }
        assert!(start.elapsed() < DEADLINE, "still {status:?}");
        // The board gets the time to tick.
        thread::sleep(Duration::from_millis(2));
    }
}

/// Ticks between which the board has received the last heartbeat of the host.
struct LastHeartbeat {
    earliest: u32,
    latest: u32,
}

impl LastHeartbeat {
    fn send(client: &mut Client) -> Self {
        let earliest = client.status().expect("answers").ticks;
        client.order(Command::Heartbeat).expect("done");
        Self { earliest, latest: client.status().expect("answers").ticks }
    }

    /// The silence since then ended in `tick`, or up to `EVERY` ticks before.
    fn is_followed_by_silence_until(&self, tick: u32) {
        let allowed = (SHORT_SILENCE_S * 1000.0) as u32;
        let (longest, shortest) = (tick - self.earliest, tick - self.latest);
        assert!(longest >= allowed && shortest <= allowed + u32::from(EVERY) + 1, "{shortest} to {longest} ticks");
    }
}

/// Watches the stream until the board is at 0 V, and gives that tick. `meanwhile` is done at every sample, with the ticks since
/// the one before.
fn wait_for_0_v(client: &mut Client, mut meanwhile: impl FnMut(&mut Client, u32)) -> u32 {
    client.order(Command::Stream { every: EVERY }).expect("done");
    let deadline = Instant::now() + DEADLINE;
    let mut last = None;
    while let Some(sample) = client.sample(deadline).expect("read") {
        if sample.command_v == 0.0 {
            return sample.tick;
        }
        meanwhile(client, sample.tick - last.replace(sample.tick).unwrap_or(sample.tick));
    }
    panic!("still not at 0 V");
}

#[test]
fn every_fault_ends_at_0_v_with_its_cause() {
    let drills = [
        (Drill::Interlock, Cause::Interlock),
        (Drill::Monitor, Cause::Monitor),
        (Drill::Sensor, Cause::Sensor(SensorFault::Range)),
        (Drill::Bus, Cause::Bus),
        (Drill::Overrun, Cause::Overrun),
    ];
    for (drill, cause) in drills {
        let (_emulator, mut client) = live(ANY_SILENCE_S);
        if drill == Drill::Monitor {
            // It stays where it is, which shows once the voltage is to change.
            client.order(Command::Drill(drill)).expect("done");
            client.order(Command::SetVoltage(1000.0)).expect("done");
        } else {
            client.order(Command::Drill(drill)).expect("done");
        }
        let status = wait(&mut client, |status| matches!(status.state, DriverState::Tripped(_)));
        println!("{drill:?}: {:?} at tick {}, {} V", status.state, status.tripped_at, status.command_v);
        assert_eq!((status.state, status.command_v), (DriverState::Tripped(cause), 0.0));
        // The cause stays although the fault is gone, until it is acknowledged.
        assert!(client.arm().is_err());
        client.order(Command::Acknowledge).expect("done");
        wait(&mut client, |status| status.state == DriverState::Disarmed);
    }
}

/// The self-test of a board, on the virtual one; QEMU has no watchdog, so that is found missing.
#[test]
fn the_self_test_ends_in_a_table() {
    let folder = tempfile::TempDir::new().expect("a folder");
    let parameters = folder.path().join("bench.bin");
    std::fs::write(&parameters, blob(ANY_SILENCE_S)).expect("written");
    let (_emulator, port) = emulator_at_a_port(&image("firmware/target/virtual-board"));
    let link = |more: &[&str]| TOOL.with(&[["link", "--port", &port, "--json"].as_slice(), more].concat());
    let start = Instant::now();
    while !link(&["identify"]).output().expect("runs").status.success() {
        assert!(start.elapsed() < DEADLINE, "QEMU does not listen");
        thread::sleep(Duration::from_millis(20));
    }
    link(&["upload", "--try", "--blob", text(&parameters)]).assert().success();
    let sound = link(&["self-test"]).assert().success().get_output().stdout.clone();
    println!("{}", String::from_utf8_lossy(&sound));
    let report: serde_json::Value = serde_json::from_slice(&sound).expect("a report");
    let whats: Vec<&str> =
        report["checks"].as_array().expect("checks").iter().filter_map(|c| c["what"].as_str()).collect();
    assert_eq!(whats.len(), 15, "{whats:?}");
    assert!(["DAC, armed", "monitor", "monitor, at the end"].iter().all(|what| whats.contains(what)), "{whats:?}");
    let starved = link(&["self-test", "--watchdog"]).assert().code(2).get_output().clone();
    assert!(String::from_utf8_lossy(&starved.stderr).contains("the self-test failed: watchdog"), "{starved:?}");
}

/// QEMU, ended with this value.
struct Qemu(std::process::Child);

impl Drop for Qemu {
    fn drop(&mut self) {
        self.0.kill().expect("runs");
        self.0.wait().expect("ends");
    }
}

/// An image in QEMU as `firmware/emulate.sh` runs it, at a port of its own.
fn emulator_at_a_port(image: &Path) -> (Qemu, String) {
    // Free now; whoever takes it before QEMU does makes that end.
    let free =
        std::net::TcpListener::bind(("127.0.0.1", 0)).and_then(|listener| listener.local_addr()).expect("a port");
    let arguments = std::fs::read_to_string(root().join("firmware/qemu.args")).expect("readable");
    let qemu = std::process::Command::new("qemu-system-arm")
        .args(arguments.split_whitespace())
        .args(["-serial", &format!("tcp:{free},server=on,wait=off,nodelay=on"), "-kernel"])
        .arg(image)
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("installed by cargo xtask setup");
    (Qemu(qemu), format!("tcp:{free}"))
}

/// A panic resets the chip; the next start keeps its message, and the trip until it is acknowledged.
#[test]
fn a_panic_resets_and_is_remembered() {
    let (_emulator, mut client) = live(ANY_SILENCE_S);
    client.order(Command::Drill(Drill::Panic)).expect("done");
    let status = wait(&mut client, |status| matches!(status.state, DriverState::Tripped(_)));
    assert_eq!((status.state, status.command_v), (DriverState::Tripped(Cause::Panic), 0.0));
    assert_eq!(status.rate_hz, 0.0, "it has started again: parameters that were only tried are gone");
    let Answer::PanicMessage(message) = client.ask(Command::PanicMessage).expect("answers") else {
        panic!("no message")
    };
    println!("{message}");
    assert!(message.starts_with("a drill at src/virtual_bench.rs:"), "{message}");
    client.upload(&blob(ANY_SILENCE_S), false).expect("taken");
    assert!(client.arm().is_err(), "not before it is acknowledged");
    client.order(Command::Acknowledge).expect("done");
    wait(&mut client, |status| status.ticks > 1);
    client.arm().expect("done");
}

/// The board goes on for as long as the parameters say, then it is at 0 V, although it is asked all the time how it is.
#[test]
fn a_silent_host_ends_at_0_v() {
    let (_emulator, mut client) = live(SHORT_SILENCE_S);
    let heartbeat = LastHeartbeat::send(&mut client);
    let tick = wait_for_0_v(&mut client, |client, _| {
        client.status().expect("answers");
    });
    heartbeat.is_followed_by_silence_until(tick);
    let status = client.status().expect("answers");
    assert_eq!((status.state, status.command_v), (DriverState::Tripped(Cause::Heartbeat), 0.0));
}

/// Garbage as fast as the line takes it: nothing of it is obeyed, the ticks go on, and with nothing but garbage the host counts
/// as silent.
#[test]
fn garbage_is_not_obeyed() {
    let (_emulator, port) = Emulator::start(&image("firmware/target/virtual-board")).expect("starts");
    let (mut client, _) = Client::new(port).expect("answers");
    let mut random = Pcg64::seed_from_u64(4);
    client.upload(&blob(SHORT_SILENCE_S), false).expect("taken");
    let before = wait(&mut client, |status| status.ticks > 1);
    flood(client.port_mut(), &mut random, 100 * BYTES_PER_TICK);
    let after = client.status().expect("answers");
    assert!(after.damaged_frames > before.damaged_frames + 10, "{after:?}");
    // As slow as the line, whatever the machine: the ticks that it takes to bring that many bytes, less the first and the last.
    assert!(after.ticks - before.ticks >= 98, "{} ticks", after.ticks - before.ticks);

    let running = start(&mut client);
    let keep_it_busy = |client: &mut Client, ticks| {
        flood(client.port_mut(), &mut random, ticks as usize * (BYTES_PER_TICK + 1));
    };
    let heartbeat = LastHeartbeat::send(&mut client);
    let tick = wait_for_0_v(&mut client, keep_it_busy);
    let status = client.status().expect("answers");
    println!("{status:?}");
    heartbeat.is_followed_by_silence_until(tick);
    assert_eq!((status.state, status.command_v), (DriverState::Tripped(Cause::Heartbeat), 0.0));
    // A frame every 30 bytes, so more than one a tick.
    assert!(status.damaged_frames - running.damaged_frames > tick - heartbeat.latest, "{status:?}");
}

/// What the line brings in a tick of a millisecond, ten bits to a byte.
const BYTES_PER_TICK: usize = BAUD as usize / 10_000;

fn flood(port: &mut Port, random: &mut Pcg64, bytes: usize) {
    // Every thirtieth byte ends a frame.
    let garbage: Vec<u8> = (0..bytes).map(|_| if random.random_ratio(1, 30) { 0 } else { random.random() }).collect();
    port.write(&[garbage.as_slice(), &[0]].concat()).expect("sent");
}

/// An upload that ends early, or with another length, is not taken.
#[test]
fn a_truncated_upload_changes_nothing() {
    let (_emulator, port) = Emulator::start(&image("firmware/target/virtual-board")).expect("starts");
    let (mut client, _) = Client::new(port).expect("answers");
    let blob = blob(ANY_SILENCE_S);
    client.upload(&blob, false).expect("taken");
    let piece: heapless::Vec<u8, { dea_driver::wire::CHUNK }> = blob[..100].iter().copied().collect();
    for length in [100, 99, blob.len() as u16] {
        client.order(Command::Upload { offset: 0, bytes: piece.clone() }).expect("done");
        let answer = client.ask(Command::Try { length }).expect("answers");
        let expected = if length == 100 { Reject::Blob } else { Reject::Upload };
        assert_eq!(answer, Answer::Rejected(expected), "{length} bytes");
        let Answer::Parameters { name, .. } = client.ask(Command::Query).expect("answers") else { panic!("no name") };
        assert_eq!(name, "karner-2022-table3-n2");
    }
    // NaN in the parameters, with a checksum that holds, is refused by the board as well.
    let mut parameters = <dea_driver::Blob>::decode(&blob, boards::STM32F405).expect("valid").into_parameters();
    parameters.law.head[2] = f32::NAN;
    let spoiled = unchecked(&parameters);
    assert!(client.upload(&spoiled, false).is_err());
    wait(&mut client, |status| status.ticks > 1);
    client.arm().expect("the old parameters are in force");
}

/// A blob whose contents nobody has checked.
fn unchecked(parameters: &dea_driver::Parameters) -> Vec<u8> {
    let body = postcard::to_vec::<_, { dea_driver::BLOB_LEN }>(parameters).expect("fits");
    let mut bytes = b"DEA\x01".to_vec();
    bytes.extend(dea_driver::SCHEMA.to_le_bytes());
    bytes.extend(boards::STM32F405.to_le_bytes());
    bytes.extend((body.len() as u16).to_le_bytes());
    bytes.extend(body.iter());
    let checksum = tests::crc32(&bytes).to_le_bytes();
    bytes.extend(checksum);
    bytes
}
