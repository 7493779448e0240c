//! Codes of the converters, their ranges in volts, and calibrations.

use serde::{Deserialize, Serialize};

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
    pub const fn largest_v(self) -> f32 {
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

/// Largest volts at the converters: what the checks of [`Parameters`](crate::Parameters) need to know of a board.
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
}

impl Converters {
    /// An AD5754 on the range of the parameters and two ADS868x on 0 to 10.24 V.
    pub const AD5754_ADS868X: Self =
        Self { command_v: None, monitor_v: AdcRange::UpTo10V24.largest_v(), sensor_v: AdcRange::UpTo10V24.largest_v() };
}

/// From an instrument's volts to a quantity and back: `y = offset + gain u + quadratic u²`.
///
/// Amplifier: u is the command (V), y the high voltage (V). Voltage monitor: u is its output (V), y the high voltage (V).
/// Displacement sensor: u is its output (V), y the stroke (m).
///
/// ```
/// use dea_driver::chips::Calibration;
///
/// // An amplifier of 1000 V per volt that loses 1 V per volt² and has an offset of −20 V.
/// let amplifier = Calibration { offset: -20.0, gain: 1000.0, quadratic: -1.0 };
/// assert!(amplifier.rises_up_to(10.0));
/// let command_v = amplifier.invert(3000.0);
/// assert!((amplifier.apply(command_v) - 3000.0).abs() < 1e-2);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Calibration {
    /// y at u = 0.
    pub offset: f32,
    /// Change of y per volt at u = 0.
    pub gain: f32,
    /// Curvature, per volt².
    pub quadratic: f32,
}

impl Calibration {
    /// A straight line through zero.
    #[must_use]
    pub const fn linear(gain: f32) -> Self {
        Self { offset: 0.0, gain, quadratic: 0.0 }
    }

    /// Whether y rises with u from 0 V to `full_scale_v`, so that it can be inverted there.
    #[must_use]
    pub fn rises_up_to(&self, full_scale_v: f32) -> bool {
        let finite = self.offset.is_finite() && self.gain.is_finite() && self.quadratic.is_finite();
        finite && self.gain > 0.0 && self.gain + 2.0 * self.quadratic * full_scale_v > 0.0
    }

    /// The quantity at `volts`.
    #[must_use]
    pub fn apply(&self, volts: f32) -> f32 {
        self.offset + volts * (self.gain + volts * self.quadratic)
    }

    /// The volts at which the quantity is `value`, for a calibration that [rises](Self::rises_up_to). Three steps of Newton
    /// from the straight line: 1e-6 of full scale for curvatures of up to a fifth of the gain.
    #[must_use]
    pub fn invert(&self, value: f32) -> f32 {
        let wanted = value - self.offset;
        let mut volts = wanted / self.gain;
        for _ in 0..3 {
            let error = volts * (self.gain + volts * self.quadratic) - wanted;
            volts -= error / (self.gain + 2.0 * self.quadratic * volts);
        }
        volts
    }
}
