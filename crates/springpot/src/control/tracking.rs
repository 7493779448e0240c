//! Tracking: feedforward with a sensor. The observer's disturbance is subtracted from the command.

use crate::actuator::{Actuator, Load};
use crate::control::adaptation::{Adaptation, AdaptationState};
use crate::control::adapted::{Adapted, Adapting};
use crate::control::fade::{Fade, FadeState};
use crate::control::inverse::{Applied, Inverse, InverseState, VoltageCommand};
use crate::control::limits::{CommandLimits, Limited};
use crate::control::observer::{Observer, ObserverState, SensorSample};
use crate::control::observer_options::ObserverOptions;
use crate::error::ControlError;
use crate::law::{Compressed, Law, LawState, Memory, state_traits};
use crate::numbers::Numbers;
use crate::scalar::{Real, Scalar};

/// Compensation with a sensor: [`Feedforward`](crate::Feedforward) from the [`Observer`]'s estimate of the film, with its
/// disturbance subtracted.
///
/// In every tick: [`observe`](Self::observe) the applied voltage and the sample that has arrived, if one has; then
/// [`command`](Self::command). One law is stepped once a tick.
///
/// With Q the low-pass of the observer, a film whose response is 1 + Δ times the model's follows its reference with the error (1 − Q) Δ /
/// (1 + Q Δ): below the bandwidth the model's error is compensated, above it the feedforward acts alone. For references near the bandwidth
/// and above, the phase of Q would amplify that error. So their frequency is measured, and above 0.6 bandwidths less of the correction is
/// used: a thirtieth from 0.85 bandwidths on, which corrects their mean. Steps, ramps and slow cycles use all of it.
///
/// While the sensor is lost the feedforward acts alone as well, with the disturbance and force scale learned so far. Changes of the film
/// beyond the force scale are compensated if the state [learns](Adapting) them.
///
/// The [crate page](crate#follower) has a program that steps it through a [`Follower`](crate::Follower).
#[derive(Clone, Debug, PartialEq)]
pub struct Tracking<T: Scalar, M: Memory<T> = crate::Compressed<T>, const PAST: usize = 64> {
    observer: Observer<T, M, PAST>,
    inverse: Inverse<T>,
    fade: Fade<T>,
    adaptation: Adaptation<T>,
}

/// State of a [`Tracking`]: changes with every tick.
pub struct TrackingState<T: Scalar, M: Memory<T> = crate::Compressed<T>, const PAST: usize = 64> {
    observer: ObserverState<T, M, PAST>,
    inverse: InverseState<T>,
    fade: FadeState<T>,
    /// The share of the correction that is left to the observer where cycles are learned.
    most: T,
    /// Limits that the last command met.
    limited: Limited,
    adaptation: AdaptationState<T, M::PerMode>,
}

state_traits!(TrackingState<T, M, PAST> { observer, inverse, fade, most, limited, adaptation });

/// Share of the static stroke at the largest voltage by which a reference must move so that its frequency counts.
const MIN_SHARE: f64 = 2e-3;

impl<T: Real, M: Memory<T>> Tracking<T, M> {
    /// Tracking for `actuator` along `law` within `limits`, with an observer of these `options` that remembers 64 ticks.
    ///
    /// # Errors
    ///
    /// As [`Feedforward::new`](crate::Feedforward::new) and [`Observer::new`].
    pub fn new(
        law: Law<T, M>,
        actuator: &Actuator,
        limits: CommandLimits,
        options: ObserverOptions,
    ) -> Result<Self, ControlError> {
        Self::with_past(law, actuator, limits, options)
    }
}

impl<T: Real, M: Memory<T>, const PAST: usize> Tracking<T, M, PAST> {
    /// As [`new`](Self::new), with an observer that remembers `PAST` ticks.
    ///
    /// # Errors
    ///
    /// As [`Feedforward::new`](crate::Feedforward::new) and [`Observer::new`].
    pub fn with_past(
        law: Law<T, M>,
        actuator: &Actuator,
        limits: CommandLimits,
        options: ObserverOptions,
    ) -> Result<Self, ControlError> {
        let inverse = Inverse::new(actuator, &limits, law.step_s(), law.max_stiffness())?;
        let stroke_m = actuator.electrostatic_force(limits.max_voltage_v) / law.stiffness_at_rest();
        let interval_s = options.sample_interval_s.max(law.step_s());
        let fade = Fade::new(options.bandwidth_hz, interval_s, MIN_SHARE * stroke_m);
        let stiffness = law.dynamic_stiffness(options.bandwidth_hz, law.tangent_at_rest()).re;
        let memory = if law.is_curved() { law.memory_stiffness(options.bandwidth_hz) } else { stiffness };
        let largest_n = actuator.electrostatic_force(limits.max_voltage_v);
        let adaptation = Adaptation::new(&law, largest_n, [stiffness, memory], &options);
        let observer = Observer::with_past(law, actuator, limits.max_voltage_v, options)?;
        Ok(Self { observer, inverse, fade, adaptation })
    }

    /// A state at 0 V with this `film`, a state of the same law; the reference begins at its displacement.
    #[must_use]
    pub fn state(&self, film: LawState<T, M>) -> TrackingState<T, M, PAST> {
        let inverse = InverseState::at(film.position());
        let fade = FadeState::at(film.position());
        TrackingState {
            observer: self.observer.state(film),
            inverse,
            fade,
            most: T::from_f64(1.0),
            limited: Limited::NONE,
            adaptation: AdaptationState::as_fitted::<M>(),
        }
    }

    /// Steps the film under the voltage that was really applied since the last tick and corrects it with a `sample`, if one
    /// has arrived. Returns the estimated displacement (m).
    #[inline]
    pub fn observe(
        &self,
        state: &mut TrackingState<T, M, PAST>,
        applied: Applied<T>,
        sample: Option<SensorSample<T>>,
    ) -> T {
        let voltage = self.inverse.record(&mut state.inverse, applied);
        if sample.is_some() {
            self.fade.advance(&mut state.fade, state.inverse.path.position, state.most);
            self.observer.set_share(&mut state.observer, state.fade.share());
        }
        let load = self.observer.drive().load(voltage);
        if state.adaptation.is_in_use() {
            return self.observe_change(state, load, sample);
        }
        self.observer.step(&mut state.observer, load, sample)
    }

    /// Steps a film that changes, and its adaptation.
    #[inline(never)] // for films that change
    fn observe_change(
        &self,
        state: &mut TrackingState<T, M, PAST>,
        load: Load<T>,
        sample: Option<SensorSample<T>>,
    ) -> T {
        state.observer.keep_force_scale();
        let position = self.observer.step(&mut state.observer, load, sample);
        // Shaping changes the reference, not the command.
        let shaping = Limited::VELOCITY | Limited::ACCELERATION;
        let is_limited = state.limited | shaping != shaping;
        self.adaptation.advance(&mut state.adaptation, &self.observer, &mut state.observer, is_limited);
        position
    }

    /// The voltage that takes the film to `reference` (m) at the end of this tick, as far as the limits allow. A non-finite
    /// reference is ignored: the last one stays.
    // Not inlined, as `Observer::observe`.
    #[inline(never)]
    pub fn command(&self, state: &mut TrackingState<T, M, PAST>, reference: T) -> VoltageCommand<T> {
        let correction = state.observer.correction();
        let TrackingState { observer, inverse, .. } = state;
        let (law, drive) = (self.observer.law(), self.observer.drive());
        let command = self.inverse.command(law, drive, &observer.film, inverse, reference, correction);
        state.limited = command.limited;
        command
    }

    /// The observer.
    #[must_use]
    pub fn observer(&self) -> &Observer<T, M, PAST> {
        &self.observer
    }
}

impl<T: Real, const HEAD: usize, const FAST: usize, const SLOW: usize, const PAST: usize>
    Tracking<T, Compressed<T, HEAD, FAST, SLOW>, PAST>
{
    /// Visits the constants of a tick. A [`Feedforward`](crate::Feedforward) of the same law, actuator and limits computes with the same
    /// law, drive and inverse.
    #[doc(hidden)]
    pub fn numbers(&self, take: &mut impl Numbers<T>) {
        self.observer.law().numbers(take);
        self.observer.drive().numbers(take);
        self.inverse.numbers(take);
        self.observer.own_numbers(take);
        self.fade.numbers(take);
    }

    /// Visits the further constants of a tick with adaptation.
    #[doc(hidden)]
    pub fn numbers_of_changes(&self, take: &mut impl Numbers<T>) {
        self.adaptation.numbers(take);
    }
}

impl<T: Real, M: Memory<T>, const PAST: usize> TrackingState<T, M, PAST> {
    /// The observer's state.
    #[must_use]
    pub fn observer(&self) -> &ObserverState<T, M, PAST> {
        &self.observer
    }

    /// Uses all of the correction until the reference has moved again: for a voltage that does not follow the sensor.
    pub(crate) fn correct_fully(&mut self) {
        self.fade = FadeState::at(self.inverse.path.position);
    }

    /// Leaves the errors of cycles to a [`Learning`](crate::Learning) from now on, by the share that it has taken over.
    pub(crate) fn leave_cycles(&mut self, taken_over: T) {
        self.most = T::from_f64(1.0) - taken_over;
    }

    /// Resets disturbance, force scale and learned changes at once: the model as it was fitted. [Learning](Adapting::Learn) continues.
    pub fn forget(&mut self) {
        self.observer.forget();
        self.adaptation.reset::<M>();
    }

    /// How the law adapts to a film that changes: [off](Adapting::Off) at first.
    #[must_use]
    pub fn adapting(&self) -> Adapting {
        self.adaptation.adapting()
    }

    /// Whether the law differs from the fitted one or may come to differ, by learned changes or a temperature.
    #[must_use]
    #[inline]
    pub fn is_adapted(&self) -> bool {
        self.adaptation.is_in_use()
    }

    /// Whether learned changes are in use or come into use.
    #[must_use]
    pub fn has_learned(&self) -> bool {
        self.adaptation.has_learned()
    }

    /// Whether the law is in use as it was fitted, without learned changes and at its own temperature.
    #[must_use]
    pub fn is_as_fitted(&self) -> bool {
        self.adaptation.is_as_fitted()
    }

    /// Sets how the law adapts to a film that changes.
    pub fn set_adapting(&mut self, adapting: Adapting) {
        self.adaptation.set_adapting::<M>(adapting);
    }

    /// The learned changes of the film.
    #[must_use]
    pub fn adapted(&self) -> Adapted<T> {
        self.adaptation.adapted(self.observer.force_scale())
    }

    /// Uses changes that were learned before, such as before a restart, and [holds](Adapting::Hold) them. Call it for a film at rest.
    ///
    /// # Errors
    ///
    /// As [`Adapted::check`], for a bias that is not finite; then nothing changes.
    pub fn restore(&mut self, adapted: &Adapted<T>) -> Result<(), ControlError> {
        adapted.check(f64::MAX)?;
        self.adaptation.restore::<M>(adapted);
        Ok(())
    }

    /// Sets the factors of stiffness and relaxation times at the film's temperature
    /// ([`TemperatureDependence`](crate::TemperatureDependence)). They come into use with a time constant of a second, with or without a
    /// sensor; learned changes are relative to them. A law that does not [learn](Adapting::Learn) is [held](Adapting::Hold) from now on,
    /// and the observer's own force scale no longer adapts; [off](Adapting::Off) resets the temperature.
    ///
    /// Modes faster than 2/s keep their rates, as with learned changes.
    ///
    /// # Errors
    ///
    /// [`ControlError::OutOfRange`] for a stiffness beyond 0.25 to 4, and times beyond a third to three times; then nothing changes.
    pub fn set_temperature_factors(&mut self, stiffness: T, time: T) -> Result<(), ControlError> {
        self.adaptation.set_temperature_factors::<M>([stiffness, time])
    }

    /// The [factors](Self::set_temperature_factors) of stiffness and times, within 1e-4; 1 if none were set.
    #[must_use]
    pub fn temperature_factors(&self) -> [T; 2] {
        self.adaptation.temperature_factors()
    }

    /// [`Adapted::ageing`].
    #[must_use]
    #[inline]
    pub fn ageing(&self) -> T {
        self.adaptation.ageing()
    }

    /// Relative change of the film's stiffness if nothing else has changed: 0.02 for 2 % stiffer. 0 below 1.25 % and within three
    /// [uncertainties](Adapted::uncertainty). Any other change shows as the stiffness that explains it best.
    #[must_use]
    pub fn stiffness_change(&self) -> T {
        self.adaptation.stiffness_change()
    }

    /// Discards learned changes, which go out of use within some seconds. Learning continues.
    pub fn forget_changes(&mut self) {
        self.adaptation.forget();
    }

    /// Estimated voltage on the film, V: behind the amplifier's gain and lag.
    #[must_use]
    pub fn film_voltage(&self) -> T {
        self.inverse.film_voltage()
    }

    /// Whether the amplifier's gain is within its bounds: a bit that flips in memory may leave it elsewhere.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.inverse.is_sound()
    }

    /// [`film_voltage`](Self::film_voltage) without the gain that the amplifier's monitor has shown, V.
    #[must_use]
    pub fn followed_voltage(&self) -> T {
        self.inverse.followed_voltage()
    }

    /// The shaped reference, m.
    #[must_use]
    pub fn reference(&self) -> T {
        self.inverse.path.position
    }
}
