//! `compare`: other models of creep on the same recordings.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::options::assumed_actuator;
use crate::error::{Error, Result, shown};
use crate::files::parameters::Parameters;
use crate::files::recording::{Direction, Recording};
use crate::fit::Settings;
use crate::fit::observation::observe_all;
use crate::studies::compare::{self, ModelRow};
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Input of the models: the recorded voltage or force, or the recorded displacement, from which the force is fitted.
    #[arg(long, value_enum, default_value_t = Direction::Force)]
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
    if arguments.starts == 0 {
        return Err(Error::option("--starts", "at least 1 is needed"));
    }
    let actuator = match &arguments.actuator {
        Some(name) => Parameters::load_actuator(name)?,
        None => assumed_actuator(arguments.drive),
    };
    let settings = Settings { seed: arguments.seed, starts: arguments.starts, actuator, ..Settings::default() };
    let recordings = arguments.recordings.iter().map(|path| Recording::read(path)).collect::<Result<Vec<_>>>()?;
    let observations = observe_all(&recordings, arguments.drive)?;
    let bar = terminal::spinner();
    let models = compare::compare(&observations, &settings, &|message| bar.set_message(message.to_owned()))?;
    bar.finish_and_clear();
    let report = Report { recordings: arguments.recordings.iter().map(|path| shown(path)).collect(), models };
    terminal::report(json, &report, || text(&report))
}

fn text(report: &Report) -> String {
    let mut text = format!(
        "{:34} {:>10} {:>9} {:>9} {:>19} {:>9}",
        "model", "parameters", "R²", "NRMSE %", "left out, NRMSE %", "ns/step"
    );
    for row in &report.models {
        let left_out = row.left_out_nrmse_pct.map_or_else(|| "–".into(), |value| format!("{value:.3}"));
        let _ = write!(
            text,
            "\n{:34} {:>10} {:>9.6} {:>9.3} {left_out:>19} {:>9.1}",
            row.model, row.parameters, row.r2_mean, row.nrmse_pct, row.step_ns
        );
    }
    text
}
