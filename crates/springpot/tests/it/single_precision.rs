//! f32 against f64: what the controller's arithmetic loses.

use rayon::prelude::*;
use springpot::{Law, LawOptions, Maxwell};

use crate::support::models::{hard_models, paper_force, presets, random_models};
use crate::support::{full_sweep, relative_rms, sample};

fn laws(model: &Maxwell, rate_hz: f64) -> (Law<f32>, Law<f64>) {
    let options = LawOptions::at_step(1.0 / rate_hz);
    (Law::compressed(model, options).expect("valid"), Law::compressed(model, options).expect("valid"))
}

#[test]
fn loses_less_than_1e_6_over_155_s() {
    let all = || presets().into_iter().chain(random_models(2022, 200)).chain(hard_models()).collect();
    for (rate_hz, count) in [(1000.0, 24), (5000.0, 4)] {
        let models: Vec<_> = sample(all(), count);
        let force = paper_force(1.0 / 7.0, 155.0, rate_hz);
        let errors: Vec<f64> = models
            .par_iter()
            .map(|(_, model)| {
                let (single, double) = laws(model, rate_hz);
                let (mut state32, mut state64) = (single.state(), double.state());
                let (x32, x64): (Vec<f64>, Vec<f64>) = force
                    .iter()
                    .map(|&f| {
                        let x32 = single.displacement(&mut state32, f as f32);
                        (f64::from(x32), double.displacement(&mut state64, f))
                    })
                    .unzip();
                relative_rms(&x32, &x64)
            })
            .collect();
        println!("{rate_hz} Hz: largest f32 error {:.1e}", errors.iter().copied().fold(0.0, f64::max));
        for ((name, _), error) in models.iter().zip(errors) {
            assert!(error <= 1e-6, "{name} at {rate_hz} Hz: {error:.1e}");
        }
    }
}

/// The same backwards, over an hour: displacement → force.
#[test]
fn loses_less_than_1e_6_backwards_over_an_hour() {
    let period: Vec<f64> = paper_force(1.0 / 7.0, 7.0, 1000.0)[..7000].iter().map(|f| 1e-5 * f).collect();
    let models = sample(presets().into_iter().chain(random_models(2022, 20)).chain(hard_models()).collect(), 3);
    let errors: Vec<f64> = models
        .par_iter()
        .map(|(_, model)| {
            let (single, double) = laws(model, 1000.0);
            let (mut state32, mut state64) = (single.state(), double.state());
            let (f32s, f64s): (Vec<f64>, Vec<f64>) = period
                .iter()
                .cycle()
                .take(3_600_000)
                .map(|&x| {
                    // Both follow the same path, which f32 holds.
                    let x = x as f32;
                    (f64::from(single.force(&mut state32, x)), double.force(&mut state64, f64::from(x)))
                })
                .unzip();
            relative_rms(&f32s, &f64s)
        })
        .collect();
    println!("1 h at 1 kHz backwards: largest f32 error {:.1e}", errors.iter().copied().fold(0.0, f64::max));
    for ((name, _), error) in models.iter().zip(errors) {
        assert!(error <= 1e-6, "{name}: {error:.1e}");
    }
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
        let (single, double) = laws(model, RATE_HZ as f64);
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
