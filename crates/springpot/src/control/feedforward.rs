//! Feedforward: the voltage for a reference displacement, without a sensor.

use crate::actuator::{Actuator, VoltageDrive};
use crate::control::inverse::{Applied, Correction, Inverse, InverseState, VoltageCommand};
use crate::control::limits::CommandLimits;
use crate::error::ControlError;
use crate::law::{Law, LawState, Memory, state_traits};
use crate::scalar::{Real, Scalar};

/// Compensation without a sensor: the inverse of the law, shaped and limited.
///
/// In every tick, in this order:
///
/// 1. [`apply`](Self::apply) the voltage that was really applied since the last tick, 0 V before the first: the model's film responds to
///    it.
/// 2. [`command`](Self::command) with the reference for the end of this tick.
///
/// `apply` comes first because a limit, here or in a supervisor behind, may have changed the last command. Each command starts from the
/// model's actual displacement, so nothing winds up.
///
/// The [crate page](crate#feedforward) has a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Feedforward<T, M = crate::Compressed<T>> {
    law: Law<T, M>,
    drive: VoltageDrive<T>,
    inverse: Inverse<T>,
}

/// State of a [`Feedforward`]: changes with every tick.
pub struct FeedforwardState<T: Scalar, M: Memory<T> = crate::Compressed<T>> {
    film: LawState<T, M>,
    inverse: InverseState<T>,
}

state_traits!(FeedforwardState<T, M> { film, inverse });

impl<T: Real, M: Memory<T>> Feedforward<T, M> {
    /// Feedforward for `actuator` along `law` within `limits`.
    ///
    /// # Errors
    ///
    /// [`ControlError::NotPositive`] for a limit that is not finite and positive, [`ControlError::Actuator`] for an actuator
    /// that is refused at the largest voltage.
    pub fn new(law: Law<T, M>, actuator: &Actuator, limits: CommandLimits) -> Result<Self, ControlError> {
        let inverse = Inverse::new(actuator, &limits, law.step_s(), law.max_stiffness())?;
        let drive = VoltageDrive::new(actuator, limits.max_voltage_v, law.min_stiffness())?;
        Ok(Self { law, drive, inverse })
    }

    /// A state at 0 V with this `film`, a state of the same law; the reference begins at its displacement.
    #[must_use]
    pub fn state(&self, film: LawState<T, M>) -> FeedforwardState<T, M> {
        let inverse = InverseState::at(film.position());
        FeedforwardState { film, inverse }
    }

    /// Steps the film under the voltage that was really applied since the last tick; returns its displacement (m).
    #[inline]
    pub fn apply(&self, state: &mut FeedforwardState<T, M>, applied: Applied<T>) -> T {
        let voltage = self.inverse.record(&mut state.inverse, applied);
        self.law.displacement_under(&mut state.film, self.drive.load(voltage))
    }

    /// The voltage that takes the film to `reference` (m) at the end of this tick, as far as the limits allow. A non-finite
    /// reference is ignored: the last one stays.
    #[inline]
    pub fn command(&self, state: &mut FeedforwardState<T, M>, reference: T) -> VoltageCommand<T> {
        let exact = Correction { disturbance: T::ZERO, force_scale: T::from_f64(1.0) };
        self.inverse.command(&self.law, &self.drive, &state.film, &mut state.inverse, reference, exact)
    }

    /// Returns the law of the film.
    #[must_use]
    pub fn law(&self) -> &Law<T, M> {
        &self.law
    }

    /// Returns the drive: force from voltage.
    #[must_use]
    pub fn drive(&self) -> &VoltageDrive<T> {
        &self.drive
    }
}

impl<T: Real, M: Memory<T>> FeedforwardState<T, M> {
    /// The displacement of the film, m.
    #[must_use]
    pub fn displacement(&self) -> T {
        self.film.position()
    }

    /// Estimated voltage on the film, V: behind the amplifier's gain and lag.
    #[must_use]
    pub fn film_voltage(&self) -> T {
        self.inverse.film_voltage()
    }

    /// The shaped reference, m.
    #[must_use]
    pub fn reference(&self) -> T {
        self.inverse.path.position
    }

    /// Returns the state of the law.
    #[must_use]
    pub fn film(&self) -> &LawState<T, M> {
        &self.film
    }
}
