//! The number type that a step runs on.

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A number that a [`Law`](crate::Law) can step with.
///
/// A step only adds, subtracts, multiplies and divides (and with an elastic curve compares), so any type with those four operations
/// will do: `f32` on a microcontroller, `f64` on a host, or a dual number that carries derivatives through the recursion. No operation is
/// ever fused or reordered, so one type gives the same bits on every machine with IEEE 754 arithmetic.
pub trait Scalar:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Zero.
    const ZERO: Self;

    /// The nearest number of this type; derivatives, where the type has them, are zero.
    fn from_f64(value: f64) -> Self;

    /// The value as `f64`, without derivatives, for the checks when a law is built.
    fn to_f64(self) -> f64;

    /// Whether the value is less than `other`; false where either is NaN. A step selects the piece of an elastic curve with it. Compares as
    /// `f64` unless a type has a faster way.
    #[inline]
    #[must_use]
    fn is_below(self, other: Self) -> bool {
        self.to_f64() < other.to_f64()
    }
}

impl Scalar for f64 {
    const ZERO: Self = 0.0;

    #[inline]
    fn from_f64(value: f64) -> Self {
        value
    }

    #[inline]
    fn to_f64(self) -> f64 {
        self
    }
}

impl Scalar for f32 {
    const ZERO: Self = 0.0;

    #[inline]
    #[allow(clippy::cast_possible_truncation)] // rounding to the nearest f32 is the purpose
    fn from_f64(value: f64) -> Self {
        value as f32
    }

    #[inline]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline]
    fn is_below(self, other: Self) -> bool {
        self < other
    }
}

/// A [`Scalar`] with comparison and a square root, which the conversion from force to voltage needs.
pub trait Real: Scalar + PartialOrd {
    /// The square root, for values ≥ 0.
    ///
    /// Correctly rounded, unless the feature `micromath` is on: then for `f32` micromath's estimate with two Heron
    /// steps, with a relative error of at most 2e-6 (1.6e-6 measured over all mantissas). Force to voltage then takes 34
    /// instructions instead of 68 on a Cortex-M4F, but 1 260 instead of 859 on a Cortex-M0, which has no divider: leave it
    /// off there. No law uses it.
    #[must_use]
    fn sqrt(self) -> Self;

    /// The value without its sign.
    #[inline]
    #[must_use]
    fn abs(self) -> Self {
        if self > Self::ZERO { self } else { Self::ZERO - self }
    }
}

impl Real for f64 {
    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }

    #[inline]
    fn abs(self) -> Self {
        Self::abs(self)
    }
}

#[cfg(not(feature = "micromath"))]
impl Real for f32 {
    #[inline]
    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }

    #[inline]
    fn abs(self) -> Self {
        Self::abs(self)
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

    #[inline]
    fn abs(self) -> Self {
        Self::abs(self)
    }
}
