//! `compare`: other models of creep on the same recordings.

use std::fmt::Write;
use std::iter;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::Args;
use serde::Serialize;

use super::choice::named;
use super::options;
use super::recordings::RecordingOptions;
use crate::error::{Result, shown};
use crate::files::output::Staged;
use crate::files::recording::{Direction, Recording};
use crate::fit::Settings;
use crate::fit::observation::{Observation, observe_all, observe_prepared};
use crate::fit::preparation::{Preparation, Window};
use crate::fit::settings::{assumed_actuator, checked_starts};
use crate::progress::Progress;
use crate::quantity::{self, positive};
use crate::report::figure::Figure;
use crate::report::figure_file::PlotOption;
use crate::report::model_figure;
use crate::report::numbers::{Form, Numbers};
use crate::report::page::{self, Row, Section};
use crate::studies::compare::{self, ModelRow};
use crate::terminal;

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
    let drawn = plot.stage_with(&report, |numbers| vec![section(numbers)], figure)?;
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
    let columns = [
        ("parameters", "/parameters", Form::Fixed(0)),
        ("R²", "/r2_mean", Form::Fixed(6)),
        ("NRMSE %", "/nrmse_pct", Form::Fixed(3)),
        ("left out, NRMSE %", "/left_out_nrmse_pct", Form::Fixed(3)),
        ("beyond, %", "/beyond_pct", Form::Fixed(3)),
        ("ns/step", "/step_ns", Form::Fixed(1)),
    ];
    let models = numbers.at("/models").rows();
    // What is known of no model has no column.
    let is_known = |path: &str| models.iter().any(|model| !model.at(path).value().is_null());
    let columns: Vec<_> = columns.into_iter().filter(|(_, path, _)| is_known(path)).collect();
    let row = |model: &Numbers<'_>| {
        let cells = columns.iter().map(|(_, path, form)| model.number(path, *form));
        Row::new(iter::once(page::text(model.text("/model"))).chain(cells).collect())
    };
    let header: Vec<&str> = iter::once("model").chain(columns.iter().map(|(name, ..)| *name)).collect();
    let rows: Vec<Row> = models.iter().map(row).collect();
    Section::new("models", "Models", page::table("Models of creep", &header, &rows))
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
