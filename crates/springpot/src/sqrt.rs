//! The one function of a step that is not arithmetic: the square root from force to voltage.

use crate::scalar::Scalar;

/// A [`Scalar`] that can be compared and has a square root: what forces become voltages in.
pub trait Real: Scalar + PartialOrd {
    /// The square root, for values ≥ 0.
    ///
    /// Correctly rounded, unless the feature `micromath` is on: then for `f32` micromath's estimate with two of Heron's
    /// steps, off by 2e-6 at the most (1.6e-6 measured over all mantissas). From force to voltage that takes 34 instructions
    /// instead of 68 on a Cortex-M4F, but 1 260 instead of 859 on a Cortex-M0, which has no divider: leave it off there.
    /// It never enters a law.
    #[must_use]
    fn sqrt(self) -> Self;
}

impl Real for f64 {
    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }
}

#[cfg(not(feature = "micromath"))]
impl Real for f32 {
    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }
}

#[cfg(feature = "micromath")]
impl Real for f32 {
    #[inline]
    fn sqrt(self) -> Self {
        if self > 0.0 {
            let estimate = micromath::F32Ext::sqrt(self);
            let better = 0.5 * (estimate + self / estimate);
            0.5 * (better + self / better)
        } else if self == 0.0 {
            self
        } else {
            f32::NAN
        }
    }
}
