//! Zero and gain of readings: which a recording has for itself, and their least squares with the response of a model.

use crate::grid::Samples;

/// Zero and gain that a recording has for itself: solved with the model's response, linearly, in every evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// An offset: a sensor that was zeroed anew.
    pub own_offset: bool,
    /// A factor: another specimen. It is relative to the first recording, whose factor is 1.
    pub own_gain: bool,
    /// A zero that drifts steadily.
    pub drifts: bool,
    /// A reading that settles from the first row on: of a film that was driven before, or a sensor that warms up.
    pub settles: bool,
}

/// Times in which such a reading settles, as shares of the recording.
pub(super) const SETTLES: [f64; 4] = [0.01, 0.03, 0.1, 0.3];

impl Reading {
    /// The zeros of `measured` rows that these are sums of.
    fn zeros(self, measured: &Samples) -> Vec<Vec<f64>> {
        let last_s = measured.time_s.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
        let column = |value: &dyn Fn(f64) -> f64| measured.time_s.iter().map(|t| value(t / last_s)).collect();
        let offset = self.own_offset.then(|| column(&|_| 1.0));
        let drift = self.drifts.then(|| column(&|t| t));
        let settles = SETTLES.iter().filter(|_| self.settles).map(|share| column(&|t| (-t / share).exp()));
        offset.into_iter().chain(drift).chain(settles).collect()
    }
}

/// The measured values of one observation with their weights.
pub(super) struct Readings {
    pub(super) measured: Vec<f64>,
    /// Factor of all residuals.
    pub(super) weight: f64,
    /// Factors of the single residuals; empty where they are 1.
    sample_weights: Vec<f64>,
    /// The part that is the recording's own.
    own: Reading,
    /// Columns of which its zero is a sum, orthonormal with the weights.
    zeros: Vec<Vec<f64>>,
}

/// Offset and gain of the readings of one observation: reading = offset + gain · modelled, with the offset after what settles and before what
/// drifts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadingFit {
    /// m or N.
    pub offset: f64,
    /// 1 unless the recording has its own.
    pub gain: f64,
    /// The part that is the recording's own.
    own: Reading,
}

impl ReadingFit {
    /// The offset, if it is the recording's own.
    pub fn own_offset(&self) -> Option<f64> {
        self.own.own_offset.then_some(self.offset)
    }

    /// The gain, if it is the recording's own.
    pub fn own_gain(&self) -> Option<f64> {
        self.own.own_gain.then_some(self.gain)
    }
}

impl Readings {
    pub(super) fn new(measured: &Samples, weight: f64, sample_weights: Vec<f64>, own: Reading) -> Self {
        let mut readings = Self { measured: measured.value.clone(), weight, sample_weights, own, zeros: Vec::new() };
        for mut zero in own.zeros(measured) {
            for _ in 0..2 {
                readings.take_zeros(&mut zero);
            }
            let size = readings.product(&zero, &zero).sqrt();
            if size > 0.0 {
                zero.iter_mut().for_each(|value| *value /= size);
                readings.zeros.push(zero);
            }
        }
        readings
    }

    /// Weighted sum of products.
    fn product(&self, one: &[f64], other: &[f64]) -> f64 {
        one.iter().zip(other).enumerate().map(|(k, (a, b))| self.weight(k).powi(2) * a * b).sum()
    }

    /// Takes from `values` what a zero makes up for.
    fn take_zeros(&self, values: &mut [f64]) {
        for zero in &self.zeros {
            let share = self.product(values, zero);
            values.iter_mut().zip(zero).for_each(|(value, zero)| *value -= share * zero);
        }
    }

    /// Factor of the residual of a `sample`.
    pub(super) fn weight(&self, sample: usize) -> f64 {
        self.weight * self.sample_weights.get(sample).copied().unwrap_or(1.0)
    }

    /// Zero and gain with the least weighted squares; `modelled` becomes what is read.
    pub(super) fn solve(&self, modelled: &mut [f64]) -> ReadingFit {
        let mut fit = ReadingFit { offset: 0.0, gain: 1.0, own: self.own };
        if self.own == Reading::default() {
            return fit;
        }
        if self.own.own_gain {
            let [mut x, mut y] = [modelled.to_vec(), self.measured.clone()];
            self.take_zeros(&mut x);
            self.take_zeros(&mut y);
            let gain = self.product(&x, &y) / self.product(&x, &x);
            fit.gain = if gain.is_finite() { gain } else { 1.0 };
        }
        modelled.iter_mut().for_each(|x| *x *= fit.gain);
        let mut zero: Vec<f64> = self.measured.iter().zip(&*modelled).map(|(y, x)| y - x).collect();
        let before = zero.clone();
        self.take_zeros(&mut zero);
        zero.iter_mut().zip(before).for_each(|(left, before)| *left = before - *left);
        if self.own.own_offset {
            let place = if self.own.settles { zero.last() } else { zero.first() };
            fit.offset = place.copied().unwrap_or(0.0);
        }
        modelled.iter_mut().zip(zero).for_each(|(x, zero)| *x += zero);
        fit
    }

    /// The weighted derivatives of the residuals from those of the modelled values: without what zero and gain make up for
    /// (variable projection after Golub and Pereyra, in Kaufman's form). `read` are the readings.
    pub(super) fn project(&self, fit: &ReadingFit, read: &[f64], mut derivative: Vec<f64>) -> Vec<f64> {
        derivative.iter_mut().for_each(|d| *d *= fit.gain);
        self.take_zeros(&mut derivative);
        if self.own.own_gain {
            let mut direction = read.to_vec();
            self.take_zeros(&mut direction);
            let share = self.product(&derivative, &direction) / self.product(&direction, &direction);
            if share.is_finite() {
                derivative.iter_mut().zip(direction).for_each(|(d, along)| *d -= share * along);
            }
        }
        derivative.iter_mut().enumerate().for_each(|(k, d)| *d *= self.weight(k));
        derivative
    }
}
