//! Recordings with a tone and the current that it causes, and the files of what was found in them.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use serde::{Deserialize, Serialize};
use springpot::{CapacitanceRelation, SelfSensingOptions};

use crate::error::{Error, Result};
use crate::files::bounded;
use crate::files::parameters::plausibility::check_self_sensing;

/// A recording at the ticks of a tone, in SI units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToneRecording {
    /// Time between two rows, s.
    pub step_s: f64,
    /// Voltage at the time of the row, V.
    pub voltage_v: Vec<f64>,
    /// Mean current since the row before, A.
    pub current_a: Vec<f64>,
    /// Displacement, m; NaN where the sensor has no reading.
    pub displacement_m: Vec<f64>,
}

/// Columns of such a recording.
const COLUMNS: [&str; 4] = ["time_s", "voltage_v", "current_a", "displacement_m"];
/// Bytes in which the names of the columns are.
const MAX_HEADER: u64 = 1 << 16;
/// Largest recording, in bytes: some hours at 1 kHz.
const MAX_RECORDING: u64 = 1 << 29;
/// Largest file with a relation, in bytes.
const MAX_FILE: u64 = 1 << 20;
/// Largest deviation of a time from its tick, in ticks.
const UNEVEN: f64 = 0.05;

impl ToneRecording {
    /// Whether the file at `path` has a column `current_a`.
    #[must_use]
    pub fn has_current(path: &Path) -> bool {
        let Ok(file) = fs::File::open(path) else { return false };
        let mut lines = BufReader::new(file.take(MAX_HEADER)).lines().map_while(std::result::Result::ok);
        lines
            .find(|line| !line.starts_with('#'))
            .is_some_and(|line| line.split(',').any(|name| name.trim() == COLUMNS[2]))
    }

    /// Reads the recording at `path`: CSV with the columns `time_s`, `voltage_v`, `current_a` and `displacement_m`, in any order and among others;
    /// cells of the displacement may be empty, and lines that begin with `#` are comments.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file and line of the first thing that cannot be used.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_csv(path, &bounded::read_text(path, MAX_RECORDING, "a recording with a tone")?)
    }

    /// Reads a recording from CSV text; `path` is what errors name.
    pub fn from_csv(path: &Path, text: &str) -> Result<Self> {
        let lines = text.lines().enumerate().map(|(k, line)| (k as u64 + 1, line.trim_start_matches('\u{feff}')));
        let mut lines = lines.filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let Some((line, header)) = lines.next() else { return Err(Error::file(path, "is empty")) };
        let names: Vec<&str> = header.split(',').map(str::trim).collect();
        let found = COLUMNS.map(|wanted| names.iter().position(|name| *name == wanted));
        let [Some(time), Some(voltage), Some(current), Some(displacement)] = found else {
            let missing = COLUMNS.iter().zip(found).filter(|(_, place)| place.is_none());
            let cause = format!(
                "no column {}; a recording for self-sensing has {}: rename others, and convert their numbers to s, V, A and m",
                missing.map(|(name, _)| *name).collect::<Vec<_>>().join(", "),
                COLUMNS.join(", ")
            );
            return Err(Error::line(path, line, cause));
        };
        let places = [time, voltage, current, displacement];
        let mut columns: [Vec<f64>; 4] = Default::default();
        for (line, row) in lines {
            let cells: Vec<&str> = row.split(',').map(str::trim).collect();
            for ((column, &place), name) in columns.iter_mut().zip(&places).zip(COLUMNS) {
                let cell = cells.get(place).copied().unwrap_or("");
                let value = match cell {
                    "" if name == "displacement_m" => f64::NAN,
                    _ => cell.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| {
                        Error::line(path, line, format!("{name} is {cell:?}; every tick needs a finite number"))
                    })?,
                };
                column.push(value);
            }
        }
        let [time_s, voltage_v, current_a, displacement_m] = columns;
        let (Some(first), Some(last)) = (time_s.first(), time_s.last()) else {
            return Err(Error::file(path, "has no rows"));
        };
        let step_s = (last - first) / (time_s.len().max(2) - 1) as f64;
        let off = |k: usize| (time_s[k] - first - step_s * k as f64).abs();
        let is_even = step_s > 0.0 && (0..time_s.len()).all(|k| off(k) <= UNEVEN * step_s);
        if !is_even {
            let cause = "the rows are not one tick apart; record every tick of the tone, without gaps";
            return Err(Error::file(path, cause));
        }
        // A clock has its digits.
        let step_s = (step_s * 1e9).round() * 1e-9;
        Ok(Self { step_s, voltage_v, current_a, displacement_m })
    }
}

/// A film and its bench, as self-sensing needs them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CapacitanceFile {
    /// The film.
    pub relation: CapacitanceRelation,
    /// Tone and monitors.
    pub options: SelfSensingOptions,
}

impl CapacitanceFile {
    /// Reads the file at `path` (TOML).
    ///
    /// # Errors
    ///
    /// [`Error::File`] for a file that has another content, and values that no film has.
    pub fn read(path: &Path) -> Result<Self> {
        let text = bounded::read_text(path, MAX_FILE, "a relation of capacitance and displacement")?;
        let file: Self = toml::from_str(&text).map_err(|error| {
            let (kind, cause) = ("relation of capacitance and displacement", error.message());
            Error::file(path, format!("is no {kind}: {cause}; the command self-sensing writes one"))
        })?;
        check_self_sensing(&file.relation, &file.options).map_err(|cause| Error::file(path, cause))?;
        Ok(file)
    }

    /// As TOML.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).unwrap_or_else(|error| unreachable!("numbers alone: {error}"))
    }
}
