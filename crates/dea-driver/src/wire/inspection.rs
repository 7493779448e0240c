//! The state of a board's parts.

use serde::{Deserialize, Serialize};

/// State of a board's parts in a tick, with or without parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Inspection {
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// Whether the pin of the enable output reads high, whatever drives it.
    pub enable_high: bool,
    /// The DAC of the amplifier's command.
    pub dac: Part,
    /// The ADC of the voltage monitor.
    pub monitor: Part,
    /// The ADC of the displacement sensor.
    pub sensor: Part,
    /// At the monitor's ADC, V; NaN if it does not answer.
    pub monitor_adc_v: f32,
    /// At the sensor's ADC, V; NaN if it does not answer.
    pub sensor_adc_v: f32,
}

impl Inspection {
    /// A board whose parts are being set up.
    pub const STARTING: Self = Self {
        interlock_closed: false,
        enable_high: false,
        dac: Part::Starting,
        monitor: Part::Starting,
        sensor: Part::Starting,
        monitor_adc_v: f32::NAN,
        sensor_adc_v: f32::NAN,
    };
}

/// How a part answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Part {
    /// Correctly: it reads back as it was sent.
    Answers,
    /// The transfer failed.
    Bus,
    /// The value read back differs from the one sent: the part is not there, without supply, not wired, or another chip.
    Wrong {
        /// The value that it was sent.
        wanted: u16,
        /// The value that was read.
        found: u16,
    },
    /// It is being set up.
    Starting,
    /// A pin does not switch.
    Pin,
    /// The DAC has no internal reference, which the firmware was built for: it is an AD5754, not an AD5754R.
    NoReference,
}
