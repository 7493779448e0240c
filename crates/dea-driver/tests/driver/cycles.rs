//! Learning of periodic references in the tick, and what becomes of it from run to run.

use std::f64::consts::TAU;

use dea_driver::{Blob, BlobError, Control, Controller, DriverState, LearningOrder, Mode, OnSensorFault, Parameters};
use springpot::ControlError;

use crate::bench::board_parameters;
use crate::film_bench::{FilmBench as Bench, adc_v};

fn parameters(harmonics: u8, period_s: f32) -> Parameters {
    let control = Control { harmonics, period_s, delay_s: 0.0, ..Control::BENCH };
    let mut parameters = Parameters { control, ..board_parameters() };
    parameters.limits.on_sensor_fault = OnSensorFault::OpenLoop;
    parameters
}

/// A film with a tenth less force than the model's.
fn bench(harmonics: u8, period_s: f32) -> Bench {
    Bench { force_scale: 0.9, ..Bench::with(parameters(harmonics, period_s)) }
}

/// A run of sines of 1 s: the largest error in each second, m, and the largest size of what was learned, m. Without its sensor where
/// `is_lost`.
fn run(bench: &mut Bench, seconds: u32, is_lost: impl Fn(u32) -> bool) -> Vec<[f64; 2]> {
    let tick = |bench: &mut Bench, k: u32| {
        let reference = 0.6e-3 - 0.15e-3 * (TAU * f64::from(k) / 1000.0).cos();
        bench.set_reference(reference as f32);
        let lost = is_lost(k / 1000);
        let outputs = bench.tick(|inputs| {
            if lost {
                inputs.sensor_adc_v = Some(adc_v(u16::MAX));
            }
        });
        assert_eq!(bench.controller.supervisor().state(), DriverState::Running, "tick {k}");
        let shaped = f64::from(outputs.telemetry.reference_m);
        assert!(
            k < 1000 || (shaped - reference).abs() < 1e-6,
            "tick {k}: the log shows the reference as it was asked for"
        );
        [(bench.displacement_m - reference).abs(), f64::from(outputs.telemetry.learned_m).abs()]
    };
    let second = |bench: &mut Bench, second: u32| {
        (0..1000).fold([0.0f64; 2], |[error, learned], k| {
            let [e, l] = tick(bench, 1000 * second + k);
            [error.max(e), learned.max(l)]
        })
    };
    (0..seconds).map(|k| second(bench, k)).collect()
}

fn restart(bench: &mut Bench, mode: Mode) {
    bench.ask(Controller::stop).expect("it runs");
    // The film comes back to rest.
    bench.run(20_000);
    bench.ask(|controller| controller.start(mode)).expect("armed");
}

/// A tenth of 0.6 mm is off at first; after ten cycles what the sensor's noise of 5 µm leaves.
#[test]
fn cycles_are_learned_in_a_run() {
    for (mode, period_s) in [(Mode::Feedforward, 1.0), (Mode::Feedforward, 0.0), (Mode::Tracking, 1.0)] {
        let mut bench = bench(6, period_s);
        bench.start(mode);
        let seconds = run(&mut bench, 25, |_| false);
        let [late, learned] = seconds[24];
        println!("{mode:?}: {:.1} µm at first, {:.1} µm at last", 1e6 * seconds[1][0], 1e6 * late);
        // Tracking finds the scale of the force by itself, and leaves little to be learned.
        let least = if mode == Mode::Feedforward { 10e-6 } else { 0.1e-6 };
        assert!(late < 4e-6 && learned > least, "{mode:?}: {late} m, {learned} m learned");
    }
    // Without learning feedforward is off by as much as at first.
    let mut bench = bench(0, 0.0);
    bench.start(Mode::Feedforward);
    let seconds = run(&mut bench, 15, |_| false);
    assert!(seconds[14][0] > 50e-6 && seconds[14][1] == 0.0);
}

#[test]
fn what_was_learned_stays_without_the_sensor() {
    let mut bench = bench(6, 1.0);
    bench.start(Mode::Feedforward);
    let seconds = run(&mut bench, 40, |second| second >= 20);
    assert!(seconds[39][0] < 6e-6, "{} m", seconds[39][0]);
}

/// Another run begins with nothing, or by order with what the one before has learned; by order it is forgotten within a second.
#[test]
fn what_was_learned_is_cleared_or_carried_over() {
    let mut bench = bench(6, 1.0);
    bench.start(Mode::Feedforward);
    run(&mut bench, 20, |_| false);

    bench.ask(|controller| controller.order_learning(LearningOrder::CarryOver));
    restart(&mut bench, Mode::Feedforward);
    let [carried, _] = run(&mut bench, 3, |_| false)[2];
    restart(&mut bench, Mode::Feedforward);
    let [anew, _] = run(&mut bench, 3, |_| true)[2];
    println!("carried over {:.1} µm, anew {:.1} µm", 1e6 * carried, 1e6 * anew);
    assert!(carried < 8e-6 && anew > 40e-6);

    run(&mut bench, 20, |_| false);
    bench.ask(|controller| controller.order_learning(LearningOrder::Forget));
    let forgotten = run(&mut bench, 2, |_| true)[1];
    assert!(forgotten[0] > 40e-6 && forgotten[1] < 1e-9, "{forgotten:?}");
}

#[test]
fn what_cannot_be_learned_is_refused() {
    let refused = |harmonics, period_s| Blob::new(parameters(harmonics, period_s)).err();
    assert_eq!(refused(7, 1.0), Some(BlobError::Control(ControlError::Harmonics { harmonics: 7 })));
    let period = |value| Some(BlobError::Control(ControlError::NotPositive { quantity: "period_s", value }));
    assert_eq!(refused(6, -1.0), period(-1.0));
    assert_eq!(refused(6, f32::INFINITY), period(f64::INFINITY));
    assert_eq!(refused(0, -1.0), None);
}
