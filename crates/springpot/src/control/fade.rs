//! How much of the observer's correction is in use: less for references that are faster than its loop.

use core::f64::consts::TAU;

use crate::numbers::Numbers;
use crate::scalar::Real;

/// ρ below which the whole correction is in use, and above which the least: of sines of 0.6 and 0.85 bandwidths.
///
/// The loop's sensitivity passes 1 near 0.8 bandwidths: above that, feedback makes an error larger.
const FADES: [f64; 2] = [1.562, 1.972];
/// The least share: a thirtieth of the bandwidth for what is slow, and a sensitivity of 1 within a percent for what is not.
const MIN_SHARE: f64 = 0.03;
/// Times, in units of 1 / ω of the bandwidth: after which a move counts as the mean, over which distances are averaged, and over which
/// the share changes.
const FORGETS: f64 = 2.0;
const AVERAGES: f64 = 4.0;
const FOLLOWS: f64 = 1.0;

/// Measures the frequency of a reference q by how far it goes and how far it gets.
///
/// With the speed v = dq/dt, a time constant T and means over some time,
///
/// ```text
/// ρ = mean of T |v|, after a lag of T / mean of T |v after a lag of T|
/// ```
///
/// is 1 for every step and ramp, also while it happens, and √(1 + ω² T²) for a sine. Slow cycles and moves of any speed keep the whole
/// correction, fast cycles lose it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fade<T> {
    /// Weights of a sample in the three lags.
    forgets: T,
    averages: T,
    follows: T,
    /// Distance from the mean that does not count, m.
    floor: T,
}

/// What changes with every tick of a [`Fade`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FadeState<T> {
    /// The reference at the sample before, m.
    position: T,
    /// T times the speed after a lag: distance from the slow mean, m.
    distance: T,
    /// Mean of its size, m.
    gets: T,
    /// Mean of T times the size of the speed, before and after a lag, m.
    goes: [T; 2],
    /// The share now.
    share: T,
}

/// The share as a straight line of ρ: at ρ = 0, and how much it falls with ρ.
fn line<T: Real>() -> [T; 2] {
    let [from, to] = FADES;
    let falls = (1.0 - MIN_SHARE) / (to - from);
    [1.0 + falls * from, falls].map(T::from_f64)
}

impl<T: Real> Fade<T> {
    /// For an observer of `bandwidth_hz` with samples every `interval_s` (s). References that move by much less than `least_m` (m) do not
    /// count.
    pub(crate) fn new(bandwidth_hz: f64, interval_s: f64, least_m: f64) -> Self {
        let angle = TAU * bandwidth_hz * interval_s;
        let weight = |time: f64| T::from_f64(angle / (angle + time));
        Self {
            forgets: weight(FORGETS),
            averages: weight(AVERAGES),
            follows: weight(FOLLOWS),
            floor: T::from_f64(least_m),
        }
    }

    /// Visits what the share is computed with.
    pub(crate) fn numbers(&self, take: &mut impl Numbers<T>) {
        let [highest, falls] = line::<T>();
        take.structure(
            "fade",
            "How much of the correction is in use for references that are faster than the observer.",
        );
        take.number("forgets", self.forgets, "");
        take.number("averages", self.averages, "");
        take.number("follows", self.follows, "");
        take.number("floor", self.floor, "m");
        take.number("highest", highest, "");
        take.number("falls", falls, "");
        take.number("least", T::from_f64(MIN_SHARE), "");
    }

    /// Takes the `position` (m) of the reference, with every sample of the sensor. `is_learned`: the errors of its cycles are left to a
    /// learning.
    #[inline]
    pub(crate) fn advance(&self, state: &mut FadeState<T>, position: T, is_learned: bool) {
        // T times the speed.
        let moved = (position - state.position) / self.forgets;
        state.position = position;
        state.distance = state.distance + self.forgets * (moved - state.distance);
        state.gets = state.gets + self.averages * (state.distance.abs() - state.gets);
        let [mean, lagged] = state.goes;
        let mean = mean + self.averages * (moved.abs() - mean);
        let lagged = lagged + self.forgets * (mean - lagged);
        state.goes = [mean, lagged];
        let (one, least) = (T::from_f64(1.0), T::from_f64(MIN_SHARE));
        let [highest, falls] = line::<T>();
        let share = highest - falls * (lagged / (state.gets + self.floor));
        let share = if share > one { one } else { share };
        let share = if share < least || is_learned { least } else { share };
        state.share = state.share + self.follows * (share - state.share);
    }
}

impl<T: Real> FadeState<T> {
    /// A reference at rest at `position` (m).
    pub(crate) fn at(position: T) -> Self {
        Self { position, distance: T::ZERO, gets: T::ZERO, goes: [T::ZERO; 2], share: T::from_f64(1.0) }
    }

    /// The share of the correction that is in use.
    pub(crate) fn share(&self) -> T {
        self.share
    }
}
