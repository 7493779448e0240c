//! `reference`: writes a reference to follow.

use super::prelude::*;
use crate::references::{Reference, Shape};
use crate::report::axis::DISPLACEMENT;
use crate::report::figure::{Figure, Line, Panel};
use crate::report::figure_file::PlotOption;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Shape of the reference.
    #[arg(long, value_parser = named::<Shape>())]
    shape: Shape,
    /// Lowest displacement after the rise from 0.
    #[arg(long, value_name = "M", value_parser = quantity::metres)]
    low: f64,
    /// Highest displacement.
    #[arg(long, value_name = "M", value_parser = quantity::metres)]
    high: f64,
    /// Length of a period; of a plateau with its edge (steps); or the period beyond which a random walk hardly moves.
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    period: f64,
    /// Length of the rise at the start and of edges, with the least jerk. If left out, 5, or a quarter of a shorter reference and half a plateau.
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    rise: Option<f64>,
    /// Length of the reference.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 155.0)]
    duration: f64,
    /// Samples per second.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz, default_value_t = 1000.0)]
    rate: f64,
    /// Seed of a random walk.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Reference to write: time_s, displacement_m.
    #[arg(long, value_name = "REF.csv")]
    out: PathBuf,
    #[command(flatten)]
    plot: PlotOption,
}

#[derive(Serialize)]
struct Report {
    out: String,
    samples: usize,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let Arguments { shape, low, high, period, rise, duration, rate, seed, .. } = *arguments;
    let usual = Reference::new(shape, low, high, period);
    let (values, grid) = Reference { seed, ..usual }.over(duration, rate, rise)?;
    let plot = arguments.plot.check_beside(&[], Some(&arguments.out))?;
    let time = grid.times_s();
    let table = output::stage_columns(
        &arguments.out,
        &[("time_s", Some(time.as_slice())), ("displacement_m", Some(values.as_slice()))],
    )?;
    let report = Report { out: shown(&arguments.out), samples: grid.samples };
    plot.write(&report, [table], || {
        let line = Line::new("reference", &time, &DISPLACEMENT.transform(&values));
        let panel = Panel::new("Reference", "time (s)", DISPLACEMENT.label()).with(line);
        Figure::new(format!("Reference {}", report.out), vec![panel])
    })?;
    terminal::report(json, &report, || format!("{}: {} samples", report.out, report.samples))
}
