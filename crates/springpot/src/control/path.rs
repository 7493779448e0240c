//! A reference that a film can follow: bounded speed and acceleration.

use crate::control::limits::Limited;
use crate::numbers::Numbers;
use crate::scalar::Real;

/// Bounds of the path, per tick.
///
/// A reference that keeps within them is followed exactly, without delay. Any other is approached as fast as they allow:
/// with e the distance to the target and a the largest change of increment, the path may close in by n a per tick where
///
/// ```text
/// a + 2 a + … + n a = n (n + 1) a / 2 = |e|
/// ```
///
/// because then it can still brake by a in every tick and stop at the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shaper<T> {
    /// Largest increment, m.
    increment: T,
    /// Largest change of the increment, m.
    change: T,
}

/// The state of a path: position and motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Path<T> {
    /// The target at the last tick, m.
    target: T,
    /// The shaped reference, m.
    pub(crate) position: T,
    /// Its last increment, m.
    pub(crate) increment: T,
    /// Change of the increment in the last tick, m.
    pub(crate) change: T,
}

impl<T: Real> Path<T> {
    /// A path at rest at `position` (m).
    pub(crate) fn at(position: T) -> Self {
        Self { target: position, position, increment: T::ZERO, change: T::ZERO }
    }
}

impl<T: Real> Shaper<T> {
    pub(crate) fn new(step_s: f64, max_velocity: f64, max_acceleration: f64) -> Self {
        Self { increment: T::from_f64(max_velocity * step_s), change: T::from_f64(max_acceleration * step_s * step_s) }
    }

    /// Whether both bounds are positive in type T and can be divided by.
    pub(crate) fn is_usable(&self) -> bool {
        self.increment > T::ZERO
            && self.change > T::ZERO
            && T::from_f64(1.0 / self.change.to_f64()).to_f64().is_finite()
    }

    /// Visits its bounds.
    pub(crate) fn numbers(&self, take: &mut impl Numbers<T>) {
        take.number("max_increment", self.increment, "of the shaped reference in a tick, m");
        take.number("max_change", self.change, "of that increment in a tick, m");
    }

    /// Moves `path` by one tick towards `target` (m). After a non-finite target the last one stays.
    #[inline]
    pub(crate) fn advance(&self, path: &mut Path<T>, target: T) -> Limited {
        let target = if is_finite(target) { target } else { path.target };
        let motion = target - path.target;
        let distance = path.target - path.position;
        path.target = target;

        let mut limited = Limited::NONE;
        let (one, eight, half) = (T::from_f64(1.0), T::from_f64(8.0), T::from_f64(0.5));
        let size = if distance < T::ZERO { -distance } else { distance };
        let brakable = half * self.change * ((one + eight * (size / self.change)).sqrt() - one);
        let approach = if size <= self.change {
            distance
        } else {
            limited |= Limited::ACCELERATION;
            if distance < T::ZERO { -brakable } else { brakable }
        };
        let wanted = motion + approach;
        let allowed = clamp(wanted, -self.increment, self.increment);
        if allowed < wanted || wanted < allowed {
            limited |= Limited::VELOCITY;
        }
        let increment = clamp(allowed, path.increment - self.change, path.increment + self.change);
        if increment < allowed || allowed < increment {
            limited |= Limited::ACCELERATION;
        }
        path.change = increment - path.increment;
        path.increment = increment;
        path.position = path.position + increment;
        limited
    }
}

#[inline]
pub(crate) fn clamp<T: Real>(value: T, low: T, high: T) -> T {
    if value < low {
        low
    } else if value > high {
        high
    } else {
        value
    }
}

/// Neither infinite nor NaN.
#[inline]
pub(crate) fn is_finite<T: Real>(value: T) -> bool {
    #[allow(clippy::eq_op)] // ∞ − ∞ is NaN, which equals nothing
    let difference = value - value;
    difference == T::ZERO
}
