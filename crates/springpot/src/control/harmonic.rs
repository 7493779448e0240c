//! A harmonic of the error, and the film's response to the correction that is added for it.

use crate::control::block::{Block, Progress, Verdict};
use crate::numbers::Numbers;
use crate::scalar::Real;

/// Harmonics that are learned, beside the mean.
pub const HARMONICS: usize = 6;

/// Step size γ while the film's response is not measured yet: for slow harmonics, and the first one for fast ones, near which the film may
/// resonate. It doubles with every block that shows no response.
const INITIAL_STEP_SIZE: f64 = 0.6;
/// Half of that first one.
const PROBING_STEP_SIZE: f64 = 0.05;
/// Step size γ once the response is measured.
const STEP_SIZE: f64 = 0.8;
/// Bounds of |1/P|²: beyond the upper one the film hardly responds.
const INVERSE_GAINS: [f64; 2] = [1e-3, 25.0];
/// Bounds of 1/P of the mean, to which a film always responds about as its law predicts.
const MEAN_INVERSE_GAINS: [f64; 2] = [0.4, 2.5];
/// A drift that is not known: no block has ended yet, or one.
const DRIFT_UNKNOWN: [f64; 2] = [-2.0, -1.0];
/// Share of the drift that is kept in the next block, and the power of a response over it that is significant.
const DRIFT_KEPT: f64 = 0.7;
const DRIFT_SIGNIFICANCE: f64 = 9.0;
/// Signal power over noise power above which a change is significant.
const SIGNIFICANCE: f64 = 25.0;

/// Consecutive blocks without a response after which nothing is added.
const UNRESPONSIVE_BLOCKS: u8 = 2;

/// Kind of a harmonic, by how a film may respond to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// The mean, to which a film always responds.
    Mean,
    /// A harmonic far below any resonance.
    Slow,
    /// A harmonic near which the film may resonate, or beyond which it may hardly respond.
    Fast,
}

/// A complex number as real and imaginary part.
pub(crate) type Pair<T> = [T; 2];

fn square<T: Real>([re, im]: Pair<T>) -> T {
    re * re + im * im
}

/// Complex amplitudes, so that a signal is Re(A exp(i h θ)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Harmonic<T> {
    /// Correction that is added now, m.
    pub(crate) added: Pair<T>,
    /// Correction that is approached, and the one of the block before, m.
    target: Pair<T>,
    previous_target: Pair<T>,
    /// Correction of the block with the least error, m.
    best: Pair<T>,
    /// Σ e exp(−i h θ) of this block, m.
    sum: Pair<T>,
    /// E of the block before, m.
    error: Pair<T>,
    /// 1 / P.
    inverse_gain: Pair<T>,
    /// |ΔE|² of two blocks with the same correction, m²; less than 0 before two blocks have ended.
    drift: T,
    /// Step size γ.
    step_size: T,
    /// Consecutive blocks in which the film hardly responded. After two of them nothing is added any more.
    unresponsive_blocks: u8,
}

impl<T: Real> Harmonic<T> {
    /// Visits the constants of learning a harmonic.
    pub(crate) fn numbers(take: &mut impl Numbers<T>) {
        take.number("initial_step_size", T::from_f64(INITIAL_STEP_SIZE), "");
        take.number("probing_step_size", T::from_f64(PROBING_STEP_SIZE), "");
        take.number("step_size", T::from_f64(STEP_SIZE), "");
        take.array("inverse_gains", INVERSE_GAINS.map(T::from_f64), "");
        take.array("mean_inverse_gains", MEAN_INVERSE_GAINS.map(T::from_f64), "");
        take.number("significance", T::from_f64(SIGNIFICANCE), "");
        take.array("drift_unknown", DRIFT_UNKNOWN.map(T::from_f64), "");
        take.number("drift_kept", T::from_f64(DRIFT_KEPT), "");
        take.number("drift_significance", T::from_f64(DRIFT_SIGNIFICANCE), "");
        take.count("unresponsive_blocks", u32::from(UNRESPONSIVE_BLOCKS), "");
    }

    /// No correction, for a film that responds as its law predicts.
    pub(crate) fn new() -> Self {
        let (zero, one) = ([T::ZERO; 2], T::from_f64(1.0));
        Self {
            added: zero,
            target: zero,
            previous_target: zero,
            best: zero,
            sum: zero,
            error: zero,
            inverse_gain: [one, T::ZERO],
            drift: T::from_f64(DRIFT_UNKNOWN[0]),
            step_size: T::from_f64(PROBING_STEP_SIZE),
            unresponsive_blocks: 0,
        }
    }

    /// The learned correction for another run, none of it added yet.
    pub(crate) fn carried_over(self) -> Self {
        let zero = [T::ZERO; 2];
        // No change against the block before: the measured response of the film stays.
        Self { added: zero, previous_target: self.target, sum: zero, ..self }
    }

    /// Begins a block.
    pub(crate) fn begin(&mut self) {
        self.sum = [T::ZERO; 2];
    }

    /// Adds an `error` (m) at the phase of `unit` = exp(i h θ).
    #[inline]
    pub(crate) fn accumulate(&mut self, error: T, unit: Pair<T>) {
        self.sum = [self.sum[0] + error * unit[0], self.sum[1] - error * unit[1]];
    }

    /// Approaches the target by this `share` of the distance that is left.
    #[inline]
    pub(crate) fn approach(&mut self, share: T) {
        for (added, &target) in self.added.iter_mut().zip(&self.target) {
            *added = *added + share * (target - *added);
        }
    }

    /// Returns to the correction of the block with the least error, or to none where it did harm.
    pub(crate) fn retreat(&mut self, verdict: Verdict) {
        if verdict == Verdict::Harmful {
            *self = Self { added: self.added, ..Self::new() };
        } else {
            self.target = self.best;
        }
    }

    /// Whether a correction is added.
    pub(crate) fn adds(&self) -> bool {
        square(self.target) > T::ZERO
    }

    /// Halves the target.
    pub(crate) fn halve(&mut self) {
        self.target = self.target.map(|target| T::from_f64(0.5) * target);
    }

    /// |Σ e exp(−i h θ)|² of the block, m².
    pub(crate) fn power(&self) -> T {
        square(self.sum)
    }

    /// Takes the sum of a `block` that has ended. Returns whether E is significant.
    pub(crate) fn update(&mut self, kind: Kind, block: &Block<T>, progress: &Progress<T>) -> bool {
        // The mean has half of what a harmonic has of the sum.
        let scale = if kind == Kind::Mean { T::from_f64(0.5) * block.scale } else { block.scale };
        let error = [scale * self.sum[0], scale * self.sum[1]];
        let response = [error[0] - self.error[0], error[1] - self.error[1]];
        let change = [self.target[0] - self.previous_target[0], self.target[1] - self.previous_target[1]];
        self.error = error;
        self.previous_target = self.target;
        if progress.verdict == Verdict::Best {
            self.best = self.target;
        }
        if progress.verdict == Verdict::Harmful {
            *self = Self { added: self.added, ..Self::new() };
            return true;
        }
        if progress.verdict == Verdict::Settling {
            return true;
        }
        let threshold = T::from_f64(SIGNIFICANCE) * block.variance;
        if self.measure_drift(kind, square(response)) {
            return true;
        }
        self.measure_response(kind, change, response, threshold);
        if self.unresponsive_blocks >= UNRESPONSIVE_BLOCKS && kind != Kind::Mean {
            self.target = [T::ZERO; 2];
            return false;
        }
        if progress.verdict == Verdict::Worse {
            self.target = self.best;
            return true;
        }
        // The step gets smaller where E is not above the noise.
        let (energy, noise) = (square(error), T::from_f64(4.0) * block.variance);
        let weight = energy * energy / (energy * energy + noise * noise);
        let share = if energy > T::ZERO { self.step_size * progress.caution * weight } else { T::ZERO };
        let [re, im] = self.inverse_gain;
        self.target = [
            self.target[0] - share * (re * error[0] - im * error[1]),
            self.target[1] - share * (re * error[1] + im * error[0]),
        ];
        energy > threshold
    }

    /// Measures how much E changes by itself, from the two blocks before anything is added. Returns whether that needs another block.
    fn measure_drift(&mut self, kind: Kind, response_power: T) -> bool {
        let [none, one] = DRIFT_UNKNOWN.map(T::from_f64);
        let is_first = kind == Kind::Fast && self.drift <= none;
        self.drift = match kind {
            Kind::Mean | Kind::Slow => T::ZERO,
            Kind::Fast if is_first => one,
            Kind::Fast if self.drift < T::ZERO => response_power,
            Kind::Fast => T::from_f64(DRIFT_KEPT) * self.drift,
        };
        is_first
    }

    /// Takes P = ΔE / ΔA, where ΔE is far above the noise and the drift.
    fn measure_response(&mut self, kind: Kind, change: Pair<T>, response: Pair<T>, threshold: T) {
        let [low, high] = INVERSE_GAINS.map(T::from_f64);
        let (change_power, response_power) = (square(change), square(response));
        if change_power > T::ZERO && response_power > threshold + T::from_f64(DRIFT_SIGNIFICANCE) * self.drift {
            let inverse_gain = [
                (change[0] * response[0] + change[1] * response[1]) / response_power,
                (change[1] * response[0] - change[0] * response[1]) / response_power,
            ];
            let [least, largest] = MEAN_INVERSE_GAINS.map(T::from_f64);
            if kind == Kind::Mean && (inverse_gain[0] < least || inverse_gain[0] > largest) {
                // An error that drifts, not a response.
            } else if square(inverse_gain) > high {
                self.unresponsive_blocks = self.unresponsive_blocks.saturating_add(1);
            } else if square(inverse_gain) > low {
                self.inverse_gain = inverse_gain;
                self.step_size = T::from_f64(STEP_SIZE);
                self.unresponsive_blocks = 0;
            }
        } else if change_power > high * threshold {
            self.unresponsive_blocks = self.unresponsive_blocks.saturating_add(1);
        } else if self.step_size < T::from_f64(INITIAL_STEP_SIZE) {
            let (doubled, initial) = (self.step_size + self.step_size, T::from_f64(INITIAL_STEP_SIZE));
            self.step_size = if kind == Kind::Fast && doubled < initial { doubled } else { initial };
        }
    }
}
