//! `replay`: responses to recorded inputs, compared with what was measured.

use std::fmt::Write;

use super::options::{self, RunArguments};
use super::prelude::*;
use super::recordings::{RecordingOptions, report_sampling};
use crate::agreement::RecordingAgreement;
use crate::choice::Choice;
use crate::files::recording::{Direction, Recording};
use crate::replay::comparison::Comparison;
use crate::replay::memory::RunOptions;
use crate::replay::simulate::Response;
use crate::report::axis::{DISPLACEMENT, FORCE, MICROMETRES, MILLINEWTONS};
use crate::report::comparison_figure;
use crate::report::figure::{Figure, Panel};
use crate::report::figure_file::PlotOption;
use crate::terminal::{decimals, rounded};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    model: RunArguments,
    /// Input of the model: the recorded voltage or force, or the recorded displacement, from which the force is
    /// predicted.
    #[arg(long, value_parser = named::<Direction>(), default_value = "force")]
    drive: Direction,
    /// Folder for the responses, one CSV per recording.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    plot: PlotOption,
    #[command(flatten)]
    reading: RecordingOptions,
    /// Recordings to replay.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

/// A recording along which the film has no response.
#[derive(Serialize)]
pub(super) struct WithoutResponse {
    file: String,
    cause: String,
}

#[derive(Serialize)]
pub(super) struct Report {
    pub(super) recordings: Vec<RecordingAgreement>,
    pub(super) r2_mean: f64,
    /// Recordings that have no response beside others that have.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    without_response: Vec<WithoutResponse>,
    /// Note on the electric field, if the film's sizes are assumed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) field_note: Option<String>,
}

impl Report {
    pub(super) fn new(recordings: Vec<RecordingAgreement>) -> Self {
        let r2_mean = recordings.iter().map(|row| row.r2).sum::<f64>() / recordings.len() as f64;
        Self { recordings, r2_mean, without_response: Vec::new(), field_note: None }
    }
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let options = arguments.model.run_options();
    let parameters = arguments.model.law.parameters()?;
    // All are read before any is run: a bad one is refused at once.
    let recordings = arguments.reading.read(&arguments.recordings)?;
    arguments.model.law.check_temperature(&recordings)?;
    let comparisons = recordings
        .iter()
        .map(|recording| Comparison::new(recording, arguments.drive, &parameters, options.rate_hz))
        .collect::<Result<Vec<Comparison<'_>>>>()?;
    let outputs = match &arguments.out {
        Some(folder) => output_paths(folder, &recordings, &arguments.model.law.params)?.into_iter().map(Some).collect(),
        None => vec![None; comparisons.len()],
    };

    let inputs: Vec<&Path> =
        recordings.iter().map(Recording::path).chain([Path::new(&arguments.model.law.params)]).collect();
    let written: Vec<&Path> = outputs.iter().flatten().map(PathBuf::as_path).collect();
    let plot = arguments.plot.check(&inputs, &written)?;

    let bar = Progress::over(comparisons.iter().map(|comparison| comparison.grid.samples as u64).sum(), "replay");
    // Removed again if it stays empty.
    let _folder = arguments.out.as_deref().map(Folder::at).transpose()?;
    let (mut rows, mut without) = (Vec::new(), Vec::new());
    let mut written = Vec::new();
    let mut panels = Vec::new();
    for (number, (comparison, path)) in comparisons.iter().zip(outputs).enumerate() {
        let recording = comparison.recording();
        bar.set_message(format!("replay {} ({} of {})", shown(recording.path()), number + 1, comparisons.len()));
        let (response, agreement) = match comparison.run(&parameters, &options, &bar) {
            Ok(done) => done,
            // The others may be within what the film withstands.
            Err(Error::Computation(cause)) if comparisons.len() > 1 => {
                without.push(WithoutResponse { file: shown(recording.path()), cause });
                continue;
            }
            Err(error) => return Err(error.about(&arguments.model.law.params, recording.path())),
        };
        rows.push(RecordingAgreement::new(recording.path(), arguments.drive, &agreement));
        if plot.is_wanted() {
            panels.extend(compared(comparison, arguments.drive, &comparison.readings(&parameters, &response)));
        }
        if let Some(path) = path {
            written.push(stage(&path, arguments.drive, &response, comparison)?);
        }
    }
    bar.finish_and_clear();
    if let (true, Some(WithoutResponse { file, cause })) = (rows.is_empty(), without.first()) {
        return Err(Error::Computation(cause.clone()).about(&arguments.model.law.params, Path::new(file)));
    }
    let mut report = Report::new(rows);
    report.without_response = without;
    report.field_note = options::field_note(&parameters).filter(|_| arguments.drive == Direction::Force);
    plot.write(&report, written, || Figure::new(format!("Replay of {}", parameters.name), panels))?;
    terminal::warnings(
        json,
        report.without_response.iter().map(|row| format!("{}: left out: {}", row.file, row.cause)),
    );
    comparisons.iter().for_each(|run| report_sampling(run.recording(), &run.input, options.rate_hz));
    terminal::warnings(json, &report.field_note);
    terminal::report(json, &report, || format!("{}\n{}", table(&report), how(&options)))
}

/// How the model was run: a fit runs it at the recording's own rate, and with full memory.
fn how(options: &RunOptions) -> String {
    format!("at {} Hz, memory {}, {}", rounded(options.rate_hz), options.memory, options.precision.name())
}

fn output_paths(folder: &Path, recordings: &[Recording], parameters: &str) -> Result<Vec<PathBuf>> {
    let inputs: Vec<&Path> = recordings.iter().map(Recording::path).chain([Path::new(parameters)]).collect();
    let mut paths = Vec::new();
    for recording in recordings {
        let mut path = folder.join(recording.path().file_name().unwrap_or_default());
        if recording.understood().is_some() {
            // A response is CSV, whatever the recording was.
            path.set_extension("csv");
        }
        if paths.contains(&path) {
            return Err(Error::field("out", format!("two recordings would be written to {}", shown(&path))));
        }
        output::check(&path, &inputs, Folders::AreMade)?;
        paths.push(path);
    }
    Ok(paths)
}

fn stage(path: &Path, drive: Direction, response: &Response, comparison: &Comparison<'_>) -> Result<Staged> {
    let measured = comparison.grid.resample(&comparison.measured);
    let name = match drive {
        Direction::Force => "measured_displacement_m",
        Direction::Displacement => "measured_force_n",
    };
    response.stage(path, comparison.grid, &[(name, Some(&measured))])
}

/// A recording beside the response, and their difference.
fn compared(comparison: &Comparison<'_>, drive: Direction, readings: &[f64]) -> [Panel; 2] {
    let (axis, fine) = match drive {
        Direction::Force => (DISPLACEMENT, MICROMETRES),
        Direction::Displacement => (FORCE, MILLINEWTONS),
    };
    let name = comparison.recording().path().file_name().unwrap_or_default().to_string_lossy().into_owned();
    comparison_figure::panels(&comparison.measured, readings, axis, fine)
        .map(|panel| Panel { title: format!("{name}: {}", panel.title.to_lowercase()), ..panel })
}

pub(super) fn table(report: &Report) -> String {
    let rows = &report.recordings;
    let width = rows.iter().map(|row| row.file.chars().count()).max().unwrap_or(0).max(9);
    let unit = if rows.iter().any(|row| row.rmse_n.is_some()) { "mN" } else { "µm" };
    let mut text =
        format!("{:width$}  {:>9}  {:>9}  {:>10}  samples\n", "recording", "R²", "NRMSE %", format!("RMSE {unit}"));
    for row in rows {
        let rmse = row.rmse_m.map(|m| 1e6 * m).or(row.rmse_n.map(|n| 1e3 * n)).unwrap_or(f64::NAN);
        let _ = writeln!(
            text,
            "{:width$}  {:>9}  {:>9}  {:>10}  {:>7}",
            row.file,
            decimals(row.r2, 5),
            decimals(row.nrmse_pct, 3),
            decimals(rmse, 2),
            row.samples
        );
    }
    let _ = write!(text, "{:width$}  {:>9}", "mean", decimals(report.r2_mean, 5));
    if rows.iter().any(|row| row.r2.is_nan()) {
        text.push_str("\n– : the measurement does not change, so its spread and its range are 0");
    }
    text
}
