//! f32 against f64: what the controller's arithmetic loses.

use rayon::prelude::*;
use springpot::{Discretisation, Law, Maxwell};

use crate::support::models::{hard_models, paper_force, presets, random_models};
use crate::support::{METHODS, all_models, creep, full_sweep, largest, law_by, relative_rms, relaxation, sample};

/// Asserts that relative errors of f32 are below 1e-6.
fn loses_less_than_1e_6(
    what: &str,
    models: &[(String, Maxwell)],
    error: impl Fn(&Law<f32>, &Law<f64>) -> f64 + Sync,
    rate_hz: f64,
) {
    let errors: Vec<(Discretisation, f64)> = models
        .par_iter()
        .enumerate()
        .map(|(k, (_, model))| {
            let method = METHODS[k % 2];
            (method, error(&law_by(model, rate_hz, method), &law_by(model, rate_hz, method)))
        })
        .collect();
    println!("{what}: largest f32 error {:.1e}", largest(errors.iter().map(|e| e.1)));
    for ((name, _), (method, error)) in models.iter().zip(errors) {
        assert!(error <= 1e-6, "{what}, {name}, {method:?}: {error:.1e}");
    }
}

#[test]
fn loses_less_than_1e_6_over_155_s() {
    for (rate_hz, count) in [(1000.0, 30), (5000.0, 4)] {
        let force = || paper_force(1.0 / 7.0, 155.0, rate_hz);
        let error =
            |single: &Law<f32>, double: &Law<f64>| relative_rms(&creep(single, force()), &creep(double, force()));
        loses_less_than_1e_6(&format!("{rate_hz} Hz"), &sample(all_models(200), count), error, rate_hz);
    }
}

/// The same backwards, over an hour: displacement → force.
#[test]
fn loses_less_than_1e_6_backwards_over_an_hour() {
    let period: Vec<f64> = paper_force(1.0 / 7.0, 7.0, 1000.0)[..7000].iter().map(|f| 1e-5 * f).collect();
    // Both follow the same path, which f32 holds.
    let path = || period.iter().cycle().take(3_600_000).map(|&x| f64::from(x as f32));
    let error =
        |single: &Law<f32>, double: &Law<f64>| relative_rms(&relaxation(single, path()), &relaxation(double, path()));
    loses_less_than_1e_6("1 h at 1 kHz backwards", &sample(all_models(20), 3), error, 1000.0);
}

/// Neither drift nor stagnation over a day: 86.4 million steps. Without a full sweep over an hour.
#[test]
fn does_not_drift_in_24_hours_at_1_khz() {
    let hours = if full_sweep() { 24 } else { 1 };
    const RATE_HZ: usize = 1000;
    const PERIOD: usize = 7 * RATE_HZ;
    const HOUR: usize = 3600 * RATE_HZ;
    let force: Vec<f64> = paper_force(1.0 / 7.0, 7.0, RATE_HZ as f64)[..PERIOD].to_vec();
    let named = |wanted: &str| presets().into_iter().find(|(name, _)| name == wanted).expect("a preset");
    let mut models = vec![named("table3-n2 Eq11"), named("table3-n2 Parallel"), named("table4-f7 Parallel")];
    models.extend(random_models(24, 3));
    models.extend(hard_models().into_iter().filter(|(name, _)| name == "soft and heavy" || name == "almost a spring"));
    let models = sample(models, 3);
    models.par_iter().for_each(|(name, model)| {
        let (single, double) =
            (law_by::<f32>(model, 1000.0, Discretisation::Gl), law_by::<f64>(model, 1000.0, Discretisation::Gl));
        let (mut state32, mut state64) = (single.state(), double.state());
        let (mut sum, mut sum_squares, mut error_squares, mut worst_hour) = (0.0, 0.0, 0.0, 0f64);
        for _ in 0..hours {
            let mut error_sum = 0.0;
            for step in 0..HOUR {
                let f = force[step % PERIOD];
                let x = double.displacement(&mut state64, f);
                let error = f64::from(single.displacement(&mut state32, f as f32)) - x;
                sum += x;
                sum_squares += x * x;
                error_sum += error;
                error_squares += error * error;
            }
            worst_hour = worst_hour.max((error_sum / HOUR as f64).abs());
        }
        let n = (hours * HOUR) as f64;
        let spread = (sum_squares / n - (sum / n) * (sum / n)).sqrt();
        let rms = (error_squares / n).sqrt() / spread;
        let hour = worst_hour / spread;
        println!("{hours} h at 1 kHz, {name}: RMS {rms:.1e}, largest hourly mean {hour:.1e}");
        assert!(rms <= 1e-6 && hour <= 1e-6, "{name}: RMS {rms:.1e}, hourly mean {hour:.1e}");
    });
}
