//! Options that commands of control share.

use clap::Args;
use springpot::CommandLimits;

use crate::error::{Error, Result};
use crate::files::parameters::Board;

/// Limits of what is commanded. Those that are left out are the board's, or without one the paper's bench's.
#[derive(Clone, Debug, Args)]
pub(super) struct LimitOptions {
    /// Largest voltage; the parameters' or 6000 if left out.
    #[arg(long, value_name = "V")]
    max_voltage: Option<f64>,
    /// Largest electric field in the film as it thins, V/m; the parameters' or 4.2e7 if left out.
    #[arg(long, value_name = "V/M")]
    max_field: Option<f64>,
    /// Largest change of voltage, V/s; the parameters' or 50e3 if left out.
    #[arg(long, value_name = "V/S")]
    max_slew: Option<f64>,
    /// Largest speed of the shaped reference, m/s; the parameters' or 0.05 if left out.
    #[arg(long, value_name = "M/S")]
    max_velocity: Option<f64>,
    /// Largest acceleration of the shaped reference, m/s²; the parameters' or 0.5 if left out.
    #[arg(long, value_name = "M/S2")]
    max_acceleration: Option<f64>,
}

impl LimitOptions {
    /// The limits on `board`.
    pub(super) fn limits(&self, board: Option<&Board>) -> Result<CommandLimits> {
        let mut limits = board.map_or(CommandLimits::BENCH, |Board { limits, control, .. }| CommandLimits {
            max_voltage_v: as_written(limits.max_voltage_v),
            max_field_v_per_m: as_written(limits.max_field_v_per_m),
            max_slew_v_per_s: as_written(limits.max_slew_v_per_s),
            max_velocity_m_per_s: as_written(control.max_velocity_m_per_s),
            max_acceleration_m_per_s2: as_written(control.max_acceleration_m_per_s2),
            return_hz: as_written(control.return_hz),
        });
        for (option, given, limit) in [
            ("--max-voltage", self.max_voltage, &mut limits.max_voltage_v),
            ("--max-field", self.max_field, &mut limits.max_field_v_per_m),
            ("--max-slew", self.max_slew, &mut limits.max_slew_v_per_s),
            ("--max-velocity", self.max_velocity, &mut limits.max_velocity_m_per_s),
            ("--max-acceleration", self.max_acceleration, &mut limits.max_acceleration_m_per_s2),
        ] {
            if let Some(given) = given {
                positive(option, given)?;
                *limit = given;
            }
        }
        Ok(limits)
    }
}

/// A number of a controller as it was written, without the digits of its single precision.
pub(super) fn as_written(number: f32) -> f64 {
    number.to_string().parse().unwrap_or(f64::from(number))
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
