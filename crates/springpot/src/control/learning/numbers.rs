//! What learning computes with, in numbers.

use core::f64::consts::TAU;

use super::{
    COSINE, FADED, FADING, Learning, MAX_ANGLE, MIN_BLOCK_S, MIN_SAMPLES, SAME_PERIOD, SETTLING_S, SINE, SMOOTHING,
    UNENDED,
};
use crate::control::harmonic::Harmonic;
use crate::numbers::Numbers;
use crate::scalar::Real;

impl<T: Real, const PAST: usize> Learning<T, PAST> {
    /// Hands out what a tick computes with, as numbers of `learning`.
    pub fn numbers(&self, take: &mut impl Numbers<T>) {
        self.finder.numbers(take);
        take.number("learning.period", self.period);
        take.count("learning.harmonics", u32::try_from(self.harmonics).unwrap_or(u32::MAX));
        take.number("learning.largest_angle", self.largest_angle);
        take.number("learning.rate", self.rate);
        take.number("learning.approach", self.approach);
        Harmonic::numbers(take);
        take.number("learning.series_angle", T::from_f64(MAX_ANGLE));
        take.array("learning.cosine", COSINE.map(T::from_f64));
        take.array("learning.sine", SINE.map(T::from_f64));
        take.array("learning.settling_s", SETTLING_S.map(T::from_f64));
        take.array("learning.least_s", MIN_BLOCK_S.map(T::from_f64));
        take.number("learning.longest_s", T::from_f64(UNENDED * MIN_BLOCK_S[1]));
        take.number("learning.least_samples", T::from_f64(MIN_SAMPLES));
        take.number("learning.smoothing", T::from_f64(SMOOTHING));
        take.number("learning.fading", T::from_f64(FADING));
        take.number("learning.same_period", T::from_f64(SAME_PERIOD));
        take.number("learning.faded", T::from_f64(FADED));
        take.number("learning.turn", T::from_f64(TAU));
    }
}
