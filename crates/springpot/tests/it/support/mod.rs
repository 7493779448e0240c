//! Shared parts of the tests.

pub mod bent_films;
pub mod defining_sum;
pub mod full_memory;
pub mod models;
mod sweep;

pub use sweep::{full_sweep, sample};

use models::{hard_models, presets, random_models};
use springpot::{Compressed, Discretisation, Law, LawOptions, Maxwell, Scalar};

pub const METHODS: [Discretisation; 2] = [Discretisation::Gl, Discretisation::Bdf2];

/// The default law of `model` at `rate_hz` by `method`.
pub fn law_by<T: Scalar>(model: &Maxwell, rate_hz: f64, method: Discretisation) -> Law<T> {
    Law::compressed(model, LawOptions::at_step(1.0 / rate_hz).with_method(method)).expect("valid")
}

/// Published, random and hard models.
pub fn all_models(random: usize) -> Vec<(String, Maxwell)> {
    presets().into_iter().chain(random_models(2022, random)).chain(hard_models()).collect()
}

/// Displacements (m) of `law` from rest under `force` (N).
pub fn creep<T: Scalar, const H: usize, const F: usize, const S: usize>(
    law: &Law<T, Compressed<T, H, F, S>>,
    force: impl IntoIterator<Item = f64>,
) -> Vec<f64> {
    let mut film = law.state();
    force.into_iter().map(|force| law.displacement(&mut film, T::from_f64(force)).to_f64()).collect()
}

/// Forces (N) of `law` from rest along `path` (m).
pub fn relaxation<T: Scalar, const H: usize, const F: usize, const S: usize>(
    law: &Law<T, Compressed<T, H, F, S>>,
    path: impl IntoIterator<Item = f64>,
) -> Vec<f64> {
    let mut film = law.state();
    path.into_iter().map(|x| law.force(&mut film, T::from_f64(x)).to_f64()).collect()
}

/// The largest of `values`, which are errors.
pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |largest, value| largest.max(value.abs()))
}

/// RMS of the difference of two series over the standard deviation of the second.
pub fn relative_rms(series: &[f64], reference: &[f64]) -> f64 {
    assert_eq!(series.len(), reference.len());
    let mean = reference.iter().sum::<f64>() / reference.len() as f64;
    let spread: f64 = reference.iter().map(|y| (y - mean).powi(2)).sum();
    let difference: f64 = series.iter().zip(reference).map(|(x, y)| (x - y).powi(2)).sum();
    (difference / spread).sqrt()
}
