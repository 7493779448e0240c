//! Values between the rows of a recording.

use std::f64::consts::TAU;

use host_io::grid::Samples;

/// Rows at uneven times, and the largest error of what is interpolated between them.
fn largest_error(of: impl Fn(f64) -> f64) -> f64 {
    let time_s: Vec<f64> = (0..200).map(|k| 0.1 * f64::from(k) + 0.02 * f64::from(k % 3)).collect();
    let samples = Samples { value: time_s.iter().map(|t| of(*t)).collect(), time_s };
    let between: Vec<f64> = (10..1900).map(|k| 0.01 * f64::from(k)).collect();
    let found = samples.curved_at(between.iter().copied());
    found.iter().zip(&between).fold(0.0, |most, (x, t)| most.max((x - of(*t)).abs()))
}

/// Some 20 rows a period, where lines miss by up to 1.8 % of the amplitude.
#[test]
fn a_sine_keeps_its_curvature() {
    let error = largest_error(|t| (0.5 * TAU * t).sin());
    assert!(error < 3e-3, "{error}");
}

/// Ramps and corners stay as they are, and nothing overshoots a step.
#[test]
fn steps_ramps_and_corners_stay() {
    assert!(largest_error(|t| if t < 9.9 { t } else { 19.8 - t }) < 1e-12);
    assert!(largest_error(|t| 3.0 * t) < 1e-12);
    let time_s: Vec<f64> = (0..20).map(f64::from).collect();
    let value = time_s.iter().map(|t| if *t < 10.0 { 0.0 } else { 1.0 }).collect();
    let step = Samples { time_s, value };
    let found = step.curved_at((0..190).map(|k| 0.1 * f64::from(k)));
    assert_eq!(found, step.at((0..190).map(|k| 0.1 * f64::from(k))));
}
