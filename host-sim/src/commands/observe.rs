//! `observe`: the observer over a recording.

use std::num::NonZeroUsize;

use super::options::LawOptions;
use super::prelude::*;
use super::recordings::{RecordingOptions, report_sampling};
use crate::files::parameters::Parameters;
use crate::grid::Grid;
use crate::replay::memory::Precision;
use crate::replay::observer::{Estimates, ObservedRecording, ObserverSummary, Tuning};
use crate::report::axis::{DISPLACEMENT, MICROMETRES};
use crate::report::figure::{Colour, Figure, Line, Panel};
use crate::report::figure_file::PlotOption;
use crate::terminal::decimals;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    law: LawOptions,
    /// Recording of voltage and displacement.
    #[arg(value_name = "REC.csv")]
    recording: PathBuf,
    #[command(flatten)]
    reading: RecordingOptions,
    /// Estimates to write: time_s, voltage_v, displacement_m, sample_m, disturbance_n, force_scale, innovation_m,
    /// innovation_mean_m, innovation_std_m.
    #[arg(long, value_name = "OUT.csv")]
    out: PathBuf,
    /// Write every so many ticks; the ticks of the recording's rows if left out.
    #[arg(long, value_name = "N")]
    every: Option<NonZeroUsize>,
    #[command(flatten)]
    plot: PlotOption,
    /// Up to here the estimate follows the sensor, beyond it the model; 0.6 Hz, or the most that sensor and model allow, if left
    /// out.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz)]
    bandwidth: Option<f64>,
    /// Time over which a disturbance that swings with the load becomes a change of the force scale; 0 for never.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 30.0)]
    adaptation: f64,
    /// Arithmetic of a step.
    #[arg(long, value_parser = named::<Precision>(), default_value = "f32")]
    precision: Precision,
}

#[derive(Serialize)]
struct Report {
    out: String,
    rate_hz: f64,
    #[serde(flatten)]
    observed: ObserverSummary,
    /// The doubt about a force scale that ends far from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    force_scale_note: Option<String>,
}

/// Deviation of the force scale from 1 without doubt. Its bounds, 0.25 and 4, are beyond.
const MAX_CHANGE: f64 = 0.5;

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let tuning = Tuning::new(arguments.bandwidth, arguments.adaptation)?;
    let parameters = arguments.law.parameters()?;
    let recording = arguments.reading.read_one(&arguments.recording)?;
    arguments.law.check_temperature(std::slice::from_ref(&recording))?;
    let parameters = parameters.along(&recording).map_err(|e| e.about(&arguments.law.params, recording.path()))?;
    let inputs = [arguments.recording.as_path(), arguments.law.params.as_ref()];
    let plot = arguments.plot.check_beside(&inputs, Some(&arguments.out))?;
    let run = ObservedRecording::from_recording(&recording, arguments.law.rate)?;
    let grid = run.grid;
    let bar = Progress::over(grid.samples as u64, "observe");
    let estimates = run
        .estimate(&parameters, tuning, arguments.precision, &bar)
        .map_err(|e| e.about(&arguments.law.params, recording.path()))?;
    bar.finish_and_clear();
    report_sampling(&recording, &recording.drive()?, grid.rate_hz);
    let rows = arguments.rows(recording.time_s(), grid);
    let table = stage(&arguments.out, grid, &rows, &run.voltage_v, &estimates)?;
    let observed = estimates.summary();
    let is_far = (observed.force_scale - 1.0).abs() > MAX_CHANGE;
    let force_scale_note = is_far.then(|| {
        format!(
            "{}: the force scale ends at {}, where 1 is the film of {}: check the sign and the unit of displacement and voltage, or fit the \
             film of this recording",
            shown(recording.path()),
            decimals(observed.force_scale, 2),
            arguments.law.params
        )
    });
    let report = Report { out: shown(&arguments.out), rate_hz: grid.rate_hz, observed, force_scale_note };
    let title = format!("Observer over {}", shown(&arguments.recording));
    plot.write(&report, [table], || Figure::new(title, panels(&parameters, &estimates, grid)))?;
    terminal::warnings(json, &report.force_scale_note);
    terminal::report(json, &report, || {
        format!(
            "{}: {} sensor samples, bandwidth {} Hz, innovation {} µm RMS, at the end disturbance {} N and force scale {}",
            report.out,
            observed.samples,
            decimals(observed.bandwidth_hz, 2),
            decimals(1e6 * observed.innovation_rms_m, 2),
            decimals(observed.disturbance_n, 3),
            decimals(observed.force_scale, 4)
        )
    })
}

impl Arguments {
    /// The ticks that are written: those at which rows of the recording arrive, at `time_s`, or every so many.
    fn rows(&self, time_s: &[f64], grid: Grid) -> Vec<usize> {
        if let Some(every) = self.every {
            return (0..grid.samples).step_by(every.get()).collect();
        }
        let tick = |time: &f64| ((time - 1e-9) * grid.rate_hz).ceil().max(0.0) as usize;
        let mut rows: Vec<usize> = time_s.iter().map(tick).filter(|row| *row < grid.samples).collect();
        rows.dedup();
        rows
    }
}

fn stage(path: &Path, grid: Grid, rows: &[usize], volts: &[f64], estimates: &Estimates) -> Result<Staged> {
    let time = grid.times_s();
    output::stage_rows(
        path,
        &[
            ("time_s", Some(time.as_slice())),
            ("voltage_v", Some(volts)),
            ("displacement_m", Some(&estimates.displacement_m)),
            ("sample_m", Some(&estimates.sample_m)),
            ("disturbance_n", Some(&estimates.disturbance_n)),
            ("force_scale", Some(&estimates.force_scale)),
            ("innovation_m", Some(&estimates.innovation_m)),
            ("innovation_mean_m", Some(&estimates.innovation_mean_m)),
            ("innovation_std_m", Some(&estimates.innovation_std_m)),
        ],
        rows.iter().copied(),
    )
}

/// Sensor and estimate, what the observer makes of their difference, and what is left.
fn panels(parameters: &Parameters, estimates: &Estimates, grid: Grid) -> Vec<Panel> {
    let time = grid.times_s();
    let sensor = parameters.sensor();
    let sampled: Vec<f64> = estimates.sample_m.iter().map(|reading| sensor.film_displacement_m(*reading)).collect();
    vec![
        Panel::new("Sensor and estimate", "time (s)", DISPLACEMENT.label())
            .with(Line::new("sensor", &time, &DISPLACEMENT.transform(&sampled)).beneath())
            .with(Line::new("estimate", &time, &DISPLACEMENT.transform(&estimates.displacement_m))),
        Panel::new("Innovation: sensor minus prediction", "time (s)", "innovation (µm)").with(
            Line::new("innovation", &time, &MICROMETRES.transform(&estimates.innovation_m)).coloured(Colour::VERMILION),
        ),
        Panel::new("Disturbance force", "time (s)", "disturbance (N)")
            .with(Line::new("disturbance", &time, &estimates.disturbance_n).coloured(Colour::GREEN)),
        Panel::new("Force scale", "time (s)", "force scale")
            .with(Line::new("force scale", &time, &estimates.force_scale).coloured(Colour::PURPLE)),
    ]
}
