//! The loop test: what a chip is compared with, bit by bit.

use std::f64::consts::TAU;

use dea_driver::server::Denial;
use dea_driver::wire::Reject;
use dea_driver::{Blob, Cause, Controller, Device, DriverState, Followed, Inputs, Mode, Refusal, Step, Target, Ticked};
use springpot::{Actuator, Applied, SensorSample, Tracking, VoltageDrive};

use crate::bench::{board_parameters, changed_parameters, law};
use crate::film_bench::rides_through;

fn device() -> Device {
    let mut device = Device::new(None);
    let controller = Controller::new(Blob::new(board_parameters()).expect("valid"));
    device.install(controller).expect("disabled");
    device
}

/// A tick of a film at rest, with the sensor's noise.
fn tick(device: &mut Device, k: usize) {
    let noise_v = if k.is_multiple_of(2) { 0.0 } else { 1e-3 };
    device.tick(Inputs { interlock_closed: true, monitor_adc_v: Some(0.0), sensor_adc_v: Some(1.0 + noise_v) });
}

/// The loop test steps a model of its own, bit for bit the law that a host steps.
#[test]
fn the_loop_test_is_the_law_itself() {
    let mut device = device();
    let law = law();
    let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6500.0, law.stiffness()).expect("valid");
    // The paper's voltage, 3 kV (1 − cos), at 0.2 Hz.
    let voltages: Vec<f32> = (0..10_001).map(|k| (3000.0 * (1.0 - (TAU * 2e-4 * f64::from(k)).cos())) as f32).collect();
    for _ in 0..2 {
        device.rest().expect("disabled");
        let mut film = law.state();
        for (k, batch) in voltages.chunks(24).enumerate() {
            let steps: Vec<Step> = device.step(batch).expect("disabled");
            // Ticks in between do not disturb it.
            tick(&mut device, k);
            for (step, &volts) in steps.iter().zip(batch) {
                let load = drive.load(volts);
                let x = law.displacement_under(&mut film, load);
                assert_eq!(step.displacement_m.to_bits(), x.to_bits());
                assert_eq!(step.force_n.to_bits(), film.base_force().to_bits());
                assert!((step.voltage_v - volts).abs() < 0.01);
            }
        }
    }
    // Not while the amplifier is enabled.
    device.arm().expect("healthy");
    device.start(Mode::Voltage).expect("armed");
    let running = Denial::Refused(Refusal::State(DriverState::Running));
    assert_eq!(device.rest(), Err(running));
    assert_eq!(device.step::<Vec<Step>>(&[0.0]), Err(running));
    assert_eq!(device.follow::<Vec<Followed>>(Mode::Voltage, &[]), Err(running));
    // Nor before there are parameters.
    assert_eq!(Device::new(None).rest(), Err(Denial::Rejected(Reject::NoParameters)));
}

/// Whole ticks are those of the parameters in use, which are not replaced while the amplifier is enabled.
#[test]
fn other_parameters_end_the_loop_test_of_the_last_ones() {
    let mut device = device();
    device.rest().expect("disabled");
    assert_eq!(device.tick_test::<Vec<Ticked>>(Mode::Voltage, &[]), Ok(vec![]));
    let another = || Controller::new(Blob::new(board_parameters()).expect("valid"));
    device.install(another()).expect("disabled");
    let missing = Err(Denial::Rejected(Reject::NoParameters));
    assert_eq!(device.tick_test::<Vec<Ticked>>(Mode::Voltage, &[]), missing);
    tick(&mut device, 0);
    device.arm().expect("healthy");
    assert_eq!(device.install(another()), Err(Refusal::State(DriverState::Armed)));
}

/// A controller at rest has the stroke of a new one whose sensor has shown the film at rest, without any sensor.
#[test]
fn a_controller_at_rest_knows_that_the_film_is() {
    let parameters = changed_parameters(|p| {
        rides_through(p);
        p.limits.max_displacement_m = 1e-3;
    });
    let new = Controller::new(Blob::new(parameters).expect("valid"));
    let trips = |mut controller: Controller, shows: bool| {
        let mut dac_v = 0.0;
        (0..60_000u16).find(|&tick| {
            let sensor_adc_v = (shows && tick < 2).then_some(1.0);
            dac_v = controller.tick(Inputs { interlock_closed: true, monitor_adc_v: Some(dac_v), sensor_adc_v }).dac_v;
            let _ = match controller.supervisor().state() {
                DriverState::Disarmed => controller.arm(),
                DriverState::Armed => controller.start(Mode::Voltage),
                _ => Ok(()),
            };
            controller.heartbeat();
            let _ = controller.set_voltage(f32::from(tick) / 10.0);
            controller.supervisor().state() == DriverState::Tripped(Cause::ModelDisplacement)
        })
    };
    let shown = trips(new.clone(), true);
    assert!(shown.is_some());
    assert_eq!(trips(new.at_rest(), false), shown);
    assert!(trips(new, false) < shown);
}

/// The loop test of the control is `springpot::Tracking` itself, bit for bit, in all three modes.
#[test]
fn the_loop_test_of_the_control_is_the_control_itself() {
    let mut device = device();
    let parameters = board_parameters();
    let (control, lag) = (parameters.control, parameters.amplifier_lag);
    let (law, limits) = (law(), control.command_limits(&parameters.limits, lag));
    let rest = law.state();
    let tracking = Tracking::new(law, &Actuator::KARNER_2022, limits, control.observer_options()).expect("valid");
    for mode in [Mode::Voltage, Mode::Feedforward, Mode::Tracking] {
        device.rest().expect("disabled");
        let mut state = tracking.state(rest.clone());
        let mut voltage = 0.0f32;
        for k in 0..2000u16 {
            let swing = (0.01 * f64::from(k)).sin() as f32;
            let value = if mode == Mode::Voltage { 3000.0 + 2000.0 * swing } else { 0.5e-3 + 0.2e-3 * swing };
            let sample_m = (k % 10 == 0).then_some(0.4e-3 + 0.2e-3 * swing);
            let ticks: Vec<Followed> = device.follow(mode, &[Target { value, sample_m }]).expect("disabled");

            if mode == Mode::Voltage {
                voltage = value;
            }
            let sample = sample_m.filter(|_| mode != Mode::Feedforward);
            let sample = sample.map(|displacement| SensorSample { displacement_m: displacement, age_ticks: 10 });
            let x = tracking.observe(&mut state, Applied::as_commanded(voltage), sample);
            let command = tracking.command(&mut state, if mode == Mode::Voltage { x } else { value });
            if mode != Mode::Voltage {
                voltage = command.voltage_v;
            }
            assert_eq!(ticks[0].voltage_v.to_bits(), voltage.to_bits(), "{mode:?}, tick {k}");
            assert_eq!(ticks[0].displacement_m.to_bits(), x.to_bits());
            assert_eq!(ticks[0].disturbance_n.to_bits(), state.observer().disturbance().to_bits());
        }
    }
}
