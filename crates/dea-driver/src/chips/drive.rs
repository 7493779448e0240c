//! The amplifier's input at the end of a tick.

use crate::chips::CommandRange;

/// The amplifier's input at the end of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Whether the amplifier is enabled. If not, disable it before anything else.
    pub enable: bool,
    /// The amplifier's command, V at the DAC's output.
    pub dac_v: f32,
    /// The range of an AD5754. A board with another DAC ignores it.
    pub range: CommandRange,
}

impl Drive {
    /// 0 V, disabled.
    pub const OFF: Self = Self { enable: false, dac_v: 0.0, range: CommandRange::FiveVolts };
}
