//! Logs of an amplifier: what was commanded, and what the voltage monitor showed.
//!
//! [`crate::files::layout`] reads them. `link … stream` and `play` write such logs; there the column of the monitor is `voltage_v`.

use std::io::Read;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::files::import::{Hints, Names, Quantity, Understood};
use crate::files::layout::Layout;
use crate::files::table::Table;
use crate::grid::range;

/// A log, row by row; time from its first row.
#[derive(Clone, Debug, PartialEq)]
pub struct AmplifierLog {
    path: PathBuf,
    /// Times, s.
    pub time_s: Vec<f64>,
    /// High voltage that was asked for from that time on, V.
    pub command_v: Vec<f64>,
    /// High voltage that the monitor showed, V; NaN where it gave nothing.
    pub monitor_v: Vec<f64>,
    /// Interpretation of the file.
    pub understood: Understood,
}

const COMMAND: &Names = &[("command_v", "V"), ("command_kv", "kV")];
const MONITOR: &Names = &[("monitor_v", "V"), ("monitor_kv", "kV"), ("voltage_v", "V"), ("voltage_kv", "kV")];

const LOG: Layout<2> = Layout {
    what: "a CSV log",
    columns: [(Quantity::Command, COMMAND), (Quantity::Voltage, MONITOR)],
    needed: &[&[Quantity::Command], &[Quantity::Voltage]],
};

/// Fewer rows do not separate a lag from noise.
const MIN_ROWS: usize = 50;
/// A command below 0 V by more than this share of the largest is no offset of its zero.
const BELOW_ZERO: f64 = 0.02;

impl AmplifierLog {
    /// Reads the log at `path`, of which a person says `hints`.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file and line of the first thing that cannot be used.
    pub fn read(path: &Path, hints: &Hints) -> Result<Self> {
        let (table, understood) = LOG.read(path, hints)?;
        Self::new(path, table, understood)
    }

    /// Reads a log from CSV text; `path` is what errors name.
    pub fn from_csv(path: &Path, csv: impl Read) -> Result<Self> {
        let (table, understood) = LOG.from_csv(path, csv)?;
        Self::new(path, table, understood)
    }

    fn new(path: &Path, table: Table<2>, understood: Understood) -> Result<Self> {
        let Table { time_s, columns: [command, monitor], .. } = table;
        let fault = |cause: String| Error::file(path, cause);
        if time_s.len() < MIN_ROWS {
            let cause = format!("{} rows; record at least {MIN_ROWS}, with steps up and down to 0 V", time_s.len());
            return Err(fault(cause));
        }
        let command = command.ok_or_else(|| fault("command_v is empty; fill in the commanded voltage".into()))?;
        let monitor = monitor.ok_or_else(|| fault("the monitor's column is empty; connect the monitor".into()))?;
        let command_v = command.complete(path, &time_s, "what was commanded must be complete")?.value;
        let shown = monitor.present(&time_s);
        let mut shown = shown.time_s.iter().zip(&shown.value).peekable();
        let monitor_v: Vec<f64> =
            time_s.iter().map(|t| shown.next_if(|(at, _)| *at == t).map_or(f64::NAN, |(_, &volts)| volts)).collect();
        let readings = monitor_v.iter().filter(|volts| !volts.is_nan());
        let count = readings.clone().count();
        if count < MIN_ROWS {
            return Err(fault(format!("{count} rows with a reading of the monitor; at least {MIN_ROWS} are needed")));
        }
        let (low, high) = range(&command_v);
        if low < -BELOW_ZERO * high.abs().max(-low) {
            return Err(fault(format!("command_v goes down to {low} V; the amplifier's model is from 0 V up")));
        }
        if high - low <= 1e-6 * high.abs() {
            return Err(fault(format!("command_v stays at {high} V; record steps up and down to 0 V")));
        }
        let (shown_low, shown_high) = range(readings);
        if shown_high == shown_low {
            let cause = format!("the monitor shows {shown_high} V throughout; check its wiring and the amplifier");
            return Err(fault(cause));
        }
        Ok(Self { path: path.into(), time_s, command_v, monitor_v, understood })
    }

    /// Where the log came from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Largest command minus the smallest, V.
    pub fn span_v(&self) -> f64 {
        let (low, high) = range(&self.command_v);
        high - low
    }
}
