use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::fit::FitOptions;
use crate::compare::{self, Row};
use crate::error::{Error, Result, shown};
use crate::fit;
use crate::fit::observe::Direction;
use crate::fit::search::Workbench;
use crate::interrupt;
use crate::recording::Recording;
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    options: FitOptions,
    /// Recordings to fit.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    recordings: Vec<String>,
    models: Vec<Row>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let settings = arguments.options.settings()?;
    if arguments.options.direction() == Direction::Displacement {
        return Err(Error::option("--drive", "models are compared as voltage or force drives them"));
    }
    let recordings = arguments.recordings.iter().map(|path| Recording::read(path)).collect::<Result<Vec<_>>>()?;
    let (observations, _) = arguments.options.observations(&recordings)?;
    let bar = terminal::spinner();
    let workbench = Workbench::new(&observations, &settings.actuator)?;
    let surroundings = fit::effective(&observations, &settings, &mut Vec::new());
    let context = workbench.context(&settings, surroundings, interrupt::stop_flag());
    let models = compare::compare(&context, &observations, &|message| bar.set_message(message.to_owned()))?;
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
