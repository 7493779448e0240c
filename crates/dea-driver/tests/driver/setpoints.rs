//! Set-points are taken within the limits and while the amplifier is enabled alone, are reached in time, and end with the state that
//! they were set in; runs begin at 0 V.

use dea_driver::{Cause, Controller, DriverState, Mode, SetpointError};

use crate::film_bench::FilmBench;

/// A change of state.
type Change = (&'static str, fn(&mut Controller) -> bool);

const CHANGES: [Change; 7] = [
    ("arm", |controller| controller.arm().is_ok()),
    ("start voltage", |controller| controller.start(Mode::Voltage).is_ok()),
    ("start tracking", |controller| controller.start(Mode::Tracking).is_ok()),
    ("stop", |controller| controller.stop().is_ok()),
    ("disarm", |controller| controller.disarm().is_ok()),
    ("trip", |controller| {
        controller.trip(Cause::Overrun);
        true
    }),
    ("acknowledge", |controller| controller.acknowledge().is_ok()),
];

/// A bench in `state`; its run, if it is running, in `mode`.
fn reach(state: DriverState, mode: Mode) -> FilmBench {
    let mut bench = FilmBench::new();
    bench.tick(|_| ());
    if state.is_live() {
        bench.ask(Controller::arm).expect("healthy");
    }
    match state {
        DriverState::Running => bench.start_armed(mode),
        DriverState::Tripped(cause) => bench.controller.trip(cause),
        _ => {}
    }
    assert_eq!(bench.state(), state);
    bench
}

/// Goes on to a run from any state, setting nothing.
fn to_a_run(bench: &mut FilmBench, mode: Mode) {
    for _ in 0..3 {
        bench.ask(|controller| match controller.supervisor().state() {
            DriverState::Tripped(_) => controller.acknowledge().expect("tripped"),
            DriverState::Disarmed => controller.arm().expect("healthy"),
            DriverState::Armed => controller.start(mode).expect("armed"),
            _ => {}
        });
        bench.tick(|_| ());
    }
    assert_eq!(bench.state(), DriverState::Running);
}

/// Every set-point in every state, in a run of voltages or of references, then every change of state, with and without ticks between: the
/// next run stays at 0 V until something is set in it.
#[test]
fn no_set_point_outlives_its_state() {
    let states =
        [DriverState::Disarmed, DriverState::Armed, DriverState::Running, DriverState::Tripped(Cause::Interlock)];
    let modes = [Mode::Voltage, Mode::Feedforward, Mode::Tracking];
    let mut changed = 0;
    let runs = [Mode::Voltage, Mode::Feedforward].into_iter().flat_map(|first| modes.map(|mode| (first, mode)));
    let runs: Vec<_> = runs.flat_map(|run| [0, 1, 100].map(|ticks| (ticks, run))).collect();
    for (state, (name, change)) in states.iter().flat_map(|&state| CHANGES.map(|change| (state, change))) {
        for &(ticks, (first, mode)) in &runs {
            let mut bench = reach(state, first);
            let taken = if state.is_live() { Ok(()) } else { Err(SetpointError::NotLive(state)) };
            assert_eq!(bench.ask(|controller| controller.set_voltage(3000.0)), taken, "{state:?}");
            assert_eq!(bench.ask(|controller| controller.set_reference(0.5e-3)), taken, "{state:?}");
            bench.run(ticks);
            // Refused changes leave the run, and its target, as they are.
            if !bench.ask(change) {
                continue;
            }
            changed += 1;
            // The film is at 0 V for a second before it is armed again.
            bench.run(1001);
            to_a_run(&mut bench, mode);
            let volts = (0..200).map(|_| bench.live_tick(|_| ()).telemetry.command_v);
            let largest_v = volts.fold(0.0, f32::max);
            assert_eq!(largest_v, 0.0, "set while {state:?}, {first:?}, {ticks} ticks, {name}, a run in {mode:?}");
        }
    }
    println!("{changed} pairs of a set-point and a change of state");
    // Disarmed: arm, disarm, trip. Armed: 2 × start, disarm, trip. Running: stop, disarm, trip. Tripped: trip, acknowledge.
    assert_eq!(changed, (3 + 4 + 3 + 2) * 3 * 2 * 3);
}

/// Requests that arrive within one tick are as good as those between ticks: a run that is stopped and started again begins at 0 V.
#[test]
fn a_run_begins_at_0_v_without_a_tick_before_it() {
    for mode in [Mode::Voltage, Mode::Feedforward, Mode::Tracking] {
        let mut bench = reach(DriverState::Running, Mode::Voltage);
        bench.set_voltage(2000.0);
        bench.run(100);
        assert_eq!(bench.controller.supervisor().command_v(), 2000.0);
        bench.ask(Controller::stop).expect("running");
        bench.start_armed(mode);
        assert_eq!(bench.controller.supervisor().command_v(), 0.0, "{mode:?}");
        for _ in 0..100 {
            assert_eq!(bench.tick(|_| ()).telemetry.command_v, 0.0, "{mode:?}");
        }
        assert_eq!(bench.state(), DriverState::Running, "{mode:?}");
    }
}

/// A voltage is approached within 50 ms, or the time since the one before if that is less, and it ends exactly there.
#[test]
fn a_voltage_is_reached_in_time_and_exactly() {
    for (wait, most) in [(7, 7), (33, 33), (50, 50), (400, 50)] {
        let mut bench = FilmBench::new().at_voltage(100.0);
        bench.run(wait);
        bench.set_voltage(133.3);
        let volts: Vec<f32> = (0..200).map(|_| bench.tick(|_| ()).telemetry.command_v).collect();
        for (index, &volts) in volts.iter().enumerate() {
            let expected = 100.0 + 33.3 * ((index + 1) as f32 / most as f32).min(1.0);
            assert!((volts - expected).abs() < 1e-3, "{wait} ticks: {volts} V instead of {expected} V in tick {index}");
        }
        assert!(volts[most - 1..].iter().all(|&volts| volts == 133.3), "{wait} ticks: {:?}", &volts[most - 1..]);
    }
    // Another one in each tick: each is reached within it.
    let mut bench = FilmBench::new();
    bench.start(Mode::Voltage);
    for k in 1..20 {
        let volts = 40.0 * k as f32;
        bench.set_voltage(volts);
        assert_eq!(bench.tick(|_| ()).telemetry.command_v, volts);
    }
}

/// A reference that is set in a run of voltages neither leads the film nor its record.
#[test]
fn a_reference_does_not_act_on_a_run_of_voltages() {
    let mut bench = FilmBench::new().at_reference(Mode::Voltage, 0.8e-3);
    for _ in 0..300 {
        let telemetry = bench.tick(|_| ()).telemetry;
        assert_eq!((telemetry.command_v, telemetry.limited), (0.0, 0));
        assert!((telemetry.reference_m - telemetry.predicted_m).abs() < 1e-9, "{} m", telemetry.reference_m);
    }
}
