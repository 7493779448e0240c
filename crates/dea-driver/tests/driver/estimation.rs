//! The controller's estimate of its film: from the sensor, and from the model that is corrected by it.

use dea_driver::chips::Calibration;
use dea_driver::{Controller, Mode};

use crate::bench::board_parameters;
use crate::film_bench::FilmBench;

/// A sensor that reads 0.1 mm at rest: the displacement is what is above that, of a straight line and of measured points alike.
#[test]
fn the_sensor_s_offset_is_taken_off() {
    let points = Calibration::points(&[[0.0, -1e-3], [1.0, 0.0], [10.24, 9.24e-3]]).expect("valid");
    for sensor in [board_parameters().sensor, points] {
        let mut bench = FilmBench::changed(|p| (p.sensor, p.sensor_offset_m) = (sensor, 0.1e-3));
        let telemetry = bench.tick(|inputs| inputs.sensor_adc_v = Some(1.5)).telemetry;
        assert!((telemetry.displacement_m - 0.4e-3).abs() < 1e-9, "{} m", telemetry.displacement_m);
    }
}

/// The model is corrected as often as the sensor has samples: here every tenth tick.
#[test]
fn a_sample_is_used_every_interval() {
    let mut bench = FilmBench { force_scale: 0.9, ..FilmBench::new() }.at_reference(Mode::Tracking, 0.5e-3);
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

/// Nothing is learned while the sensor is only checked, or the film is not driven: not in feedforward, not while armed.
#[test]
fn nothing_is_learned_in_feedforward_or_at_rest() {
    let mut bench = FilmBench { force_scale: 0.9, ..FilmBench::new() }.at_reference(Mode::Feedforward, 0.6e-3);
    for _ in 0..3000 {
        let telemetry = bench.live_tick(|_| ()).telemetry;
        assert_eq!((telemetry.disturbance_n, telemetry.force_scale), (0.0, 1.0));
    }
    let mut bench = FilmBench::new();
    bench.tick(|_| ());
    bench.ask(Controller::arm).expect("healthy");
    for tick in 0..3000 {
        // Someone leans on the film.
        let telemetry = bench.live_tick(|inputs| inputs.sensor_adc_v = Some(1.1 + 1e-3 * (tick % 3) as f32)).telemetry;
        assert_eq!((telemetry.disturbance_n, telemetry.force_scale, telemetry.predicted_m), (0.0, 1.0, 0.0));
    }
}

/// Feedforward uses the model as it was fitted, whatever was learned before.
#[test]
fn feedforward_forgets_what_tracking_learned() {
    let mut bench = FilmBench { force_scale: 0.9, ..FilmBench::new() }.at_reference(Mode::Tracking, 0.6e-3);
    let learned = (0..10_000).fold(0.0, |_, _| bench.live_tick(|_| ()).telemetry.disturbance_n);
    assert!(learned.abs() > 1e-3, "{learned} N");
    bench.ask(Controller::stop).expect("running");
    bench.start_armed(Mode::Feedforward);
    let telemetry = bench.tick(|_| ()).telemetry;
    assert_eq!((telemetry.disturbance_n, telemetry.force_scale), (0.0, 1.0));
}

/// An estimate is made of a film that was left stretched by a trip, and goes on after it is acknowledged.
#[test]
fn the_estimate_goes_on_after_an_acknowledged_trip() {
    let mut bench = FilmBench::new().at_voltage(5000.0);
    bench.run(5000);
    bench.tick(|inputs| inputs.interlock_closed = false);
    bench.run(20);
    bench.ask(Controller::acknowledge).expect("tripped");
    let predicted_m = f64::from(bench.tick(|_| ()).telemetry.predicted_m);
    assert!(bench.displacement_m > 0.2e-3, "still stretched: {} m", bench.displacement_m);
    assert!((predicted_m - bench.displacement_m).abs() < 10e-6, "{predicted_m} m of {} m", bench.displacement_m);
}
