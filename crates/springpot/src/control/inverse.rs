//! From a reference to a voltage: the step that all laws of control share.

use crate::actuator::{Actuator, VoltageDrive};
use crate::control::limits::{CommandLimits, Limited};
use crate::control::path::{Path, Shaper, clamp, is_finite};
use crate::error::ControlError;
use crate::law::{Law, Memory, State};
use crate::scalar::Real;

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

/// The voltage since the last tick, V, either sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Applied<T> {
    /// What was commanded in the end, by whoever had the last word.
    pub commanded: T,
    /// What a monitor read of it, if there is one; what is no number is passed over.
    pub reading: Option<T>,
}

impl<T: Real> Applied<T> {
    /// A commanded voltage, which is taken to have acted.
    pub const fn as_commanded(voltage: T) -> Self {
        Self { commanded: voltage, reading: None }
    }

    /// A commanded voltage beside what a monitor read of it.
    pub const fn as_monitored(commanded: T, reading: T) -> Self {
        Self { commanded, reading: Some(reading) }
    }
}

/// What steering remembers from tick to tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Course<T> {
    pub(crate) path: Path<T>,
    /// Size of the voltage that was commanded last, V.
    commanded: T,
    /// Slow means of commanded and read voltage, V, and their ratio: the amplifier's gain.
    commanded_mean: T,
    reading_mean: T,
    gain: T,
}

impl<T: Real> Course<T> {
    /// At rest at `position` (m), at 0 V.
    pub(crate) fn at(position: T) -> Self {
        Self {
            path: Path::at(position),
            commanded: T::ZERO,
            commanded_mean: T::ZERO,
            reading_mean: T::ZERO,
            gain: T::from_f64(1.0),
        }
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
/// Δx_k − Δx_{k−1} = (Δq_k − Δq_{k−1}) + (1 − p²) (w − δ),      w = −(1 − p) / (1 + p) ε
/// ```
///
/// which puts both poles of ε to p. While no limit is met ε and δ are nought and the law's inverse is exact. After a limit
/// a film that is asked back onto its path within one tick would need a force of m ε / h² this way and that: it would
/// chatter between 0 V and the largest voltage. For the same reason the term that leads back is bounded to a share of what
/// the largest force can do to the film's inertia, and w to what that can brake. Working on changes of increments also keeps
/// the digits of a slow reference in f32.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Steering<T> {
    shaper: Shaper<T>,
    /// 1 − p².
    damping: T,
    /// (1 − p)² / (1 − p²): share of ε by which to close in, per tick.
    approach: T,
    /// Largest increment of closing in and largest change of it, m.
    closing: T,
    back: T,
    max_voltage: T,
    /// Voltage of the largest field at x = 0.
    field_voltage: T,
    coupling: T,
    /// Largest change of voltage in a tick, V.
    slew: T,
    /// Share of a tick in the means of the voltage.
    averaging: T,
    /// Mean voltage from which on the amplifier's gain shows, V.
    telling_voltage: T,
}

/// Share of the largest force that leading the film back may take for its inertia.
const RETURN_SHARE: f64 = 0.1;
/// Time over which the amplifier's gain is measured, s.
const GAIN_S: f64 = 10.0;
/// It stays within these.
const GAINS: [f64; 2] = [0.8, 1.25];

/// What a first-order lag of `rate` (1/s) takes in of its input in a step: backward Euler, stable at any rate.
pub(crate) fn share_per_step(rate: f64, step_s: f64) -> f64 {
    let steps = rate * step_s;
    steps / (1.0 + steps)
}

impl<T: Real> Steering<T> {
    pub(crate) fn new(
        actuator: &Actuator,
        limits: &CommandLimits,
        step_s: f64,
        stiffness: T,
    ) -> Result<Self, ControlError> {
        limits.check()?;
        let shaper = Shaper::new(step_s, limits.max_velocity_m_per_s, limits.max_acceleration_m_per_s2);
        let pole = 1.0 - share_per_step(core::f64::consts::TAU * limits.return_hz, step_s);
        let approach = (1.0 - pole) / (1.0 + pole);
        let largest_force = actuator.force_per_square_volt() * limits.max_voltage_v * limits.max_voltage_v;
        let back = RETURN_SHARE * largest_force / stiffness.to_f64();
        let slew = limits.max_slew_v_per_s * step_s;
        let steering = Self {
            shaper,
            damping: T::from_f64(1.0 - pole * pole),
            approach: T::from_f64(approach),
            closing: T::from_f64(back / approach),
            back: T::from_f64(back),
            max_voltage: T::from_f64(limits.max_voltage_v),
            field_voltage: T::from_f64(limits.field_voltage(actuator)),
            coupling: T::from_f64(actuator.stretch_coupling),
            slew: T::from_f64(slew),
            averaging: T::from_f64(share_per_step(1.0 / GAIN_S, step_s)),
            telling_voltage: T::from_f64(0.02 * limits.max_voltage_v),
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

    /// Takes note of what was applied, and returns the voltage that acted on the film (V).
    ///
    /// The inverse asks for the force that goes on from the film's last one, so a reading that is 1 % off would add up tick
    /// by tick, and its noise would come back as commands. A monitor therefore tells the amplifier's gain, slowly.
    #[inline]
    pub(crate) fn note(&self, course: &mut Course<T>, applied: Applied<T>) -> T {
        let size = |voltage: T| if voltage < T::ZERO { -voltage } else { voltage };
        course.commanded = size(applied.commanded);
        if let Some(reading) = applied.reading.filter(|reading| is_finite(*reading)) {
            course.commanded_mean = course.commanded_mean + self.averaging * (course.commanded - course.commanded_mean);
            course.reading_mean = course.reading_mean + self.averaging * (size(reading) - course.reading_mean);
            if course.commanded_mean > self.telling_voltage {
                let [low, high] = GAINS.map(T::from_f64);
                course.gain = clamp(course.reading_mean / course.commanded_mean, low, high);
            }
        }
        course.gain * course.commanded
    }

    /// The command that takes `film` along its `course` towards `reference` (m).
    #[inline]
    pub(crate) fn command<M: Memory<T>>(
        &self,
        law: &Law<T, M>,
        drive: &VoltageDrive<T>,
        film: &State<T, M>,
        course: &mut Course<T>,
        reference: T,
        correction: Correction<T>,
    ) -> Command<T> {
        let Course { path, commanded, gain, .. } = course;
        let away = film.position() - path.position;
        let drift = film.increment() - path.increment;
        let mut limited = self.shaper.advance(path, reference);
        let closing = clamp(-(self.approach * away), -self.closing, self.closing);
        let back = clamp(self.damping * (closing - drift), -self.back, self.back);
        let change = path.change + back;

        let one = T::from_f64(1.0);
        let ahead = film.position() + (film.increment() + change);
        let force = law.force_for(film, change) - correction.disturbance - drive.preload();
        let force = force / correction.force_scale;
        if force < T::ZERO {
            limited |= Limited::BELOW_ZERO;
        }
        let wanted = drive.voltage(force + drive.preload(), ahead) / *gain;

        // The film thins as it lengthens, by as much as its force grows.
        let thinning = one + self.coupling * ahead;
        let field_voltage = if thinning > one { self.field_voltage / thinning } else { self.field_voltage };
        if wanted > field_voltage {
            limited |= Limited::FIELD;
        }
        if wanted > self.max_voltage {
            limited |= Limited::MAX_VOLTAGE;
        }
        let largest = if field_voltage < self.max_voltage { field_voltage } else { self.max_voltage };
        let allowed = if wanted > largest { largest } else { wanted };
        let slewed = clamp(allowed, *commanded - self.slew, *commanded + self.slew);
        if slewed < allowed || allowed < slewed {
            limited |= Limited::SLEW;
        }
        // The largest voltage outranks the slew.
        let voltage = clamp(slewed, T::ZERO, largest);
        Command { voltage, reference: path.position, force, limited }
    }
}
