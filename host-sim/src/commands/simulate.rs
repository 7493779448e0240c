//! `simulate`: the response to a recorded input.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::ModelOptions;
use super::recordings::RecordingOptions;
use crate::error::{Result, shown};
use crate::files::output::{self, Folders};
use crate::replay::simulate;
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    model: ModelOptions,
    /// Recording whose voltage or force is the input of the model.
    #[arg(long, value_name = "REC.csv")]
    profile: PathBuf,
    #[command(flatten)]
    reading: RecordingOptions,
    /// Where the response goes: time_s, voltage_v, force_n, displacement_m.
    #[arg(long, value_name = "OUT.csv")]
    out: PathBuf,
}

#[derive(Serialize)]
struct Report {
    out: String,
    samples: usize,
    rate_hz: f64,
    /// Largest displacement, m.
    peak_displacement_m: f64,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let options = arguments.model.run_options();
    let parameters = arguments.model.parameters()?;
    let recording = arguments.reading.read_one(&arguments.profile)?;
    output::check(&arguments.out, &[&arguments.profile, arguments.model.params.as_ref()], Folders::Exist)?;
    let grid = recording.grid(options.rate_hz)?;
    let bar = terminal::progress(grid.samples as u64, "simulate");
    let response = simulate::response(&parameters, &recording.drive()?, grid, &options, &bar)
        .map_err(|e| e.about(&arguments.model.params, recording.path()))?;
    bar.finish_and_clear();
    response.stage(&arguments.out, grid, &[])?.commit()?;
    let report = Report {
        out: shown(&arguments.out),
        samples: grid.samples,
        rate_hz: grid.rate_hz,
        peak_displacement_m: response.displacement_m.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    };
    terminal::report(json, &report, || {
        format!(
            "{}: {} samples at {} Hz, largest displacement {:.4} mm",
            report.out,
            report.samples,
            report.rate_hz,
            1e3 * report.peak_displacement_m
        )
    })
}
