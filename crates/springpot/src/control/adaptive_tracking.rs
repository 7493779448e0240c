//! Tracking of a film that changes.

use crate::actuator::Actuator;
use crate::control::adaptation::{Adaptation, AdaptationState};
use crate::control::follower::sealed::Compensates;
use crate::control::inverse::{Applied, VoltageCommand};
use crate::control::limits::{CommandLimits, Limited};
use crate::control::observer::SensorSample;
use crate::control::observer_options::ObserverOptions;
use crate::control::tracking::{Tracking, TrackingState};
use crate::error::ControlError;
use crate::law::{Law, LawState, Memory, state_traits};
use crate::scalar::{Real, Scalar};

/// [`Tracking`] of a film that is no longer the one its law was fitted to: warmer, older, under another weight.
///
/// While a sensor shows the film, the law follows it, and without the sensor feedforward goes on with the law as it is then. In
///
/// ```text
/// κ F + d = m ẍ + E(x) + σ T'(x) M[T(x)],      M: what relaxes of the memory, E: what does not
/// ```
///
/// these are estimated, in terms of forces that the states of the law already have:
///
/// | parameter | meaning | bounds |
/// | --- | --- | --- |
/// | κ | [force scale](crate::ObserverState::force_scale): below 1 for a stiffer film | 0.25 to 4 |
/// | σ | stiffness of what relaxes, where at least a tenth does not: a film under another weight, or of another stiffness, has another share | 0.5 to 2 |
/// | φ | factor of all relaxation rates: temperature | 1/3 to 3 |
/// | η | a rate r becomes r^(1 + η) (1/s): the orders of springpots become α / (1 + η) | ±0.25 |
/// | d | a constant force, which is what stays of the disturbance without a sensor | |
///
/// # How
///
/// Modes of a [`Compressed`](crate::Compressed) memory are springs with dashpots. With changed rates the dashpots flow more, or less, in addition; the
/// springs keep their stiffness, and every rate stays positive. Modes faster than 2/s stay as fitted. For each mode a derivative of its extension
/// y by the logarithm of its rate r is carried along, dy'/dt = −r (y + y'). It is the regressor of φ and η, and when they change it moves the
/// extensions to where they would be if the rates had always been so. Once in some thirty ticks recursive least squares, in Bierman's factors of the covariance,
/// compare the regressors with the observer's disturbance. What is learned comes into use with a time constant of a second, without a step
/// of the force.
///
/// Nothing is learned while the sensor is lost, while limits are met, and while the observer leaves the reference to learned cycles or to feedforward, because it is fast. A
/// difference of many times what is expected counts little. What was learned counts less with time only while the load moves.
///
/// **A sensor that reads with another gain shows a film of another stiffness**: nothing distinguishes them, and the adapted law is as wrong as the
/// sensor.
///
/// ```
/// use springpot::{
///     Actuator, AdaptiveTracking, Applied, CommandLimits, Law, LawOptions, ObserverOptions, Preset, SensorSample, VoltageDrive,
/// };
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model()?, LawOptions::at_step(1e-3))?;
/// let (actuator, limits) = (Actuator::KARNER_2022, CommandLimits::BENCH);
/// let tracking = AdaptiveTracking::new(law.clone(), &actuator, limits, ObserverOptions::at_bandwidth(0.5))?;
/// let drive = VoltageDrive::new(&actuator, limits.max_voltage_v, law.stiffness())?;
///
/// // A film that has become 10 % softer, with a sensor for the first 30 s.
/// let (mut film, mut state, mut voltage_v) = (law.state(), tracking.state(law.state()), 0.0);
/// for tick in 0..60_000_u16 {
///     let mut load = drive.load(voltage_v);
///     load.force_n *= 1.1;
///     let displacement_m = law.displacement_under(&mut film, load);
///     let sample = (tick % 10 == 0 && tick < 30_000).then_some(SensorSample { displacement_m, age_ticks: 0 });
///     tracking.observe(&mut state, Applied::as_commanded(voltage_v), sample);
///     let reference_m = 1e-3 - 0.2e-3 * (core::f32::consts::TAU * f32::from(tick % 10_000) / 10_000.0).cos();
///     voltage_v = tracking.command(&mut state, reference_m).voltage_v;
///     assert!(tick < 30_000 || (displacement_m - reference_m).abs() < 2e-6);
/// }
/// assert!((state.adapted().force_scale / 1.1 - 1.0).abs() < 0.01);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct AdaptiveTracking<T: Scalar, M: Memory<T> = crate::Compressed<T>, const PAST: usize = 64> {
    tracking: Tracking<T, M, PAST>,
    adaptation: Adaptation<T, M::PerMode>,
}

/// State of an [`AdaptiveTracking`]: changes with every tick.
pub struct AdaptiveTrackingState<T: Scalar, M: Memory<T> = crate::Compressed<T>, const PAST: usize = 64> {
    tracking: TrackingState<T, M, PAST>,
    adaptation: AdaptationState<T, M::PerMode>,
}

state_traits!(AdaptiveTrackingState<T, M, PAST> { tracking, adaptation });

/// How a film differs from its law, as far as it is in use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapted<T> {
    /// Effect of the electrostatic force over the model's, κ: below 1 for a film that has become stiffer.
    pub force_scale: T,
    /// Standard deviation of the force scale, over it, if nothing but what is estimated differs.
    pub uncertainty: T,
    /// Logarithm of what relaxes over what the law has, ln σ.
    pub memory: T,
    /// Logarithm of the factor of the relaxation rates, ln φ.
    pub rate: T,
    /// η: orders of springpots are those of the law over 1 + η.
    pub stretch: T,
    /// The constant force d that is kept without a sensor, N.
    pub bias_n: T,
    /// How far the film has moved from its law: 1 for a tenth of force scale, a quarter of memory, half of a rate, or a twentieth of an order,
    /// whichever is largest in these units. Fit again from 1 on.
    pub ageing: T,
}

impl<T: Real, M: Memory<T>> AdaptiveTracking<T, M> {
    /// As [`Tracking::new`]. What was learned counts less after two to four times `adaptation_s`.
    ///
    /// # Errors
    ///
    /// As [`Tracking::new`], and [`ControlError::NotPositive`] for an `adaptation_s` of 0.
    pub fn new(
        law: Law<T, M>,
        actuator: &Actuator,
        limits: CommandLimits,
        options: ObserverOptions,
    ) -> Result<Self, ControlError> {
        Self::with_past(law, actuator, limits, options)
    }
}

impl<T: Real, M: Memory<T>, const PAST: usize> AdaptiveTracking<T, M, PAST> {
    /// As [`new`](Self::new), with an observer that remembers `PAST` ticks.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn with_past(
        law: Law<T, M>,
        actuator: &Actuator,
        limits: CommandLimits,
        options: ObserverOptions,
    ) -> Result<Self, ControlError> {
        let adaptation_s = options.adaptation_s;
        if adaptation_s.is_nan() || adaptation_s <= 0.0 {
            return Err(ControlError::NotPositive { quantity: "adaptation_s", value: adaptation_s });
        }
        let largest_n = actuator.electrostatic_force(limits.max_voltage_v);
        let tracking = Tracking::with_past(law, actuator, limits, ObserverOptions { adaptation_s: 0.0, ..options })?;
        let adaptation = Adaptation::new(tracking.observer(), largest_n, &options);
        Ok(Self { tracking, adaptation })
    }

    /// A state that begins with `film`, at 0 V; the reference begins where the film is.
    #[must_use]
    pub fn state(&self, film: LawState<T, M>) -> AdaptiveTrackingState<T, M, PAST> {
        AdaptiveTrackingState { tracking: self.tracking.state(film), adaptation: AdaptationState::as_fitted::<M>() }
    }

    /// As [`Tracking::observe`].
    #[inline]
    pub fn observe(
        &self,
        state: &mut AdaptiveTrackingState<T, M, PAST>,
        applied: Applied<T>,
        sample: Option<SensorSample<T>>,
    ) -> T {
        let position = self.tracking.observe(&mut state.tracking, applied, sample);
        self.adaptation.advance(&mut state.adaptation, self.tracking.observer(), state.tracking.observer_mut());
        position
    }

    /// As [`Tracking::command`].
    #[inline]
    pub fn command(&self, state: &mut AdaptiveTrackingState<T, M, PAST>, reference: T) -> VoltageCommand<T> {
        let command = self.tracking.command(&mut state.tracking, reference);
        // Shaping changes the reference, not the command.
        let shaping = Limited::VELOCITY | Limited::ACCELERATION;
        state.adaptation.is_limited = command.limited | shaping != shaping;
        command
    }

    /// The tracking along the law as it was fitted.
    #[must_use]
    pub fn tracking(&self) -> &Tracking<T, M, PAST> {
        &self.tracking
    }
}

impl<T: Real, M: Memory<T>, const PAST: usize> AdaptiveTrackingState<T, M, PAST> {
    /// The state of the tracking.
    #[must_use]
    pub fn tracking(&self) -> &TrackingState<T, M, PAST> {
        &self.tracking
    }

    /// How the film differs from its law.
    #[must_use]
    pub fn adapted(&self) -> Adapted<T> {
        let [_, memory, rate, stretch, bias_n] = self.adaptation.used();
        Adapted {
            force_scale: self.tracking.observer().force_scale(),
            uncertainty: self.adaptation.uncertainty(),
            memory,
            rate,
            stretch,
            bias_n,
            ageing: self.adaptation.ageing(),
        }
    }

    /// Switches learning on (the default) or off: then what was learned stays in use.
    pub fn set_learning(&mut self, is_on: bool) {
        self.adaptation.set_learning(is_on);
    }

    /// Forgets what was learned: the law as it was fitted comes back into use, within some seconds.
    pub fn forget(&mut self) {
        self.adaptation.forget();
    }
}

impl<T: Real, M: Memory<T>, const PAST: usize> Compensates<T> for AdaptiveTracking<T, M, PAST> {
    type Film = LawState<T, M>;
    type State = AdaptiveTrackingState<T, M, PAST>;

    fn state(&self, film: Self::Film) -> Self::State {
        self.state(film)
    }

    #[inline]
    fn observe(&self, state: &mut Self::State, applied: Applied<T>, sample: Option<SensorSample<T>>) -> T {
        self.observe(state, applied, sample)
    }

    #[inline]
    fn command(&self, state: &mut Self::State, reference: T) -> VoltageCommand<T> {
        self.command(state, reference)
    }

    #[inline]
    fn displacement(state: &Self::State) -> T {
        state.tracking.observer().displacement()
    }

    #[inline]
    fn correct_fully(state: &mut Self::State) {
        state.tracking.correct_fully();
    }

    #[inline]
    fn leave_cycles(state: &mut Self::State, taken_over: T) {
        state.tracking.leave_cycles(taken_over);
    }

    fn forget(state: &mut Self::State) {
        state.forget();
    }
}
