use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::ModelOptions;
use crate::error::Result;
use crate::output;
use crate::parameters::Parameters;
use crate::recording::Recording;
use crate::run;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    model: ModelOptions,
    /// Recording whose voltage or force drives the model.
    #[arg(long, value_name = "REC.csv")]
    profile: PathBuf,
    /// Where the response goes: time_s, voltage_v, force_n, displacement_m.
    #[arg(long, value_name = "OUT.csv")]
    out: PathBuf,
}

#[derive(Serialize)]
struct Report {
    out: PathBuf,
    samples: usize,
    rate_hz: f64,
    /// Largest displacement, m.
    peak_displacement_m: f64,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let options = arguments.model.run_options();
    let parameters = Parameters::load(&arguments.model.params)?;
    let recording = Recording::read(&arguments.profile)?;
    let grid = recording.grid(options.rate_hz)?;
    let bar = output::progress(grid.samples as u64, "simulate");
    let response = run::run(&parameters, &recording.drive()?, grid, &options, &bar)?;
    bar.finish_and_clear();
    response.write(&arguments.out, grid, &[])?;
    let report = Report {
        out: arguments.out.clone(),
        samples: grid.samples,
        rate_hz: grid.rate_hz,
        peak_displacement_m: response.displacement_m.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    };
    output::report(json, &report, || {
        format!(
            "{}: {} samples at {} Hz, largest displacement {:.4} mm",
            report.out.display(),
            report.samples,
            report.rate_hz,
            1e3 * report.peak_displacement_m
        )
    });
    Ok(())
}
