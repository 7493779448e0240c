//! Edges that mutants of the driver's source found untested: counts to the tick, values at a limit, what is told beside the state.

use dea_driver::{
    Cause, Controller, DriverState, Limits, LimitsError, Mode, Monitor, Plausibility, PlausibilityLimits, Readings,
    SensorFault, Supervisor,
};

use crate::bench::{bench_limits, board_parameters};
use crate::film_bench::{FilmBench, adc_v};

const RATE_HZ: f32 = 1000.0;

fn readings(monitor_v: f32) -> Readings {
    Readings {
        interlock_closed: true,
        monitor_v,
        displacement_m: 1e-6,
        predicted_m: 0.0,
        open_loop_m: 0.0,
        follows: false,
        disturbance_share: 0.0,
    }
}

/// The band around 0 V and the largest voltage belong to what is allowed: more than that does not.
#[test]
fn a_monitor_at_its_limit_is_within_it() {
    let limits = bench_limits();
    let mut supervisor = Supervisor::new(&limits, RATE_HZ).expect("valid");
    supervisor.check(readings(limits.monitor.band_v));
    assert!(!supervisor.is_film_live() && !supervisor.runs());
    supervisor.arm().expect("at 0 V");
    assert!(!supervisor.runs() && supervisor.enables());
    supervisor.start().expect("armed");
    assert!(supervisor.runs());
    // 6500 V, 3 % and 60 V.
    let most_v = limits.monitored_v();
    assert!((most_v - 6755.0).abs() < 0.01);
    assert_eq!(supervisor.check(readings(most_v)).state, DriverState::Running);
    assert_eq!(supervisor.check(readings(most_v.next_up())).state, DriverState::Tripped(Cause::Voltage));
    assert!(!supervisor.runs());
    supervisor.check(readings(limits.monitor.band_v.next_up()));
    assert!(supervisor.is_film_live());
}

/// More voltage than was commanded is as wrong as less, below the largest voltage as well: 4000 V with a band of 60 V and 3 %.
#[test]
fn a_monitor_above_its_band_disagrees() {
    for (monitor_v, agrees) in [(4170.0, true), (4190.0, false), (3830.0, true), (3810.0, false)] {
        let mut monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
        assert!((0..1000).all(|_| monitor.agrees(4000.0, 4000.0)));
        let all = (0..1000).fold(true, |all, _| monitor.agrees(4000.0, monitor_v) && all);
        assert_eq!(all, agrees, "{monitor_v} V");
    }
    let mut monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
    assert!((0..1000).all(|_| monitor.agrees(0.0, 50.0)), "within the band around 0 V");
}

/// A sensor with the noise of its converter, and a model that is `modelled_m(tick)`: the ticks in which it counts as stuck.
fn stuck_ticks(ticks: u32, moves_m: impl Fn(u32) -> f32, modelled_m: impl Fn(u32) -> f32) -> Vec<u32> {
    let limits = PlausibilityLimits { low: -1e-3, high: 9e-3, jump: 0.4e-3, stuck_ticks: 500, stuck_band: 2e-6 };
    let mut sensor = Plausibility::new(limits);
    (0..ticks)
        .filter(|&tick| {
            let noise_m = [0.0, 0.5e-6, -0.3e-6][tick as usize % 3];
            let value = 1e-3 + moves_m(tick) + noise_m;
            sensor.check(value, value, modelled_m(tick)) == Some(SensorFault::Stuck)
        })
        .collect()
}

/// A frozen sensor is told a fifth of `stuck_ticks` after the model has moved five bands, whenever that is, and stays stuck when a
/// swing brings the model back.
#[test]
fn a_frozen_sensor_is_told_after_a_fifth_of_its_ticks() {
    for moved in [50, 137, 480, 700, 1210] {
        let stuck = stuck_ticks(moved + 1000, |_| 0.0, |tick| if tick < moved { 0.0 } else { 20e-6 });
        assert_eq!(stuck, (moved + 100..moved + 1000).collect::<Vec<_>>(), "moved in tick {moved}");
        let swings = |tick| if (moved..moved + 150).contains(&tick) { 20e-6 } else { 0.0 };
        assert_eq!(stuck_ticks(moved + 1000, |_| 0.0, swings), stuck, "a swing from tick {moved} on");
        let returns = |tick| if (moved..moved + 100).contains(&tick) { 20e-6 } else { 0.0 };
        assert_eq!(stuck_ticks(moved + 1000, |_| 0.0, returns), [0; 0], "back in time, from tick {moved} on");
    }
    // Less than five bands, and creep of 4 bands in `stuck_ticks`, prove nothing.
    assert_eq!(stuck_ticks(3000, |_| 0.0, |tick| if tick < 700 { 0.0 } else { 9.9e-6 }), [0; 0]);
    assert_eq!(stuck_ticks(10_000, |_| 0.0, |tick| 16e-9 * tick as f32), [0; 0]);
}

/// A sensor that follows again is plausible again, after ten good values.
#[test]
fn a_sensor_that_moves_again_is_not_stuck() {
    let model = |tick: u32| if tick < 100 { 0.0 } else { 20e-6 + 5e-9 * tick as f32 };
    let film = |tick: u32| if tick < 400 { 0.0 } else { 20e-6 + 5e-9 * tick as f32 };
    assert_eq!(stuck_ticks(5000, film, model), (200..409).collect::<Vec<_>>());
}

/// After a reset a sensor has no past: no fault, and no value from which it could have jumped.
#[test]
fn a_reset_sensor_has_no_past() {
    let mut sensor = Plausibility::new(bench_limits().sensor);
    assert_eq!(sensor.check(0.5, 0.0, f32::NAN), Some(SensorFault::Range));
    assert_eq!(sensor.check(1e-3, 1e-3, f32::NAN), Some(SensorFault::Jump));
    sensor.reset();
    assert_eq!(sensor.check(5e-3, 1e-3, f32::NAN), None);
}

/// Each bound of the limits belongs to what is allowed, and each limit is checked by itself.
#[test]
fn limits_at_their_bounds_are_kept_and_beyond_are_refused() {
    let checked = |change: fn(&mut Limits)| {
        let mut limits = bench_limits();
        change(&mut limits);
        Supervisor::new(&limits, RATE_HZ).map(drop)
    };
    for within in [
        |l: &mut Limits| l.monitor.slew_v_per_s = 6500.0,
        // A quarter of the range of 9.9 mm.
        |l: &mut Limits| l.sensor.jump = 2.4e-3,
        // Ten seconds.
        |l: &mut Limits| l.sensor.stuck_ticks = 10_000,
        |l: &mut Limits| l.sensor.stuck_ticks = 5000,
        |l: &mut Limits| l.monitor.settle_s = 0.0,
        |l: &mut Limits| l.monitor.band_share = 0.0,
    ] {
        assert_eq!(checked(within), Ok(()));
    }
    for monitor in [
        |l: &mut Limits| l.monitor.band_v = 0.0,
        |l: &mut Limits| l.monitor.band_v = f32::NAN,
        |l: &mut Limits| l.monitor.band_share = -0.01,
        |l: &mut Limits| l.monitor.band_share = f32::NAN,
        |l: &mut Limits| l.monitor.settle_s = -0.01,
        |l: &mut Limits| l.monitor.settle_s = f32::INFINITY,
    ] {
        assert_eq!(checked(monitor), Err(LimitsError::Monitor));
    }
    for sensor in [
        |l: &mut Limits| l.sensor.low = f32::NEG_INFINITY,
        |l: &mut Limits| l.sensor.low = f32::NAN,
        |l: &mut Limits| l.sensor.high = f32::INFINITY,
        |l: &mut Limits| l.sensor.high = f32::NAN,
        |l: &mut Limits| l.sensor.jump = 0.0,
        |l: &mut Limits| l.sensor.stuck_ticks = 4,
    ] {
        assert_eq!(checked(sensor), Err(LimitsError::Sensor));
    }
    assert_eq!(checked(|l| l.sensor.jump = 2.6e-3), Err(LimitsError::TooLarge("sensor.jump")));
}

/// Largest stroke: a reference to it is within the limits.
#[test]
fn the_largest_stroke_may_be_asked_for() {
    let mut bench = FilmBench::new();
    bench.start(Mode::Tracking);
    assert_eq!(bench.controller.set_reference(8e-3), Ok(()));
    assert_eq!(bench.controller.set_reference(-8e-3), Ok(()));
    assert!(bench.controller.set_reference(8e-3f32.next_up()).is_err());
}

/// A voltage is approached within 50 ms, or the time since the one before if that is less, and it ends exactly there.
#[test]
fn a_voltage_is_reached_in_time_and_exactly() {
    for (wait, most) in [(7, 7), (33, 33), (50, 50), (400, 50)] {
        let mut bench = FilmBench::new();
        bench.start(Mode::Voltage);
        bench.set_voltage(100.0);
        for _ in 0..wait {
            bench.tick(|_| ());
        }
        bench.set_voltage(133.3);
        let volts: Vec<f32> = (0..200).map(|_| bench.tick(|_| ()).telemetry.command_v).collect();
        for (index, &volts) in volts.iter().enumerate() {
            let expected = 100.0 + 33.3 * ((index + 1) as f32 / most as f32).min(1.0);
            assert!((volts - expected).abs() < 1e-3, "{wait} ticks: {volts} V instead of {expected} V in tick {index}");
        }
        assert!(volts[most - 1..].iter().all(|&volts| volts == 133.3), "{wait} ticks: {:?}", &volts[most - 1..]);
    }
}

/// A sensor that reads 0.1 mm at rest: the displacement is what is above that.
#[test]
fn the_sensor_s_offset_is_taken_off() {
    let mut parameters = board_parameters();
    parameters.sensor_offset_m = 0.1e-3;
    let mut bench = FilmBench::with(parameters);
    let telemetry = bench.tick(|inputs| inputs.sensor_adc_v = Some(1.5)).telemetry;
    assert!((telemetry.displacement_m - 0.4e-3).abs() < 1e-9, "{} m", telemetry.displacement_m);
}

/// Nothing is learned while the sensor is only checked, or the film is not driven: not in feedforward, not while armed.
#[test]
fn nothing_is_learned_in_feedforward_or_at_rest() {
    let mut bench = FilmBench { force_scale: 0.9, ..FilmBench::new() };
    bench.start(Mode::Feedforward);
    bench.set_reference(0.6e-3);
    for _ in 0..3000 {
        bench.controller.heartbeat();
        let telemetry = bench.tick(|_| ()).telemetry;
        assert_eq!((telemetry.disturbance_n, telemetry.force_scale), (0.0, 1.0));
    }
    let mut bench = FilmBench::new();
    bench.tick(|_| ());
    bench.ask(Controller::arm).expect("healthy");
    for tick in 0..3000 {
        bench.controller.heartbeat();
        // Someone leans on the film.
        let telemetry = bench.tick(|inputs| inputs.sensor_adc_v = Some(1.1 + 1e-3 * (tick % 3) as f32)).telemetry;
        assert_eq!((telemetry.disturbance_n, telemetry.force_scale, telemetry.predicted_m), (0.0, 1.0, 0.0));
    }
}

/// Feedforward uses the model as it was fitted, whatever was learned before.
#[test]
fn feedforward_forgets_what_tracking_learned() {
    let mut bench = FilmBench { force_scale: 0.9, ..FilmBench::new() };
    bench.start(Mode::Tracking);
    bench.set_reference(0.6e-3);
    let learned = (0..10_000).fold(0.0, |_, _| {
        bench.controller.heartbeat();
        bench.tick(|_| ()).telemetry.disturbance_n
    });
    assert!(learned.abs() > 1e-3, "{learned} N");
    bench.ask(Controller::stop).expect("running");
    bench.ask(|controller| controller.start(Mode::Feedforward)).expect("armed");
    let telemetry = bench.tick(|_| ()).telemetry;
    assert_eq!((telemetry.disturbance_n, telemetry.force_scale), (0.0, 1.0));
}

/// An estimate is made of a film that was left stretched by a trip, and goes on after it is acknowledged.
#[test]
fn the_estimate_goes_on_after_an_acknowledged_trip() {
    let mut bench = FilmBench::new();
    bench.start(Mode::Voltage);
    bench.set_voltage(5000.0);
    for _ in 0..5000 {
        bench.controller.heartbeat();
        bench.tick(|_| ());
    }
    bench.tick(|inputs| inputs.interlock_closed = false);
    for _ in 0..20 {
        bench.tick(|_| ());
    }
    bench.ask(Controller::acknowledge).expect("tripped");
    let predicted_m = f64::from(bench.tick(|_| ()).telemetry.predicted_m);
    assert!(bench.displacement_m > 0.2e-3, "still stretched: {} m", bench.displacement_m);
    assert!((predicted_m - bench.displacement_m).abs() < 10e-6, "{predicted_m} m of {} m", bench.displacement_m);
}

/// The model is corrected as often as the sensor has samples: here every tenth tick.
#[test]
fn a_sample_is_used_every_interval() {
    let mut bench = FilmBench { force_scale: 0.9, ..FilmBench::new() };
    bench.start(Mode::Tracking);
    bench.set_reference(0.5e-3);
    let mut before = 0.0;
    let mut used = Vec::new();
    for tick in 0..400 {
        let innovation_m = bench.tick(|_| ()).telemetry.innovation_m;
        if innovation_m != before {
            used.push(tick);
        }
        before = innovation_m;
    }
    assert!(used.len() >= 38, "{used:?}");
    assert!(used.windows(2).all(|pair| pair[1] - pair[0] == 10), "{used:?}");
}

/// A reference that is set in a run of voltages neither leads the film nor its record.
#[test]
fn a_reference_does_not_act_on_a_run_of_voltages() {
    let mut bench = FilmBench::new();
    bench.start(Mode::Voltage);
    bench.set_reference(0.8e-3);
    for _ in 0..300 {
        let telemetry = bench.tick(|_| ()).telemetry;
        assert_eq!((telemetry.command_v, telemetry.limited), (0.0, 0));
        assert!((telemetry.reference_m - telemetry.predicted_m).abs() < 1e-9, "{} m", telemetry.reference_m);
    }
}

/// The field limit knows the film at its longest, whichever of sensor and model says so: at 30 V/µm a film with a third more force
/// than the model's is thinner than the model, and one with less may be what the sensor shows wrongly. It knows what is left of one
/// run in the next, after a trip between them.
#[test]
fn the_field_limit_knows_the_longer_of_sensor_and_model() {
    for force_scale in [1.3, 0.7] {
        let mut parameters = board_parameters();
        parameters.limits.max_field_v_per_m = 3e7;
        parameters.limits.max_disturbance_share = 0.4;
        let mut bench = FilmBench { force_scale, ..FilmBench::with(parameters) };
        let (mut model, mut longest_m) = (bench.law.state(), 0.0f64);
        let mut tick = |bench: &mut FilmBench, closed: bool| {
            let command_v = f64::from(bench.tick(|inputs| inputs.interlock_closed = closed).telemetry.command_v);
            // What both were when the tick began: 0.1 % for a tick of motion and the sensor's noise.
            let thickness_m = 160e-6 / (1.0 + longest_m / 0.04);
            assert!(command_v / thickness_m < 1.001 * 3e7, "{force_scale}: {command_v} V at {longest_m} m");
            let modelled_m = bench.law.displacement_under(&mut model, bench.drive.load(bench.high_voltage_v));
            longest_m = bench.displacement_m.max(modelled_m);
            longest_m
        };
        for run in 0..2 {
            tick(&mut bench, true);
            bench.ask(Controller::arm).expect("healthy");
            bench.ask(|controller| controller.start(Mode::Voltage)).expect("armed");
            bench.set_voltage(6500.0);
            let reached_m = (0..10_000).fold(0.0, |_, _| {
                bench.controller.heartbeat();
                tick(&mut bench, true)
            });
            assert!(reached_m > 1e-3, "run {run}: {reached_m} m");
            tick(&mut bench, false);
            for _ in 0..20 {
                tick(&mut bench, true);
            }
            bench.ask(Controller::acknowledge).expect("tripped");
        }
    }
}

/// Without a reference that is followed nothing has to move: neither in a run of voltages without a film, whatever reference was set,
/// nor when its model creeps back.
#[test]
fn a_sensor_is_not_stuck_before_there_is_a_reference() {
    let mut bench = FilmBench::new();
    bench.start(Mode::Voltage);
    bench.set_voltage(5000.0);
    bench.set_reference(0.5e-3);
    let still = |tick: u16| Some(adc_v(6400 + tick % 3));
    for tick in 0..1000 {
        bench.controller.heartbeat();
        bench.tick(|inputs| inputs.sensor_adc_v = still(tick));
        assert_eq!(bench.controller.supervisor().state(), DriverState::Running, "tick {tick}");
    }
    bench.ask(Controller::stop).expect("running");
    bench.ask(|controller| controller.start(Mode::Feedforward)).expect("armed");
    for tick in 0..2000 {
        bench.controller.heartbeat();
        bench.tick(|inputs| inputs.sensor_adc_v = still(tick));
        assert_eq!(bench.controller.supervisor().state(), DriverState::Running, "tick {tick}");
    }
}

/// What a file need not state: a tenth of the force, a second, and 2 µm.
#[test]
fn limits_that_are_not_stated_have_values() {
    let stated = serde_json::json!({
        "max_voltage_v": 6000.0, "max_field_v_per_m": 4.2e7, "thickness_m": 160e-6, "max_slew_v_per_s": 50e3,
        "max_displacement_m": 8e-3, "on_sensor_fault": "trip", "heartbeat_s": 0.5,
        "monitor": { "slew_v_per_s": 1e5, "band_v": 60.0, "band_share": 0.03, "settle_s": 0.02 },
        "sensor": { "low": -0.5e-3, "high": 9e-3, "jump": 0.5e-3, "stuck_ticks": 500 },
    });
    let limits: Limits = serde_json::from_value(stated).expect("complete");
    assert_eq!((limits.max_disturbance_share, limits.discharge_s, limits.sensor.stuck_band), (0.1, 1.0, 2e-6));
}
