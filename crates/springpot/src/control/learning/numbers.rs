//! The constants that learning computes with.

use core::f64::consts::TAU;

use super::{
    COSINE, FADE_WEIGHT, FADED_OUT, Learning, MAX_ANGLE, MAX_BLOCKS, MIN_BLOCK_S, MIN_SAMPLES, SAME_PERIOD, SETTLING_S,
    SINE, SLOW_HZ, SMOOTHING,
};
use crate::control::block::Progress;
use crate::control::harmonic::Harmonic;
use crate::numbers::Numbers;
use crate::scalar::Real;

impl<T: Real, const PAST: usize> Learning<T, PAST> {
    /// Visits the constants of a tick.
    #[doc(hidden)]
    pub fn numbers(&self, take: &mut impl Numbers<T>) {
        take.structure("learning", "Learning of periodic references.");
        self.finder.numbers(take);
        take.number("period", self.period, "ticks; 0 where it is taken from the reference");
        take.count("harmonics", u32::try_from(self.harmonics).unwrap_or(u32::MAX), "that are learned, beside the mean");
        take.number("largest_angle", self.largest_angle, "in a tick, of a harmonic that is learned, rad");
        take.number("rate", self.rate, "ticks in a second");
        take.number("approach", self.approach, "");
        take.number("slow", T::from_f64(SLOW_HZ * TAU), "up to which a harmonic is slow, rad/s");
        Harmonic::numbers(take);
        Progress::numbers(take);
        take.number("series_angle", T::from_f64(MAX_ANGLE), "largest angle of the series of cosine and sine, rad");
        take.array("cosine", COSINE.map(T::from_f64), "");
        take.array("sine", SINE.map(T::from_f64), "");
        take.array("settling_s", SETTLING_S.map(T::from_f64), "");
        take.array("min_block_s", MIN_BLOCK_S.map(T::from_f64), "");
        take.number("max_block_s", T::from_f64(MAX_BLOCKS * MIN_BLOCK_S[1]), "");
        take.number("min_samples", T::from_f64(MIN_SAMPLES), "");
        take.number("smoothing", T::from_f64(SMOOTHING), "");
        take.number("fade_weight", T::from_f64(FADE_WEIGHT), "");
        take.number("same_period", T::from_f64(SAME_PERIOD), "");
        take.number("faded_out", T::from_f64(FADED_OUT), "");
        take.number("turn", T::from_f64(TAU), "2 pi");
    }
}
