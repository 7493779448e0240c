//! Limits of a command: those of a board, or others that are given.

use clap::Args;
use springpot::{Actuator, CommandLimits};

use crate::error::Result;
use crate::files::parameters::Board;
use crate::quantity::{self, positive};

/// Limits of the command. Defaults are those of the board, or without one those of the paper's bench.
#[derive(Clone, Debug, Default, Args)]
pub struct LimitOptions {
    /// Largest voltage; the parameters' or 6000 if left out.
    #[arg(long, value_name = "V", value_parser = quantity::volts)]
    pub max_voltage: Option<f64>,
    /// Largest electric field in the film as it thins, V/m; the parameters' or 4.2e7 if left out.
    #[arg(long, value_name = "V/M", value_parser = quantity::volts_per_metre)]
    pub max_field: Option<f64>,
    /// Largest change of voltage, V/s; the parameters' or 50e3 if left out.
    #[arg(long, value_name = "V/S", value_parser = quantity::volts_per_second)]
    pub max_slew: Option<f64>,
    /// Largest speed of the shaped reference, m/s; the parameters' or 0.05 if left out.
    #[arg(long, value_name = "M/S", value_parser = quantity::metres_per_second)]
    pub max_velocity: Option<f64>,
    /// Largest acceleration of the shaped reference, m/s²; the parameters' or 0.5 if left out.
    #[arg(long, value_name = "M/S2", value_parser = quantity::metres_per_second_squared)]
    pub max_acceleration: Option<f64>,
}

impl LimitOptions {
    /// The limits on `board`, in the controller's single precision.
    ///
    /// # Errors
    ///
    /// [`Error::Field`](crate::error::Error::Field) for one that is not finite and positive.
    pub fn limits(&self, board: Option<&Board>) -> Result<CommandLimits> {
        let mut board = board.cloned().unwrap_or_else(|| Board::bench(&Actuator::KARNER_2022));
        let Board { limits, control, .. } = &mut board;
        for (option, given, limit) in [
            ("max_voltage_v", self.max_voltage, &mut limits.max_voltage_v),
            ("max_field_v_per_m", self.max_field, &mut limits.max_field_v_per_m),
            ("max_slew_v_per_s", self.max_slew, &mut limits.max_slew_v_per_s),
            ("max_velocity_m_per_s", self.max_velocity, &mut control.max_velocity_m_per_s),
            ("max_acceleration_m_per_s2", self.max_acceleration, &mut control.max_acceleration_m_per_s2),
        ] {
            if let Some(given) = given {
                positive(option, given)?;
                *limit = given as f32;
            }
        }
        Ok(board.command_limits())
    }
}
