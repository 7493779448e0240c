//! Autocorrelation of the residuals of a fit.

use super::objective::Objective;

/// Largest lag at which whiteness is tested.
const LAGS: usize = 20;

/// Autocorrelation of the residuals of one fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whiteness {
    /// Whether the residuals are white: no autocorrelation beyond chance at the first 20 lags.
    pub white: bool,
    /// Autocorrelation at lag one.
    pub lag_one: f64,
    /// Number of independent samples among the residuals.
    pub effective_samples: f64,
}

impl Whiteness {
    /// The whiteness of `residuals` of `objective`, recording by recording.
    pub fn of(objective: &Objective, residuals: &[f64]) -> Self {
        let mut rest = residuals;
        let (mut effective, mut lag_one, mut samples) = (0.0, 0.0, 0.0);
        let mut white = true;
        for measured in objective.measured() {
            let (this, others) = rest.split_at(measured.len());
            rest = others;
            let n = this.len() as f64;
            let mean = this.iter().sum::<f64>() / n;
            let variance: f64 = this.iter().map(|r| (r - mean).powi(2)).sum();
            let correlation = |lag: usize| -> f64 {
                if variance == 0.0 || lag >= this.len() {
                    return 0.0;
                }
                this.iter().zip(&this[lag..]).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>() / variance
            };
            // Four standard deviations at 20 lags: white residuals fail once in 800 fits.
            white &= (1..=LAGS).all(|lag| correlation(lag).abs() <= 4.0 / n.sqrt());
            // Summed up to the first zero of the correlation.
            let sum: f64 = (1..this.len() / 4).map(correlation).take_while(|&c| c > 0.0).sum();
            effective += (n / (1.0 + 2.0 * sum)).max(1.0);
            lag_one += n * correlation(1);
            samples += n;
        }
        Self { white, lag_one: lag_one / samples, effective_samples: effective }
    }
}
