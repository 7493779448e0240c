//! A host's conversation with a board: every command in the states of the link's table.

use dea_driver::server::Session;
use dea_driver::wire::{Answer, BAUD, Command, InjectedFault, Message, Mode, Reject, Request, Status, VERSION};
use dea_driver::{Cause, Device, DriverState, Inputs, Refusal, SCHEMA, SensorFault, Telemetry};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::board::frame;
use crate::host::{Host, blob};

#[test]
fn before_there_are_parameters_most_commands_are_rejected() {
    let mut host = Host::new(None);
    let nothing = Status {
        state: DriverState::Disarmed,
        rate_hz: 0.0,
        ticks: 0,
        tripped_at: 0,
        command_v: 0.0,
        monitor_v: 0.0,
        live: false,
        damaged_frames: 0,
        unknown_frames: 0,
        stack_peak: 0,
        lost_bytes: 0,
        falls: 0,
    };
    let status = host.bench.device.status();
    assert!(status.monitor_v.is_nan() && Status { monitor_v: 0.0, ..status } == nothing, "{status:?}");
    for command in [
        Command::Arm,
        Command::Start(Mode::Voltage),
        Command::Stop,
        Command::Acknowledge,
        Command::SetVoltage(1.0),
        Command::SetReference(f32::NAN),
        Command::Query,
        Command::Rest,
        Command::Step([0.0].into_iter().collect()),
        Command::Follow { mode: Mode::Voltage, targets: [].into_iter().collect() },
        Command::Reload,
    ] {
        assert_eq!(host.ask(command.clone()), Answer::Rejected(Reject::NoParameters), "{command:?}");
    }
    for command in [Command::Heartbeat, Command::Disarm, Command::Stream { every: 3 }] {
        assert_eq!(host.ask(command.clone()), Answer::Done, "{command:?}");
    }
    assert_eq!(host.ask(Command::InjectFault(InjectedFault::Panic)), Answer::Rejected(Reject::Unknown));
    assert_eq!(host.ask(Command::Commit { length: 0 }), Answer::Rejected(Reject::Upload));
    let Answer::Identity(identity) = host.ask(Command::Identify) else { panic!("no identity") };
    let who = (identity.protocol, identity.schema, identity.board, identity.firmware.as_str());
    assert_eq!(who, (VERSION, SCHEMA, 7, "1.2.3"));
    let Answer::PanicMessage(message) = host.ask(Command::PanicMessage) else { panic!("no message") };
    assert_eq!(message, "a panic");
    // A cause that is latched over a reset is acknowledged once.
    let mut host = Host::new(Some(Cause::Watchdog));
    let tripped = DriverState::Tripped(Cause::Watchdog);
    assert_eq!(host.state(), tripped);
    assert_eq!(host.ask(Command::Disarm), Answer::Refused(Refusal::State(tripped)));
    host.done(Command::Acknowledge);
    host.done(Command::Disarm);
    assert_eq!(host.ask(Command::Acknowledge), Answer::Rejected(Reject::NoParameters));
}

/// The records that wait for the host.
fn telemetry(host: &mut Host) -> impl Iterator<Item = Telemetry> {
    std::iter::from_fn(|| host.bench.device.telemetry())
}

#[test]
fn a_run_from_upload_to_disarm() {
    let mut host = Host::with_parameters();
    assert_eq!(host.bench.rate_hz, 1000.0);
    let checksum = blob().last_chunk().copied().map(u32::from_le_bytes);
    let parameters = Answer::Parameters { name: "table3-n2".try_into().expect("short"), checksum };
    assert_eq!(host.ask(Command::Query), parameters);
    for command in [Command::Start(Mode::Voltage), Command::Stop, Command::Acknowledge] {
        assert_eq!(host.ask(command), Answer::Refused(Refusal::State(DriverState::Disarmed)));
    }
    host.arm();
    host.done(Command::Start(Mode::Voltage));
    assert_eq!(host.ask(Command::SetVoltage(7000.0)), Answer::Rejected(Reject::Value));
    assert_eq!(host.ask(Command::SetReference(f32::NAN)), Answer::Rejected(Reject::Value));
    host.done(Command::SetVoltage(1000.0));
    host.done(Command::Stream { every: 10 });
    host.ticks(100);
    assert_eq!(host.bench.drive.dac_v, 1.0);
    let records: Vec<u32> = telemetry(&mut host).map(|record| record.tick).collect();
    assert_eq!(records.len(), 10);
    assert!(records.windows(2).all(|pair| pair[1] - pair[0] == 10));
    // Parameters and loop tests are for a disabled amplifier.
    let running = Answer::Refused(Refusal::State(DriverState::Running));
    let flash = host.bench.store.clone().destroy();
    assert_eq!(host.commit(&blob()), running);
    // Saving would hold up the ticks.
    assert_eq!(host.bench.store.clone().destroy(), flash);
    assert_eq!(host.ask(Command::Rest), running);
    assert_eq!(host.ask(Command::Step([0.0].into_iter().collect())), running);
    host.done(Command::Stop);
    host.done(Command::Disarm);
    // The cycles are those of the steps alone.
    host.done(Command::Rest);
    let Answer::Steps { steps, cycles: 42 } = host.ask(Command::Step([500.0; 3].into_iter().collect())) else {
        panic!("no steps")
    };
    assert_eq!(steps.len(), 3);
}

/// Accepted set-points and heartbeats of the host that armed keep the amplifier enabled; nothing else does. Any frame did, so that a
/// host that only looked on held the voltage of one that had died.
#[test]
fn only_the_host_that_armed_keeps_it_enabled() {
    let keeps = |token: u16, command: &Command, mode: Option<Mode>| {
        let mut host = Host::with_parameters();
        host.arm();
        if let Some(mode) = mode {
            host.done(Command::Start(mode));
        }
        for _ in 0..4 {
            host.ticks(300);
            let own = host.token;
            host.token = own.wrapping_mul(token);
            host.ask(command.clone());
            host.token = own;
            // Damaged frames do not count.
            host.hear(&[1, 2, 3, 0]);
        }
        match host.bench.device.state() {
            DriverState::Tripped(Cause::Heartbeat) => false,
            state => {
                assert!(state.is_live(), "{command:?}: {state:?}");
                // 0.5 s at 1 kHz, from the last request on.
                host.ticks(500);
                assert!(host.bench.device.state().is_live(), "{command:?}");
                host.tick();
                assert_eq!(host.bench.device.state(), DriverState::Tripped(Cause::Heartbeat), "{command:?}");
                true
            }
        }
    };
    let (voltage, tracking) = (Some(Mode::Voltage), Some(Mode::Tracking));
    for (command, mode) in [
        (Command::Heartbeat, None),
        (Command::Heartbeat, voltage),
        (Command::SetVoltage(500.0), None),
        (Command::SetVoltage(500.0), voltage),
        // The sensor of this bench does not move.
        (Command::SetReference(0.0), tracking),
    ] {
        assert!(keeps(1, &command, mode), "{command:?}");
        // Without the token, and with another one.
        assert!(!keeps(0, &command, mode) && !keeps(3, &command, mode), "{command:?} of another host");
    }
    for command in [Command::SetVoltage(f32::NAN), Command::SetVoltage(1e6), Command::SetReference(f32::NAN)] {
        assert!(!keeps(1, &command, voltage), "{command:?} is rejected");
    }
    // Neither set anything nor end in a new state.
    for command in [
        Command::Query,
        Command::Reload,
        Command::Start(Mode::Tracking),
        Command::Stream { every: 0 },
        Command::Identify,
        Command::Status,
        Command::PanicMessage,
        Command::InjectFault(InjectedFault::Hang),
    ] {
        assert!(!keeps(1, &command, voltage), "{command:?}");
    }
}

/// Another host is refused, and has no effect, whatever the order of its requests.
#[test]
fn another_host_cannot_start_or_move_what_it_did_not_arm() {
    let mut host = Host::with_parameters();
    host.arm();
    let token = std::mem::take(&mut host.token);
    for command in [
        Command::Start(Mode::Voltage),
        Command::SetVoltage(500.0),
        Command::SetReference(0.1e-3),
        Command::Heartbeat,
        Command::SetVoltage(f32::NAN),
    ] {
        assert_eq!(host.ask(command.clone()), Answer::Rejected(Reject::Token), "{command:?}");
    }
    assert_eq!(host.state(), DriverState::Armed);
    // It may always end it.
    host.done(Command::Disarm);
    // The next arming draws another token; the old one is worth nothing.
    host.arm();
    let next = std::mem::replace(&mut host.token, token);
    assert!(next != token && next != 0 && token != 0);
    assert_eq!(host.ask(Command::Start(Mode::Voltage)), Answer::Rejected(Reject::Token));
    host.token = next;
    host.done(Command::Start(Mode::Voltage));
    host.done(Command::Stop);
    // Before a host has armed no token is that of one, whatever is enabled by other means; nor is any number of a request old.
    for token in [0, 1] {
        let mut host = Host::with_parameters();
        (host.token, host.sequence) = (token, 1 << 20);
        assert_eq!(host.ask(Command::Start(Mode::Voltage)), Answer::Refused(Refusal::State(DriverState::Disarmed)));
        host.bench.device.arm().expect("healthy");
        assert_eq!(host.ask(Command::Heartbeat), Answer::Rejected(Reject::Token), "{token}");
    }
}

/// A frame of the host that armed is obeyed once, and not after a newer one: neither the same bytes again nor one from a buffer keep a voltage, or act
/// after a newer set-point or another host's stop. What is lost on the way does not matter, up to 255 requests in a row.
#[test]
fn no_request_is_obeyed_late_or_twice() {
    let mut random = Pcg64::seed_from_u64(30);
    for _ in 0..20 {
        let mut host = Host::with_parameters();
        host.sequence = random.random();
        host.arm();
        let mut sent: Vec<(u32, Command)> = Vec::new();
        host.done(Command::Start(Mode::Voltage));
        sent.push((host.sequence, Command::Start(Mode::Voltage)));
        for _ in 0..200 {
            host.sequence = host.sequence.wrapping_add(random.random_range(0..255));
            let command = match random.random_range(0..4) {
                0 => Command::Heartbeat,
                1 => Command::Status,
                _ => Command::SetVoltage(random.random_range(0.0..3000.0)),
            };
            let answer = host.ask(command.clone());
            assert!(matches!(answer, Answer::Done | Answer::Status(_)), "{answer:?}");
            sent.push((host.sequence, command));
            host.ticks(3);
            let (sequence, old) = sent[random.random_range(0..sent.len())].clone();
            let newest = host.sequence;
            if old != Command::Status {
                host.sequence = sequence.wrapping_sub(1);
                assert_eq!(host.ask(old.clone()), Answer::Stale { newest }, "{old:?}");
            }
            host.sequence = newest;
        }
        // Another host stops it, and the last bytes come again.
        let (sequence, newest, token) = (sent[0].0, host.sequence, std::mem::take(&mut host.token));
        host.done(Command::Stop);
        host.token = token;
        host.sequence = sequence.wrapping_sub(1);
        assert_eq!(host.ask(Command::Start(Mode::Voltage)), Answer::Stale { newest });
        // Long ago is old as well: so many numbers are those of a minute at 1 kHz, or of a day.
        for ago in [1 << 16, 1 << 26] {
            host.sequence = newest.wrapping_sub(ago);
            assert_eq!(host.ask(Command::Heartbeat), Answer::Stale { newest });
        }
        // Stop and disarm are obeyed at any time.
        host.done(Command::Disarm);
    }
    // 256 numbers ahead is the most.
    let mut host = Host::with_parameters();
    host.arm();
    host.sequence += 255;
    host.done(Command::Heartbeat);
    let newest = host.sequence;
    host.sequence += 256;
    assert_eq!(host.ask(Command::Heartbeat), Answer::Stale { newest });
    // The same bytes for an hour: only the first keep it alive.
    let mut host = Host::with_parameters();
    host.arm();
    host.done(Command::Start(Mode::Voltage));
    host.done(Command::SetVoltage(3000.0));
    let sequence = host.sequence;
    for _ in 0..600 {
        host.tick();
        host.sequence = sequence.wrapping_sub(1);
        assert_eq!(host.ask(Command::SetVoltage(3000.0)), Answer::Stale { newest: sequence });
    }
    assert_eq!(host.state(), DriverState::Tripped(Cause::Heartbeat));
}

/// The watchdog is fed as long as the background's loop turns within half a second, whatever the rate, parameters or not.
#[test]
fn a_background_that_hangs_is_noticed_by_the_tick() {
    let inputs = Inputs { interlock_closed: true, monitor_adc_v: Some(0.0), sensor_adc_v: Some(1.0) };
    let mut without = Device::new(None);
    let mut with = Host::with_parameters().bench.device;
    let rate_hz = with.controller().expect("installed").parameters().rate_hz;
    with.background_is_running();
    // The time begins with the device.
    for (device, rate_hz) in [(&mut without, 1000.0), (&mut with, rate_hz)] {
        let bound = (0.5 * rate_hz) as u32;
        for _ in 0..bound {
            device.tick(inputs);
            assert!(device.background_is_alive());
        }
        device.tick(inputs);
        assert!(!device.background_is_alive());
        device.background_is_running();
        assert!(device.background_is_alive());
    }
}

/// A turn of the background ends however fast a line brings frames, so that the tick finds it alive: it takes as long as its answers on the line.
#[test]
fn a_flood_does_not_starve_the_background() {
    let request = Request { sequence: 1, token: 0, command: Command::Status };
    // Frames of one byte, and requests back to back.
    for flood in [vec![1, 0], frame(&request)] {
        let mut host = Host::with_parameters();
        let rate_hz = host.bench.device.rate_hz();
        let mut line = flood.iter().copied().cycle().take(1_000_000);
        let mut ticks = 0;
        while ticks < 5000 {
            let mut sent = 0;
            let answered = |message: &Message| sent += frame(message).len();
            assert!(host.session.turn(line.by_ref(), &mut host.bench, answered));
            let turn = (sent as f32 * 10.0 / BAUD as f32 * rate_hz) as u32;
            assert!(turn > 0 && turn < 100, "{turn} ticks");
            for _ in 0..turn {
                host.tick();
                assert!(host.bench.device.background_is_alive());
            }
            ticks += turn;
        }
        assert!(line.next().is_some());
        assert!(!host.session.turn(core::iter::empty(), &mut host.bench, |_| ()));
    }
}

/// All reasons at once, the first of which arming is refused for, and the age of the self-test.
#[test]
fn preflight_names_everything_that_is_in_the_way() {
    let mut host = Host::new(None);
    assert_eq!(host.ask(Command::Preflight), Answer::Rejected(Reject::NoParameters));
    let mut host = Host::with_parameters();
    let ready = |self_test_s| Answer::Preflight { refusals: [].into_iter().collect(), self_test_s };
    assert_eq!(host.ask(Command::Preflight), ready(None));
    host.done(Command::SelfTested);
    // Whole seconds at 1 kHz.
    for (ticks, self_test_s) in [(999, 0), (1, 1), (1500, 2)] {
        host.ticks(ticks);
        assert_eq!(host.ask(Command::Preflight), ready(Some(self_test_s)));
    }

    let bad = Inputs { interlock_closed: false, monitor_adc_v: Some(9.0), sensor_adc_v: None };
    (0..100).for_each(|_| host.bench.tick(bad));
    let everything = [Refusal::InterlockOpen, Refusal::LiveVoltage, Refusal::Sensor(SensorFault::Range)];
    let refusals = everything.into_iter().collect();
    assert_eq!(host.ask(Command::Preflight), Answer::Preflight { refusals, self_test_s: Some(2) });
    assert_eq!(host.ask(Command::Arm), Answer::Refused(Refusal::InterlockOpen));

    let mut host = Host::with_parameters();
    host.arm();
    let armed = Refusal::State(DriverState::Armed);
    assert_eq!(host.ask(Command::SelfTested), Answer::Refused(armed));
    let Answer::Preflight { refusals, .. } = host.ask(Command::Preflight) else { panic!("no preflight") };
    assert_eq!(refusals[0], armed);
}

/// Frames that were damaged or unknown and the depth of the stack are reported with the state.
#[test]
fn the_status_counts_what_was_refused() {
    let mut host = Host::with_parameters();
    // Broken stuffing three times, which has no number, and twice a command that does not exist.
    let answered = [9, 9, 0].into_iter().find_map(|byte| host.session.serve(byte, &mut host.bench));
    assert!(matches!(answered, Some(Message::Answer { sequence: 0, answer: Answer::Rejected(_) })));
    host.hear(&[9, 9, 0].repeat(2));
    host.hear(&frame(&(1u16, 0u16, 200u8)).repeat(2));
    let status = host.status();
    assert_eq!((status.damaged_frames, status.unknown_frames, status.stack_peak), (3, 2, 99));
}

/// A token is never 0 and never the one before, whenever it is drawn; which one it is depends on when.
#[test]
fn no_token_is_0_or_the_one_before() {
    let mut host = Host::with_parameters();
    let mut first = Vec::new();
    for _ in 0..=u16::MAX {
        host.session = Session::new("1.2.3");
        host.arm();
        let token = host.token;
        host.done(Command::Disarm);
        host.arm();
        assert!(token != 0 && host.token != 0 && host.token != token, "{token}, then {}", host.token);
        host.done(Command::Disarm);
        first.push(token);
        host.tick();
    }
    first.sort_unstable();
    first.dedup();
    // A host that armed before a reset guesses it once in a thousand times at most.
    assert!(first.len() > 1000, "{} tokens", first.len());
}

/// Every third tick from the request on, none before it, and none after its end.
#[test]
fn records_are_those_of_every_nth_tick() {
    let mut host = Host::with_parameters();
    host.ticks(5);
    assert_eq!(telemetry(&mut host).count(), 0);
    host.done(Command::Stream { every: 3 });
    let before = host.status().ticks;
    host.ticks(7);
    assert!(telemetry(&mut host).map(|record| record.tick - before).eq([3, 6]));
    host.done(Command::Stream { every: 0 });
    host.ticks(5);
    assert_eq!(telemetry(&mut host).count(), 0);
}

/// Records that no host takes are counted, and the next one reports how many. The queue holds 16.
#[test]
fn dropped_records_are_reported() {
    let mut host = Host::with_parameters();
    assert!(host.bench.device.controller().is_some_and(|controller| controller.parameters().rate_hz == 1000.0));
    host.done(Command::Stream { every: 1 });
    host.ticks(30);
    assert!(telemetry(&mut host).map(|record| record.dropped).eq([0; 16]));
    host.ticks(2);
    assert!(telemetry(&mut host).map(|record| record.dropped).eq([14, 0]));
}
