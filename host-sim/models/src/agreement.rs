//! Agreement of a model with a measurement.

use serde::Serialize;

use crate::statistics::{mean, range};

/// Measures of agreement between measured and modelled samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// 1 − SS_res / SS_tot (the paper's Eq. 14); NaN (null) for a measurement that does not change.
    pub r2: f64,
    /// RMS of the difference in % of the measurement's peak to peak; NaN (null) likewise.
    pub nrmse_pct: f64,
    /// RMS of the difference, in the unit of the samples.
    pub rmse: f64,
    /// Samples that were compared.
    pub samples: usize,
}

impl Agreement {
    /// The agreement of `modelled` with `measured`, pair by pair.
    pub fn new(measured: &[f64], modelled: &[f64]) -> Self {
        let samples = measured.len();
        let n = samples as f64;
        let mean = mean(measured);
        let total: f64 = measured.iter().map(|y| (y - mean).powi(2)).sum();
        let residual: f64 = measured.iter().zip(modelled).map(|(y, x)| (y - x).powi(2)).sum();
        let (low, high) = range(measured);
        let rmse = (residual / n).sqrt();
        // A change so small that its square is 0 counts as no change.
        let changes = high > low && total > 0.0;
        Self {
            r2: if changes { 1.0 - residual / total } else { f64::NAN },
            nrmse_pct: if changes { 100.0 * rmse / (high - low) } else { f64::NAN },
            rmse,
            samples,
        }
    }
}

/// Mean of R² over recordings, each counted alike.
pub fn mean_r2(agreements: &[Agreement]) -> f64 {
    agreements.iter().map(|agreement| agreement.r2).sum::<f64>() / agreements.len() as f64
}

/// Mean of NRMSE over recordings, each counted alike, %.
pub fn mean_nrmse_pct(agreements: &[Agreement]) -> f64 {
    agreements.iter().map(|agreement| agreement.nrmse_pct).sum::<f64>() / agreements.len() as f64
}

/// RMS of the difference of two series over the standard deviation of the second.
pub fn relative_rms(series: &[f64], reference: &[f64]) -> f64 {
    let mean = mean(reference);
    let spread: f64 = reference.iter().map(|y| (y - mean).powi(2)).sum();
    let difference: f64 = series.iter().zip(reference).map(|(x, y)| (x - y).powi(2)).sum();
    (difference / spread).sqrt()
}
