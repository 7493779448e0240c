//! The command of a tick to the amplifier.

use crate::chips::{CommandRange, DacCode};

/// What the amplifier is to be told at the end of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drive {
    /// Whether the amplifier is enabled. If not, disable it before anything else.
    pub enable: bool,
    /// The amplifier's command.
    pub command: DacCode,
    /// The range of that command.
    pub range: CommandRange,
}

impl Drive {
    /// 0 V, disabled.
    pub const OFF: Self = Self { enable: false, command: DacCode::ZERO, range: CommandRange::FiveVolts };
}
