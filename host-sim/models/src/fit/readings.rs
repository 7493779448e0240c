//! Measured values, their weights, and what of them is a recording's own: an offset and a gain, solved in every evaluation.

use super::observation::{Observation, Reading};

/// The measured values of one observation with their weights.
pub(super) struct Readings {
    pub(super) measured: Vec<f64>,
    /// Factor of all residuals.
    weight: f64,
    /// Factors of the single residuals; empty where they are 1.
    sample_weights: Vec<f64>,
    /// What of them is the recording's own.
    own: Reading,
}

/// Offset and gain of the readings of one observation: reading = offset + gain · modelled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadingFit {
    /// m or N.
    pub offset: f64,
    /// 1 unless the recording has its own.
    pub gain: f64,
    /// Which of them are the recording's own.
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
    /// The readings of `observation`.
    pub(super) fn new(observation: &Observation) -> Self {
        Self {
            measured: observation.measured.value.clone(),
            weight: observation.weight,
            sample_weights: observation.sample_weights.clone(),
            own: observation.reading,
        }
    }

    /// Factor of the residual of a `sample`.
    pub(super) fn weight(&self, sample: usize) -> f64 {
        self.weight * self.sample_weights.get(sample).copied().unwrap_or(1.0)
    }

    /// Offset and gain with the least weighted squares; `modelled` becomes what is read.
    pub(super) fn solve(&self, modelled: &mut [f64]) -> ReadingFit {
        let Reading { own_offset, own_gain } = self.own;
        let mut fit = ReadingFit { offset: 0.0, gain: 1.0, own: self.own };
        if !(own_offset || own_gain) {
            return fit;
        }
        let weighted = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            let pairs = modelled.iter().zip(&self.measured).enumerate();
            pairs.map(|(k, (x, y))| self.weight(k).powi(2) * of(*x, *y)).sum()
        };
        let total = weighted(&|_, _| 1.0);
        let (x_mean, y_mean) =
            if own_offset { (weighted(&|x, _| x) / total, weighted(&|_, y| y) / total) } else { (0.0, 0.0) };
        if own_gain {
            let square = weighted(&|x, _| (x - x_mean).powi(2));
            let gain = weighted(&|x, y| (x - x_mean) * (y - y_mean)) / square;
            fit.gain = if gain.is_finite() { gain } else { 1.0 };
        }
        if own_offset {
            fit.offset = y_mean - fit.gain * x_mean;
        }
        modelled.iter_mut().for_each(|x| *x = fit.offset + fit.gain * *x);
        fit
    }

    /// The weighted derivatives of the residuals from those of the modelled values: without what offset and gain make up for
    /// (variable projection after Golub and Pereyra, in Kaufman's form). `read` are the readings.
    pub(super) fn project(&self, fit: &ReadingFit, read: &[f64], derivative: Vec<f64>) -> Vec<f64> {
        let weights = (0..derivative.len()).map(|k| self.weight(k));
        let mut column: Vec<f64> = weights.clone().zip(derivative).map(|(weight, d)| weight * fit.gain * d).collect();
        let Reading { own_offset, own_gain } = self.own;
        let mut without = |direction: &[f64]| {
            let square: f64 = direction.iter().map(|d| d * d).sum();
            let share = column.iter().zip(direction).map(|(c, d)| c * d).sum::<f64>() / square;
            if share.is_finite() {
                column.iter_mut().zip(direction).for_each(|(c, d)| *c -= share * d);
            }
        };
        if own_offset {
            without(&weights.clone().collect::<Vec<f64>>());
        }
        if own_gain {
            // What is left of the readings without their mean, if the offset is their own as well.
            let total: f64 = weights.clone().map(|w| w * w).sum();
            let mean = weights.clone().zip(read).map(|(w, r)| w * w * r).sum::<f64>() / total;
            let centre = if own_offset { mean } else { 0.0 };
            without(&weights.zip(read).map(|(w, r)| w * (r - centre)).collect::<Vec<f64>>());
        }
        column
    }
}
