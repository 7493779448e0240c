//! `compare`: other models of creep on the same recordings.

use std::fmt::Write;
use std::sync::atomic::AtomicBool;

use super::options;
use super::prelude::*;
use super::recordings::RecordingOptions;
use crate::files::recording::{Direction, Recording};
use crate::fit::Settings;
use crate::fit::observation::{Observation, observe_all, observe_prepared};
use crate::fit::preparation::{Preparation, Window};
use crate::fit::settings::{assumed_actuator, checked_starts};
use crate::quantity::positive;
use crate::report::figure::Figure;
use crate::report::figure_file::PlotOption;
use crate::report::model_figure;
use crate::report::numbers::{Form, Numbers};
use crate::report::page::{Cell, Section, list};
use crate::studies::compare::{self, ModelRow};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Input of the models: the recorded voltage or force, or the recorded displacement, from which the force is fitted.
    #[arg(long, value_parser = named::<Direction>(), default_value = "force")]
    drive: Direction,
    /// File with the actuator table: geometry, permittivity, mass, preload. The default is the paper's, without mass if
    /// displacement drives.
    #[arg(long, value_name = "P")]
    actuator: Option<String>,
    /// Seed of the random starts.
    #[arg(long, value_name = "N", default_value_t = Settings::default().seed)]
    seed: u64,
    /// Random starts per structure.
    #[arg(long, value_name = "N", default_value_t = Settings::default().starts)]
    starts: usize,
    /// Fit what was measured up to here, s, and predict the rest: a column beyond, RMS error in % of the measured RMS.
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    to: Option<f64>,
    #[command(flatten)]
    plot: PlotOption,
    #[command(flatten)]
    reading: RecordingOptions,
    /// Recordings to fit.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    recordings: Vec<String>,
    models: Vec<ModelRow>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    checked_starts(arguments.starts)?;
    let actuator = match &arguments.actuator {
        Some(name) => options::load_actuator(name)?.0,
        None => assumed_actuator(arguments.drive),
    };
    let settings = Settings { seed: arguments.seed, starts: arguments.starts, actuator, ..Settings::default() };
    let recordings = arguments.reading.read(&arguments.recordings)?;
    let (observations, beyond) = match arguments.to {
        None => (observe_all(&recordings, arguments.drive)?, Vec::new()),
        Some(to_s) => {
            positive("to", to_s)?;
            (
                within(&recordings, arguments.drive, Window { to_s, ..Window::ALL })?,
                within(&recordings, arguments.drive, Window { from_s: to_s, ..Window::ALL })?,
            )
        }
    };
    let read = recordings.iter().map(Recording::path).chain(arguments.actuator.as_deref().map(Path::new));
    let plot = arguments.plot.check(&read.collect::<Vec<&Path>>(), &[])?;
    let bar = Progress::unknown("compare");
    let models =
        compare::compare(&observations, &beyond, &settings, &AtomicBool::new(false), &|stage| bar.enter(stage))?;
    bar.finish_and_clear();
    let report = Report { recordings: arguments.recordings.iter().map(|path| shown(path)).collect(), models };
    let title = "Models of creep on the same recordings";
    let figure = || Figure::new(title, model_figure::panels(&report.models));
    let drawn = plot.stage(&report, |numbers| vec![section(numbers)], figure)?;
    drawn.map_or(Ok(()), Staged::commit)?;
    terminal::report(json, &report, || text(&report))
}

/// The observations of `recordings` whose measured values lie in `window`.
fn within(recordings: &[Recording], drive: Direction, window: Window) -> Result<Vec<Observation>> {
    let preparation = Preparation { window, ..Preparation::NONE };
    let observe = |recording| Ok(observe_prepared(recording, drive, 1.0, preparation)?.0.at_one_temperature());
    recordings.iter().map(observe).collect()
}

/// The table of the models on a page.
fn section(numbers: &Numbers<'_>) -> Section {
    let models = numbers.at("/models");
    // What is known of no model has no column.
    let is_known = |path: &str| models.rows().iter().any(|model| !model.at(path).value().is_null());
    let mut columns = vec![("model", Cell::Text("/model"))];
    for (title, path, decimals) in [
        ("parameters", "/parameters", 0),
        ("R²", "/r2_mean", 6),
        ("NRMSE %", "/nrmse_pct", 3),
        ("left out, NRMSE %", "/left_out_nrmse_pct", 3),
        ("beyond, %", "/beyond_pct", 3),
        ("ns/step", "/step_ns", 1),
    ] {
        columns.extend(is_known(path).then_some((title, Cell::Number(path, Form::Fixed(decimals)))));
    }
    Section::new("models", "Models", list("Models of creep", &columns, &models))
}

fn text(report: &Report) -> String {
    let mut text = format!(
        "{:34} {:>10} {:>9} {:>9} {:>19} {:>9}",
        "model", "parameters", "R²", "NRMSE %", "left out, NRMSE %", "ns/step"
    );
    let foretold = report.models.iter().any(|row| row.beyond_pct.is_some());
    if foretold {
        let _ = write!(text, " {:>9}", "beyond %");
    }
    for row in &report.models {
        let left_out = row.left_out_nrmse_pct.map_or_else(|| "–".into(), |value| format!("{value:.3}"));
        let _ = write!(
            text,
            "\n{:34} {:>10} {:>9.6} {:>9.3} {left_out:>19} {:>9.1}",
            row.model, row.parameters, row.r2_mean, row.nrmse_pct, row.step_ns
        );
        if foretold {
            let beyond = row.beyond_pct.map_or_else(|| "–".into(), |value| format!("{value:.3}"));
            let _ = write!(text, " {beyond:>9}");
        }
    }
    text
}
