//! Codes of the converters, and their ranges in volts.

use serde::{Deserialize, Serialize};

use crate::chips::boards;

/// Full scale of the amplifier's command, V at the DAC's output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CommandRange {
    /// 0 to 5 V.
    FiveVolts,
    /// 0 to 10 V.
    TenVolts,
}

impl CommandRange {
    /// The full scale, V.
    #[must_use]
    pub const fn full_scale_v(self) -> f32 {
        match self {
            Self::FiveVolts => 5.0,
            Self::TenVolts => 10.0,
        }
    }
}

/// Input range of a sensor's ADC: the unipolar ranges of an ADS868x on its internal reference of 4.096 V.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AdcRange {
    /// 0 to 12.288 V.
    UpTo12V288,
    /// 0 to 10.24 V.
    #[default]
    UpTo10V24,
    /// 0 to 6.144 V.
    UpTo6V144,
    /// 0 to 5.12 V.
    UpTo5V12,
}

impl AdcRange {
    /// The full scale, V.
    #[must_use]
    pub const fn full_scale_v(self) -> f32 {
        match self {
            Self::UpTo12V288 => 12.288,
            Self::UpTo10V24 => 10.24,
            Self::UpTo6V144 => 6.144,
            Self::UpTo5V12 => 5.12,
        }
    }

    /// The input of the largest code, V.
    #[must_use]
    pub const fn max_v(self) -> f32 {
        self.full_scale_v() * (65_535.0 / 65_536.0)
    }
}

/// A code of the amplifier's DAC: straight binary, 16 bits left-aligned, 0 at 0 V. The AD5754 takes all 16, its smaller
/// siblings the upper 14 or 12.
///
/// ```
/// use dea_driver::chips::{CommandRange, DacCode};
///
/// let code = DacCode::from_volts(2.5, CommandRange::FiveVolts);
/// assert_eq!(code, DacCode(0x8000));
/// assert_eq!(code.volts(CommandRange::FiveVolts), 2.5);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DacCode(pub u16);

impl DacCode {
    /// 0 V.
    pub const ZERO: Self = Self(0);

    /// The code nearest to `volts` at the DAC's output; saturates at the ends of `range`, 0 V for NaN.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates, and NaN gives 0
    pub fn from_volts(volts: f32, range: CommandRange) -> Self {
        let counts = volts * (65_536.0 / range.full_scale_v()) + 0.5;
        // Beyond the largest count the cast saturates at 65535.
        Self(counts as u16)
    }

    /// The output, V.
    #[must_use]
    pub fn volts(self, range: CommandRange) -> f32 {
        f32::from(self.0) * (range.full_scale_v() / 65_536.0)
    }
}

/// A code of a sensor's ADC: straight binary, 16 bits, 0 at 0 V.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AdcCode(pub u16);

impl AdcCode {
    /// The input, V.
    #[must_use]
    pub fn volts(self, range: AdcRange) -> f32 {
        f32::from(self.0) * (range.full_scale_v() / 65_536.0)
    }
}

/// Full scales of a board's converters in V, and its ceilings, for the checks of [`Parameters`](crate::Parameters).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Converters {
    /// Full scale of the DAC of the amplifier's command, V; `None`: as
    /// [`Parameters::command_range`](crate::Parameters::command_range) states.
    pub command_v: Option<f32>,
    /// Largest voltage that the ADC of the voltage monitor can show, V: that of its largest code.
    pub monitor_v: f32,
    /// The same for the ADC of the displacement sensor, V.
    pub sensor_v: f32,
    /// The same for the ADC of the current monitor, V; `None` for a board without one.
    pub current_v: Option<f32>,
    /// Their resolution.
    pub resolution: Resolution,
    /// Largest values that parameters may state on this board.
    pub ceilings: Ceilings,
}

/// Resolution of the converters of a board, with noise, as shares of their full scales. [`Parameters`](crate::Parameters) with finer limits
/// are refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Resolution {
    /// Share of the full scale of the amplifier's command.
    pub command: f32,
    /// Share of the full scale of the voltage monitor's ADC; 0: finer than any limit.
    pub monitor: f32,
    /// Share of the full scale of the displacement sensor's ADC; 0: finer than any limit.
    pub sensor: f32,
    /// Share by which a common reference of all converters may be off, so that command and monitor agree and both are wrong; 0 without one.
    /// It lowers the ceilings.
    pub reference: f32,
}

impl Resolution {
    /// An AD5754 and ADCs finer than any limit, with references of their own.
    pub const AD5754_ADS868X: Self = Self { command: 1.0 / 65_536.0, monitor: 0.0, sensor: 0.0, reference: 0.0 };

    /// One step of converters with so many `bits`, 1 to 24, with references of their own.
    #[must_use]
    #[allow(clippy::cast_precision_loss)] // a power of two
    pub const fn bits(bits: u32) -> Self {
        let step = 1.0 / (1_u32 << bits) as f32;
        Self { command: step, monitor: step, sensor: step, reference: 0.0 }
    }
}

impl Converters {
    /// Lowest and highest supply of an STM32F4 of 3 V with [`STM32F4_ON_CHIP`](Self::STM32F4_ON_CHIP), V. It is the reference of its converters.
    pub const STM32F4_SUPPLY_V: [f32; 2] = [2.8, 3.2];
    /// The DAC and the ADCs on an STM32F4, by [`on_chip`](Self::on_chip).
    pub const STM32F4_ON_CHIP: Self = Self::on_chip(Self::STM32F4_SUPPLY_V);

    /// Lowest and highest supply of an STM32G4 of 3.3 V with [`STM32G4_ON_CHIP`](Self::STM32G4_ON_CHIP), V.
    pub const STM32G4_SUPPLY_V: [f32; 2] = [3.1, 3.5];
    /// The DAC and the ADCs on an STM32G4, by [`on_chip`](Self::on_chip).
    pub const STM32G4_ON_CHIP: Self = Self::on_chip(Self::STM32G4_SUPPLY_V);

    /// The DAC and the ADCs of 12 bits on a chip whose supply, V from the lowest to the highest, is their reference, V at its pins, without ceilings.
    /// Full scales are those of the lowest supply; the steps are two of 4096 of the highest, since neighbouring codes of the DAC may be as far apart,
    /// and an ADC is off by as much (data sheet: differential linearity). The supply is measured with the chip's own reference, which is taken to be
    /// off by 1 % at the most.
    #[must_use]
    pub const fn on_chip([low_v, high_v]: [f32; 2]) -> Self {
        let full_scale_v = low_v * (4095.0 / 4096.0);
        let step = 2.0 * high_v / 4096.0 / full_scale_v;
        Self {
            command_v: Some(full_scale_v),
            monitor_v: full_scale_v,
            sensor_v: full_scale_v,
            current_v: None,
            resolution: Resolution { command: step, monitor: step, sensor: step, reference: 0.01 },
            ceilings: Ceilings::NONE,
        }
    }

    /// The converters of a board that this repository has firmware for, by its number, without ceilings; those of [`boards::STM32F405`] for
    /// any other number, so state those of your own firmware. With a monitor of the current where a board may have one; the board itself
    /// refuses parameters that need a missing one.
    #[must_use]
    pub const fn of_board(id: u16) -> Self {
        let converters = match id {
            boards::STM32F407_DISCOVERY => Self::STM32F4_ON_CHIP,
            boards::NUCLEO_G474RE => Self::STM32G4_ON_CHIP,
            _ => Self::AD5754_ADS868X,
        };
        // On the chip by one of its ADCs as well; otherwise the most that a board of that number has, which is the virtual one.
        Self { current_v: Some(converters.monitor_v), ..converters }
    }

    /// An AD5754 on the range of the parameters and two ADS868x on 0 to 10.24 V, without ceilings.
    pub const AD5754_ADS868X: Self = Self {
        command_v: None,
        monitor_v: AdcRange::UpTo10V24.max_v(),
        sensor_v: AdcRange::UpTo10V24.max_v(),
        current_v: None,
        resolution: Resolution::AD5754_ADS868X,
        ceilings: Ceilings::NONE,
    };
}

/// Hard ceilings of a board, which no parameters exceed: constants of its program, so that neither a blob nor an upload raises them.
///
/// ```
/// use dea_driver::chips::{Ceilings, Converters};
/// use dea_driver::{Blob, BlobError, Parameters};
/// use springpot::{Actuator, Law, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// // An amplifier of 10 kV beside a film that is never to see more than 5 kV, whatever is uploaded.
/// let ceilings = Ceilings { voltage_v: 5e3, ..Ceilings::NONE };
/// let board = Converters { ceilings, ..Converters::AD5754_ADS868X };
/// # let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model()?, LawOptions::at_step(1e-3))?;
/// let refused = Blob::with_converters(Parameters::bench(&law, Actuator::KARNER_2022), &board).err();
/// let beyond = BlobError::Ceiling { quantity: "max_voltage_v", value: 6e3, ceiling: 5e3 };
/// assert_eq!(refused, Some(beyond));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ceilings {
    /// Ceiling of [`max_voltage_v`](crate::Limits::max_voltage_v), V.
    pub voltage_v: f32,
    /// Ceiling of [`max_field_v_per_m`](crate::Limits::max_field_v_per_m), V/m.
    pub field_v_per_m: f32,
    /// Ceiling of [`max_displacement_m`](crate::Limits::max_displacement_m), m.
    pub stroke_m: f32,
}

impl Ceilings {
    /// The bounds of any limits, beyond all amplifiers, elastomers and films.
    pub const NONE: Self = Self { voltage_v: 50e3, field_v_per_m: 5e8, stroke_m: 1.0 };

    /// The ceilings of limits if a common reference may be off by a `share`.
    pub(crate) fn within(&self, share: f32) -> Self {
        let lower = |ceiling: f32| ceiling / (1.0 + share);
        Self {
            voltage_v: lower(self.voltage_v),
            field_v_per_m: lower(self.field_v_per_m),
            stroke_m: lower(self.stroke_m),
        }
    }
}
