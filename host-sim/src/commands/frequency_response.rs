//! `frequency-response`: displacement over force against frequency.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::error::{Error, Result, shown};
use crate::files::output::{self, Folders, Staged};
use crate::files::parameters::Parameters;
use crate::quantity;
use crate::replay::frequency_response;
use crate::report::figure::Figure;
use crate::report::figure_file::PlotOption;
use crate::report::response_figure;
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Parameter file (TOML), or preset:NAME such as preset:table3-n2.
    #[arg(long, value_name = "P")]
    params: String,
    /// Lowest frequency.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz)]
    from: f64,
    /// Highest frequency.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz)]
    to: f64,
    /// Number of frequencies, spaced evenly on a logarithmic scale.
    #[arg(long, value_name = "N")]
    points: usize,
    /// Where the table goes: frequency_hz, magnitude_m_per_n, phase_rad.
    #[arg(long, value_name = "FR.csv")]
    out: PathBuf,
    /// Displacement about which a film with an elastic curve oscillates, m.
    #[arg(long, value_name = "M", value_parser = quantity::metres, default_value_t = 0.0)]
    at: f64,
    /// Of the law that the controller steps (f32, compressed), instead of the continuous Eq. 11.
    #[arg(long)]
    discrete: bool,
    /// Steps per second of the law (1000 if left out).
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz, requires = "discrete")]
    rate: Option<f64>,
    #[command(flatten)]
    plot: PlotOption,
}

#[derive(Serialize)]
struct Report {
    out: String,
    points: usize,
    discrete: bool,
}

/// Lowest frequency (Hz) at which every model has a response.
const LOWEST: f64 = 1e-12;
/// Highest such frequency, Hz.
const HIGHEST: f64 = 1e12;

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let rate = arguments.checked_rate()?;
    let parameters = Parameters::load(&arguments.params)?;
    output::check(&arguments.out, &[arguments.params.as_ref()], Folders::Exist)?;
    let plot = arguments.plot.check(&[arguments.params.as_ref()], &[&arguments.out])?;
    let law = arguments
        .discrete
        .then(|| parameters.film().compressed_law::<f32>(rate))
        .transpose()
        .map_err(|e| e.about(&arguments.params, &arguments.out))?;
    let frequency = frequency_response::logarithmic(arguments.from, arguments.to, arguments.points);
    let (magnitude, phase): (Vec<f64>, Vec<f64>) = frequency
        .iter()
        .map(|&f| match &law {
            Some(law) => law.frequency_response_about(f, arguments.at),
            None => frequency_response::continuous(&parameters, f, arguments.at),
        })
        .map(|response| response.to_polar())
        .unzip();
    let table = output::stage_columns(
        &arguments.out,
        &[],
        &[("frequency_hz", Some(&frequency)), ("magnitude_m_per_n", Some(&magnitude)), ("phase_rad", Some(&phase))],
    )?;
    let report = Report { out: shown(&arguments.out), points: arguments.points, discrete: arguments.discrete };
    let title = format!("Frequency response of {}", parameters.name);
    let drawn =
        plot.stage(&report, || Figure::new(title, response_figure::of(&frequency, &magnitude, &phase).into()))?;
    [Some(table), drawn].into_iter().flatten().try_for_each(Staged::commit)?;
    terminal::report(json, &report, || {
        let kind = if report.discrete { format!("the law at {rate} Hz") } else { "Eq. 11".into() };
        format!("{}: {} frequencies of {kind}", report.out, report.points)
    })
}

impl Arguments {
    /// The rate of the law (Hz), once all options are checked.
    fn checked_rate(&self) -> Result<f64> {
        let Self { from, to, points, .. } = *self;
        let rate = self.rate.unwrap_or(1000.0);
        if !(LOWEST..=HIGHEST).contains(&from) {
            return Err(Error::option("--from", format!("{from:?} Hz must be from {LOWEST:?} to {HIGHEST:?}")));
        }
        if !(from..=HIGHEST).contains(&to) {
            return Err(Error::option("--to", format!("{to:?} Hz must be from --from to {HIGHEST:?}")));
        }
        if !(1..=10_000_000).contains(&points) {
            return Err(Error::option("--points", format!("{points} must be from 1 to 10000000")));
        }
        if points == 1 && from != to {
            return Err(Error::option("--points", "1 is one frequency, but --from and --to are two"));
        }
        if !(rate.is_finite() && rate > 0.0) {
            return Err(Error::option("--rate", format!("{rate:?} Hz must be finite and greater than 0")));
        }
        if self.discrete && to > 0.5 * rate {
            let cause = format!("{to} Hz is above half the rate; a law at {rate} Hz has no such frequency");
            return Err(Error::option("--to", cause));
        }
        Ok(rate)
    }
}
