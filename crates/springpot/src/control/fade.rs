//! How much of the observer's correction is in use: less for references that are faster than its loop.

use core::f64::consts::TAU;

use crate::numbers::Numbers;
use crate::scalar::Real;

/// ρ up to which all of the correction is in use, and from which the smallest share is: sines of 0.6 and 0.85 bandwidths.
///
/// The loop's sensitivity passes 1 near 0.8 bandwidths: above that, feedback makes an error larger.
const FADE_RATIOS: [f64; 2] = [1.562, 1.972];
/// Smallest share: a thirtieth of the bandwidth for slow errors, and a sensitivity of 1 within a percent for fast ones.
const MIN_SHARE: f64 = 0.03;
/// Time constants, in units of 1 / ω of the bandwidth: of the high-pass, of the averages, and of the smoothing of the share.
const HIGH_PASS: f64 = 2.0;
const AVERAGING: f64 = 4.0;
const SMOOTHING: f64 = 1.0;

/// Measures the frequency of a reference q by its path length over its net excursion.
///
/// With the speed v = dq/dt and the time constant T of the high-pass,
///
/// ```text
/// path length   = mean of T |v|, low-passed with T
/// net excursion = mean of |h|, where h = T v low-passed with T: q through the high-pass
/// ρ             = path length / net excursion
/// ```
///
/// ρ is 1 for every step and ramp, also while it happens, and √(1 + ω² T²) for a sine. Slow cycles and moves of any speed keep the whole
/// correction, fast cycles lose it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fade<T> {
    /// Weights of a sample in the high-pass, in the averages and in the smoothing of the share.
    high_pass: T,
    averaging: T,
    smoothing: T,
    /// Net excursion that is added, m: smaller references do not count.
    floor: T,
}

/// State of a [`Fade`]: changes with every sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FadeState<T> {
    /// The reference at the sample before, m.
    position: T,
    /// The reference through the high-pass, m.
    high_passed: T,
    /// Mean of its size, m.
    net_excursion: T,
    /// Mean of T times the size of the speed, before and after the low-pass, m.
    path_length: [T; 2],
    /// The share now.
    share: T,
}

/// The share as a straight line of ρ: its intercept at ρ = 0, and its negative slope.
fn line<T: Real>() -> [T; 2] {
    let [from, to] = FADE_RATIOS;
    let slope = (1.0 - MIN_SHARE) / (to - from);
    [1.0 + slope * from, slope].map(T::from_f64)
}

impl<T: Real> Fade<T> {
    /// For an observer of `bandwidth_hz` with samples every `interval_s` (s). References that move by much less than `least_m` (m) do not
    /// count.
    pub(crate) fn new(bandwidth_hz: f64, interval_s: f64, least_m: f64) -> Self {
        let angle = TAU * bandwidth_hz * interval_s;
        let weight = |time: f64| T::from_f64(angle / (angle + time));
        Self {
            high_pass: weight(HIGH_PASS),
            averaging: weight(AVERAGING),
            smoothing: weight(SMOOTHING),
            floor: T::from_f64(least_m),
        }
    }

    /// Visits the constants of the share.
    pub(crate) fn numbers(&self, take: &mut impl Numbers<T>) {
        let [intercept, slope] = line::<T>();
        take.structure(
            "fade",
            "How much of the correction is in use for references that are faster than the observer.",
        );
        take.number("high_pass", self.high_pass, "");
        take.number("averaging", self.averaging, "");
        take.number("smoothing", self.smoothing, "");
        take.number("floor", self.floor, "m");
        take.number("intercept", intercept, "");
        take.number("slope", slope, "");
        take.number("min_share", T::from_f64(MIN_SHARE), "");
    }

    /// Takes the `position` (m) of the reference, with every sample of the sensor. `most`: the share of the correction that is left to it,
    /// where learning has taken over the rest of its cycles.
    #[inline]
    pub(crate) fn advance(&self, state: &mut FadeState<T>, position: T, most: T) {
        // T times the speed.
        let moved = (position - state.position) / self.high_pass;
        state.position = position;
        state.high_passed = state.high_passed + self.high_pass * (moved - state.high_passed);
        state.net_excursion = state.net_excursion + self.averaging * (state.high_passed.abs() - state.net_excursion);
        let [mean, lagged] = state.path_length;
        let mean = mean + self.averaging * (moved.abs() - mean);
        let lagged = lagged + self.high_pass * (mean - lagged);
        state.path_length = [mean, lagged];
        let least = T::from_f64(MIN_SHARE);
        let [intercept, slope] = line::<T>();
        let share = intercept - slope * (lagged / (state.net_excursion + self.floor));
        let share = if share > most { most } else { share };
        let share = if share < least { least } else { share };
        state.share = state.share + self.smoothing * (share - state.share);
    }
}

impl<T: Real> FadeState<T> {
    /// A reference at rest at `position` (m).
    pub(crate) fn at(position: T) -> Self {
        Self {
            position,
            high_passed: T::ZERO,
            net_excursion: T::ZERO,
            path_length: [T::ZERO; 2],
            share: T::from_f64(1.0),
        }
    }

    /// The share of the correction that is in use.
    pub(crate) fn share(&self) -> T {
        self.share
    }
}
