//! Limits of a command: those of a board, or others that are given.

use springpot::{Actuator, CommandLimits};

use crate::error::{Error, Result};
use crate::files::parameters::Board;
use crate::quantity::positive;

/// The limits of a command on `board`, or on the paper's bench, in the controller's single precision; those in `given` replace
/// the limits of these names.
///
/// # Errors
///
/// [`Error::Field`] for one that is not finite and positive, or whose name is not among them.
pub fn command_limits<'a>(
    board: Option<&Board>,
    given: impl IntoIterator<Item = (&'a str, f64)>,
) -> Result<CommandLimits> {
    let mut board = board.cloned().unwrap_or_else(|| Board::bench(&Actuator::KARNER_2022));
    let Board { limits, control, .. } = &mut board;
    let mut known = [
        ("max_voltage_v", &mut limits.max_voltage_v),
        ("max_field_v_per_m", &mut limits.max_field_v_per_m),
        ("max_slew_v_per_s", &mut limits.max_slew_v_per_s),
        ("max_velocity_m_per_s", &mut control.max_velocity_m_per_s),
        ("max_acceleration_m_per_s2", &mut control.max_acceleration_m_per_s2),
    ];
    for (name, value) in given {
        let names = known.each_ref().map(|(known, _)| *known).join(", ");
        let (field, limit) = known
            .iter_mut()
            .find(|(known, _)| *known == name)
            .ok_or_else(|| Error::field("limits", format!("no limit {name:?}; there are {names}")))?;
        positive(field, value)?;
        **limit = value as f32;
    }
    Ok(board.command_limits())
}
