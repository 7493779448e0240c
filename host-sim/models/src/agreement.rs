//! Agreement of a model with a measurement.

use std::path::Path;

use serde::Serialize;

use crate::error::shown;
use crate::files::recording::Direction;
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

/// A recording's agreement, as reports state it.
#[derive(Serialize)]
pub struct RecordingAgreement {
    /// The recording's file.
    pub file: String,
    /// R² (Eq. 14).
    pub r2: f64,
    /// NRMSE, % of peak to peak.
    pub nrmse_pct: f64,
    /// RMS of the difference where displacement is the output, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse_m: Option<f64>,
    /// RMS of the difference where force is the output, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse_n: Option<f64>,
    /// Number of measured values.
    pub samples: usize,
}

impl RecordingAgreement {
    /// The `agreement` with the recording in `file`, whose input is in this `direction`.
    pub fn new(file: &Path, direction: Direction, agreement: &Agreement) -> Self {
        let Agreement { r2, nrmse_pct, rmse, samples } = *agreement;
        let rmse_for = |which| (direction == which).then_some(rmse);
        let (rmse_m, rmse_n) = (rmse_for(Direction::Force), rmse_for(Direction::Displacement));
        Self { file: shown(file), r2, nrmse_pct, rmse_m, rmse_n, samples }
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
