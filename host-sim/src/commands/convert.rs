//! `convert`: a material test, or a file of a testing machine, as a recording of a body.

use super::prelude::*;
use super::recordings::{self, RecordingOptions};
use crate::files::material_test::{MaterialTest, Strain};
use crate::files::parameters::plausibility;
use crate::terminal::decimals;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Length L of the unstretched body along the load (Eqs. 12–13). Needed for stretches, and for other strains than
    /// engineering.
    #[arg(long, value_name = "M", value_parser = quantity::metres)]
    length: Option<f64>,
    /// Cross-section A of the unstretched body across the load. Needed for stresses.
    #[arg(long, value_name = "M2", value_parser = quantity::square_metres)]
    area: Option<f64>,
    /// Strain that times L is the displacement: engineering (stretch − 1), neo-hookean ((stretch − stretch⁻²)/3) or hencky (its
    /// logarithm). All agree for small strains.
    #[arg(long, value_parser = named::<Strain>(), default_value = "engineering")]
    strain: Strain,
    #[command(flatten)]
    reading: RecordingOptions,
    /// Recording to write: time_s, displacement_m, force_n.
    #[arg(long, value_name = "REC.csv")]
    out: PathBuf,
    /// Material test: time_s (or time_ms); stretch, or displacement_mm as of a testing machine; nominal_stress_pa (or _kpa, _mpa),
    /// or force_n; or a laboratory's own file of these.
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
    plausibility::check_body(arguments.length, arguments.area)?;
    output::check(&arguments.out, &[&arguments.test], Folders::Exist)?;
    let path = &arguments.test;
    let test = MaterialTest::read(path, &arguments.reading.hints())?;
    recordings::report_understood(&test.understood);
    terminal::warnings(
        false,
        test.doubt(arguments.length).map(|doubt| format!("{}: {}", shown(path), with_flags(&doubt))),
    );
    let (displacement, force) =
        (test.displacement_m(arguments.length, arguments.strain)?, test.force_n(arguments.area)?);
    output::write_columns(
        &arguments.out,
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
            "{}: {} samples, up to {} mm and {} N",
            report.out,
            report.samples,
            decimals(1e3 * report.largest_displacement_m, 3),
            decimals(report.largest_force_n, 4)
        )
    })
}
