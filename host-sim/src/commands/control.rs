//! Options that commands of control share.

use clap::Args;
use springpot::CommandLimits;

use crate::error::{Error, Result};

/// Limits of what is commanded.
#[derive(Clone, Debug, Args)]
pub(super) struct LimitOptions {
    /// Largest voltage.
    #[arg(long, value_name = "V", default_value_t = CommandLimits::BENCH.max_voltage_v)]
    max_voltage: f64,
    /// Largest electric field in the film as it thins, V/m.
    #[arg(long, value_name = "V/M", default_value_t = CommandLimits::BENCH.max_field_v_per_m)]
    max_field: f64,
    /// Largest change of voltage, V/s.
    #[arg(long, value_name = "V/S", default_value_t = CommandLimits::BENCH.max_slew_v_per_s)]
    max_slew: f64,
    /// Largest speed of the shaped reference, m/s.
    #[arg(long, value_name = "M/S", default_value_t = CommandLimits::BENCH.max_velocity_m_per_s)]
    max_velocity: f64,
    /// Largest acceleration of the shaped reference, m/s².
    #[arg(long, value_name = "M/S2", default_value_t = CommandLimits::BENCH.max_acceleration_m_per_s2)]
    max_acceleration: f64,
}

impl LimitOptions {
    /// The limits.
    pub(super) fn limits(&self) -> Result<CommandLimits> {
        for (option, value) in [
            ("--max-voltage", self.max_voltage),
            ("--max-field", self.max_field),
            ("--max-slew", self.max_slew),
            ("--max-velocity", self.max_velocity),
            ("--max-acceleration", self.max_acceleration),
        ] {
            positive(option, value)?;
        }
        Ok(CommandLimits {
            max_voltage_v: self.max_voltage,
            max_field_v_per_m: self.max_field,
            max_slew_v_per_s: self.max_slew,
            max_velocity_m_per_s: self.max_velocity,
            max_acceleration_m_per_s2: self.max_acceleration,
            ..CommandLimits::BENCH
        })
    }
}

/// Refuses a value that is not finite and greater than 0.
pub(super) fn positive(option: &'static str, value: f64) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(Error::option(option, format!("{value:?} must be finite and greater than 0")))
    }
}

/// Refuses a value that does not lie within 0 and `most`.
pub(super) fn at_most(option: &'static str, value: f64, most: f64) -> Result<()> {
    if (0.0..=most).contains(&value) {
        Ok(())
    } else {
        Err(Error::option(option, format!("{value:?} must be from 0 to {most}")))
    }
}
