//! Shared parts of the tests.

pub mod defining_sum;
pub mod full_memory;
pub mod models;
mod sweep;

pub use sweep::{full_sweep, sample};

/// RMS of the difference of two series over the standard deviation of the second.
pub fn relative_rms(series: &[f64], reference: &[f64]) -> f64 {
    assert_eq!(series.len(), reference.len());
    let mean = reference.iter().sum::<f64>() / reference.len() as f64;
    let spread: f64 = reference.iter().map(|y| (y - mean).powi(2)).sum();
    let difference: f64 = series.iter().zip(reference).map(|(x, y)| (x - y).powi(2)).sum();
    (difference / spread).sqrt()
}
