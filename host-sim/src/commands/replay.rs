use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::ModelOptions;
use crate::agreement::Agreement;
use crate::error::{Error, Result, shown};
use crate::files::output::{self, Folders, Staged};
use crate::files::parameters::Parameters;
use crate::files::recording::{Input, Recording, Samples};
use crate::grid::Grid;
use crate::replay::simulate::{self, Response};
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    model: ModelOptions,
    /// What drives the model: the recorded voltage or force, or the recorded displacement, from which the force is
    /// predicted.
    #[arg(long, value_enum, default_value_t = Drive::Force)]
    drive: Drive,
    /// Folder for the responses, one CSV per recording.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Recordings to replay.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Drive {
    Force,
    Displacement,
}

/// One recording's agreement. RMSE is in m, or in N where displacement drives.
#[derive(Serialize)]
pub(super) struct Row {
    file: String,
    r2: f64,
    nrmse_pct: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    rmse_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rmse_n: Option<f64>,
    samples: usize,
}

#[derive(Serialize)]
pub(super) struct Report {
    pub(super) recordings: Vec<Row>,
    pub(super) r2_mean: f64,
}

impl Row {
    /// The agreement of a run that was driven by voltage or force, as the displacement sensor reads it.
    pub(super) fn of_displacement(
        recording: &Recording,
        parameters: &Parameters,
        response: &Response,
        grid: Grid,
    ) -> Result<Self> {
        let measured = recording.displacement()?;
        let modelled = grid.at(&response.displacement_m, &measured.time_s);
        let read: Vec<f64> = modelled.iter().map(|x| x + parameters.sensor_offset_m).collect();
        let Agreement { r2, nrmse_pct, rmse, samples } = Agreement::of(&measured.value, &read);
        Ok(Self { file: shown(recording.path()), r2, nrmse_pct, rmse_m: Some(rmse), rmse_n: None, samples })
    }
}

impl Report {
    pub(super) fn of(recordings: Vec<Row>) -> Self {
        let r2_mean = recordings.iter().map(|row| row.r2).sum::<f64>() / recordings.len() as f64;
        Self { recordings, r2_mean }
    }
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let options = arguments.model.run_options();
    let parameters = Parameters::load(&arguments.model.params)?;
    // All are read before any is run, so that a bad one costs no waiting.
    let recordings =
        arguments.recordings.iter().map(|path| Recording::read(path)).collect::<Result<Vec<Recording>>>()?;
    let jobs = recordings
        .iter()
        .map(|recording| Job::new(recording, arguments.drive, &parameters, options.rate_hz))
        .collect::<Result<Vec<Job<'_>>>>()?;
    let outputs = match &arguments.out {
        Some(folder) => output_paths(folder, &recordings, &arguments.model.params)?.into_iter().map(Some).collect(),
        None => vec![None; jobs.len()],
    };

    let bar = terminal::progress(jobs.iter().map(|job| job.grid.samples as u64).sum(), "replay");
    let mut rows = Vec::new();
    let mut written = Vec::new();
    for (Job { recording, grid, input, measured }, path) in jobs.into_iter().zip(outputs) {
        let response = simulate::run(&parameters, &input, grid, &options, &bar)
            .map_err(|e| e.about(&arguments.model.params, recording.path()))?;
        let modelled = match arguments.drive {
            Drive::Force => &response.displacement_m,
            Drive::Displacement => &response.force_n,
        };
        let offset = match arguments.drive {
            Drive::Force => parameters.sensor_offset_m,
            Drive::Displacement => 0.0,
        };
        let read: Vec<f64> = grid.at(modelled, &measured.time_s).iter().map(|value| value + offset).collect();
        let agreement = Agreement::of(&measured.value, &read);
        let rmse_for = |drive| (arguments.drive == drive).then_some(agreement.rmse);
        rows.push(Row {
            file: shown(recording.path()),
            r2: agreement.r2,
            nrmse_pct: agreement.nrmse_pct,
            rmse_m: rmse_for(Drive::Force),
            rmse_n: rmse_for(Drive::Displacement),
            samples: agreement.samples,
        });
        if let Some(path) = path {
            if let Some(folder) = path.parent() {
                output::make_folder(folder)?;
            }
            written.push(stage(&path, arguments.drive, &response, grid, &measured)?);
        }
    }
    bar.finish_and_clear();
    written.into_iter().try_for_each(Staged::commit)?;
    let report = Report::of(rows);
    terminal::report(json, &report, || table(&report))
}

/// What is run and compared.
struct Job<'a> {
    recording: &'a Recording,
    grid: Grid,
    input: Input,
    measured: Samples,
}

impl<'a> Job<'a> {
    fn new(recording: &'a Recording, drive: Drive, parameters: &Parameters, rate_hz: f64) -> Result<Self> {
        let (input, measured) = match drive {
            Drive::Force => (recording.drive()?, recording.displacement()?),
            Drive::Displacement => (recording.displacement_drive()?, total_force(parameters, recording)?),
        };
        if measured.value.len() < 2 {
            return Err(Error::file(recording.path(), "one measured value; a comparison needs at least 2"));
        }
        Ok(Self { recording, grid: recording.grid(rate_hz)?, input, measured })
    }
}

/// The force on the film as it was measured, or as Eq. 1 gives it from voltage and displacement.
fn total_force(parameters: &Parameters, recording: &Recording) -> Result<Samples> {
    if let Some(force) = recording.force() {
        return Ok(force);
    }
    let Input::Voltage(voltage) = recording.drive()? else {
        return Err(Error::file(recording.path(), "neither force_n nor voltage_v has a value"));
    };
    let actuator = &parameters.actuator;
    let displacement = recording.displacement_drive()?;
    let pairs = voltage.value.iter().zip(&displacement.samples().value);
    let force = |(v, x): (&f64, &f64)| {
        actuator.force_per_square_volt() * v * v * (1.0 + actuator.stretch_coupling * x) + actuator.preload_n()
    };
    Ok(Samples { time_s: voltage.time_s, value: pairs.map(force).collect() })
}

fn output_paths(folder: &Path, recordings: &[Recording], parameters: &str) -> Result<Vec<PathBuf>> {
    let inputs: Vec<&Path> = recordings.iter().map(Recording::path).chain([Path::new(parameters)]).collect();
    let mut paths = Vec::new();
    for recording in recordings {
        let path = folder.join(recording.path().file_name().unwrap_or_default());
        if paths.contains(&path) {
            return Err(Error::option("--out", format!("two recordings would be written to {}", shown(&path))));
        }
        output::check(&path, &inputs, Folders::AreMade)?;
        paths.push(path);
    }
    Ok(paths)
}

fn stage(path: &Path, drive: Drive, response: &Response, grid: Grid, measured: &Samples) -> Result<Staged> {
    let measured = grid.resample(measured);
    let name = match drive {
        Drive::Force => "measured_displacement_m",
        Drive::Displacement => "measured_force_n",
    };
    response.stage(path, grid, &[(name, Some(&measured))])
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
            "{:width$}  {:>9.5}  {:>9.3}  {rmse:>10.2}  {:>7}",
            row.file, row.r2, row.nrmse_pct, row.samples
        );
    }
    let _ = write!(text, "{:width$}  {:>9.5}", "mean", report.r2_mean);
    text
}
