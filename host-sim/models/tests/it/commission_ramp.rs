//! The ramp of commissioning, on films and sensors of this test alone: what ends it, and what it finds.

use host_io::files::parameters::Board;
use host_models::commission::Row;
use host_models::commission::ramp::{Limits, Ramp, Report};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::Actuator;

/// Rows of a ramp on a film of this displacement (m) at a time (s) and a voltage, until the ramp ends.
fn ramped(limits: Limits, film: &mut dyn FnMut(f64, f64) -> f64) -> Report {
    let (mut ramp, mut volts, mut k) = (Ramp::new(limits), 0.0, 0_u32);
    loop {
        let time_s = f64::from(k) * 0.01;
        let displacement_m = film(time_s, volts);
        let row = Row { time_s, host_s: time_s, command_v: volts, monitor_v: volts, displacement_m, reference_m: 0.0 };
        let Some(next) = ramp.next(&row) else { return ramp.report() };
        (volts, k) = (next, k + 1);
    }
}

/// A film whose force grows with its stretch is stopped before it pulls in, and never later than at half of the way there by its slope; a reading that
/// drifts at 0 V ends the ramp before its first step, noise does not.
#[test]
fn a_ramp_ends_before_pull_in_and_where_the_sensor_drifts() {
    let mut random = Pcg64::seed_from_u64(11);
    let bench = Limits::new(&Actuator::KARNER_2022, &Board::bench(&Actuator::KARNER_2022));
    // The limits are far away: the curvature alone ends it.
    let limits = Limits { stroke_m: 1.0, field_v_per_m: 1e9, ..bench };
    for case in 0..100 {
        // x = s (1 + x / a)²: unstable from x = a, at s = a / 4.
        let a_m = random.random_range(2e-3..20e-3);
        let pull_in_v = limits.voltage_v * random.random_range(0.4..1.0_f64).sqrt();
        let noise_m = a_m * random.random_range(1e-5..1e-3);
        let mut largest_m: f64 = 0.0;
        let report = ramped(limits, &mut |_, volts| {
            let s = 0.25 * (volts / pull_in_v).powi(2);
            assert!(s < 0.25, "{case}: pulled in at {volts} V");
            let x = a_m * (1.0 - 2.0 * s - (1.0 - 4.0 * s).sqrt()) / (2.0 * s).max(1e-12);
            largest_m = largest_m.max(x);
            x + noise_m * random.random_range(-1.7..1.7)
        });
        assert!(report.ended_by.contains("pull-in") || pull_in_v > 0.9 * limits.voltage_v, "{case}: {report:?}");
        assert!(largest_m < 0.6 * a_m, "{case}: {largest_m} m of {a_m}");

        let (drift, noise_m) = (random.random_range(3e-6..3e-5), random.random_range(0.0..2e-5));
        let report = ramped(bench, &mut |t, _| drift * t + noise_m * random.random_range(-1.7..1.7));
        let found = report.drift_m_per_s.unwrap_or(0.0);
        assert!(report.steps.is_empty() && (found / drift - 1.0).abs() < 0.2, "{case}: {drift} {found} {report:?}");
        let report = ramped(bench, &mut |_, volts| 1e-10 * volts * volts + noise_m * random.random_range(-1.7..1.7));
        assert_eq!(report.drift_m_per_s, None, "{case}");
    }
}

/// Friction of the sensor's target shows at the end of the ramp, on films that creep, stiffen or soften, with noise; without friction nothing does.
#[test]
fn a_ramp_shows_friction() {
    let mut random = Pcg64::seed_from_u64(13);
    let limits = Limits::new(&Actuator::KARNER_2022, &Board::bench(&Actuator::KARNER_2022));
    for case in 0..200 {
        let (stroke_m, creep) = (limits.stroke_m * random.random_range(0.2..1.5), random.random_range(0.0..0.3));
        let (bend, memory) = (random.random_range(-0.4..0.4), random.random_range(3e-4..1e-2));
        let noise_m = stroke_m * random.random_range(0.0..1e-3);
        // To both sides, as a share of the stroke that the ramp reaches.
        for friction in [0.0, random.random_range(0.025..0.1)] {
            let (mut crept, mut target_m) = (0.0, 0.0_f64);
            let width_m = friction * stroke_m.min(0.9 * limits.stroke_m);
            let report = ramped(limits, &mut |_, volts| {
                let share = (volts / limits.voltage_v).powi(2);
                crept += (share - crept) * memory;
                let film_m = stroke_m * (share * (1.0 + bend * share) + creep * crept);
                target_m = target_m.clamp(film_m - width_m, film_m + width_m);
                target_m + noise_m * random.random_range(-1.7..1.7)
            });
            assert_eq!(report.stays_behind_m.is_some(), friction > 0.0, "{case}: friction {friction}, {report:?}");
        }
    }
}

/// A sensor that ends within the range of a film that stiffens or softens ends the ramp within two steps, before the film is beyond its stroke; a sensor
/// that does not, never.
#[test]
fn a_ramp_ends_where_the_sensor_does() {
    let mut random = Pcg64::seed_from_u64(9);
    let limits = Limits::new(&Actuator::KARNER_2022, &Board::bench(&Actuator::KARNER_2022));
    let mut named = 0;
    for case in 0..400 {
        let (stroke_m, creep) = (limits.stroke_m * random.random_range(0.3..2.0), random.random_range(0.0..0.15));
        let bend = random.random_range(-0.4..0.4);
        // Reached at 60 % of the largest force, or of the stroke, or before.
        let reached_m = (0.6 * stroke_m * (1.0 + 0.6 * bend)).min(0.85 * limits.stroke_m);
        let end_m = if case % 2 == 0 { f64::INFINITY } else { reached_m * random.random_range(0.3..1.0) };
        let (mut crept, mut seen_v, mut furthest_m) = (0.0, f64::INFINITY, 0.0_f64);
        let report = ramped(limits, &mut |_, volts| {
            let share = (volts / limits.voltage_v).powi(2);
            crept += (share - crept) * 1e-3;
            let film_m = stroke_m * (share * (1.0 + bend * share) + creep * crept);
            furthest_m = furthest_m.max(film_m);
            seen_v = if film_m < end_m { seen_v } else { seen_v.min(volts) };
            film_m.min(end_m) + 2e-6 * random.random_range(-1.0..1.0)
        });
        let is_flat = report.ended_by.contains("no longer grows");
        assert!(!is_flat || end_m.is_finite(), "{case}: {}", report.ended_by);
        named += usize::from(is_flat);
        let over = report.steps.iter().filter(|step| step.voltage_v > seen_v).count();
        assert!(over <= 2, "{case}: {over} steps beyond {seen_v} V, {}", report.ended_by);
        assert!(furthest_m < limits.stroke_m, "{case}: {furthest_m} m, {}", report.ended_by);
    }
    // Others look like a pull-in.
    assert!(named >= 160, "{named} of 200");
}
