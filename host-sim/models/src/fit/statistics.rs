//! Statistics of recordings and residuals: ranges, loss functions, autocorrelation.

use host_fft::Planner;
use host_io::choice;

/// Smallest and largest value.
pub(crate) fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
}

/// Peak to peak of a load; its size where it varies by at most 1 %, because it was applied at once and held.
pub(crate) fn change(load: &[f64]) -> f64 {
    let (low, high) = range(load);
    let size = low.abs().max(high.abs());
    if high - low > 0.01 * size { high - low } else { size }
}

/// The median; NaN if empty.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The sizes of the upper turning points of a drive: where it comes down to half.
pub(super) fn peaks(values: &[f64]) -> Vec<f64> {
    let most = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let mut peaks = Vec::new();
    let (mut rises, mut highest, mut lowest) = (true, 0.0, 0.0);
    for value in values.iter().map(|value| value.abs()) {
        // Noise about 0 is no turning point.
        if rises && value < 0.5 * highest && highest > 0.2 * most {
            peaks.push(highest);
            (rises, lowest) = (false, value);
        } else if !rises && value > lowest + 0.2 * most {
            (rises, highest) = (true, value);
        } else if rises {
            highest = value.max(highest);
        } else {
            lowest = value.min(lowest);
        }
    }
    // The last rise may end before its turning point.
    if rises && peaks.iter().all(|peak| *peak < highest) {
        peaks.push(highest);
    }
    peaks
}

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
    /// The loss for measurements of the given [`percentile_range`]: the same for every candidate, so that their costs can be
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

    /// Weights of iteratively reweighted least squares: with them the squares have the slope of this loss.
    pub fn weights(&self, residuals: &[f64]) -> Weights {
        let weight = |r: &f64| if r.abs() > self.limit { (self.limit / r.abs()).sqrt() } else { 1.0 };
        Weights(residuals.iter().map(weight).collect())
    }
}

/// Square roots of the residuals' weights.
pub struct Weights(Vec<f64>);

impl Weights {
    /// Multiplies `values`, one per residual.
    pub fn apply(&self, values: &mut [f64]) {
        values.iter_mut().zip(&self.0).for_each(|(value, weight)| *value *= weight);
    }
}

/// The range between the 2nd and the 98th percentile, which drop-outs do not change.
pub fn percentile_range(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * (sorted.len().max(1) - 1) as f64) as usize).copied().unwrap_or(0.0);
    at(0.98) - at(0.02)
}

/// Robust estimate of the residuals' standard deviation: 1.4826 times their median absolute value.
pub fn robust_deviation(residuals: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    1.4826 * *median
}

/// RMS noise from row to row, from fourth differences.
pub(crate) fn noise(values: &[f64]) -> f64 {
    let fourth: Vec<f64> = values.windows(5).map(|v| v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]).collect();
    robust_deviation(&fourth) / 70f64.sqrt()
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
