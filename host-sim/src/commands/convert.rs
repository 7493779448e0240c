//! `convert`: a material test as a recording of a body.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::error::{Error, Result, shown};
use crate::files::material_test::MaterialTest;
use crate::files::output::{self, Folders};
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Length L of the unstretched body along the load (Eqs. 12–13).
    #[arg(long, value_name = "M")]
    length: f64,
    /// Cross-section A of the unstretched body across the load.
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

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    for (option, value) in [("--length", arguments.length), ("--area", arguments.area)] {
        if !(1e-12..=1e6).contains(&value) {
            return Err(Error::option(option, format!("{value:?} must be from 1e-12 to 1e6")));
        }
    }
    output::check(&arguments.out, &[&arguments.test], Folders::Exist)?;
    let path = &arguments.test;
    let test = MaterialTest::read(path)?;
    let (displacement, force) = (test.displacement_m(arguments.length), test.force_n(arguments.area));
    let comment = format!("{}, as a body of L = {} m and A = {} m2", shown(path), arguments.length, arguments.area);
    output::write_columns(
        &arguments.out,
        &[comment],
        &[("time_s", Some(&test.time_s)), ("displacement_m", Some(&displacement)), ("force_n", Some(&force))],
    )?;
    let largest = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let report = Report {
        out: shown(&arguments.out),
        samples: test.time_s.len(),
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
