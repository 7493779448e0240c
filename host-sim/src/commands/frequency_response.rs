//! `frequency-response`: displacement over force against frequency.

use std::f64::consts::TAU;
use std::path::PathBuf;

use clap::Args;
use num_complex::Complex;
use serde::Serialize;

use crate::error::{Error, Result, shown};
use crate::files::output::{self, Folders};
use crate::files::parameters::Parameters;
use crate::replay::memory;
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Parameter file (TOML), or preset:NAME such as preset:table3-n2.
    #[arg(long, value_name = "P")]
    params: String,
    /// Lowest frequency.
    #[arg(long, value_name = "HZ")]
    from: f64,
    /// Highest frequency.
    #[arg(long, value_name = "HZ")]
    to: f64,
    /// Number of frequencies, spaced evenly on a logarithmic scale.
    #[arg(long, value_name = "N")]
    points: usize,
    /// Where the table goes: frequency_hz, magnitude_m_per_n, phase_rad.
    #[arg(long, value_name = "FR.csv")]
    out: PathBuf,
    /// Displacement about which a film with an elastic curve oscillates, m.
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_negative_numbers = true)]
    at: f64,
    /// Of the law that the controller steps (f32, compressed), instead of the continuous Eq. 11.
    #[arg(long)]
    discrete: bool,
    /// Steps per second of the law (1000 if left out).
    #[arg(long, value_name = "HZ", requires = "discrete")]
    rate: Option<f64>,
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
    let law = arguments
        .discrete
        .then(|| memory::compressed_law::<f32>(parameters.film(), rate))
        .transpose()
        .map_err(|e| e.about(&arguments.params, &arguments.out))?;
    let frequency = arguments.frequencies();
    let (magnitude, phase): (Vec<f64>, Vec<f64>) = frequency
        .iter()
        .map(|&f| match &law {
            Some(law) => law.frequency_response_about(f, arguments.at),
            None => response_about(&parameters, f, arguments.at),
        })
        .map(|response| response.to_polar())
        .unzip();
    output::write_columns(
        &arguments.out,
        &[],
        &[("frequency_hz", Some(&frequency)), ("magnitude_m_per_n", Some(&magnitude)), ("phase_rad", Some(&phase))],
    )?;
    let report = Report { out: shown(&arguments.out), points: arguments.points, discrete: arguments.discrete };
    terminal::report(json, &report, || {
        let kind = if report.discrete { format!("the law at {rate} Hz") } else { "Eq. 11".into() };
        format!("{}: {} frequencies of {kind}", report.out, report.points)
    })
}

/// Of the continuous model for small oscillations about `at_m`: displacement over force, m/N.
fn response_about(parameters: &Parameters, frequency_hz: f64, at_m: f64) -> Complex<f64> {
    let model = &parameters.model;
    match &parameters.curve {
        Some(curve) => {
            let s = Complex::new(0.0, TAU * frequency_hz);
            (s * s * model.mass_kg() + model.modulus(s) * curve.pieces().slope(at_m)).inv()
        }
        None => model.frequency_response(frequency_hz),
    }
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
        if !self.at.is_finite() {
            return Err(Error::option("--at", format!("{:?} m must be finite", self.at)));
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

    /// The frequencies (Hz), spaced evenly on a logarithmic scale.
    fn frequencies(&self) -> Vec<f64> {
        let Self { from, to, points, .. } = *self;
        let spacing = (to / from).ln() / (points.max(2) - 1) as f64;
        (0..points).map(|k| if k + 1 == points { to } else { from * (spacing * k as f64).exp() }).collect()
    }
}
