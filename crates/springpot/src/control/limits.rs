//! Limits of a command, and the set of limits that a command met.

use core::fmt;
use core::ops::{BitOr, BitOrAssign};

use crate::actuator::Actuator;
use crate::control::amplifier::AmplifierLag;
use crate::error::{ControlError, first_not_positive};

/// Limits of the path and of the voltage that a law commands, and the amplifier that carries it out. SI units; all limits must be finite
/// and greater than 0.
///
/// These limits shape commands. A supervisor that protects people and film comes after them, with its own limits.
///
/// ```
/// use springpot::{Actuator, CommandLimits, Feedforward, FeedforwardState, Law, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let model = Preset::TABLE3_N2.model()?;
/// let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
/// let rest = law.state();
/// let limits = CommandLimits { max_voltage_v: 2000.0, ..CommandLimits::BENCH };
/// let feedforward: Feedforward<f32> = Feedforward::new(law, &Actuator::KARNER_2022, limits)?;
/// let mut state: FeedforwardState<f32> = feedforward.state(rest);
///
/// // 4 mm would take more than 2 kV: the command stays at the limit and reports it.
/// let last = (0..2000).map(|_| feedforward.command(&mut state, 4e-3)).last().unwrap();
/// assert!(last.voltage_v <= 2000.0 && last.limited.bits() != 0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct CommandLimits {
    /// Largest voltage, V.
    pub max_voltage_v: f64,
    /// Largest electric field in the film as it thins, V/m.
    pub max_field_v_per_m: f64,
    /// Largest change of voltage, V/s.
    pub max_slew_v_per_s: f64,
    /// Largest speed of the shaped reference, m/s.
    pub max_velocity_m_per_s: f64,
    /// Largest acceleration of the shaped reference, m/s².
    pub max_acceleration_m_per_s2: f64,
    /// Speed of the return to the reference after a limit was met: two poles at this frequency, Hz. Heavy films return more
    /// slowly, as the largest force allows.
    pub return_hz: f64,
    /// Lag of the amplifier: the command compensates it as far as the limits allow.
    pub amplifier: AmplifierLag,
}

impl CommandLimits {
    /// Limits of the bench of Karner et al. 2022: 6 kV and 50 kV/s; 50 mm/s and 0.5 m/s², far above any reference below
    /// 1 Hz; return within some tenths of a second.
    ///
    /// The field is that of 6 kV on 160 µm plus a margin of 12 % for thinning.
    pub const BENCH: Self = Self {
        max_voltage_v: 6000.0,
        max_field_v_per_m: 4.2e7,
        max_slew_v_per_s: 50e3,
        max_velocity_m_per_s: 0.05,
        max_acceleration_m_per_s2: 0.5,
        return_hz: 5.0,
        amplifier: AmplifierLag::NONE,
    };

    pub(crate) fn check(&self) -> Result<(), ControlError> {
        let values = [
            ("max_voltage_v", self.max_voltage_v),
            ("max_field_v_per_m", self.max_field_v_per_m),
            ("max_slew_v_per_s", self.max_slew_v_per_s),
            ("max_velocity_m_per_s", self.max_velocity_m_per_s),
            ("max_acceleration_m_per_s2", self.max_acceleration_m_per_s2),
            ("return_hz", self.return_hz),
        ];
        let wrong = first_not_positive(&values);
        wrong.map_or(Ok(()), |(quantity, value)| Err(ControlError::NotPositive { quantity, value }))
    }

    /// The voltage that makes the largest field in the film at x = 0, V.
    pub(crate) fn field_voltage(&self, actuator: &Actuator) -> f64 {
        self.max_field_v_per_m * actuator.thickness_m
    }
}

/// The limits that a command met: a set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limited(u8);

impl Limited {
    /// No limit: the command follows the reference.
    pub const NONE: Self = Self(0);
    /// A force below that of 0 V: voltage can only lengthen the film.
    pub const BELOW_ZERO: Self = Self(1);
    /// The largest voltage.
    pub const MAX_VOLTAGE: Self = Self(1 << 1);
    /// The largest field.
    pub const FIELD: Self = Self(1 << 2);
    /// The largest change of voltage in a tick.
    pub const SLEW: Self = Self(1 << 3);
    /// The largest speed of the shaped reference.
    pub const VELOCITY: Self = Self(1 << 4);
    /// The largest acceleration of the shaped reference.
    pub const ACCELERATION: Self = Self(1 << 5);

    /// The speed of the amplifier: rising, its command would have to exceed the largest voltage; falling, its bleeder does not discharge
    /// the film as fast.
    pub const AMPLIFIER: Self = Self(1 << 7);

    /// The film is beyond the measured range of its elastic curve, which continues linearly there.
    pub const BEYOND_CURVE: Self = Self(1 << 6);

    /// All limits with their names.
    pub const ALL: [(Self, &'static str); 8] = [
        (Self::BELOW_ZERO, "below-zero"),
        (Self::MAX_VOLTAGE, "max-voltage"),
        (Self::FIELD, "field"),
        (Self::SLEW, "slew"),
        (Self::VELOCITY, "velocity"),
        (Self::ACCELERATION, "acceleration"),
        (Self::BEYOND_CURVE, "beyond-curve"),
        (Self::AMPLIFIER, "amplifier"),
    ];

    /// Whether all limits of `others` were met.
    #[must_use]
    pub const fn contains(self, others: Self) -> bool {
        self.0 & others.0 == others.0
    }

    /// Whether no limit was met.
    #[must_use]
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }

    /// The set as bits: below zero 1, largest voltage 2, field 4, slew 8, velocity 16, acceleration 32, beyond the elastic
    /// curve 64, amplifier 128.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }
}

impl BitOr for Limited {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for Limited {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

impl fmt::Display for Limited {
    /// The names with `+` between them, or `none`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_none() {
            return f.write_str("none");
        }
        let mut names = Self::ALL.iter().filter(|(limit, _)| self.contains(*limit)).map(|(_, name)| *name);
        f.write_str(names.next().unwrap_or_default())?;
        names.try_for_each(|name| write!(f, "+{name}"))
    }
}
