//! The amplifier between command and film: how fast the voltage follows.

use crate::error::ControlError;
use crate::scalar::Real;

/// How an amplifier follows its command. Times in s; 0: without lag.
///
/// The voltage V on the film follows the command u with a first-order lag. It rises with the time constant `rise_s`. It falls with the
/// smaller of both, but no faster than through a bleeder:
///
/// ```text
/// V̇ = (u − V) / rise_s                                          u > V
/// V̇ = max((u − V) / min(rise_s, fall_s), −V / fall_s)           u ≤ V
/// ```
///
/// So an amplifier that sources current alone, and whose film is discharged through a resistor, has a `fall_s` above its `rise_s`; one that
/// drives both ways has `fall_s` = `rise_s`.
///
/// ```
/// use springpot::{Actuator, Applied, AmplifierLag, CommandLimits, Feedforward, Law, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let model = Preset::TABLE3_N2.model()?;
/// let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
/// let rest = law.state();
/// // A small converter: 50 ms up, 0.5 s down.
/// let amplifier = AmplifierLag { rise_s: 0.05, fall_s: 0.5 };
/// let limits = CommandLimits { amplifier, ..CommandLimits::BENCH };
/// let feedforward = Feedforward::new(law, &Actuator::KARNER_2022, limits)?;
///
/// // A film that is to move at 0.5 mm/s: the command leads.
/// let mut state = feedforward.state(rest);
/// let mut command = 0.0;
/// for tick in 0..1000_u16 {
///     feedforward.apply(&mut state, Applied::as_commanded(command));
///     command = feedforward.command(&mut state, 0.5e-6 * f32::from(tick)).voltage_v;
/// }
/// assert!(command > 1.02 * state.film_voltage());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct AmplifierLag {
    /// Time constant with which the voltage rises, s.
    pub rise_s: f64,
    /// Time constant with which it falls to 0 V at a command of 0 V, s.
    pub fall_s: f64,
}

/// Longest time constant, s: a slower amplifier cannot drive a film that moves.
const MAX_S: f64 = 10.0;

impl AmplifierLag {
    /// An amplifier without lag.
    pub const NONE: Self = Self { rise_s: 0.0, fall_s: 0.0 };

    pub(crate) fn check(&self) -> Result<(), ControlError> {
        let Self { rise_s, fall_s } = *self;
        for (quantity, value) in [("amplifier.rise_s", rise_s), ("amplifier.fall_s", fall_s)] {
            if !(0.0..=MAX_S).contains(&value) {
                return Err(ControlError::OutOfRange { quantity, value, most: MAX_S });
            }
        }
        Ok(())
    }
}

/// The voltage behind an amplifier, tick by tick.
///
/// ```
/// use springpot::{AmplifierLag, AmplifierModel};
///
/// # fn main() -> Result<(), springpot::ControlError> {
/// let converter = AmplifierLag { rise_s: 0.1, fall_s: 0.5 };
/// let model: AmplifierModel<f64> = AmplifierModel::new(converter, 1e-3)?;
///
/// // After 100 ms of 3 kV, 63 % of it; after 0.5 s of 0 V, 37 % of that.
/// let risen = (0..100).fold(0.0, |voltage, _| model.advance(voltage, 3000.0));
/// assert!((risen - 3000.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
/// let fallen = (0..500).fold(risen, |voltage, _| model.advance(voltage, 0.0));
/// assert!((fallen - risen * (-1.0_f64).exp()).abs() < 1e-9);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmplifierModel<T> {
    /// Share of the distance to the command that it goes in a tick, up and down.
    pub(super) up: T,
    pub(super) down: T,
    /// Share of the voltage that is left after a tick at a command of 0 V.
    pub(super) left: T,
}

impl<T: Real> AmplifierModel<T> {
    /// The model of `lag`, in ticks of `step_s` (s).
    ///
    /// # Errors
    ///
    /// [`ControlError::OutOfRange`] for a time constant that is negative, not finite or above 10 s.
    pub fn new(lag: AmplifierLag, step_s: f64) -> Result<Self, ControlError> {
        lag.check()?;
        // e^−∞ is 0: at once.
        let left = |time_s: f64| if time_s > 0.0 { libm::exp(-step_s / time_s) } else { 0.0 };
        let up = 1.0 - left(lag.rise_s);
        let down = 1.0 - left(lag.rise_s.min(lag.fall_s));
        Ok(Self { up: T::from_f64(up), down: T::from_f64(down), left: T::from_f64(left(lag.fall_s)) })
    }

    /// As [`new`](Self::new), or `None` for an amplifier without lag, which needs no model.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn lagging(lag: AmplifierLag, step_s: f64) -> Result<Option<Self>, ControlError> {
        let model = Self::new(lag, step_s)?;
        Ok((lag != AmplifierLag::NONE).then_some(model))
    }

    /// Returns the voltage (V) at the end of a tick under `command` (V), from `voltage` (V) at its start.
    #[inline]
    #[must_use]
    pub fn advance(&self, voltage: T, command: T) -> T {
        let share = if command > voltage { self.up } else { self.down };
        let followed = voltage + share * (command - voltage);
        let lowest = self.lowest(voltage);
        if followed < lowest { lowest } else { followed }
    }

    /// The command that takes `voltage` (V) to `wanted` (V) by the end of a tick.
    #[inline]
    pub(crate) fn lead(&self, voltage: T, wanted: T) -> T {
        let share = if wanted > voltage { self.up } else { self.down };
        voltage + (wanted - voltage) / share
    }

    /// The lowest voltage (V) to which `voltage` (V) can fall in a tick.
    #[inline]
    #[must_use]
    pub fn lowest(&self, voltage: T) -> T {
        self.left * voltage
    }
}
