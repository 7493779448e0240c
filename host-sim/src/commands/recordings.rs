//! Recordings as commands take them: reads the laboratory's own formats, and reports how each was read.

use super::prelude::*;
use crate::files::import::{Choices, Decimal, Fill, Hints, RepeatedTimes, Understood};
use crate::files::recording::{Input, Recording};
use crate::grid::Grid;
use crate::quantity::positive;
use crate::references;
use crate::sampling;

/// Options for files whose columns do not have the names of a recording.
#[derive(Clone, Debug, Default, Args)]
pub(super) struct RecordingOptions {
    /// Which column is what, by its name or number, with a unit and a factor if need be:
    /// time=Zeit:s,voltage="HV mon"*2000,displacement=3:mm. Other columns are found by names and units; force=none leaves it out.
    /// Logs of an amplifier have a command beside the voltage, material tests stretch and stress.
    #[arg(long, value_name = "COLUMNS")]
    columns: Option<Choices>,
    /// Spreadsheet of a workbook.
    #[arg(long, value_name = "NAME")]
    sheet: Option<String>,
    /// Line of the column names, where it is not found; the rows follow it.
    #[arg(long, value_name = "LINE")]
    header: Option<u64>,
    /// Run of rows to read, from 1, where the header is repeated.
    #[arg(long, value_name = "N")]
    segment: Option<usize>,
    /// Decimal sign, where numbers such as 1.234 can be read in two ways.
    #[arg(long, value_name = "SIGN", value_parser = named::<Decimal>())]
    decimal: Option<Decimal>,
    /// Meaning of rows of one time.
    #[arg(long, value_name = "MEANING", value_parser = named::<RepeatedTimes>())]
    repeated_times: Option<RepeatedTimes>,
    /// Drive between its readings, where it was logged more slowly than the sensor.
    #[arg(long, value_name = "HOW", value_parser = named::<Fill>())]
    fill: Option<Fill>,
}

/// Options of the commands that judge or rewrite recordings.
#[derive(Clone, Debug, Args)]
pub(super) struct RawOptions {
    #[command(flatten)]
    reading: RecordingOptions,
    /// Rows per second, for a file without a column of times.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz)]
    rate: Option<f64>,
    /// Take the displacement with the opposite sign.
    #[arg(long)]
    invert: bool,
}

impl RawOptions {
    pub(super) fn hints(&self) -> Result<Hints> {
        if let Some(rate_hz) = self.rate {
            positive("rate_hz", rate_hz)?;
        }
        Ok(Hints { rate_hz: self.rate, invert: self.invert, ..self.reading.hints() })
    }
}

impl RecordingOptions {
    pub(super) fn hints(&self) -> Hints {
        Hints {
            choices: self.columns.clone().unwrap_or_default(),
            sheet: self.sheet.clone(),
            header_line: self.header,
            segment: self.segment,
            decimal: self.decimal,
            repeated_times: self.repeated_times,
            fill: self.fill,
            ..Hints::default()
        }
    }

    /// Reads all `paths`; how files with other names were read is reported on standard error.
    pub(super) fn read(&self, paths: &[PathBuf]) -> Result<Vec<Recording>> {
        let hints = self.hints();
        let recordings =
            paths.iter().map(|path| Recording::read_with(path, &hints)).collect::<Result<Vec<Recording>>>()?;
        recordings.iter().for_each(report);
        Ok(recordings)
    }

    /// Reads the recording at `path`, as [`read`](Self::read).
    pub(super) fn read_one(&self, path: &Path) -> Result<Recording> {
        let recording = Recording::read_with(path, &self.hints())?;
        report(&recording);
        Ok(recording)
    }

    /// Reads the reference at `path`, as [`read`](Self::read).
    pub(super) fn read_reference(&self, path: &Path) -> Result<Recording> {
        let recording = Recording::read_reference(path, &self.hints())?;
        report(&recording);
        Ok(recording)
    }

    /// The same, on its grid at `rate_hz`.
    pub(super) fn reference(&self, path: &Path, rate_hz: f64) -> Result<(Vec<f64>, Grid)> {
        let recording = self.read_reference(path)?;
        report_sampling(&recording, &recording.displacement_drive()?, rate_hz);
        references::on_grid(&recording, rate_hz)
    }
}

/// Reports how a `recording` with other names was read, and which temperature is not used.
pub(super) fn report_columns(recording: &Recording) {
    recording.understood().into_iter().for_each(report_understood);
    if let Some(unused) = recording.unused_temperature() {
        terminal::information(format!("{}: {}", shown(recording.path()), with_flags(&unused)));
    }
}

/// Warns of what a model that follows the `input` of a `recording` at `rate_hz` misses of it.
pub(super) fn report_sampling(recording: &Recording, input: &Input, rate_hz: f64) {
    let file = shown(recording.path());
    let remarks = sampling::remarks(input.samples(), rate_hz).into_iter();
    terminal::warnings(false, remarks.map(|remark| format!("{file}: {remark}")));
}

/// Reports the columns of a `recording`, and what of its rows needs care.
pub(super) fn report(recording: &Recording) {
    report_columns(recording);
    let file = shown(recording.path());
    let lines = recording.remarks().into_iter();
    terminal::warnings(false, lines.map(|line| format!("{file}: {}", with_flags(&line))));
}

/// Reports how a file was read, if it has other names.
pub(super) fn report_understood(understood: &Understood) {
    if !understood.is_own() {
        terminal::information(understood.line());
    }
}
