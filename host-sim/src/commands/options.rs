//! Options that several commands share.

use clap::Args;
use springpot::{Actuator, CommandLimits};

use crate::error::{Error, Result};
use crate::files::parameters::Board;
use crate::files::recording::Direction;
use crate::quantity;

/// Limits of the command. Defaults are those of the board, or without one those of the paper's bench.
#[derive(Clone, Debug, Args)]
pub(super) struct LimitOptions {
    /// Largest voltage; the parameters' or 6000 if left out.
    #[arg(long, value_name = "V", value_parser = quantity::volts)]
    max_voltage: Option<f64>,
    /// Largest electric field in the film as it thins, V/m; the parameters' or 4.2e7 if left out.
    #[arg(long, value_name = "V/M", value_parser = quantity::volts_per_metre)]
    max_field: Option<f64>,
    /// Largest change of voltage, V/s; the parameters' or 50e3 if left out.
    #[arg(long, value_name = "V/S", value_parser = quantity::volts_per_second)]
    max_slew: Option<f64>,
    /// Largest speed of the shaped reference, m/s; the parameters' or 0.05 if left out.
    #[arg(long, value_name = "M/S", value_parser = quantity::metres_per_second)]
    max_velocity: Option<f64>,
    /// Largest acceleration of the shaped reference, m/s²; the parameters' or 0.5 if left out.
    #[arg(long, value_name = "M/S2", value_parser = quantity::metres_per_second_squared)]
    max_acceleration: Option<f64>,
}

impl LimitOptions {
    /// The limits on `board`.
    pub(super) fn limits(&self, board: Option<&Board>) -> Result<CommandLimits> {
        let mut limits = board.map_or(CommandLimits::BENCH, Board::command_limits);
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

/// The actuator of recordings without one: the paper's, without mass if displacement drives, because a test machine carries the
/// weight.
pub(super) fn assumed_actuator(drive: Direction) -> Actuator {
    match drive {
        Direction::Force => Actuator::KARNER_2022,
        Direction::Displacement => Actuator { mass_kg: 0.0, ..Actuator::KARNER_2022 },
    }
}

/// Most random starts of a structure: their memory alone would be gigabytes.
const MOST_STARTS: usize = 100_000;

/// Refuses a number of random starts of a structure with which no search could begin, or end.
pub(super) fn checked_starts(starts: usize) -> Result<()> {
    if (1..=MOST_STARTS).contains(&starts) {
        Ok(())
    } else {
        Err(Error::option("--starts", format!("{starts} must be from 1 to {MOST_STARTS}; the default is 8")))
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

/// Refuses a value outside 0 to `most`.
pub(super) fn at_most(option: &'static str, value: f64, most: f64) -> Result<()> {
    if (0.0..=most).contains(&value) {
        Ok(())
    } else {
        Err(Error::option(option, format!("{value:?} must be from 0 to {most}")))
    }
}
