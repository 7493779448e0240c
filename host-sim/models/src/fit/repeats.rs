//! Recordings that repeat another: the same file again, or a copy that was resampled, cut, smoothed, or zeroed anew.
//!
//! A copy is no second measurement: it shares the noise of the first, or has none. Two recordings of the same drive differ by the noise
//! of both.

use host_fft::Planner;
use num_complex::Complex;

use super::observation::Observation;
use super::statistics::{median, range, robust_deviation};
use crate::files::recording::Input;
use crate::grid::Grid;

/// Most samples of a comparison: copies that are cut out of longer recordings are found only by their beginning.
const MAX_SAMPLES: f64 = 131_072.0;
/// Share of the shorter recording that must be in the longer one.
const MIN_OVERLAP: f64 = 0.8;
/// A difference up to this share of the noise of both shows that the noise is the same.
const SAME_NOISE: f64 = 0.5;
/// Noise below this share of the other's is that of a smoothed copy, whose difference is at most so many times the other's noise.
const SMOOTH: f64 = 0.3;
const SMOOTHED: f64 = 1.2;
/// Largest difference of equal values, as a share of the range.
const EQUAL: f64 = 1e-4;
/// The drive of a copy differs by at most this share of its range.
const SAME_DRIVE: f64 = 0.02;

/// The first of `observations` that repeats an earlier one, and that one.
#[must_use]
pub fn first(observations: &[Observation]) -> Option<(&Observation, &Observation)> {
    let later = observations.iter().enumerate();
    let mut pairs = later.flat_map(|(k, later)| observations[..k].iter().map(move |earlier| (later, earlier)));
    pairs.find(|(later, earlier)| is_repeat(later, earlier))
}

fn is_repeat(one: &Observation, other: &Observation) -> bool {
    let rate_hz = row_rate(one).min(row_rate(other));
    let (Some(one), Some(other)) = (Series::new(one, rate_hz), Series::new(other, rate_hz)) else { return false };
    let (short, long) = if one.measured.len() < other.measured.len() { (one, other) } else { (other, one) };
    if short.input != long.input || short.measured.len() < 8 {
        return false;
    }
    let Some(lag) = best_lag(&short.measured, &long.measured) else { return false };
    let difference = |short: &[f64], long: &[f64]| -> f64 {
        let (short, long) = overlap(short, long, lag);
        let differences: Vec<f64> = short.iter().zip(long).map(|(a, b)| a - b).collect();
        let mean = differences.iter().sum::<f64>() / differences.len() as f64;
        (differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / differences.len() as f64).sqrt()
    };
    let size = |values: &[f64]| {
        let (low, high) = range(values);
        (high - low).max(f64::MIN_POSITIVE)
    };
    let (noise, other_noise) = (noise(&short.measured), noise(&long.measured));
    let (least, most) = (noise.min(other_noise), noise.max(other_noise));
    let differs = difference(&short.measured, &long.measured);
    let is_same = differs <= EQUAL * size(&short.measured)
        || differs <= SAME_NOISE * noise.hypot(other_noise)
        || (least < SMOOTH * most && differs <= SMOOTHED * most);
    is_same && difference(&short.drive, &long.drive) <= SAME_DRIVE * size(&long.drive)
}

/// Median rate of the rows of `observation`, Hz; lower where there are very many.
fn row_rate(observation: &Observation) -> f64 {
    let time_s = &observation.measured.time_s;
    let steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    (1.0 / median(&steps)).min(MAX_SAMPLES / time_s.last().copied().unwrap_or(1.0).max(f64::MIN_POSITIVE))
}

/// A recording on an even grid.
struct Series {
    input: std::mem::Discriminant<Input>,
    drive: Vec<f64>,
    measured: Vec<f64>,
}

impl Series {
    fn new(observation: &Observation, rate_hz: f64) -> Option<Self> {
        let grid = Grid::covering(observation.measured.time_s.last().copied()?, rate_hz).ok()?;
        let input = std::mem::discriminant(&observation.input);
        let [drive, measured] = [observation.input.samples(), &observation.measured].map(|s| grid.resample(s));
        Some(Self { input, drive, measured })
    }
}

/// The parts of two series at the same times, where the short one begins `lag` samples after the long one.
fn overlap<'a>(short: &'a [f64], long: &'a [f64], lag: isize) -> (&'a [f64], &'a [f64]) {
    let (in_short, in_long) = (lag.min(0).unsigned_abs(), lag.max(0).unsigned_abs());
    let count = (short.len() - in_short).min(long.len() - in_long);
    (&short[in_short..][..count], &long[in_long..][..count])
}

/// The lag at which two series differ least, without their means, over most of the short one.
fn best_lag(short: &[f64], long: &[f64]) -> Option<isize> {
    let products = correlation(short, long);
    let sums = |values: &[f64]| {
        let sum = |of: fn(f64) -> f64| {
            let mut sum = 0.0;
            let mut sums = vec![0.0];
            sums.extend(values.iter().map(|&value| {
                sum += of(value);
                sum
            }));
            sums
        };
        [sum(|value| value), sum(|value| value * value)]
    };
    // Around the middle, where rounding is least.
    let centred = |values: &[f64]| {
        let middle = values.iter().sum::<f64>() / values.len() as f64;
        sums(&values.iter().map(|value| value - middle).collect::<Vec<f64>>())
    };
    let (of_short, of_long) = (centred(short), centred(long));
    let most_left_out = ((1.0 - MIN_OVERLAP) * short.len() as f64) as isize;
    let lags = -most_left_out..=(long.len() - short.len()) as isize + most_left_out;
    let spread = |lag: isize| {
        let (from_short, from_long) = (lag.min(0).unsigned_abs(), lag.max(0).unsigned_abs());
        let count = (short.len() - from_short).min(long.len() - from_long);
        let over = |sums: &[f64], from: usize| sums[from + count] - sums[from];
        let [x, xx] = [0, 1].map(|k| over(&of_short[k], from_short));
        let [y, yy] = [0, 1].map(|k| over(&of_long[k], from_long));
        let xy = products[lag.rem_euclid(products.len() as isize) as usize];
        let n = count as f64;
        (xx - 2.0 * xy + yy) / n - ((x - y) / n).powi(2)
    };
    lags.min_by(|&a, &b| spread(a).total_cmp(&spread(b)))
}

/// Sum of the products of `short` with `long` from every lag on, both around their means, by the Fourier transform.
fn correlation(short: &[f64], long: &[f64]) -> Vec<f64> {
    let points = (short.len() + long.len()).next_power_of_two();
    let mut planner = Planner::new();
    let (forward, backward) = (planner.forward(points), planner.backward(points));
    let spectrum = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let mut time = forward.make_input_vec();
        time.iter_mut().zip(values).for_each(|(slot, value)| *slot = value - mean);
        let mut spectrum = forward.make_output_vec();
        forward.process(&mut time, &mut spectrum).expect("lengths are the plan's own");
        spectrum
    };
    let mut product: Vec<Complex<f64>> =
        spectrum(short).iter().zip(spectrum(long)).map(|(a, b)| a.conj() * b).collect();
    product[0].im = 0.0;
    product[points / 2].im = 0.0;
    let mut lags = backward.make_output_vec();
    backward.process(&mut product, &mut lags).expect("lengths are the plan's own");
    lags.iter_mut().for_each(|value| *value /= points as f64);
    lags
}

/// RMS noise of an even series, from its fourth differences: what a film does between five rows is little beside it.
fn noise(values: &[f64]) -> f64 {
    let fourth: Vec<f64> = values.windows(5).map(|v| v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]).collect();
    robust_deviation(&fourth) / 70f64.sqrt()
}
