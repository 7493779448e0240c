//! `reduce`: a smaller model with the same response.

use super::options;
use super::prelude::*;
use crate::reduce::{self, Criterion};
use crate::terminal::rounded;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Parameter file (TOML), or preset:NAME such as preset:table3-n5.
    #[arg(long, value_name = "P")]
    params: String,
    /// Parameter file to write.
    #[arg(long, value_name = "P.toml")]
    out: PathBuf,
    /// Lowest frequency at which the response must stay the same.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz, default_value_t = Criterion::default().from_hz)]
    from: f64,
    /// Highest frequency at which the response must stay the same.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz, default_value_t = Criterion::default().to_hz)]
    to: f64,
    /// Largest relative change of the dynamic modulus between them.
    #[arg(long, value_name = "SHARE", value_parser = quantity::share, default_value_t = Criterion::default().tolerance)]
    tolerance: f64,
}

#[derive(Serialize)]
struct Report {
    parameters_file: String,
    branches_before: usize,
    branches: usize,
    steps: Vec<String>,
    largest_change: f64,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let criterion = Criterion { from_hz: arguments.from, to_hz: arguments.to, tolerance: arguments.tolerance };
    let before = options::load(&arguments.params)?;
    output::check(&arguments.out, &[arguments.params.as_ref()], Folders::Exist)?;
    let (parameters, reduction) = reduce::reduced_parameters(&before, criterion)?;
    output::write_whole(&arguments.out, |file| file.write_all(parameters.to_toml().as_bytes()))?;
    let report = Report {
        parameters_file: shown(&arguments.out),
        branches_before: before.model.branches().len(),
        branches: parameters.model.branches().len(),
        steps: reduction.steps,
        largest_change: reduction.change,
    };
    terminal::report(json, &report, || {
        let mut lines = report.steps.clone();
        lines.push(format!(
            "{}: {} branches became {}; the modulus changes by {:.1e} at the most from {} to {} Hz",
            report.parameters_file,
            report.branches_before,
            report.branches,
            report.largest_change,
            rounded(criterion.from_hz),
            rounded(criterion.to_hz)
        ));
        lines.join("\n")
    })
}
