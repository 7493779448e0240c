//! `simulate`: the response to a recorded input.

use super::options::RunArguments;
use super::prelude::*;
use super::recordings::{RecordingOptions, report_sampling};
use crate::grid::Grid;
use crate::replay::simulate::{self, Response};
use crate::report::axis::{DISPLACEMENT, FORCE, VOLTAGE};
use crate::report::figure::{Colour, Figure, Line, Panel};
use crate::report::figure_file::PlotOption;
use crate::terminal::{decimals, rounded};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    model: RunArguments,
    /// Recording whose voltage or force is the input of the model.
    #[arg(long, value_name = "REC.csv")]
    profile: PathBuf,
    #[command(flatten)]
    reading: RecordingOptions,
    /// Response to write: time_s, voltage_v, force_n, displacement_m.
    #[arg(long, value_name = "OUT.csv")]
    out: PathBuf,
    #[command(flatten)]
    plot: PlotOption,
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
    let parameters = arguments.model.law.parameters()?;
    let recording = arguments.reading.read_one(&arguments.profile)?;
    arguments.model.law.check_temperature(std::slice::from_ref(&recording))?;
    let parameters =
        parameters.along(&recording).map_err(|e| e.about(&arguments.model.law.params, recording.path()))?;
    let inputs = [arguments.profile.as_path(), arguments.model.law.params.as_ref()];
    let plot = arguments.plot.check_beside(&inputs, Some(&arguments.out))?;
    let grid = recording.grid(options.rate_hz)?;
    let bar = Progress::over(grid.samples as u64, "simulate");
    let drive = recording.drive()?;
    let response = simulate::response(&parameters, &drive, grid, &options, &bar)
        .map_err(|e| e.about(&arguments.model.law.params, recording.path()))?;
    bar.finish_and_clear();
    report_sampling(&recording, &drive, options.rate_hz);
    let table = response.stage(&arguments.out, grid, &[])?;
    let report = Report {
        out: shown(&arguments.out),
        samples: grid.samples,
        rate_hz: grid.rate_hz,
        peak_displacement_m: response.displacement_m.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    };
    let title = format!("Response of {} to {}", parameters.name, shown(&arguments.profile));
    plot.write(&report, [table], || Figure::new(title, panels(&response, grid)))?;
    terminal::report(json, &report, || {
        format!(
            "{}: {} samples at {} Hz, largest displacement {} mm",
            report.out,
            report.samples,
            rounded(report.rate_hz),
            decimals(1e3 * report.peak_displacement_m, 4)
        )
    })
}

/// Panels of the drive and of the response.
fn panels(response: &Response, grid: Grid) -> Vec<Panel> {
    let time = grid.times_s();
    let voltage = response.voltage_v.as_ref().map(|volts| {
        Panel::new("Voltage", "time (s)", VOLTAGE.label())
            .with(Line::new("voltage", &time, &VOLTAGE.transform(volts)).coloured(Colour::GREEN))
    });
    let force = Panel::new("Force on the film", "time (s)", FORCE.label())
        .with(Line::new("force", &time, &response.force_n).coloured(Colour::VERMILION));
    let displacement = Panel::new("Displacement", "time (s)", DISPLACEMENT.label()).with(Line::new(
        "displacement",
        &time,
        &DISPLACEMENT.transform(&response.displacement_m),
    ));
    voltage.into_iter().chain([force, displacement]).collect()
}
