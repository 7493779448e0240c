//! From a reference to a voltage: the step that feedforward and tracking share.

use crate::actuator::{Actuator, VoltageDrive};
use crate::control::limits::{CommandLimits, Limited};
use crate::control::pace::{GAIN_S, Pace, PacedAmplifier, Reading};
use crate::control::path::{Path, Shaper, clamp, is_finite};
use crate::error::ControlError;
use crate::law::{Law, LawState, Memory};
use crate::numbers::Numbers;
use crate::scalar::Real;

/// The command of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltageCommand<T> {
    /// The voltage, V.
    pub voltage_v: T,
    /// The shaped reference at the end of this tick, m.
    pub reference_m: T,
    /// The electrostatic force that the reference needs, N; negative where no voltage can give it.
    pub force_n: T,
    /// The limits that were met.
    pub limited: Limited,
}

/// The voltage since the last tick, V, either sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Applied<T> {
    /// The commanded voltage after all limits and supervisors. A non-finite one counts as the last finite one.
    pub commanded_v: T,
    /// The voltage that a monitor measured at the end of that time, or a tick before, if there is one. It shows the amplifier's gain and, of
    /// an [`AmplifierLag`](crate::AmplifierLag), how much faster it is. Non-finite readings are ignored.
    pub reading_v: Option<T>,
}

impl<T: Real> Applied<T> {
    /// A commanded voltage, without a monitor: it is assumed to have acted.
    pub const fn as_commanded(voltage: T) -> Self {
        Self { commanded_v: voltage, reading_v: None }
    }

    /// A commanded voltage and the voltage that a monitor measured.
    pub const fn as_monitored(commanded: T, reading: T) -> Self {
        Self { commanded_v: commanded, reading_v: Some(reading) }
    }
}

/// State of an [`Inverse`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InverseState<T> {
    pub(crate) path: Path<T>,
    /// Size of the voltage that was commanded last, V.
    commanded: T,
    /// The voltage behind the amplifier, V, apart from its gain.
    followed: T,
    /// Slow means of that voltage and of the one that was read, V, and their ratio: the amplifier's gain.
    followed_mean: T,
    reading_mean: T,
    gain: T,
    /// How fast the amplifier is, where it lags.
    pace: Pace<T>,
}

impl<T: Real> InverseState<T> {
    /// At rest at `position` (m), at 0 V.
    pub(crate) fn at(position: T) -> Self {
        Self {
            path: Path::at(position),
            commanded: T::ZERO,
            followed: T::ZERO,
            followed_mean: T::ZERO,
            reading_mean: T::ZERO,
            gain: T::from_f64(1.0),
            pace: Pace::nominal(),
        }
    }
}

impl<T: Real> InverseState<T> {
    /// The voltage on the film, V: behind the amplifier, with its gain.
    pub(crate) fn film_voltage(&self) -> T {
        self.gain * self.followed
    }

    /// Whether the gain is one that ticks leave.
    pub(crate) fn is_sound(&self) -> bool {
        let [low, high] = GAINS.map(T::from_f64);
        low <= self.gain && self.gain <= high
    }

    /// The voltage behind the amplifier, apart from its gain, V.
    pub(crate) fn followed_voltage(&self) -> T {
        self.followed
    }
}

/// The known difference between model and film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Correction<T> {
    /// A force on the film that the model does not explain, N.
    pub(crate) disturbance: T,
    /// Effect of the electrostatic force on the film over its effect on the model.
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
/// which places both poles of ε at p. While no limit is met ε and δ are 0 and the law's inverse is exact.
///
/// After a limit the film must return to its path. A return within one tick would need forces of ± m ε / h² and chatter
/// between 0 V and the largest voltage. The poles prevent that for light films. For heavy ones the returning term is also
/// bounded to a share of what the largest force can do to the film's inertia, and w to what that share can brake. Working on
/// changes of increments keeps the digits of a slow reference in f32.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Inverse<T> {
    shaper: Shaper<T>,
    /// 1 − p².
    damping: T,
    /// (1 − p) / (1 + p): share of ε by which to approach the path, per tick.
    approach: T,
    /// Largest change of the increment of the approach, m.
    max_return: T,
    max_voltage: T,
    /// Voltage of the largest field at x = 0.
    field_voltage: T,
    /// Thinning with displacement, 1/m.
    thinning: T,
    /// Largest change of voltage in a tick, V.
    slew: T,
    /// None where it follows at once.
    amplifier: Option<PacedAmplifier<T>>,
    /// Weight of a tick in the means of the voltage.
    averaging: T,
}

/// Share of the largest force that may accelerate the film back to its path.
const RETURN_SHARE: f64 = 0.1;
/// Share of the largest voltage above which its mean shows it.
const GAIN_SHARE: f64 = 0.02;
/// Bounds of that gain.
const GAINS: [f64; 2] = [0.8, 1.25];

/// Weight of the input in one step of a first-order lag of `rate` (1/s): backward Euler, stable at any rate.
pub(crate) fn share_per_step(rate: f64, step_s: f64) -> f64 {
    let steps = rate * step_s;
    steps / (1.0 + steps)
}

impl<T: Real> Inverse<T> {
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
        let largest_force = actuator.electrostatic_force(limits.max_voltage_v);
        let max_return = RETURN_SHARE * largest_force / stiffness.to_f64();
        let slew = limits.max_slew_v_per_s * step_s;
        let inverse = Self {
            shaper,
            damping: T::from_f64(1.0 - pole * pole),
            approach: T::from_f64(approach),
            max_return: T::from_f64(max_return),
            max_voltage: T::from_f64(limits.max_voltage_v),
            field_voltage: T::from_f64(limits.field_voltage(actuator)),
            thinning: T::from_f64(actuator.thinning_per_m()),
            slew: T::from_f64(slew),
            amplifier: PacedAmplifier::lagging(limits.amplifier, step_s)?,
            averaging: T::from_f64(share_per_step(1.0 / GAIN_S, step_s)),
        };
        for (quantity, value, usable) in [
            ("max_velocity_m_per_s or max_acceleration_m_per_s2", limits.max_acceleration_m_per_s2, shaper.is_usable()),
            ("max_slew_v_per_s", limits.max_slew_v_per_s, inverse.slew > T::ZERO),
        ] {
            if !usable {
                return Err(ControlError::NotPositive { quantity, value });
            }
        }
        Ok(inverse)
    }

    /// Visits the constants of a command.
    pub(crate) fn numbers(&self, take: &mut impl Numbers<T>) {
        take.structure("inverse", "Shaping of references, and the limits of a command.");
        self.shaper.numbers(take);
        take.number("damping", self.damping, "");
        take.number("approach", self.approach, "");
        take.number("max_return", self.max_return, "m");
        take.number("max_voltage", self.max_voltage, "V");
        take.number("field_voltage", self.field_voltage, "at which the field is largest at x = 0, V");
        take.number("thinning", self.thinning, "of the film with displacement, 1/m");
        take.number("slew", self.slew, "largest change of voltage in a tick, V");
        take.number("averaging", self.averaging, "weight of a tick in the means of the voltage");
        take.number(
            "gain_share",
            T::from_f64(GAIN_SHARE),
            "of the largest voltage, above which the amplifier's gain is seen",
        );
        take.array("gains", GAINS.map(T::from_f64), "bounds of that gain");
        if let Some(amplifier) = &self.amplifier {
            amplifier.numbers(take);
        }
    }

    /// Records the applied voltage, and returns the one that acted on the film (V).
    ///
    /// A command is relative to the force of the last tick. A monitor that is 1 % off would therefore accumulate tick by tick,
    /// and its noise would return as commands. So the monitor only estimates the amplifier's gain and, where it lags, its pace, slowly.
    #[inline]
    pub(crate) fn record(&self, state: &mut InverseState<T>, applied: Applied<T>) -> T {
        let commanded = applied.commanded_v.abs();
        state.commanded = if is_finite(commanded) { commanded } else { state.commanded };
        let reading = applied.reading_v.filter(|reading| is_finite(*reading)).map(T::abs);
        state.followed = match &self.amplifier {
            Some(amplifier) => {
                let reading = reading.map(|reading| Reading {
                    voltage: reading / state.gain,
                    forgotten: self.averaging,
                    max_voltage: self.max_voltage,
                });
                amplifier.advance(&mut state.pace, state.followed, state.commanded, reading)
            }
            None => state.commanded,
        };
        if let Some(reading) = reading {
            state.followed_mean = state.followed_mean + self.averaging * (state.followed - state.followed_mean);
            state.reading_mean = state.reading_mean + self.averaging * (reading - state.reading_mean);
            if state.followed_mean > T::from_f64(GAIN_SHARE) * self.max_voltage {
                let [low, high] = GAINS.map(T::from_f64);
                state.gain = clamp(state.reading_mean / state.followed_mean, low, high);
            }
        }
        state.film_voltage()
    }

    /// The command that takes `film` towards `reference` (m).
    #[inline]
    pub(crate) fn command<M: Memory<T>>(
        &self,
        law: &Law<T, M>,
        drive: &VoltageDrive<T>,
        film: &LawState<T, M>,
        state: &mut InverseState<T>,
        reference: T,
        correction: Correction<T>,
    ) -> VoltageCommand<T> {
        let InverseState { path, commanded, followed, gain, pace, .. } = state;
        let offset = film.position() - path.position;
        let drift = film.increment() - path.increment;
        let mut limited = self.shaper.advance(path, reference);
        // No more than it can brake.
        let max_approach = self.max_return / self.approach;
        let approach = clamp(-(self.approach * offset), -max_approach, max_approach);
        let correction_m = clamp(self.damping * (approach - drift), -self.max_return, self.max_return);
        let change = path.change + correction_m;

        let one = T::from_f64(1.0);
        let ahead = film.position() + (film.increment() + change);
        let force = law.force_for(film, change) - correction.disturbance - drive.preload();
        let force = force / correction.force_scale;
        if force < T::ZERO {
            limited |= Limited::BELOW_ZERO;
        }
        if film.beyond_curve() {
            limited |= Limited::BEYOND_CURVE;
        }
        let wanted = drive.voltage(force + drive.preload(), ahead) / *gain;

        // The film thins as it lengthens.
        let thinning = one + self.thinning * ahead;
        let field_voltage = if thinning > one { self.field_voltage / thinning } else { self.field_voltage };
        if wanted > field_voltage {
            limited |= Limited::FIELD;
        }
        if wanted > self.max_voltage {
            limited |= Limited::MAX_VOLTAGE;
        }
        let largest = if field_voltage < self.max_voltage { field_voltage } else { self.max_voltage };
        let wanted = if wanted > largest { largest } else { wanted };
        // The command leads by as much as the amplifier lags.
        let mut allowed = wanted;
        if let Some(amplifier) = &self.amplifier {
            let (led, can_follow) = amplifier.lead(pace, *followed, wanted);
            if led > largest || !can_follow {
                limited |= Limited::AMPLIFIER;
            }
            allowed = if led > largest { largest } else { led };
        }
        let slewed = clamp(allowed, *commanded - self.slew, *commanded + self.slew);
        if slewed != allowed {
            limited |= Limited::SLEW;
        }
        // The largest voltage has priority over the slew limit.
        let voltage = clamp(slewed, T::ZERO, largest);
        VoltageCommand { voltage_v: voltage, reference_m: path.position, force_n: force, limited }
    }
}
