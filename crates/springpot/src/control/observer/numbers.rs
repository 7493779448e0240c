//! The constants that an observer computes with.

use super::{EXCITED, FORCE_SCALE_RANGE, FULL_SHARE, Gains, Observer, STATISTICS_SAMPLES};
use crate::law::Memory;
use crate::numbers::{Numbers, Record};
use crate::scalar::Real;

impl<T: Real, M: Memory<T>, const PAST: usize> Observer<T, M, PAST> {
    /// Visits its constants besides those of law and drive.
    pub(in crate::control) fn own_numbers(&self, take: &mut impl Numbers<T>) {
        take.structure("observer", "The observer.");
        let gains = Record {
            name: "gains",
            about: "Gains of the observer on an innovation.",
            fields: [("proportional", "N/m"), ("integral", "N/m in a tick"), ("slope", "N/m in a tick, squared")],
        };
        let Gains { proportional, integral, slope } = self.gains;
        take.records("gains", &gains, [[proportional, integral, slope]], "");
        take.count("lost_after", self.lost_after, "ticks without a sample after which the sensor counts as lost");
        take.number("smoothing", self.smoothing, "");
        take.number("recovery", self.recovery, "");
        take.number("averaging", self.averaging, "");
        take.number("forgetting", self.forgetting, "");
        take.number("forgetting_slope", self.forgetting_slope, "");
        take.number("adapting", self.adapting, "1: the force scale adapts; 0: it stays 1");
        take.number("regularisation", self.regularisation, "N^2");
        take.number(
            "excited",
            T::from_f64(EXCITED) * self.max_disturbance,
            "N: smallest swing of the load that teaches the force scale",
        );
        take.number("max_disturbance", self.max_disturbance, "N");
        take.number("max_slope", self.max_slope, "N in a tick");
        take.number("max_innovation", self.max_innovation, "m");
        take.number("statistics", T::from_f64(1.0 / STATISTICS_SAMPLES), "weight of a sample in the statistics");
        take.number("full_share", T::from_f64(FULL_SHARE), "of the correction, above which the force scale adapts");
        take.array("scales", FORCE_SCALE_RANGE.map(T::from_f64), "bounds of the force scale");
    }
}
