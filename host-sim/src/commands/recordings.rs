//! Recordings as commands take them: reads the laboratory's own formats, and reports how each was read.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::error::Result;
use crate::files::import::{Choices, Hints, Understood};
use crate::files::recording::Recording;
use crate::grid::Grid;
use crate::references;
use crate::terminal;

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
}

impl RecordingOptions {
    pub(super) fn hints(&self) -> Hints {
        Hints { choices: self.columns.clone().unwrap_or_default(), sheet: self.sheet.clone() }
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
        references::on_grid(&self.read_reference(path)?, rate_hz)
    }
}

/// Reports how a `recording` with other names was read.
pub(super) fn report(recording: &Recording) {
    recording.understood().into_iter().for_each(report_understood);
}

/// Reports how a file was read, if it has other names.
pub(super) fn report_understood(understood: &Understood) {
    if !understood.is_own() {
        terminal::information(understood.line());
    }
}
