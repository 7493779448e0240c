//! How much of the observer's correction is in use: less for references that are faster than its loop.

use core::f64::consts::TAU;

use crate::scalar::Real;

/// Frequencies of a reference, in bandwidths: below the first the whole correction is in use, above the second the least.
///
/// The loop's sensitivity passes 1 near 0.8: above that, feedback makes an error larger.
const FADES: [f64; 2] = [0.6, 0.85];
/// The least share: a twentieth of the bandwidth for what is slow, and a sensitivity of 1 within two percent for what is not.
pub(crate) const LEAST: f64 = 0.05;
/// Time over which the reference's frequency is measured, and the share changes, times the bandwidth in rad/s.
const MEMORY: f64 = 4.0;
/// The same for the distance from the mean: the time after which a move counts as the mean.
const DISTANCE: f64 = 2.0;
/// The same for the share.
const FOLLOWING: f64 = 1.0;
/// Weight of the present distance beside its mean square: a single rise is no fast cycle, though little distance has been seen yet.
const PRESENT: f64 = 0.4;

/// Measures the frequency of a reference as the ratio of speed to distance from its mean, both RMS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fade<T> {
    /// Share of the distance that is forgotten in a tick.
    forgetting: T,
    /// Weight of a tick in the means.
    weight: T,
    /// The same for the share.
    following: T,
    /// Square of a distance from the mean that does not count, m².
    floor: T,
    /// Share that is lost per square of the frequency, and the share at 0, unbounded: of the squared angle in a tick.
    falls: T,
    highest: T,
}

/// What changes with every tick of a [`Fade`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FadeState<T> {
    /// Distance from the slow mean, m.
    distance: T,
    /// Means of the squared distance (m²) and of the squared increment (m² per tick²).
    distance_square: T,
    increment_square: T,
    /// The share now.
    share: T,
}

impl<T: Real> Fade<T> {
    /// For an observer of `bandwidth_hz`, ticked every `step_s` (s). References that move by much less than `least_m` (m) do not count.
    pub(crate) fn new(bandwidth_hz: f64, step_s: f64, least_m: f64) -> Self {
        let angle = TAU * bandwidth_hz * step_s;
        // Forgotten distance adds the square of its rate.
        let [from, to] = FADES.map(|share| (share * share + 1.0 / (DISTANCE * DISTANCE)) * angle * angle);
        let falls = (1.0 - LEAST) / (to - from);
        Self {
            forgetting: T::from_f64(angle / (angle + DISTANCE)),
            weight: T::from_f64(angle / (angle + MEMORY)),
            following: T::from_f64(angle / (angle + FOLLOWING)),
            floor: T::from_f64(least_m * least_m),
            falls: T::from_f64(falls),
            highest: T::from_f64(1.0 + falls * from),
        }
    }

    /// Takes the next `increment` (m) of the reference.
    #[inline]
    pub(crate) fn advance(&self, state: &mut FadeState<T>, increment: T, is_learned: bool) {
        let distance = state.distance + increment;
        state.distance = distance - self.forgetting * distance;
        state.distance_square =
            state.distance_square + self.weight * (state.distance * state.distance - state.distance_square);
        state.increment_square =
            state.increment_square + self.weight * (increment * increment - state.increment_square);
        let present = T::from_f64(PRESENT) * state.distance * state.distance;
        let square = state.increment_square / (state.distance_square + present + self.floor);
        let (one, least) = (T::from_f64(1.0), T::from_f64(LEAST));
        let share = self.highest - self.falls * square;
        let share = if share > one { one } else { share };
        let share = if share < least || is_learned { least } else { share };
        state.share = state.share + self.following * (share - state.share);
    }
}

impl<T: Real> FadeState<T> {
    /// A reference at rest.
    pub(crate) fn at_rest() -> Self {
        let one = T::from_f64(1.0);
        Self { distance: T::ZERO, distance_square: T::ZERO, increment_square: T::ZERO, share: one }
    }

    /// The share of the correction that is in use.
    pub(crate) fn share(&self) -> T {
        self.share
    }
}
