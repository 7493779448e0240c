//! Feedforward with a sensor: the observer's disturbance is taken off the command.

use crate::actuator::Actuator;
use crate::control::inverse::{Applied, Command, Course, Steering};
use crate::control::limits::CommandLimits;
use crate::control::observer::{Observer, ObserverOptions, ObserverState, Sample};
use crate::error::ControlError;
use crate::law::{Law, Memory, State, state_traits};
use crate::scalar::{Real, Scalar};

/// Compensation with a sensor: [`Feedforward`](crate::Feedforward) from where an [`Observer`] sees the film, less the
/// disturbance that it sees.
///
/// In every tick: [`observe`](Self::observe) the applied voltage and the sample that has arrived, if one has; then
/// [`command`](Self::command). One law is stepped once a tick.
///
/// With Q the low-pass of the observer, a film whose response is 1 + Δ times the model's follows its reference with the
/// error (1 − Q) Δ / (1 + Q Δ): below the bandwidth what the model misses is taken out, above it the feedforward stands.
/// While the sensor is lost it stands alone, with what was learned about the film.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracking<T, M = crate::Compressed<T>, const PAST: usize = 64> {
    observer: Observer<T, M, PAST>,
    steering: Steering<T>,
}

/// What changes with every tick of a [`Tracking`].
pub struct TrackingState<T: Scalar, M: Memory<T> = crate::Compressed<T>, const PAST: usize = 64> {
    observer: ObserverState<T, M, PAST>,
    course: Course<T>,
}

state_traits!(TrackingState<T, M, PAST> { observer, course });

impl<T: Real, M: Memory<T>, const PAST: usize> Tracking<T, M, PAST> {
    /// Tracking for `actuator` along `law` within `limits`, corrected as `options` tell.
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
        let steering = Steering::new(actuator, &limits, law.step_s(), law.stiffness())?;
        let observer = Observer::new(law, actuator, limits.max_voltage_v, options)?;
        Ok(Self { observer, steering })
    }

    /// A state whose film is `film`, with its reference where the film is, at 0 V.
    #[must_use]
    pub fn state(&self, film: State<T, M>) -> TrackingState<T, M, PAST> {
        let course = Course::at(film.position());
        TrackingState { observer: self.observer.state(film), course }
    }

    /// Steps the film under the voltage that was really applied since the last tick and corrects it with a `sample`, if one
    /// has arrived. Returns the estimated displacement (m).
    #[inline]
    pub fn observe(&self, state: &mut TrackingState<T, M, PAST>, applied: Applied<T>, sample: Option<Sample<T>>) -> T {
        let voltage = self.steering.note(&mut state.course, applied);
        self.observer.observe(&mut state.observer, voltage, sample)
    }

    /// The voltage that takes the film to `reference` (m) at the end of this tick, as far as the limits allow. A reference
    /// that is not finite leaves the one before.
    #[inline]
    pub fn command(&self, state: &mut TrackingState<T, M, PAST>, reference: T) -> Command<T> {
        let correction = state.observer.correction();
        let TrackingState { observer, course } = state;
        let (law, drive) = (self.observer.law(), self.observer.drive());
        self.steering.command(law, drive, &observer.film, course, reference, correction)
    }

    /// The observer.
    #[must_use]
    pub fn observer(&self) -> &Observer<T, M, PAST> {
        &self.observer
    }
}

impl<T: Real, M: Memory<T>, const PAST: usize> TrackingState<T, M, PAST> {
    /// What the observer knows.
    #[must_use]
    pub fn observer(&self) -> &ObserverState<T, M, PAST> {
        &self.observer
    }

    /// Forgets what was learned about disturbance and force scale: the model as it was fitted from now on.
    pub fn forget(&mut self) {
        self.observer.forget();
    }

    /// The shaped reference, m.
    #[must_use]
    pub fn reference(&self) -> T {
        self.course.path.position
    }
}
