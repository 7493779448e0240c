//! The whole control tick, tracking with a sensor, as the firmware runs it.

use core::hint::black_box;

use dea_driver::chips::{AdcCode, AdcRange, Calibration, CommandRange, DacCode};
use dea_driver::{Blob, Control, Controller, Inputs, Limits, Mode, Outputs, Parameters, PlausibilityLimits};
use springpot::{Actuator, AmplifierLag, Coefficients, Maxwell};

use crate::{Checksum, Name, Report, STEPS};

/// Reports cost and bits of a tick of the film of `model`. Each step has a stack of its own: the small chip has 16 KiB for all.
#[inline(never)]
pub fn run(report: &mut impl Report, name: Name, model: &Maxwell) {
    run_along(report, name, &law(name, model));
}

#[inline(never)]
fn run_along(report: &mut impl Report, name: Name, law: &Coefficients<f32>) {
    let blob = blob(law, name.film.actuator());
    bits(report, name, &blob);
    cost(report, name, &blob);
}

#[inline(never)]
fn bits(report: &mut impl Report, name: Name, blob: &Blob) {
    let mut controller = Controller::from(blob);
    start(&mut controller);
    let mut checksum = Checksum::default();
    ticks(&mut controller, |code, outputs| {
        checksum.add(outputs.telemetry.command_v);
        checksum.add(outputs.telemetry.predicted_m);
        checksum.add(f32::from(code.0));
    });
    report.bits(name, checksum);
}

#[inline(never)]
fn cost(report: &mut impl Report, name: Name, blob: &Blob) {
    let mut controller = Controller::from(blob);
    start(&mut controller);
    let keep = |code: DacCode, _: Outputs| {
        black_box(code);
    };
    report.cost_of_step(name, STEPS, || ticks(&mut controller, keep), || ());
    // A tick that tripped would have cost another thing.
    assert!(controller.supervisor().enables(), "the bench tripped");
}

/// A controller on the bench, tracking.
pub fn running(law: &Coefficients<f32>, actuator: Actuator) -> Controller {
    let mut controller = Controller::new(blob(law, actuator));
    start(&mut controller);
    controller
}

#[inline(never)]
fn blob(law: &Coefficients<f32>, actuator: Actuator) -> Blob {
    let Ok(blob) = Blob::new(parameters(law, actuator)) else { panic!("the bench is refused") };
    blob
}

/// The default law of the film in numbers.
#[inline(never)]
pub fn law(name: Name, model: &Maxwell) -> Coefficients<f32> {
    name.film.law(model).coefficients()
}

/// Arms and starts it, after what the sensors say at rest.
#[inline(never)]
fn start(controller: &mut Controller) {
    tick(controller, DacCode::ZERO);
    let started = controller.arm().and_then(|()| controller.start(Mode::Tracking));
    assert!(started.is_ok() && controller.set_reference(0.8e-3).is_ok(), "the bench is refused");
}

fn ticks(controller: &mut Controller, mut take: impl FnMut(DacCode, Outputs)) {
    let mut command = DacCode::ZERO;
    for _ in 0..STEPS {
        let (code, outputs) = tick(controller, black_box(command));
        command = code;
        take(code, outputs);
    }
}

/// A tick from codes to a code, as the firmware has it: a monitor that follows the `command` of the last tick at once, and a
/// sensor that shows a film at rest, and its own noise.
#[inline(never)]
pub fn tick(controller: &mut Controller, command: DacCode) -> (DacCode, Outputs) {
    // Both are volts: of 10 V at 65536, and of 10.24 V.
    #[allow(clippy::cast_possible_truncation)] // below the DAC's code
    let monitor = (u32::from(command.0) * 1000 / 1024) as u16;
    let adc_v = |code| Some(AdcCode(black_box(code)).volts(AdcRange::UpTo10V24));
    // 0.8 mm, and 2.5 µm in every other tick.
    let sensor = if controller.supervisor().ticks() & 1 == 0 { 11_520 } else { 11_536 };
    let inputs = Inputs { interlock_closed: true, monitor_adc_v: adc_v(monitor), sensor_adc_v: adc_v(sensor) };
    let outputs = controller.tick(inputs);
    (DacCode::from_volts(outputs.dac_v, controller.parameters().command_range), outputs)
}

const BENCH: Limits = Limits::bench(160e-6);

fn parameters(law: &Coefficients<f32>, actuator: Actuator) -> Parameters {
    Parameters {
        name: heapless::String::new(),
        rate_hz: 1000.0,
        law: law.clone(),
        actuator,
        sensor_offset_m: 0.0,
        command_range: CommandRange::TenVolts,
        amplifier: Calibration::Parabola { offset: 0.0, gain: 1000.0, quadratic: -1.0 },
        amplifier_lag: AmplifierLag::NONE,
        monitor: Calibration::Parabola { offset: 0.0, gain: 1000.0, quadratic: -1.0 },
        sensor: Calibration::Parabola { offset: -1e-3, gain: 1e-3, quadratic: 0.0 },
        limits: Limits {
            max_disturbance_share: 0.4,
            sensor: PlausibilityLimits { low: -0.9e-3, stuck_ticks: 5000, ..BENCH.sensor },
            heartbeat_s: 10.0,
            ..BENCH
        },
        control: Control::BENCH,
        self_test_above_v: <Parameters>::NO_SELF_TEST_V,
        adapted: None,
        self_sensing: None,
    }
}
