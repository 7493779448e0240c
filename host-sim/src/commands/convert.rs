use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::error::{Error, Result, shown};
use crate::files::csv::{Names, Table};
use crate::files::output::{self, Folders};
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Length L of the body along the load when it is not stretched (Eqs. 12–13).
    #[arg(long, value_name = "M")]
    length: f64,
    /// Cross-section A of the body across the load when it is not stretched.
    #[arg(long, value_name = "M2")]
    area: f64,
    /// Where the recording goes: time_s, displacement_m, force_n.
    #[arg(long, value_name = "REC.csv")]
    out: PathBuf,
    /// Material test: time_s (or time_ms), stretch, nominal_stress_pa (or nominal_stress_kpa).
    #[arg(value_name = "TEST.csv")]
    test: PathBuf,
}

#[derive(Serialize)]
struct Report {
    out: String,
    samples: usize,
    largest_displacement_m: f64,
    largest_force_n: f64,
}

const STRETCH: &Names = &[("stretch", 1.0)];
const STRESS: &Names = &[("nominal_stress_pa", 1.0), ("nominal_stress_kpa", 1e3)];

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    for (option, value) in [("--length", arguments.length), ("--area", arguments.area)] {
        if !(1e-12..=1e6).contains(&value) {
            return Err(Error::option(option, format!("{value:?} must be from 1e-12 to 1e6")));
        }
    }
    output::check(&arguments.out, &[&arguments.test], Folders::Exist)?;
    let path = &arguments.test;
    let table = Table::read(path, [STRETCH, STRESS], &[&[0], &[1]])?;
    let complete = |index: usize| {
        let column: &Option<crate::files::csv::Column> = &table.columns[index];
        let column = column.as_ref().ok_or_else(|| Error::file(path, "stretch or nominal stress has no value"))?;
        column.complete(path, &table.time_s, "a material test needs both in every row")
    };
    let stretch = complete(0)?;
    if let Some(k) = stretch.value.iter().position(|&stretch| stretch <= 0.0) {
        let cause =
            format!("stretch is {} at {} s; it is length over original length", stretch.value[k], table.time_s[k]);
        return Err(Error::file(path, cause));
    }
    let displacement: Vec<f64> = stretch.value.iter().map(|stretch| (stretch - 1.0) * arguments.length).collect();
    let force: Vec<f64> = complete(1)?.value.iter().map(|stress| stress * arguments.area).collect();
    let comment = format!("{}, as a body of L = {} m and A = {} m2", shown(path), arguments.length, arguments.area);
    output::write_columns(
        &arguments.out,
        &[comment],
        &[("time_s", Some(&table.time_s)), ("displacement_m", Some(&displacement)), ("force_n", Some(&force))],
    )?;
    let largest = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let report = Report {
        out: shown(&arguments.out),
        samples: table.time_s.len(),
        largest_displacement_m: largest(&displacement),
        largest_force_n: largest(&force),
    };
    terminal::report(json, &report, || {
        format!(
            "{}: {} samples, up to {:.3} mm and {:.4} N",
            report.out,
            report.samples,
            1e3 * report.largest_displacement_m,
            report.largest_force_n
        )
    })
}
