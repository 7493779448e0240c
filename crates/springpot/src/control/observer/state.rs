//! The estimates of an observer, and changes of them between ticks.

use super::{FULL_SHARE, Observer, ObserverState, SensorSample};
use crate::actuator::{Load, VoltageDrive};
use crate::control::inverse::Correction;
use crate::control::statistics::Statistics;
use crate::law::{LawState, Memory};
use crate::scalar::Real;

impl<T: Real, M: Memory<T>, const PAST: usize> ObserverState<T, M, PAST> {
    #[inline]
    pub(super) fn remember(&mut self, position: T) {
        self.newest = if self.newest == 0 { PAST.saturating_sub(1) } else { self.newest - 1 };
        if let Some(slot) = self.past.get_mut(self.newest) {
            *slot = position;
        }
    }

    /// A sample minus the prediction for its time; `None` for a sample that is too old.
    #[inline]
    pub(super) fn innovation_of(&self, sample: SensorSample<T>) -> Option<T> {
        if sample.age_ticks >= PAST {
            return None;
        }
        let index = self.newest + sample.age_ticks;
        let index = if index >= PAST { index - PAST } else { index };
        self.past.get(index).map(|&predicted| sample.displacement_m - predicted)
    }

    /// Resets disturbance and force scale to 0 and 1; film, innovation and statistics stay.
    pub(crate) fn forget(&mut self) {
        self.integral = T::ZERO;
        self.slope = T::ZERO;
        self.proportional = T::ZERO;
        self.disturbance = T::ZERO;
        self.force_scale = T::from_f64(1.0);
        self.integral_mean = T::ZERO;
        self.load_mean = T::ZERO;
        self.excitation = T::ZERO;
    }

    /// The estimated displacement, m.
    #[must_use]
    pub fn displacement(&self) -> T {
        self.film.position()
    }

    /// The force on the film that the model does not explain, N, apart from the force scale.
    #[must_use]
    #[inline]
    pub fn disturbance(&self) -> T {
        self.disturbance
    }

    /// Effect of the electrostatic force over the model's: below 1 for a film that has become stiffer.
    #[must_use]
    pub fn force_scale(&self) -> T {
        self.force_scale
    }

    /// The last innovation, m: a sample minus its prediction.
    #[must_use]
    pub fn innovation(&self) -> T {
        self.innovation
    }

    /// Statistics of the innovation (m, m²) over the last few hundred samples.
    #[must_use]
    pub fn statistics(&self) -> Statistics<T> {
        self.statistics
    }

    /// Ticks since the last sample arrived.
    #[must_use]
    pub fn ticks_since_sample(&self) -> u32 {
        self.since_sample
    }

    /// The load of the voltage that acted in the last tick, weight included: the model's, without force scale and disturbance.
    #[must_use]
    pub fn load(&self) -> Load<T> {
        self.load
    }

    /// Returns the state of the law.
    #[must_use]
    pub fn film(&self) -> &LawState<T, M> {
        &self.film
    }

    /// Share of the correction that is in use: below 1 in [`Tracking`](crate::Tracking) of references that are faster than the bandwidth.
    #[must_use]
    pub fn share(&self) -> T {
        self.share
    }

    /// The electrostatic force as scaled, N.
    pub(crate) fn scaled_load(&self, drive: &VoltageDrive<T>) -> T {
        let Load { force_n, slope_n_per_m } = self.load;
        self.force_scale * ((force_n - drive.preload()) + slope_n_per_m * self.film.position())
    }

    /// How far a `load` (N) is from its slow mean, N.
    pub(crate) fn load_swing(&self, load: T) -> T {
        (load - self.load_mean).abs()
    }

    /// The force that a model of this `stiffness` (N/m) lacks, N: the disturbance, and the part that the last innovation still needs.
    pub(crate) fn unexplained(&self, stiffness: T) -> T {
        self.disturbance + stiffness * self.film.slope() * self.innovation
    }

    /// Whether a sensor corrects the film, with all of the correction in use.
    pub(crate) fn is_corrected(&self, observer: &Observer<T, M, PAST>) -> bool {
        self.since_sample <= observer.lost_after && self.share > T::from_f64(FULL_SHARE)
    }

    /// Sets the force scale to `scale`. The disturbance becomes less by `shift` (N), which is now in the model, and returns to `kept` (N)
    /// without a sensor.
    pub(crate) fn adapt_to(&mut self, scale: T, shift: T, kept: T) {
        self.force_scale = scale;
        self.integral = self.integral - shift;
        self.disturbance = self.disturbance - shift;
        self.integral_mean = kept;
    }

    /// Until the next sample the force scale stays: something else adapts it.
    #[inline]
    pub(crate) fn keep_force_scale(&mut self) {
        self.adapting = T::ZERO;
    }

    pub(crate) fn correction(&self) -> Correction<T> {
        Correction { disturbance: self.disturbance(), force_scale: self.force_scale }
    }
}
