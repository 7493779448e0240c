//! Recordings that repeat another: the same file again, or a copy that was scaled, turned, shifted, resampled, cut, smoothed, or made noisier.
//!
//! A copy is no second measurement: it shares the noise of the first, or both have none. The noise is what no linear equation of the rows
//! before and of the drive predicts: neither scales nor clocks of a copy change it, and two measurements never have the same.

use std::ops::Range;

use host_fft::Planner;

use super::explained::Basis;
use super::observation::Observation;
use crate::grid::Grid;
use crate::statistics::{self, median, peak, percentile_range, rms, robust_deviation, sorted};

/// Most rows of a comparison: copies that are cut out of longer recordings are found only by their beginning.
const MAX_ROWS: usize = 1 << 17;
/// Most rows of a recording for one of a thinned copy.
const MAX_THINNED: usize = 50;
/// Rows before each that predict it, and rows of the drive.
const ORDER: usize = 8;
const OF_DRIVE: usize = 3;
/// Correlation of the noise of a copy: with noise added to it, or between rows. In readings of coarse steps the steps repeat as well.
const SAME_NOISE: f64 = 0.4;
const SAME_STEPS: f64 = 0.9;
/// Largest share of the correlation at other lags: there the parts of a film that are not predicted recur, with the drive.
const RECURS: f64 = 0.7;
/// Rows that two recordings have in common at least, and their share of the shorter one.
const MIN_COMMON: usize = 64;
const MIN_SHARE: f64 = 0.1;
/// Below this share of the range there is no noise, and values are compared: their difference, as a share of the range.
const NO_NOISE: f64 = 5e-5;
const EQUAL: f64 = 1e-4;
/// Share of the rows without noise that a copy has in common with the other.
const MIN_OVERLAP: f64 = 0.8;
/// Gain of the drive of a copy with noise, and what may remain of it, apart from steps between rows.
const OTHER_GAIN: f64 = 0.4;
const EXACT_DRIVE: f64 = 0.01;
/// Gain of a copy without noise, and what may remain of its drive beside that of the other.
const GAIN: f64 = 0.05;
const SAME_DRIVE: f64 = 0.05;
/// Noise below this share of the other's is that of a smoothed copy, whose difference is at most so many times the other's noise, which it
/// has in part.
const SMOOTH: f64 = 0.3;
const SMOOTHED: f64 = 1.2;
const SHARED: f64 = 0.3;

/// The first of `observations` that repeats an earlier one, and that one; or one that repeats itself, twice.
#[must_use]
pub fn first(observations: &[Observation]) -> Option<(&Observation, &Observation)> {
    let rows: Vec<Rows> = observations.iter().map(Rows::new).collect();
    let pairs = (0..rows.len()).flat_map(|later| (0..later).map(move |earlier| (later, earlier)));
    let mut pairs = pairs.filter(|&(j, k)| {
        std::mem::discriminant(&observations[j].input) == std::mem::discriminant(&observations[k].input)
    });
    let is_repeat = |&(j, k): &(usize, usize)| {
        let (coarse, fine) = if rows[j].step_s < rows[k].step_s { (k, j) } else { (j, k) };
        is_repeat([&rows[coarse], &rows[fine]], [&observations[coarse], &observations[fine]])
    };
    let first = pairs.find(is_repeat).map(|(later, earlier)| (&observations[later], &observations[earlier]));
    first.or_else(|| observations.iter().find(|observation| is_twice(observation)).map(|twice| (twice, twice)))
}

/// Compares the rows of a coarse recording with those of a fine one: one for one or for each of a few, or at the same times.
fn is_repeat([coarse, fine]: [&Rows; 2], observations: [&Observation; 2]) -> bool {
    let ratio = coarse.step_s / fine.step_s;
    let each = (ratio.round() as usize).clamp(1, MAX_THINNED);
    if each == 1 && coarse.is_copy_of(fine) {
        return true;
    }
    if each > 1 && (0..each).any(|first| coarse.is_copy_of(&fine.thinned(first, each))) {
        return true;
    }
    let is_even = (ratio - 1.0).abs() < 1e-6 && coarse.is_even && fine.is_even;
    let [one, other] = observations.map(|observation| Rows::at_rate(observation, 1.0 / coarse.step_s));
    !is_even && one.zip(other).is_some_and(|(one, other)| one.is_copy_of(&other))
}

/// Whether the second half of a recording has the noise of the first: a run that is in it twice. Without noise, cycles of a film that has settled
/// are alike.
fn is_twice(observation: &Observation) -> bool {
    let middle = observation.measured.time_s.len() / 2;
    let [one, other] = [0, middle].map(|from| Rows::part(observation, from..from + middle));
    Match::of_noise(&one.noise, &other.noise).is_some_and(|noise| one.has_the_noise_of(&other, &noise))
}

struct Rows {
    drive: Vec<f64>,
    measured: Vec<f64>,
    /// Median interval, s, and whether all are the same.
    step_s: f64,
    is_even: bool,
    /// The part that the rows before and the drive do not predict, without spikes, from row [`ORDER`] on, and its size.
    noise: Vec<f64>,
    deviation: f64,
    /// Whether most readings occur several times.
    in_steps: bool,
}

impl Rows {
    fn new(observation: &Observation) -> Self {
        Self::part(observation, 0..observation.measured.time_s.len())
    }

    /// The first of these rows, as many as are compared.
    fn part(observation: &Observation, rows: Range<usize>) -> Self {
        let rows = rows.start..rows.end.min(rows.start + MAX_ROWS);
        let time_s = &observation.measured.time_s[rows.clone()];
        let steps: Vec<f64> = statistics::differences(time_s).collect();
        let step_s = median(&steps);
        let is_even = steps.iter().all(|step| (step / step_s - 1.0).abs() < 1e-3);
        let drive = observation.input.samples().at(time_s.iter().copied());
        Self::from_columns(drive, observation.measured.value[rows].to_vec(), step_s, is_even)
    }

    fn from_columns(drive: Vec<f64>, measured: Vec<f64>, step_s: f64, is_even: bool) -> Self {
        let mut noise = unpredicted(&drive, &measured);
        let deviation = robust_deviation(&noise);
        noise.iter_mut().for_each(|value| *value = value.clamp(-3.0 * deviation, 3.0 * deviation));
        let mut different = sorted(measured.iter().copied());
        different.dedup();
        let in_steps = 4 * different.len() < measured.len();
        Self { drive, measured, step_s, is_even, noise, deviation, in_steps }
    }

    /// One of every `each` rows from the row `first` on.
    fn thinned(&self, first: usize, each: usize) -> Self {
        let some = |values: &[f64]| values.iter().skip(first).step_by(each).copied().collect();
        Self::from_columns(some(&self.drive), some(&self.measured), self.step_s * each as f64, self.is_even)
    }

    /// The rows that `observation` would have at a rate.
    fn at_rate(observation: &Observation, rate_hz: f64) -> Option<Self> {
        let last_s = observation.measured.time_s.last().copied()?.min(MAX_ROWS as f64 / rate_hz);
        let grid = Grid::covering(last_s, rate_hz).ok()?;
        let [drive, measured] = [observation.input.samples(), &observation.measured].map(|s| grid.resample(s));
        Some(Self::from_columns(drive, measured, 1.0 / rate_hz, true))
    }

    /// Whether the drives are one, but for an offset, the sign and some of the gain: simulated recordings may have the noise of one seed.
    fn has_the_drive_of(&self, other: &Self, lag: isize) -> bool {
        let (gain, rest) = rest(&self.drive, &other.drive, lag, true);
        let range = percentile_range(self.drive.iter().copied());
        (gain.abs() - 1.0).abs() < OTHER_GAIN
            && rms(&rest) < SAME_DRIVE * range
            && robust_deviation(&rest) < EXACT_DRIVE * range
    }

    /// The size of the readings, m.
    fn size(&self) -> f64 {
        percentile_range(self.measured.iter().copied()).max(f64::MIN_POSITIVE)
    }

    fn has_noise(&self) -> bool {
        self.deviation > NO_NOISE * self.size()
    }

    /// Whether both have a noise, one under one drive.
    fn has_the_noise_of(&self, other: &Self, noise: &Match) -> bool {
        let least = if self.in_steps && other.in_steps { SAME_STEPS } else { SAME_NOISE };
        self.has_noise()
            && other.has_noise()
            && noise.is_single()
            && noise.correlation.abs() > least.max(noise.chance)
            && self.has_the_drive_of(other, noise.lag)
    }

    fn is_copy_of(&self, other: &Self) -> bool {
        let Some(noise) = Match::of_noise(&self.noise, &other.noise) else { return false };
        if self.has_the_noise_of(other, &noise) {
            return true;
        }
        let (short, long) = if self.measured.len() < other.measured.len() { (self, other) } else { (other, self) };
        let Some(lag) = best_lag(&short.measured, &long.measured) else { return false };
        let (gain, differs) = difference(&short.measured, &long.measured, lag, true);
        let (drive_gain, drive_differs) = difference(&short.drive, &long.drive, lag, false);
        let is_one = |gain: f64| (gain.abs() - 1.0).abs() < GAIN;
        if !is_one(gain) || !is_one(drive_gain) || drive_differs > SAME_DRIVE * peak(&long.drive) {
            return false;
        }
        let (least, most) = (self.deviation.min(other.deviation), self.deviation.max(other.deviation));
        let is_smoothed = least < SMOOTH * most && differs <= SMOOTHED * most && noise.correlation.abs() > SHARED;
        is_smoothed || (!(self.has_noise() && other.has_noise()) && differs <= EQUAL * short.size())
    }
}

/// The rest of `measured` beside the sums of the rows before it, and of the `drive` and its square, that leave least.
fn unpredicted(drive: &[f64], measured: &[f64]) -> Vec<f64> {
    let Some(count) = measured.len().checked_sub(ORDER).filter(|count| *count > 2 * ORDER) else { return Vec::new() };
    // Differences of growing order span the same rows as the rows themselves, and are less alike.
    let differences = |values: Vec<f64>, orders: usize| {
        let next = |values: &Vec<f64>| Some(statistics::differences(values).collect::<Vec<f64>>());
        std::iter::successors(Some(values), next).take(orders).collect::<Vec<_>>()
    };
    let before = differences(measured[..measured.len() - 1].to_vec(), ORDER);
    let square = drive.iter().map(|value| value * value).collect();
    let driven = [drive.to_vec(), square].map(|values| differences(values, OF_DRIVE));
    let last = |values: &Vec<f64>| values[values.len() - count..].to_vec();
    let columns = std::iter::once(vec![1.0; count]).chain(before.iter().chain(driven.iter().flatten()).map(last));
    let kept = vec![1.0; count];
    let mut basis = Basis::new(&measured[ORDER..], &kept, 1e-9);
    basis.extend(&columns.collect::<Vec<_>>());
    basis.rest
}

/// Two series at the lag at which they are most alike.
struct Match {
    lag: isize,
    correlation: f64,
    /// The largest correlation at other lags.
    elsewhere: f64,
    /// More than chance gives.
    chance: f64,
}

impl Match {
    fn of_noise(one: &[f64], other: &[f64]) -> Option<Self> {
        let products = correlation(one, other);
        let [of_one, of_other] = [one, other].map(|values| sums(values.iter().map(|value| value * value)));
        let common = MIN_COMMON.max((MIN_SHARE * one.len().min(other.len()) as f64) as usize);
        let at = |lag: isize| {
            let (from, from_other) = (lag.min(0).unsigned_abs(), lag.max(0).unsigned_abs());
            let count = (one.len().saturating_sub(from)).min(other.len().saturating_sub(from_other));
            let energy = (of_one[from + count] - of_one[from]) * (of_other[from_other + count] - of_other[from_other]);
            let product = products[lag.rem_euclid(products.len() as isize) as usize];
            (lag, if energy > 0.0 { product / energy.sqrt() } else { 0.0 }, count)
        };
        let lags = 1 - one.len() as isize..other.len() as isize;
        let all: Vec<(isize, f64, usize)> = lags.map(at).filter(|(.., count)| *count >= common).collect();
        let &(best, correlation, count) = all.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        let far = all.iter().filter(|(lag, ..)| lag.abs_diff(best) > ORDER);
        let elsewhere = far.fold(0.0_f64, |most, (_, correlation, _)| most.max(correlation.abs()));
        let chance = 1.5 * (2.0 * (all.len() as f64).ln() / count as f64).sqrt();
        Some(Self { lag: best, correlation, elsewhere, chance })
    }

    /// Whether they are alike at this lag only.
    fn is_single(&self) -> bool {
        self.elsewhere < RECURS * self.correlation.abs()
    }
}

/// The sums of the first 0, 1, … of `values`.
fn sums(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let add = |sum: &mut f64, value: f64| {
        *sum += value;
        Some(*sum)
    };
    std::iter::once(0.0).chain(values.scan(0.0, add)).collect()
}

/// The gain with which `long` from `lag` on leaves least of `short`, and the RMS of that: beside their means if those are `free`.
fn difference(short: &[f64], long: &[f64], lag: isize, free: bool) -> (f64, f64) {
    let (gain, rest) = rest(short, long, lag, free);
    (gain, rms(&rest))
}

/// That gain and what it leaves.
fn rest(short: &[f64], long: &[f64], lag: isize, free: bool) -> (f64, Vec<f64>) {
    let (from_short, from_long) = (lag.min(0).unsigned_abs(), lag.max(0).unsigned_abs());
    let count = (short.len() - from_short).min(long.len() - from_long);
    let (short, long) = (&short[from_short..][..count], &long[from_long..][..count]);
    let mean = |values: &[f64]| if free { statistics::mean(values) } else { 0.0 };
    let (x, y) = (mean(long), mean(short));
    let pairs = || short.iter().zip(long).map(|(s, l)| (s - y, l - x));
    let sum = |of: fn((f64, f64)) -> f64| pairs().map(of).sum::<f64>();
    let gain = sum(|(s, l)| l * s) / sum(|(_, l)| l * l).max(f64::MIN_POSITIVE);
    (gain, pairs().map(|(s, l)| s - gain * l).collect())
}

/// The lag at which two series are most alike, beside their means and sizes, over most of the short one.
fn best_lag(short: &[f64], long: &[f64]) -> Option<isize> {
    let products = correlation(short, long);
    // Around the middle, where rounding is least.
    let centred = |values: &[f64]| {
        let middle = statistics::mean(values);
        let centred = || values.iter().map(|value| value - middle);
        [sums(centred()), sums(centred().map(|value| value * value))]
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
        let n = count as f64;
        let xy = products[lag.rem_euclid(products.len() as isize) as usize] - x * y / n;
        1.0 - xy * xy / ((xx - x * x / n) * (yy - y * y / n)).max(f64::MIN_POSITIVE)
    };
    lags.min_by(|&a, &b| spread(a).total_cmp(&spread(b)))
}

/// Sum of the products of `short` with `long` from every lag on, both around their means, by the Fourier transform.
fn correlation(short: &[f64], long: &[f64]) -> Vec<f64> {
    let points = (short.len() + long.len()).next_power_of_two().max(2);
    let mut planner = Planner::new();
    let (forward, backward) = (planner.forward(points), planner.backward(points));
    let spectrum = |values: &[f64]| {
        let mean = statistics::mean(values);
        host_fft::spectrum(&*forward, values.iter().map(|value| value - mean))
    };
    let product = spectrum(short).iter().zip(spectrum(long)).map(|(a, b)| a.conj() * b).collect();
    host_fft::samples(&*backward, product).into_iter().map(|value| value / points as f64).collect()
}
