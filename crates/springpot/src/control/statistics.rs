//! Running statistics of a signal, in constant memory.

use crate::scalar::Scalar;

/// Mean and variance with exponential forgetting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics<T> {
    mean: T,
    variance: T,
}

impl<T: Scalar> Statistics<T> {
    pub(crate) fn new() -> Self {
        Self { mean: T::ZERO, variance: T::ZERO }
    }

    /// Adds `value` with the weight `share` (0…1) against the past.
    #[inline]
    pub(crate) fn update(&mut self, value: T, share: T) {
        let difference = value - self.mean;
        let step = share * difference;
        self.mean = self.mean + step;
        self.variance = self.variance + (difference * (difference - step) * share - share * self.variance);
    }

    /// The mean.
    #[must_use]
    pub fn mean(&self) -> T {
        self.mean
    }

    /// The variance about the mean.
    #[must_use]
    pub fn variance(&self) -> T {
        self.variance
    }
}
