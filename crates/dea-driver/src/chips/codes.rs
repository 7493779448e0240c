//! Codes of the converters, the volts they stand for, and calibrations.

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

/// A code of the amplifier's DAC: straight binary, 16 bits left-aligned, 0 at 0 V. The AD5754 takes all 16, its smaller
/// siblings the upper 14 or 12.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DacCode(pub u16);

impl DacCode {
    /// 0 V.
    pub const ZERO: Self = Self(0);

    /// The code nearest to `volts` at the DAC's output, within its range; 0 V for what is not a number.
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

/// A code of a sensor's ADC: straight binary, 0 at 0 V, 65536 counts to 10.24 V (ADS868x on its 2.5 × 4.096 V range).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AdcCode(pub u16);

impl AdcCode {
    /// Full scale, V.
    pub const FULL_SCALE_V: f32 = 10.24;

    /// The input, V.
    #[must_use]
    pub fn volts(self) -> f32 {
        f32::from(self.0) * (Self::FULL_SCALE_V / 65_536.0)
    }
}

/// From an instrument's volts to a quantity and back: `y = offset + gain u + quadratic u²`.
///
/// Of the amplifier, u is the command (V) and y the high voltage (V); of the voltage monitor, u is the monitor's output
/// and y the high voltage; of the displacement sensor, u is its output and y the stroke (m).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Calibration {
    /// y at u = 0.
    pub offset: f32,
    /// Change of y per volt at u = 0.
    pub gain: f32,
    /// Bend, per volt².
    pub quadratic: f32,
}

impl Calibration {
    /// A straight line through nought.
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
    /// from the straight line: 1e-6 of full scale for bends of up to a fifth of the gain.
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
