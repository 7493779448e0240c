//! A block of learning: the cycles over which harmonics are measured.

use core::f64::consts::TAU;

use crate::control::harmonic::{HARMONICS, Harmonic};
use crate::scalar::Real;

/// A block: some time to settle, then whole cycles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Block<T> {
    /// Ticks since its begin, and since the last block ended.
    pub(super) ticks: T,
    pub(super) ticks_since_end: T,
    /// Angle of the cycles since the film settled, and where the next one ends, rad.
    pub(super) angle: T,
    pub(super) next_end: T,
    pub(super) samples: T,
    /// Σ e², m².
    pub(super) sum_of_squares: T,
    /// Once it has ended: what makes E of the sums, and the variance of each part of E by noise, m².
    pub(super) scale: T,
    pub(super) variance: T,
    pub(super) has_ended: bool,
    /// Whether the block before showed more than noise: then this one is short.
    pub(super) is_short: bool,
}

impl<T: Real> Block<T> {
    /// The first one.
    pub(super) fn first() -> Self {
        let zero = T::ZERO;
        Self {
            ticks: zero,
            ticks_since_end: zero,
            angle: zero,
            next_end: T::from_f64(TAU),
            samples: zero,
            sum_of_squares: zero,
            scale: zero,
            variance: zero,
            has_ended: false,
            is_short: true,
        }
    }

    /// Ends it. What the harmonics do not explain of e is noise.
    pub(super) fn complete(&mut self, harmonics: &[Harmonic<T>; HARMONICS + 1]) {
        self.scale = T::from_f64(2.0) / self.samples;
        let [mean, harmonics @ ..] = harmonics;
        let explained = harmonics.iter().fold(T::from_f64(0.5) * mean.power(), |sum, harmonic| sum + harmonic.power());
        let residual = self.sum_of_squares - self.scale * explained;
        self.variance = if residual > T::ZERO { self.scale * residual / self.samples } else { T::ZERO };
        self.has_ended = true;
        self.is_short = false;
        self.ticks_since_end = T::ZERO;
    }
}
