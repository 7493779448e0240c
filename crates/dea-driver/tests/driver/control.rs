//! The control tick around a simulated film.

use dea_driver::chips::{Calibration, DacCode};
use dea_driver::{Cause, Controller, DriverState, Inputs, Mode, Parameters, Refusal, SensorFault};
use springpot::Limited;

use crate::film_bench::{FilmBench as Bench, adc_v, rides_through};

#[test]
fn follows_the_voltage_that_was_set_and_observes() {
    let mut bench = Bench::new().at_voltage(4000.0);
    bench.run(3000);
    let outputs = bench.tick(|_| ());
    assert_eq!(bench.state(), DriverState::Running);
    assert_eq!(bench.code(&outputs), DacCode(26_214), "4 V of 10 V");
    // The estimate is where the film is, to the sensor's noise of 0…5 µm.
    let predicted = f64::from(outputs.telemetry.predicted_m);
    assert!((predicted - bench.displacement_m).abs() < 5e-6, "{predicted} m for {} m", bench.displacement_m);
    assert!((f64::from(outputs.telemetry.displacement_m) - bench.displacement_m).abs() < 10e-6);
    assert_eq!((outputs.telemetry.tick, outputs.telemetry.dropped), (3002, 0));
}

/// An amplifier that is above 0 V at a command of 0 V cannot be brought below: a DAC of both signs must not be asked to.
#[test]
fn the_dac_is_never_asked_for_less_than_0_v() {
    let offset = Calibration::Parabola { offset: 20.0, gain: 1000.0, quadratic: 0.0 };
    let mut bench = Bench::changed(|p| p.amplifier = offset);
    bench.start(Mode::Voltage);
    assert_eq!(bench.tick(|_| ()).dac_v, 0.0);
    bench.set_voltage(1000.0);
    let highest_v = (0..50).map(|_| bench.tick(|_| ()).dac_v).fold(0.0, f32::max);
    assert!((highest_v - 0.98).abs() < 1e-5, "{highest_v} V");
}

/// A target does not outlive its run, although no tick passes between the trip and the next start.
#[test]
fn a_trip_clears_the_target_before_the_next_tick() {
    let mut bench = Bench::new().at_voltage(2000.0);
    bench.controller.trip(Cause::Bus);
    bench.ask(Controller::acknowledge).expect("tripped");
    bench.ask(Controller::arm).expect("the last readings were healthy");
    bench.start_armed(Mode::Voltage);
    for tick in 0..100 {
        let outputs = bench.tick(|_| ());
        assert_eq!((outputs.enable, outputs.telemetry.command_v), (true, 0.0), "tick {tick}");
    }
}

/// A film with a tenth less force than the model's: feedforward is off by as much, tracking corrects it.
#[test]
fn tracking_follows_a_film_that_the_model_does_not_know() {
    let off = |mode| {
        let mut bench = Bench { force_scale: 0.9, ..Bench::new() };
        bench.start(mode);
        // Up within two seconds, then swinging, slowly enough for the bandwidth.
        let reference_m = |time_s: f64| 0.8e-3 * (time_s / 2.0).min(1.0) - 0.1e-3 * (0.6 * time_s).sin();
        (bench.track(0..20_000, 10_000, reference_m), bench.tick(|_| ()).telemetry)
    };
    let (feedforward, _) = off(Mode::Feedforward);
    let (tracking, sample) = off(Mode::Tracking);
    println!("off by {:.1} µm, with the sensor {:.1} µm; {sample:?}", 1e6 * feedforward, 1e6 * tracking);
    assert!(feedforward > 60e-6 && tracking < 8e-6);
    // Where the film is swinging, the log shows by how much it is pulled less.
    assert!((sample.force_scale - 0.9).abs() < 0.05 && sample.limited == 0);
}

/// A fault may have taught what was learned from the sensor: after it is acknowledged, the model is as it was fitted.
#[test]
fn what_was_learned_is_forgotten_when_a_trip_is_acknowledged() {
    let mut bench = Bench { force_scale: 0.9, ..Bench::new() };
    bench.start(Mode::Tracking);
    bench.track(0..20_000, 0, |time_s| 0.8e-3 - 0.2e-3 * (1.2 * time_s).sin());
    let shown = bench.tick(|inputs| inputs.interlock_closed = false).telemetry;
    assert!((shown.force_scale - 1.0).abs() > 0.05 && shown.disturbance_n.abs() > 1e-3, "{shown:?}");
    bench.ask(Controller::acknowledge).expect("tripped");
    let forgotten = bench.tick(|_| ()).telemetry;
    assert_eq!((forgotten.force_scale, forgotten.disturbance_n), (1.0, 0.0));
}

/// With a sensor that may fail, tracking goes on without it, and comes back to it, without a jump.
#[test]
fn tracking_goes_on_without_its_sensor() {
    let mut bench = Bench { force_scale: 0.95, ..Bench::changed(rides_through) }.at_reference(Mode::Tracking, 0.8e-3);
    let mut before = None;
    for tick in 0..20_000 {
        bench.is_unplugged = (10_000..15_000).contains(&tick);
        let outputs = bench.live_tick(|_| ());
        assert_eq!(bench.state(), DriverState::Running, "tick {tick}");
        if tick > 5000 {
            assert!((bench.displacement_m - 0.8e-3).abs() < 15e-6, "tick {tick}: {} m", bench.displacement_m);
            let step = before.map_or(0.0, |before: f32| (outputs.telemetry.command_v - before).abs());
            assert!(step < 5.0, "tick {tick}: {step} V in a tick, of 50 allowed");
        }
        before = Some(outputs.telemetry.command_v);
    }
}

/// The field limit knows the film at its longest, whichever of sensor and model says so: at 30 V/µm a film with a third more force
/// than the model's is thinner than the model, and one with less may be what the sensor shows wrongly. It knows what is left of one
/// run in the next, after a trip between them.
#[test]
fn the_field_limit_knows_the_longer_of_sensor_and_model() {
    for force_scale in [1.3, 0.7] {
        let thin = |p: &mut Parameters| (p.limits.max_field_v_per_m, p.limits.max_disturbance_share) = (3e7, 0.4);
        let mut bench = Bench { force_scale, ..Bench::changed(thin) };
        let (mut model, mut longest_m) = (bench.law.state(), 0.0f64);
        let mut tick = |bench: &mut Bench, closed: bool| {
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
            bench.start_armed(Mode::Voltage);
            bench.set_voltage(6500.0);
            let reached_m = (0..10_000).fold(0.0, |_, _| {
                bench.controller.heartbeat();
                tick(&mut bench, true)
            });
            assert!(reached_m > 1e-3, "run {run}: {reached_m} m");
            tick(&mut bench, false);
            for _ in 0..1001 {
                tick(&mut bench, true);
            }
            bench.ask(Controller::acknowledge).expect("tripped");
        }
    }
}

/// An implausible value of the sensor does not move the voltage.
#[test]
fn an_implausible_sensor_does_not_limit_the_field() {
    let mut bench = Bench::changed(|p| {
        rides_through(p);
        (p.limits.max_field_v_per_m, p.actuator.stretch_coupling) = (3e7, 29.0);
    })
    .at_voltage(4500.0);
    bench.run(300);
    let before = bench.tick(|_| ()).telemetry.command_v;
    // 4.8 kV at rest; at the 9 mm that it reads it would be 3.8 kV.
    let after = bench.tick(|inputs| inputs.sensor_adc_v = Some(adc_v(u16::MAX))).telemetry.command_v;
    assert!(before > 4300.0 && (after - before).abs() < 5.0, "{before} V, then {after} V");
}

/// The model feels the voltage applied until the trip, in the tick that trips.
#[test]
fn the_model_feels_the_last_tick_before_a_trip() {
    let predicted = |trips: bool| {
        let mut bench = Bench::new().at_reference(Mode::Feedforward, 0.8e-3);
        bench.run(300);
        bench.tick(|inputs| inputs.interlock_closed = !trips).telemetry.predicted_m
    };
    assert_eq!(predicted(true).to_bits(), predicted(false).to_bits());
}

/// Feedforward brings a film that the model knows to its reference, and holds it there while it creeps: with parameters for it, without any
/// displacement sensor.
#[test]
fn feedforward_needs_no_sensor() {
    let mut bench = Bench::changed(rides_through);
    bench.tick(|inputs| inputs.sensor_adc_v = None);
    bench.ask(Controller::arm).expect("no sensor is needed");
    bench.start_armed(Mode::Feedforward);
    bench.set_reference(0.8e-3);
    let mut voltages = Vec::new();
    for tick in 0..20_000 {
        voltages.push(bench.live_tick(|inputs| inputs.sensor_adc_v = None).telemetry.command_v);
        assert!(tick < 1000 || (bench.displacement_m - 0.8e-3).abs() < 2e-6, "tick {tick}: {} m", bench.displacement_m);
    }
    assert_eq!(bench.state(), DriverState::Running);
    // What holds it sinks, because the film creeps.
    assert!(voltages[19_999] < 0.9 * voltages[1000]);
}

/// Values that come a hundred times a second are joined by straight lines, not by stairs.
#[test]
fn references_are_joined_by_lines() {
    let mut bench = Bench::new();
    bench.start(Mode::Feedforward);
    let mut last = 0.0f32;
    for tick in 0..2000 {
        if tick % 10 == 0 {
            // 0.4 mm/s: 4 µm from one value to the next.
            bench.set_reference(0.4e-6 * tick as f32);
        }
        let reference_m = bench.tick(|_| ()).telemetry.reference_m;
        let step = reference_m - last;
        assert!(tick < 100 || (0.35e-6..0.45e-6).contains(&step), "tick {tick}: {step} m");
        last = reference_m;
    }
}

/// Following begins where the film is, whatever was asked for before.
#[test]
fn following_begins_without_a_jump() {
    let mut bench = Bench::new().at_voltage(4000.0);
    bench.run(1000);
    // It was stretched, and is still creeping back when it is asked to go on.
    bench.ask(Controller::stop).expect("running");
    bench.run(200);
    let (from, increment) = (bench.displacement_m, 0.05 / 1000.0);
    bench.start_armed(Mode::Feedforward);
    bench.set_reference(2e-3);
    let first = bench.tick(|_| ()).telemetry;
    assert!((f64::from(first.reference_m) - from).abs() <= 1.01 * increment, "{} m after {from} m", first.reference_m);
    assert!(Limited::ALL.iter().any(|(limit, _)| u32::from(limit.bits()) & u32::from(first.limited) != 0));
}

#[test]
fn faults_end_at_0_v_within_the_tick() {
    type Spoil = fn(&mut Inputs);
    let faults: [(Cause, Spoil); 5] = [
        (Cause::Interlock, |inputs| inputs.interlock_closed = false),
        (Cause::Bus, |inputs| inputs.monitor_adc_v = None),
        (Cause::Sensor(SensorFault::Range), |inputs| inputs.sensor_adc_v = None),
        (Cause::Sensor(SensorFault::Range), |inputs| inputs.sensor_adc_v = Some(adc_v(u16::MAX))),
        (Cause::Voltage, |inputs| inputs.monitor_adc_v = Some(adc_v(u16::MAX))),
    ];
    for (cause, spoil) in faults {
        let mut bench = Bench::new().at_voltage(5000.0);
        bench.run(200);
        assert!(bench.high_voltage_v > 4900.0);
        let outputs = bench.tick(spoil);
        assert_eq!((outputs.enable, outputs.dac_v, outputs.telemetry.command_v), (false, 0.0, 0.0), "{cause:?}");
        assert_eq!(bench.state(), DriverState::Tripped(cause));
        assert_eq!(bench.ask(Controller::arm), Err(Refusal::State(DriverState::Tripped(cause))));
    }
}

/// A run has a mode, and its target is what comes out, whatever ran before. When the supervisor could be started past its
/// controller, the voltage after a tracking run stayed elsewhere.
#[test]
fn a_voltage_after_a_tracking_run_is_the_one_that_was_set() {
    let mut bench = Bench::new().at_reference(Mode::Tracking, 0.3e-3);
    bench.run(300);
    bench.ask(Controller::stop).expect("running");
    bench.tick(|_| ());
    bench.start_armed(Mode::Voltage);
    bench.set_voltage(2000.0);
    let command_v = (0..300).fold(0.0, |_, _| bench.tick(|_| ()).telemetry.command_v);
    assert_eq!(command_v, 2000.0);
}
