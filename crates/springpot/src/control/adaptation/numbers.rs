//! The constants that the adaptation computes with.

use super::power_series::{EXPONENTIAL, LOGARITHM};
use super::{
    AGED, AVERAGING_S, Adaptation, BIAS, BLEND_S, BY_CHANCE, DESCRIBED, EXCITED, EXPECTED, FORGETTING, FORGOTTEN,
    MIN_CHANGE, PLAUSIBLE, RELINEARISING, WANDERED,
};
use crate::control::adapted::{BOUNDS, ROUNDED};
use crate::numbers::{Numbers, Record};
use crate::scalar::Real;

impl<T: Real> Adaptation<T> {
    /// Visits its constants.
    pub(in crate::control) fn numbers(&self, take: &mut impl Numbers<T>) {
        take.structure("adaptation", "How a film that changes is followed.");
        take.count("first", u32::from(self.first), "the first mode that follows");
        take.count("count", u32::from(self.count), "modes that follow");
        for (name, value, about) in [
            ("step", self.step, "s"),
            ("lasting", self.lasting, "stiffness of what does not relax, N/m"),
            ("relaxing", self.relaxing, "within one step, N/m"),
            ("share", self.share, "of what relaxes in the stiffness"),
            ("stiffness", self.stiffness, "at the observer's bandwidth, N/m"),
            ("ticks", self.ticks, "of a round"),
            ("blend", self.blend, "share of an estimate that comes into use in a round"),
            (
                "averaging",
                T::from_f64(BLEND_S / AVERAGING_S) * self.blend,
                "of the bias, while the load stays, and of the misfit",
            ),
            ("precision", self.precision, "1/N"),
            (
                "excited",
                T::from_f64(EXCITED) * self.largest,
                "N: smallest swing of the load that distinguishes parameters",
            ),
            ("plausible", T::from_f64(PLAUSIBLE), ""),
            ("described", T::from_f64(DESCRIBED), "share of a bound beyond which no values describe a film"),
            (
                "wandering",
                T::from_f64(WANDERED) * self.forgetting,
                "growth of the variance of the force scale in a round",
            ),
            ("by_chance", T::from_f64(BY_CHANCE), "standard deviations by which an estimate differs from its law"),
            ("min_change", T::from_f64(MIN_CHANGE), "of the stiffness that is reported"),
            ("forgotten", T::from_f64(FORGOTTEN), "share of what is expected that is out of use"),
        ] {
            take.number(name, value, about);
        }
        take.array("logarithm", LOGARITHM.map(T::from_f64), "");
        take.array("exponential", EXPONENTIAL.map(T::from_f64), "");
        let parameter = Record {
            name: "parameter",
            about: "How a film may differ from its law: force scale, memory, rate, stretch, then the bias in N.",
            fields: [
                ("expected", "standard deviation before a sensor has shown anything"),
                ("bound", ""),
                ("restored", "bound of what was learned before"),
                ("forgetting", "growth of its variance in a round, over it"),
                ("relinearising", "the same for a change of rate or stretch"),
                ("aged", "1 over the change at which the film has aged by 1; 0: none does"),
            ],
        };
        let mut restored = BOUNDS.map(|bound| bound * ROUNDED);
        restored[BIAS] = f64::INFINITY;
        let [scale, memory, rate, stretch] = AGED.map(|aged| T::from_f64(1.0 / aged));
        let rows = self
            .sized(EXPECTED)
            .into_iter()
            .zip(self.sized(BOUNDS))
            .zip(restored.map(T::from_f64))
            .zip(FORGETTING.map(|rate| self.forgetting * T::from_f64(rate)))
            .zip(RELINEARISING.map(T::from_f64))
            .zip([scale, memory, rate, stretch, T::ZERO])
            .map(|(((((expected, bound), restored), forgetting), relinearising), aged)| {
                [expected, bound, restored, forgetting, relinearising, aged]
            });
        take.records("parameters", &parameter, rows, "");
    }
}
