//! How faults end on the virtual board: at 0 V, with their cause latched.

use std::time::Instant;

use dea_driver::chips::Calibration;
use dea_driver::wire::{Answer, BAUD, Command, FlightRecord, InjectedFault, Mode, Reject, Status, boards};
use dea_driver::{Cause, Control, DriverState, Limits, OnSensorFault, SensorFault};
use host_sim::files::parameters::{Board, Parameters, SelfSensing};
use host_sim::link::{Client, Emulator, Port};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{CapacitanceRelation, SelfSensingOptions};
use tests::bench::bench_limits;

use crate::{DEADLINE, image, stated};

/// The image for use, without anything connected: it reports this, refuses to be armed, and rejects fault injection. QEMU's flash cannot be
/// written: the parameters are refused as the flash refuses them, and what ran before goes on.
#[test]
fn without_a_bench_nothing_is_enabled() {
    let (_emulator, port) = Emulator::start(&image("qemu")).expect("starts");
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
    assert_eq!(
        client.ask(Command::InjectFault(InjectedFault::Panic)).expect("answers"),
        Answer::Rejected(Reject::Unknown)
    );
    assert_eq!(client.ask(Command::PanicMessage).expect("answers"), Answer::PanicMessage(Default::default()));

    // The stack, after all that the link can ask for.
    client.step(&[1000.0; 24]).expect("steps");
    let peak = f64::from(client.status().expect("answers").stack_peak);
    println!("stack: {peak} bytes at the most");
    let stated = stated("stack", "bytes");
    assert!(peak <= stated, "{stated} bytes of stack are stated, {peak} were used");
}

/// Limits that a host may write, above the ceilings that are built into the image: refused, and what ran before goes on. A self-test that the parameters
/// ask for is asked for.
#[test]
fn no_upload_exceeds_the_ceilings() {
    let (_emulator, port) = Emulator::start(&image("qemu")).expect("starts");
    let (mut client, _) = Client::new(port).expect("answers");
    client.upload(&blob(ANY_SILENCE_S), false).expect("taken");
    let before = client.ask(Command::Query).expect("answers");
    let parameters = Parameters::preset("table3-n2").expect("a preset");
    // The ceilings of the image are 10 kV, 200 V/um, 20 mm.
    let gain = |limits: &dea_driver::Limits| dea_driver::chips::Calibration::linear(0.12 * limits.max_voltage_v);
    let bench = bench_limits();
    let sensor = dea_driver::PlausibilityLimits { high: 0.03, jump: 1e-3, ..bench.sensor };
    for limits in [
        dea_driver::Limits { max_voltage_v: 10_001.0, ..bench },
        dea_driver::Limits { max_field_v_per_m: 2.01e8, ..bench },
        dea_driver::Limits { max_displacement_m: 20.1e-3, sensor, ..bench },
    ] {
        let calibration = dea_driver::chips::Calibration::Parabola { offset: -1e-3, gain: 4e-3, quadratic: 0.0 };
        let (amplifier, monitor) = (gain(&limits), gain(&limits));
        let board = Board { limits, amplifier, monitor, sensor: calibration, ..Board::bench(&parameters.actuator) };
        let bytes = parameters.to_blob(&board, 1000.0).expect("valid for a host");
        let refused = client.upload(&bytes, false).expect_err("above a ceiling").to_string();
        assert!(refused.contains("ceilings"), "{refused}");
        assert_eq!(client.ask(Command::Query).expect("answers"), before);
    }
    let board = Board { self_test_above_v: 1000.0, ..Board::bench(&parameters.actuator) };
    client.upload(&parameters.to_blob(&board, 1000.0).expect("valid"), false).expect("taken");
    let Answer::Preflight { refusals, .. } = client.ask(Command::Preflight).expect("answers") else { panic!() };
    assert!(refusals.contains(&dea_driver::Refusal::SelfTest), "{refusals:?}");
}

/// The longest silence of a host that parameters may allow, s. A host that is silent for as long as that has been stopped: no
/// test that is about something else ends in a trip because this machine is busy with other work.
pub const ANY_SILENCE_S: f32 = 10.0;
/// The silence that ends in a trip where a test is about it, s. The board has been armed and started by then, in four exchanges
/// which may take so long each.
const SHORT_SILENCE_S: f32 = 3.0;
/// Ticks between two samples while a test waits for that trip.
const EVERY: u16 = 20;

/// Parameters of the virtual bench, with the silence of the host that ends in a trip.
pub fn blob(heartbeat_s: f32) -> Vec<u8> {
    let parameters = Parameters::preset("table3-n2").expect("a preset");
    let limits = dea_driver::Limits { heartbeat_s, ..bench_limits() };
    let sensor = dea_driver::chips::Calibration::Parabola { offset: -1e-3, gain: 1e-3, quadratic: 0.0 };
    let board = Board { limits, sensor, ..Board::bench(&parameters.actuator) };
    parameters.to_blob(&board, 1000.0).expect("valid")
}

/// The virtual board with 3 kV on its simulated film.
fn live(heartbeat_s: f32) -> (Emulator, Client) {
    let (emulator, port) = Emulator::start(&image("virtual-board")).expect("starts");
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

/// Without its displacement sensor the virtual board tracks its film, which pulls 3 % harder than its model, by the film's own capacitance; a monitor of the
/// voltage that does not answer then ends the run.
#[test]
fn a_film_is_tracked_by_its_own_capacitance() {
    let parameters = Parameters::preset("table3-n2").expect("a preset");
    let calibration = |offset, gain| Calibration::Parabola { offset, gain, quadratic: 0.0 };
    let relation =
        CapacitanceRelation { uncertainty_m: 5e-5, ..CapacitanceRelation::of_geometry(600e-12, 0.04, 2.0, 720e-12) };
    let options = SelfSensingOptions { max_current_a: 0.12e-3, cable_f: 0.0, ..SelfSensingOptions::BENCH };
    let mut limits = Limits { heartbeat_s: ANY_SILENCE_S, max_slew_v_per_s: 100e3, ..bench_limits() };
    limits.on_sensor_fault = OnSensorFault::OpenLoop;
    let bench = Board::bench(&parameters.actuator);
    let control = Control {
        max_velocity_m_per_s: 0.015,
        sample_interval_s: 0.02,
        delay_s: 0.014,
        lost_after_s: 0.2,
        ..bench.control
    };
    let self_sensing = Some(SelfSensing { current: calibration(-0.25e-3, 50e-6), relation, options });
    let board = Board { limits, control, sensor: calibration(-1e-3, 1e-3), self_sensing, ..bench };
    let blob = parameters.to_blob(&board, 1000.0).expect("valid");

    // An image without a monitor of the current says why it refuses them.
    let (_emulator, port) = Emulator::start(&image("qemu")).expect("starts");
    let (mut client, _) = Client::new(port).expect("answers");
    let refused = client.upload(&blob, false).expect_err("no monitor of the current").to_string();
    assert!(refused.contains("monitor of the current"), "{refused}");

    let (_emulator, port) = Emulator::start(&image("virtual-board")).expect("starts");
    let (mut client, _) = Client::new(port).expect("answers");
    client.upload(&blob, false).expect("taken");
    wait(&mut client, |status| status.ticks > 500);
    client.arm().expect("done");
    client.order(Command::Start(Mode::Tracking)).expect("done");
    client.order(Command::SetReference(0.8e-3)).expect("done");
    client.order(Command::InjectFault(InjectedFault::Sensor)).expect("done");
    client.order(Command::Stream { every: 21 }).expect("done");
    let deadline = Instant::now() + DEADLINE;
    let (mut mean_m, mut tones, mut before_v, mut samples) = (0.0f32, 0, 0.0, 0);
    while let Some(sample) = client.sample(deadline).expect("read") {
        samples += 1;
        if samples % 50 == 0 {
            client.order(Command::SetReference(0.8e-3)).expect("done");
        }
        if samples > 400 {
            mean_m += 0.01 * sample.displacement_m;
            // From a tick of the tone to the next one.
            tones += u32::from((40.0..60.0).contains(&(sample.command_v - before_v).abs()));
        }
        before_v = sample.command_v;
        if samples == 500 {
            break;
        }
    }
    let status = client.status().expect("answers");
    println!("{mean_m} m, {tones} steps of the tone, {} bytes of stack", status.stack_peak);
    assert_eq!((status.state, samples), (DriverState::Running, 500));
    // Feedforward alone would be 24 um further.
    assert!((mean_m - 0.8e-3).abs() < 4e-6 && tones > 95, "{mean_m} m, {tones} steps of the tone");
    client.order(Command::Stream { every: 0 }).expect("done");
    client.order(Command::InjectFault(InjectedFault::Bus)).expect("done");
    let ended = wait(&mut client, |status| status.state != DriverState::Running);
    assert_eq!((ended.state, ended.command_v), (DriverState::Tripped(Cause::Bus), 0.0));
}

#[test]
fn every_fault_ends_at_0_v_with_its_cause() {
    let faults = [
        (InjectedFault::Interlock, Cause::Interlock),
        (InjectedFault::Monitor, Cause::Monitor),
        (InjectedFault::Sensor, Cause::Sensor(SensorFault::Range)),
        (InjectedFault::Bus, Cause::Bus),
        (InjectedFault::Overrun, Cause::Overrun),
    ];
    for (fault, cause) in faults {
        let (_emulator, mut client) = live(ANY_SILENCE_S);
        if fault == InjectedFault::Monitor {
            // It stays where it is, which shows once the voltage is to change.
            client.order(Command::InjectFault(fault)).expect("done");
            client.order(Command::SetVoltage(1000.0)).expect("done");
        } else {
            client.order(Command::InjectFault(fault)).expect("done");
        }
        let status = wait(&mut client, |status| matches!(status.state, DriverState::Tripped(_)));
        println!("{fault:?}: {:?} at tick {}, {} V", status.state, status.tripped_at, status.command_v);
        assert_eq!((status.state, status.command_v), (DriverState::Tripped(cause), 0.0));
        // The cause stays although the fault is gone, until it is acknowledged.
        assert!(client.arm().is_err());
        client.order(Command::Acknowledge).expect("done");
        wait(&mut client, |status| status.state == DriverState::Disarmed);
    }
}

/// A panic resets the chip; the next start keeps its message, and the trip until it is acknowledged.
#[test]
fn a_panic_resets_and_is_remembered() {
    let (_emulator, mut client) = live(ANY_SILENCE_S);
    client.order(Command::InjectFault(InjectedFault::Panic)).expect("done");
    let status = wait(&mut client, |status| matches!(status.state, DriverState::Tripped(_)));
    assert_eq!((status.state, status.command_v), (DriverState::Tripped(Cause::Panic), 0.0));
    assert_eq!(status.rate_hz, 0.0, "it has started again: parameters that were only tried are gone");
    let Answer::PanicMessage(message) = client.ask(Command::PanicMessage).expect("answers") else {
        panic!("no message")
    };
    println!("{message}");
    assert!(message.starts_with("injected fault at src/virtual_bench.rs:"), "{message}");
    client.upload(&blob(ANY_SILENCE_S), false).expect("taken");
    assert!(client.arm().is_err(), "not before it is acknowledged");
    client.order(Command::Acknowledge).expect("done");
    wait(&mut client, |status| status.ticks > 1);
    client.arm().expect("done");
}

/// A reset, here after a panic, leaves the last ticks before it: 3 kV, and no state that ended the run. A trip ends with its cause.
#[test]
fn a_reset_leaves_the_last_ticks() {
    let (_emulator, mut client) = live(ANY_SILENCE_S);
    let reached = client.status().expect("answers");
    // The monitor shows the voltage of some ticks ago.
    let running = wait(&mut client, |status| status.ticks > reached.ticks + 20);
    client.order(Command::InjectFault(InjectedFault::Panic)).expect("done");
    wait(&mut client, |status| status.state == DriverState::Tripped(Cause::Panic));
    let records = flight_records(&mut client);
    assert!(records.len() > 20, "{} records", records.len());
    assert!(records[0].state == DriverState::Running && records[0].tick >= running.ticks, "{:?}", records[0]);
    let newest = records[0];
    assert!(newest.command_v > 0.0 && (newest.monitor_v - newest.command_v).abs() < 100.0, "{newest:?}");
    assert!(records.windows(2).all(|pair| pair[0].tick == pair[1].tick + 1));

    // The next run goes on behind them.
    client.upload(&blob(ANY_SILENCE_S), false).expect("taken");
    client.order(Command::Acknowledge).expect("done");
    wait(&mut client, |status| status.ticks > 1);
    start(&mut client);
    client.order(Command::InjectFault(InjectedFault::Interlock)).expect("done");
    let status = wait(&mut client, |status| matches!(status.state, DriverState::Tripped(_)));
    let [last, ..] = flight_records(&mut client)[..] else { panic!("no records") };
    assert_eq!((last.state, last.command_v), (status.state, 0.0));
    assert_eq!(last.tick, status.tripped_at);
}

/// The newest records, newest first.
fn flight_records(client: &mut Client) -> Vec<FlightRecord> {
    let mut records = Vec::new();
    while records.len() < 100
        && let Answer::FlightRecords(older) =
            client.ask(Command::FlightRecords { back: records.len() as u16 }).expect("answers")
        && !older.is_empty()
    {
        records.extend(older);
    }
    records
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
    let (_emulator, port) = Emulator::start(&image("virtual-board")).expect("starts");
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

/// Bytes that the line carries in a tick of a millisecond, ten bits to a byte.
const BYTES_PER_TICK: usize = BAUD as usize / 10_000;

fn flood(port: &mut Port, random: &mut Pcg64, bytes: usize) {
    // Every thirtieth byte ends a frame.
    let garbage: Vec<u8> = (0..bytes).map(|_| if random.random_ratio(1, 30) { 0 } else { random.random() }).collect();
    port.write(&[garbage.as_slice(), &[0]].concat()).expect("sent");
}

/// An upload that ends early, or with another length, is not taken.
#[test]
fn a_truncated_upload_changes_nothing() {
    let (_emulator, port) = Emulator::start(&image("virtual-board")).expect("starts");
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
    let mut parameters = dea_driver::Blob::decode(&blob, boards::STM32F405).expect("valid").into_parameters();
    parameters.law.head[2] = f32::NAN;
    let spoiled = unchecked(&parameters);
    assert!(client.upload(&spoiled, false).is_err());
    wait(&mut client, |status| status.ticks > 1);
    client.arm().expect("the old parameters are in force");
}

/// A blob whose contents are not checked.
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
