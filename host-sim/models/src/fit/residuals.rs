//! Residuals: loss functions, autocorrelation.

use host_fft::Planner;
use host_io::choice;

use crate::statistics::mean;

choice! {
    /// Loss function of a fit.
    pub enum Loss {
        /// Squares: best for noise.
        Square = "square",
        /// Huber's: squares up to 0.5 % of the measured range, absolute values beyond, so that drop-outs have little effect.
        Huber = "huber",
    }
}

/// Huber's loss with its limit, in the residuals' unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Huber {
    limit: f64,
}

impl Huber {
    /// The loss for measurements of the given [`percentile_range`](crate::statistics::percentile_range): the same for every candidate, so that their costs can be
    /// compared.
    pub fn new(range: f64) -> Self {
        Self { limit: (0.005 * range).max(f64::MIN_POSITIVE) }
    }

    /// Half the sum of squares, linear beyond the limit.
    pub fn cost(&self, residuals: &[f64]) -> f64 {
        residuals
            .iter()
            .map(|r| if r.abs() <= self.limit { 0.5 * r * r } else { self.limit * (r.abs() - 0.5 * self.limit) })
            .sum()
    }

    /// Square roots of the weights of iteratively reweighted least squares: with them the squares have the slope of this loss.
    pub fn weights(&self, residuals: &[f64]) -> Vec<f64> {
        let weight = |r: &f64| if r.abs() > self.limit { (self.limit / r.abs()).sqrt() } else { 1.0 };
        residuals.iter().map(weight).collect()
    }
}

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
    /// The whiteness of `residuals`, recording by recording: so many `values` each.
    pub fn new(values: impl Iterator<Item = usize>, residuals: &[f64]) -> Self {
        let mut rest = residuals;
        let (mut effective, mut lag_one, mut samples) = (0.0, 0.0, 0.0);
        let mut white = true;
        for values in values {
            let (this, others) = rest.split_at(values);
            rest = others;
            let n = this.len() as f64;
            let correlation = autocorrelation(this);
            // Four standard deviations at 20 lags: white residuals fail once in 800 fits.
            white &= correlation.iter().skip(1).take(LAGS).all(|c| c.abs() <= 4.0 / n.sqrt());
            effective += independent(&correlation);
            lag_one += n * correlation.get(1).copied().unwrap_or(0.0);
            samples += n;
        }
        Self { white, lag_one: lag_one / samples, effective_samples: effective }
    }
}

/// The number of independent samples among `residuals`.
pub fn effective_samples(residuals: &[f64]) -> f64 {
    independent(&autocorrelation(residuals))
}

/// The same by their autocorrelation, summed up to its first zero.
fn independent(correlation: &[f64]) -> f64 {
    let sum: f64 = correlation.iter().take(correlation.len() / 4).skip(1).take_while(|&&c| c > 0.0).sum();
    (correlation.len() as f64 / (1.0 + 2.0 * sum)).max(1.0)
}

/// The autocorrelation of `values` at the lags 0, 1, … , by the Fourier transform of their power.
fn autocorrelation(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let mean = mean(values);
    // Zeros behind the values keep their end from touching their beginning.
    let points = (2 * n).next_power_of_two();
    let mut planner = Planner::new();
    let (forward, backward) = (planner.forward(points), planner.backward(points));
    let spectrum = host_fft::spectrum(&*forward, values.iter().map(|value| value - mean));
    let power = spectrum.iter().map(|value| value.norm_sqr().into()).collect();
    let mut lags = host_fft::samples(&*backward, power);
    let variance = lags[0];
    lags.truncate(n);
    lags.iter_mut().for_each(|value| *value = if variance > 0.0 { *value / variance } else { 0.0 });
    lags
}
