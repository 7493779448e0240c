//! Autocorrelation of the residuals of a fit.

use host_fft::Planner;

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
    pub fn new(objective: &Objective, residuals: &[f64]) -> Self {
        let mut rest = residuals;
        let (mut effective, mut lag_one, mut samples) = (0.0, 0.0, 0.0);
        let mut white = true;
        for measured in objective.measured() {
            let (this, others) = rest.split_at(measured.len());
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
    let mean = values.iter().sum::<f64>() / n as f64;
    // Zeros behind the values keep their end from touching their beginning.
    let points = (2 * n).next_power_of_two();
    let mut planner = Planner::new();
    let (forward, backward) = (planner.forward(points), planner.backward(points));
    let mut time = forward.make_input_vec();
    time.iter_mut().zip(values).for_each(|(slot, value)| *slot = value - mean);
    let mut power = forward.make_output_vec();
    forward.process(&mut time, &mut power).expect("lengths are the plan's own");
    power.iter_mut().for_each(|value| *value = value.norm_sqr().into());
    backward.process(&mut power, &mut time).expect("lengths are the plan's own");
    let variance = time[0];
    time.truncate(n);
    time.iter_mut().for_each(|value| *value = if variance > 0.0 { *value / variance } else { 0.0 });
    time
}
