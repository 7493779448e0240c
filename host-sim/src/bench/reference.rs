//! References for a run: of a file or of a shape, as many values a second as are sent.

use std::path::Path;

use dea_driver::wire::Mode;

use super::shared::{Play, SENT_HZ};
use crate::choice::Choice;
use crate::error::{Error, Result};
use crate::files::import::Hints;
use crate::files::recording::{Input, Recording};
use crate::grid::Grid;
use crate::references::{self, Reference, Shape};

/// The recording that `path` has for this `mode`.
///
/// # Errors
///
/// [`Error`] naming the file.
pub fn read(mode: Mode, path: &Path, hints: &Hints) -> Result<Recording> {
    if mode == Mode::Voltage { Recording::read_with(path, hints) } else { Recording::read_reference(path, hints) }
}

/// Values of `recording` to play, [`SENT_HZ`] a second: its displacement, or the magnitude of its voltage.
///
/// # Errors
///
/// [`Error`] naming the file where it has none.
pub fn values(mode: Mode, recording: &Recording) -> Result<Vec<f32>> {
    if mode != Mode::Voltage {
        let (reference, _) = references::on_grid(recording, SENT_HZ)?;
        return Ok(reference.into_iter().map(|metres| metres as f32).collect());
    }
    let Input::Voltage(voltage) = recording.drive()? else {
        return Err(Error::file(recording.path(), "a column voltage_v or voltage_kv is needed"));
    };
    let volts = Grid::covering(recording.duration_s(), SENT_HZ)?.resample(&voltage);
    // The film feels the square of a voltage: a monitor's noise about 0 V, or a bipolar drive, pulls either way.
    Ok(volts.into_iter().map(|volts| volts.abs() as f32).collect())
}

/// The reference in the file at `path`.
///
/// # Errors
///
/// [`Error`] naming the file.
pub fn of_file(mode: Mode, name: &str, path: &Path) -> Result<Play> {
    Ok(Play { name: name.into(), mode, values: values(mode, &read(mode, path, &Hints::default())?)? })
}

/// A shape between `low` and `high` (m, or V).
///
/// # Errors
///
/// [`Error::Field`] for sizes and times that make no sense.
pub fn of_shape(mode: Mode, shape: Shape, [low, high]: [f64; 2], period_s: f64, duration_s: f64) -> Result<Play> {
    // Shapes are of displacements, which are small: a voltage is one of so many.
    let unit = if mode == Mode::Voltage { 1e6 } else { 1.0 };
    let reference = Reference::new(shape, low / unit, high / unit, period_s);
    let (values, _) = reference.over(duration_s, SENT_HZ, None)?;
    let name = format!("{}, {duration_s} s", shape.name());
    Ok(Play { name, mode, values: values.into_iter().map(|value| (unit * value) as f32).collect() })
}
