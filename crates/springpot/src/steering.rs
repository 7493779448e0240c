//! From a reference to a voltage: the step that all laws of control share.

use crate::actuator::{Actuator, VoltageDrive};
use crate::error::ControlError;
use crate::law::{Law, Memory, State};
use crate::limits::{CommandLimits, Limited};
use crate::reference::{Path, Shaper, clamp};
use crate::sqrt::Real;

/// What a tick commands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command<T> {
    /// The voltage, V.
    pub voltage: T,
    /// The shaped reference at the end of this tick, m.
    pub reference: T,
    /// The electrostatic force that the reference asks for, N; negative where no voltage can follow it.
    pub force: T,
    /// The limits that were met.
    pub limited: Limited,
}

/// What steering remembers from tick to tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Course<T> {
    pub(crate) path: Path<T>,
    /// Size of the voltage that was applied last, V.
    applied: T,
}

impl<T: Real> Course<T> {
    /// At rest at `position` (m), at 0 V.
    pub(crate) fn at(position: T) -> Self {
        Self { path: Path::at(position), applied: T::ZERO }
    }

    /// Takes note of the voltage that was really applied (V, either sign).
    #[inline]
    pub(crate) fn apply(&mut self, voltage: T) {
        self.applied = if voltage < T::ZERO { -voltage } else { voltage };
    }
}

/// How the model differs from the film, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Correction<T> {
    /// A force on the film that the model does not know, N.
    pub(crate) disturbance: T,
    /// What electrostatic force moves the film in units of what the model takes it for.
    pub(crate) force_scale: T,
}

/// Shaping, inverse and saturation.
///
/// With ε = x − q the distance of the film from its path and δ the difference of their increments, the film's increment
/// is to change by
///
/// ```text
/// Δx_k − Δx_{k−1} = (Δq_k − Δq_{k−1}) − (1 − p²) δ − (1 − p)² ε
/// ```
///
/// which puts both poles of ε to p. While no limit is met ε and δ are nought and the law's inverse is exact. After a limit
/// a film that is asked back onto its path within one tick would need a force of m ε / h² this way and that: it would
/// chatter between 0 V and the largest voltage. Working on changes of increments also keeps the digits of a slow
/// reference in f32.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Steering<T> {
    shaper: Shaper<T>,
    /// 1 − p².
    damping: T,
    /// (1 − p)².
    pull: T,
    max_voltage: T,
    /// Voltage of the largest field at x = 0.
    field_voltage: T,
    coupling: T,
    /// Largest change of voltage in a tick, V.
    slew: T,
}

impl<T: Real> Steering<T> {
    pub(crate) fn new(actuator: &Actuator, limits: &CommandLimits, step_s: f64) -> Result<Self, ControlError> {
        limits.check()?;
        let shaper = Shaper::new(step_s, limits.max_velocity_m_per_s, limits.max_acceleration_m_per_s2);
        let pole = libm::exp(-core::f64::consts::TAU * limits.return_hz * step_s);
        let slew = limits.max_slew_v_per_s * step_s;
        let steering = Self {
            shaper,
            damping: T::from_f64(1.0 - pole * pole),
            pull: T::from_f64((1.0 - pole) * (1.0 - pole)),
            max_voltage: T::from_f64(limits.max_voltage_v),
            field_voltage: T::from_f64(limits.field_voltage(actuator)),
            coupling: T::from_f64(actuator.stretch_coupling),
            slew: T::from_f64(slew),
        };
        for (quantity, value, usable) in [
            ("max_velocity_m_per_s or max_acceleration_m_per_s2", limits.max_acceleration_m_per_s2, shaper.is_usable()),
            ("max_slew_v_per_s", limits.max_slew_v_per_s, steering.slew > T::ZERO),
        ] {
            if !usable {
                return Err(ControlError::NotPositive { quantity, value });
            }
        }
        Ok(steering)
    }

    /// The command that takes `film` along its `course` towards `reference` (m).
    #[inline]
    pub(crate) fn command<M: Memory<T>>(
        &self,
        law: &Law<T, M>,
        drive: &VoltageDrive<T>,
        film: &State<T, M::History>,
        course: &mut Course<T>,
        reference: T,
        correction: Correction<T>,
    ) -> Command<T> {
        let Course { path, applied } = course;
        let away = film.position() - path.position;
        let drift = film.increment() - path.increment;
        let mut limited = self.shaper.advance(path, reference);
        let change = path.change - (self.damping * drift + self.pull * away);

        let one = T::from_f64(1.0);
        let ahead = film.position() + (film.increment() + change);
        let force = law.force_for(film, change) - correction.disturbance - drive.preload();
        let force = force / correction.force_scale;
        if force < T::ZERO {
            limited |= Limited::BELOW_ZERO;
        }
        let mut voltage = drive.voltage(force + drive.preload(), ahead);

        // The film thins as it lengthens, by as much as its force grows.
        let thinning = one + self.coupling * ahead;
        let field_voltage = if thinning > one { self.field_voltage / thinning } else { self.field_voltage };
        if voltage > field_voltage {
            limited |= Limited::FIELD;
            voltage = field_voltage;
        }
        if voltage > self.max_voltage {
            limited |= Limited::MAX_VOLTAGE;
            voltage = self.max_voltage;
        }
        let within = clamp(voltage, *applied - self.slew, *applied + self.slew);
        if within < voltage || voltage < within {
            limited |= Limited::SLEW;
        }
        Command { voltage: within, reference: path.position, force, limited }
    }
}
