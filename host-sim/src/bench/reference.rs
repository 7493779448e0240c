//! References for a run: of a file or of a shape, as many values a second as are sent.

use std::path::Path;

use clap::ValueEnum;
use dea_driver::wire::{Answer, Command, Mode, Reject};
use serde::Deserialize;

use super::shared::{Play, SENT_HZ};
use crate::choice::Choice;
use crate::error::{Error, Result};
use crate::files::import::Hints;
use crate::files::recording::{Input, Recording};
use crate::grid::Grid;
use crate::link::Client;
use crate::references::{self, Reference, Shape};

/// Quantity that a controller follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum What {
    /// The voltage that is set.
    Voltage,
    /// The displacement that is set, without the sensor.
    Feedforward,
    /// The displacement that is set, with the sensor.
    Tracking,
}

impl From<What> for Mode {
    fn from(what: What) -> Self {
        match what {
            What::Voltage => Self::Voltage,
            What::Feedforward => Self::Feedforward,
            What::Tracking => Self::Tracking,
        }
    }
}

/// The command that sets `value` (V or m) in a run of this `mode`.
pub fn set(mode: Mode, value: f32) -> Command {
    if mode == Mode::Voltage { Command::SetVoltage(value) } else { Command::SetReference(value) }
}

/// The largest of `values` with the reason why the board refuses it, if it does. What is beyond the limits shows before anything is enabled: a
/// set-point within them is refused for the state alone.
pub fn refused(client: &mut Client, mode: Mode, values: &[f32]) -> Result<Option<(f32, Error)>> {
    let Some(&largest) = values.iter().max_by(|a, b| a.abs().total_cmp(&b.abs())) else { return Ok(None) };
    let answer = client.ask(set(mode, largest))?;
    Ok((answer == Answer::Rejected(Reject::Value)).then(|| (largest, client.unexpected(&answer))))
}

/// The recording that `path` has for this `mode`.
pub fn read(mode: Mode, path: &Path, hints: &Hints) -> Result<Recording> {
    if mode == Mode::Voltage { Recording::read_with(path, hints) } else { Recording::read_reference(path, hints) }
}

/// Values of `recording` to play, [`SENT_HZ`] a second: its displacement, or the magnitude of its voltage.
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
pub fn of_file(mode: Mode, name: &str, path: &Path) -> Result<Play> {
    Ok(Play { name: name.into(), mode, values: values(mode, &read(mode, path, &Hints::default())?)? })
}

/// A shape between `low` and `high` (m, or V).
pub fn of_shape(mode: Mode, shape: Shape, [low, high]: [f64; 2], period_s: f64, duration_s: f64) -> Result<Play> {
    // Shapes are of displacements, which are small: a voltage is one of so many.
    let unit = if mode == Mode::Voltage { 1e6 } else { 1.0 };
    let reference = Reference::new(shape, low / unit, high / unit, period_s);
    let (values, _) = reference.over(duration_s, SENT_HZ, None)?;
    let name = format!("{}, {duration_s} s", shape.name());
    Ok(Play { name, mode, values: values.into_iter().map(|value| (unit * value) as f32).collect() })
}
