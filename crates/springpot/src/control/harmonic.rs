//! A harmonic of the error, and the film's response to the correction that is added for it.

use crate::numbers::Numbers;
use crate::scalar::Real;

/// Harmonics that are learned, beside the mean.
pub const HARMONICS: usize = 6;

/// Step size γ while the film's response is not measured yet.
const INITIAL_STEP_SIZE: f64 = 0.6;
/// Step size γ once the response is measured.
const STEP_SIZE: f64 = 0.8;
/// Bounds of |1/P|²: beyond the upper one the film hardly responds.
const INVERSE_GAINS: [f64; 2] = [0.01, 25.0];
/// Signal power over noise power above which a change is significant.
const SIGNIFICANCE: f64 = 25.0;

/// Consecutive blocks without a response after which nothing is added.
const UNRESPONSIVE_BLOCKS: u8 = 2;

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
    /// Σ e exp(−i h θ) of this block, m.
    sum: Pair<T>,
    /// E of the block before, m.
    error: Pair<T>,
    /// 1 / P.
    inverse_gain: Pair<T>,
    /// Step size γ.
    step_size: T,
    /// Consecutive blocks in which the film hardly responded. After two of them nothing is added any more.
    unresponsive_blocks: u8,
}

impl<T: Real> Harmonic<T> {
    /// Visits what a harmonic is learned with.
    pub(crate) fn numbers(take: &mut impl Numbers<T>) {
        take.number("initial_step_size", T::from_f64(INITIAL_STEP_SIZE), "");
        take.number("step_size", T::from_f64(STEP_SIZE), "");
        take.array("inverse_gains", INVERSE_GAINS.map(T::from_f64), "");
        take.number("significance", T::from_f64(SIGNIFICANCE), "");
        take.count("unresponsive_blocks", u32::from(UNRESPONSIVE_BLOCKS), "");
    }

    /// No correction, for a film that responds as its law predicts.
    pub(crate) fn new() -> Self {
        let (zero, one) = ([T::ZERO; 2], T::from_f64(1.0));
        Self {
            added: zero,
            target: zero,
            previous_target: zero,
            sum: zero,
            error: zero,
            inverse_gain: [one, T::ZERO],
            step_size: T::from_f64(INITIAL_STEP_SIZE),
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

    /// Halves the target.
    pub(crate) fn halve(&mut self) {
        self.target = self.target.map(|target| T::from_f64(0.5) * target);
    }

    /// |Σ e exp(−i h θ)|² of the block, m².
    pub(crate) fn power(&self) -> T {
        square(self.sum)
    }

    /// Ends a block with E = `scale` times the sum; noise gives each part of E the `variance` (m²). Returns whether E is significant.
    /// `may_be_unresponsive`: a harmonic, to which a film may hardly respond. To the mean it always does.
    pub(crate) fn update(&mut self, scale: T, variance: T, may_be_unresponsive: bool) -> bool {
        let error = [scale * self.sum[0], scale * self.sum[1]];
        // P = ΔE / ΔA, where both are far above the noise.
        let response = [error[0] - self.error[0], error[1] - self.error[1]];
        let change = [self.target[0] - self.previous_target[0], self.target[1] - self.previous_target[1]];
        self.error = error;
        self.previous_target = self.target;
        let [low, high] = INVERSE_GAINS.map(T::from_f64);
        let threshold = T::from_f64(SIGNIFICANCE) * variance;
        let response_power = square(response);
        if square(change) > threshold && response_power > threshold && response_power > T::ZERO {
            let inverse_gain = [
                (change[0] * response[0] + change[1] * response[1]) / response_power,
                (change[1] * response[0] - change[0] * response[1]) / response_power,
            ];
            if square(inverse_gain) > high {
                self.unresponsive_blocks = self.unresponsive_blocks.saturating_add(1);
            } else if square(inverse_gain) > low {
                self.inverse_gain = inverse_gain;
                self.step_size = T::from_f64(STEP_SIZE);
                self.unresponsive_blocks = 0;
            }
        } else if square(change) > high * threshold {
            self.unresponsive_blocks = self.unresponsive_blocks.saturating_add(1);
        }
        if self.unresponsive_blocks >= UNRESPONSIVE_BLOCKS && may_be_unresponsive {
            self.target = [T::ZERO; 2];
            return false;
        }
        // The step gets smaller where E is not above the noise.
        let (energy, noise) = (square(error), T::from_f64(4.0) * variance);
        let weight = energy * energy / (energy * energy + noise * noise);
        let share = if energy > T::ZERO { self.step_size * weight } else { T::ZERO };
        let [re, im] = self.inverse_gain;
        self.target = [
            self.target[0] - share * (re * error[0] - im * error[1]),
            self.target[1] - share * (re * error[1] + im * error[0]),
        ];
        energy > threshold
    }
}
