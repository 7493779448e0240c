//! The composed control law: follows a reference, with or without a sensor, and learns its cycles.

use crate::control::adapted::{Adapted, Adapting};
use crate::control::feedforward::{Feedforward, FeedforwardState};
use crate::control::inverse::{Applied, VoltageCommand};
use crate::control::learning::{Learning, LearningState};
use crate::control::limits::Limited;
use crate::control::observer::{ObserverState, SensorSample};
use crate::control::tracking::{Tracking, TrackingState};
use crate::error::ControlError;
use crate::law::{LawState, Memory};
use crate::scalar::{Real, Scalar};

/// A control law that a [`Follower`] composes: [`Tracking`], or [`Feedforward`] where no sensor corrects it.
///
/// The trait is sealed. Use it as a bound to write code for both.
pub trait Compensator<T: Real>: sealed::Compensates<T> {}

impl<T: Real, C: sealed::Compensates<T>> Compensator<T> for C {}

pub(crate) mod sealed {
    use super::{Applied, SensorSample, VoltageCommand};

    /// The two phases of a tick, and what a follower needs beside them.
    pub trait Compensates<T> {
        type Film;
        type State;

        fn state(&self, film: Self::Film) -> Self::State;

        fn observe(&self, state: &mut Self::State, applied: Applied<T>, sample: Option<SensorSample<T>>) -> T;

        fn command(&self, state: &mut Self::State, reference: T) -> VoltageCommand<T>;

        /// The estimated displacement, m.
        fn displacement(state: &Self::State) -> T;

        /// All of the sensor's correction is in use until the reference has moved again.
        fn correct_fully(state: &mut Self::State);

        /// From now on the sensor's correction leaves the errors of cycles to learning, by the share (0 to 1) that it has taken over.
        fn leave_cycles(state: &mut Self::State, taken_over: T);

        /// Resets what the sensor has shown of the film.
        fn forget(state: &mut Self::State);
    }
}

impl<T: Real, M: Memory<T>> sealed::Compensates<T> for Feedforward<T, M> {
    type Film = LawState<T, M>;
    type State = FeedforwardState<T, M>;

    fn state(&self, film: Self::Film) -> Self::State {
        self.state(film)
    }

    #[inline]
    fn observe(&self, state: &mut Self::State, applied: Applied<T>, _: Option<SensorSample<T>>) -> T {
        self.apply(state, applied)
    }

    #[inline]
    fn command(&self, state: &mut Self::State, reference: T) -> VoltageCommand<T> {
        self.command(state, reference)
    }

    fn displacement(state: &Self::State) -> T {
        state.displacement()
    }

    fn correct_fully(_: &mut Self::State) {}

    fn leave_cycles(_: &mut Self::State, _: T) {}

    fn forget(_: &mut Self::State) {}
}

impl<T: Real, M: Memory<T>, const PAST: usize> sealed::Compensates<T> for Tracking<T, M, PAST> {
    type Film = LawState<T, M>;
    type State = TrackingState<T, M, PAST>;

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
        state.observer().displacement()
    }

    #[inline]
    fn correct_fully(state: &mut Self::State) {
        state.correct_fully();
    }

    #[inline]
    fn leave_cycles(state: &mut Self::State, taken_over: T) {
        state.leave_cycles(taken_over);
    }

    fn forget(state: &mut Self::State) {
        state.forget();
    }
}

/// The composed control law: [`Tracking`] or [`Feedforward`], with [`Learning`] of periodic references in front where it is configured.
///
/// One call for each tick, [`step`](Self::step), or its two phases where a program acts between them, such as a supervisor with limits of
/// its own:
///
/// 1. [`observe`](Self::observe) takes the voltage that was applied since the last tick and the sample that has arrived, if one has. It
///    returns the estimated displacement.
/// 2. [`command`](Self::command) takes the reference for the end of this tick and returns the voltage. In a tick whose voltage something
///    else sets, call [`standby`](Self::standby) instead: the reference stays at the film's displacement, so that following begins without
///    a jump.
///
/// # Exactly
///
/// With learning configured, `command` computes in this order: a run that has not begun yet begins at this reference
/// ([`Learning::restart`]); [`Learning::advance`] with the limits that the last command of this run met; the sensor's correction leaves
/// cycles to learning by the share that learning has [taken over](LearningState::taken_over); the compensator's `command` for the reference that learning
/// returned. Without learning it is the compensator's `command`.
///
/// A state begins within a run, whose reference begins where the film is. [`standby`](Self::standby) and
/// [`end_run`](FollowerState::end_run) end a run; the next `command` begins one. Learned cycles begin anew with it, unless
/// [`carry_over`](FollowerState::carry_over) was called since the last one began.
///
/// [`set_feedback`](FollowerState::set_feedback) withholds the samples from the observer, and from it alone: feedforward and tracking can
/// be switched between two ticks.
///
/// ```
/// use springpot::{
///     Actuator, Applied, CommandLimits, Follower, Law, LawOptions, Learning, LearningOptions, ObserverOptions, Preset, SensorSample,
///     Tracking, VoltageDrive,
/// };
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model()?, LawOptions::at_step(1e-3))?;
/// let (actuator, limits) = (Actuator::KARNER_2022, CommandLimits::BENCH);
/// // The real film, which moves 5 % further than its law.
/// let (plant, mut film) = (law.clone(), law.state());
/// let drive = VoltageDrive::new(&actuator, limits.max_voltage_v, law.stiffness())?;
///
/// let cycles = LearningOptions { period_s: Some(1.0), ..LearningOptions::BENCH };
/// let learning = Learning::new(&law, &actuator, limits.max_voltage_v, cycles)?;
/// let tracking = Tracking::new(law, &actuator, limits, ObserverOptions::at_bandwidth(0.5))?;
/// let follower = Follower::new(tracking).with_learning(learning);
///
/// let mut state = follower.state(plant.state());
/// let (mut voltage_v, mut reference_m) = (0.0, 0.0_f32);
/// for tick in 0..40_000_u16 {
///     let displacement_m = 1.05 * plant.displacement_under(&mut film, drive.load(voltage_v));
///     assert!(tick < 30_000 || (displacement_m - reference_m).abs() < 1e-6);
///     // A sensor of 100 Hz.
///     let sample = (tick % 10 == 0).then_some(SensorSample { displacement_m, age_ticks: 0 });
///     let angle = core::f32::consts::TAU * f32::from(tick % 1000) / 1000.0;
///     reference_m = 1e-3 - 0.2e-3 * angle.cos();
///     voltage_v = follower.step(&mut state, Applied::as_commanded(voltage_v), sample, reference_m).voltage_v;
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Follower<T: Scalar, C = Tracking<T>, const PAST: usize = 64> {
    compensator: C,
    learning: Option<Learning<T, PAST>>,
}

/// State of a [`Follower`]: changes with every tick.
#[derive(Clone, Debug, PartialEq)]
pub struct FollowerState<T: Real, C: Compensator<T> = Tracking<T>, const PAST: usize = 64> {
    compensator: C::State,
    /// Whether samples reach the observer.
    has_feedback: bool,
    cycles: Option<Cycles<T, PAST>>,
}

/// Learned cycles, through runs.
#[derive(Clone, Debug, PartialEq)]
struct Cycles<T, const PAST: usize> {
    learned: LearningState<T, PAST>,
    /// Limits that the last command of this run met.
    limited: Limited,
    /// Whether this run has had a reference.
    has_begun: bool,
    /// Whether the next run begins with what was learned before it.
    carries_over: bool,
}

impl<T: Real, C: Compensator<T>> Follower<T, C> {
    /// A follower without learning of cycles.
    pub fn new(compensator: C) -> Self {
        Self { compensator, learning: None }
    }
}

impl<T: Real, C: Compensator<T>, const PAST: usize> Follower<T, C, PAST> {
    /// The same with `learning` in front: of the same law, actuator and largest voltage.
    #[must_use]
    pub fn with_learning<const TICKS: usize>(self, learning: Learning<T, TICKS>) -> Follower<T, C, TICKS> {
        Follower { compensator: self.compensator, learning: Some(learning) }
    }

    /// A state at 0 V with this `film`, a state of the same law; the reference begins at its displacement.
    #[must_use]
    pub fn state(&self, film: C::Film) -> FollowerState<T, C, PAST> {
        let compensator = self.compensator.state(film);
        let position = C::displacement(&compensator);
        let cycles = self.learning.as_ref().map(|learning| Cycles {
            learned: learning.state(position),
            limited: Limited::NONE,
            has_begun: true,
            carries_over: false,
        });
        FollowerState { compensator, has_feedback: true, cycles }
    }

    /// Both phases of a tick: [`observe`](Self::observe), then [`command`](Self::command).
    #[inline]
    pub fn step(
        &self,
        state: &mut FollowerState<T, C, PAST>,
        applied: Applied<T>,
        sample: Option<SensorSample<T>>,
        reference: T,
    ) -> VoltageCommand<T> {
        self.observe(state, applied, sample);
        self.command(state, reference)
    }

    /// First phase: steps the film under the voltage that was really applied since the last tick, 0 V before the first, and corrects it
    /// with a `sample`, if one has arrived. Returns the estimated displacement (m).
    #[inline]
    pub fn observe(
        &self,
        state: &mut FollowerState<T, C, PAST>,
        applied: Applied<T>,
        sample: Option<SensorSample<T>>,
    ) -> T {
        if let Some(cycles) = &mut state.cycles
            && let Some(sample) = sample
        {
            cycles.learned.observe(sample);
        }
        let fed_back = if state.has_feedback { sample } else { None };
        self.compensator.observe(&mut state.compensator, applied, fed_back)
    }

    /// Second phase: the voltage that takes the film to `reference` (m) at the end of this tick, as far as the limits allow. A non-finite
    /// reference is ignored: the last one stays.
    #[inline]
    pub fn command(&self, state: &mut FollowerState<T, C, PAST>, reference: T) -> VoltageCommand<T> {
        let FollowerState { compensator, cycles, .. } = state;
        let (Some(learning), Some(cycles)) = (&self.learning, cycles) else {
            return self.compensator.command(compensator, reference);
        };
        if !cycles.has_begun {
            cycles.begin(learning, reference);
        }
        let followed = learning.advance(&mut cycles.learned, reference, cycles.limited);
        C::leave_cycles(compensator, cycles.learned.taken_over());
        let command = self.compensator.command(compensator, followed);
        cycles.limited = command.limited;
        command
    }

    /// Second phase of a tick whose voltage something else sets: ends the run, and moves the reference to the film's displacement, with all
    /// of the sensor's correction in use. Returns the command that would hold the film there.
    // Not inlined: a tick that follows would pay for it.
    #[inline(never)]
    pub fn standby(&self, state: &mut FollowerState<T, C, PAST>) -> VoltageCommand<T> {
        state.end_run();
        C::correct_fully(&mut state.compensator);
        let position = C::displacement(&state.compensator);
        self.compensator.command(&mut state.compensator, position)
    }

    /// The control law that compensates creep.
    #[must_use]
    pub fn compensator(&self) -> &C {
        &self.compensator
    }

    /// Learning of cycles, if it is configured.
    #[must_use]
    pub fn learning(&self) -> Option<&Learning<T, PAST>> {
        self.learning.as_ref()
    }
}

impl<T: Real, const PAST: usize> Cycles<T, PAST> {
    /// Begins a run at `reference` (m). Not inlined: a tick would need the stack for it.
    #[inline(never)]
    fn begin(&mut self, learning: &Learning<T, PAST>, reference: T) {
        learning.restart(&mut self.learned, reference, self.carries_over);
        self.limited = Limited::NONE;
        self.has_begun = true;
        self.carries_over = false;
    }
}

impl<T: Real, C: Compensator<T>, const PAST: usize> FollowerState<T, C, PAST> {
    /// The estimated displacement, m.
    #[must_use]
    pub fn displacement(&self) -> T {
        C::displacement(&self.compensator)
    }

    /// The compensator's state.
    #[must_use]
    pub fn compensator(&self) -> &C::State {
        &self.compensator
    }

    /// Learned cycles, if learning is configured.
    #[must_use]
    pub fn learned(&self) -> Option<&LearningState<T, PAST>> {
        self.cycles.as_ref().map(|cycles| &cycles.learned)
    }

    /// The part of the followed reference that learned cycles add in this tick, m; 0 where nothing is learned.
    #[must_use]
    #[inline]
    pub fn added(&self) -> T {
        match &self.cycles {
            Some(cycles) if cycles.has_begun => cycles.learned.added(),
            _ => T::ZERO,
        }
    }

    /// Switches correction by samples on (the default) or off: feedforward then continues with the present correction. Learning uses
    /// samples either way.
    pub fn set_feedback(&mut self, is_on: bool) {
        self.has_feedback = is_on;
    }

    /// Resets what the observer has learned from the sensor, disturbance and force scale: back to the model as it was fitted.
    pub fn forget_correction(&mut self) {
        C::forget(&mut self.compensator);
    }

    /// Ends a run: the next [`command`](Follower::command) begins one.
    #[inline]
    pub fn end_run(&mut self) {
        if let Some(cycles) = &mut self.cycles {
            cycles.has_begun = false;
            cycles.learned.drop_sample();
            C::leave_cycles(&mut self.compensator, T::ZERO);
        }
    }

    /// The next run begins with what was learned of cycles before it.
    pub fn carry_over(&mut self) {
        if let Some(cycles) = &mut self.cycles {
            cycles.carries_over = true;
        }
    }

    /// Forgets what was learned of cycles. What it adds in this run fades out.
    pub fn forget_cycles(&mut self) {
        if let Some(cycles) = &mut self.cycles {
            cycles.learned.forget();
            cycles.carries_over = false;
        }
    }
}

impl<T: Real, M: Memory<T>, const TICKS: usize, const PAST: usize> FollowerState<T, Tracking<T, M, TICKS>, PAST> {
    /// The observer's state.
    #[must_use]
    #[inline]
    pub fn observer(&self) -> &ObserverState<T, M, TICKS> {
        self.compensator.observer()
    }

    /// [`TrackingState::set_adapting`].
    pub fn set_adapting(&mut self, adapting: Adapting) {
        self.compensator.set_adapting(adapting);
    }

    /// [`TrackingState::restore`].
    #[allow(clippy::missing_errors_doc)] // as there
    pub fn restore(&mut self, adapted: &Adapted<T>) -> Result<(), ControlError> {
        self.compensator.restore(adapted)
    }

    /// [`TrackingState::set_temperature_factors`].
    #[allow(clippy::missing_errors_doc)] // as there
    pub fn set_temperature_factors(&mut self, stiffness: T, time: T) -> Result<(), ControlError> {
        self.compensator.set_temperature_factors(stiffness, time)
    }

    /// [`TrackingState::forget_changes`].
    pub fn forget_changes(&mut self) {
        self.compensator.forget_changes();
    }
}
