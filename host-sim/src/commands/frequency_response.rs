//! `frequency-response`: displacement over force against frequency.

use super::options::AtTemperature;
use super::prelude::*;
use crate::replay::frequency_response::{Response, Sweep};
use crate::report::figure::Figure;
use crate::report::figure_file::PlotOption;
use crate::report::response_figure;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Parameter file (TOML), or preset:NAME such as preset:table3-n2.
    #[arg(long, value_name = "P")]
    params: String,
    #[command(flatten)]
    temperature: AtTemperature,
    /// Lowest frequency.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz)]
    from: f64,
    /// Highest frequency.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz)]
    to: f64,
    /// Number of frequencies, spaced evenly on a logarithmic scale.
    #[arg(long, value_name = "N")]
    points: usize,
    /// Table to write: frequency_hz, magnitude_m_per_n, phase_rad.
    #[arg(long, value_name = "FR.csv")]
    out: PathBuf,
    /// Displacement about which a film with an elastic curve oscillates, m.
    #[arg(long, value_name = "M", value_parser = quantity::metres, default_value_t = 0.0)]
    at: f64,
    /// Use the law that the controller steps (f32, compressed), instead of the continuous Eq. 11.
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

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let Arguments { from, to, points, at, discrete, .. } = *arguments;
    let law = discrete.then(|| arguments.rate.unwrap_or(1000.0));
    let sweep = Sweep { from_hz: from, to_hz: to, points, at_m: at, law_hz: law };
    sweep.check()?;
    let parameters = arguments.temperature.load(&arguments.params)?;
    let plot = arguments.plot.check_beside(&[arguments.params.as_ref()], Some(&arguments.out))?;
    let Response { frequency_hz, magnitude_m_per_n, phase_rad } =
        sweep.run(&parameters).map_err(|e| e.about(&arguments.params, &arguments.out))?;
    let table = output::stage_columns(
        &arguments.out,
        &[
            ("frequency_hz", Some(&frequency_hz)),
            ("magnitude_m_per_n", Some(&magnitude_m_per_n)),
            ("phase_rad", Some(&phase_rad)),
        ],
    )?;
    let report = Report { out: shown(&arguments.out), points: arguments.points, discrete: arguments.discrete };
    let title = format!("Frequency response of {}", parameters.name);
    plot.write(&report, [table], || {
        Figure::new(title, response_figure::bode_panels(&frequency_hz, &magnitude_m_per_n, &phase_rad).into())
    })?;
    terminal::report(json, &report, || {
        let kind = law.map_or_else(|| "Eq. 11".into(), |rate| format!("the law at {rate} Hz"));
        format!("{}: {} frequencies of {kind}", report.out, report.points)
    })
}
