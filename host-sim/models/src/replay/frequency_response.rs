//! Displacement over force against frequency, of the continuous model or of a law.

use std::f64::consts::TAU;

use num_complex::Complex;
use springpot::{Maxwell, Spring};

use crate::error::{Error, Result};
use crate::files::parameters::Parameters;
use crate::replay::in_series::elongation;

/// The response of `parameters` to small oscillations about `at_m`, m/N.
pub fn continuous(parameters: &Parameters, frequency_hz: f64, at_m: f64) -> Complex<f64> {
    let model = &parameters.model;
    let s = Complex::new(0.0, TAU * frequency_hz);
    let (inertia, memory) = (s * s * model.mass_kg(), model.modulus(s));
    let slope = parameters.curve.as_ref().map(|curve| curve.pieces().slope(at_m));
    match (slope, &parameters.spring) {
        (Some(slope), Some(spring)) => inertia + memory * (slope * slope) + spring.slope(at_m),
        (Some(slope), None) => inertia + memory * slope,
        (None, Some(spring)) => {
            let compliance = spring.slope(elongation_at(model, spring, at_m)).recip();
            inertia + memory / (memory * compliance + 1.0)
        }
        (None, None) => return model.frequency_response(frequency_hz),
    }
    .inv()
}

/// Stretch (m) of a `spring` in series with `model` where both are at `at_m` (m) within about a second, as a law has it.
fn elongation_at(model: &Maxwell, spring: &Spring, at_m: f64) -> f64 {
    let Complex { re, im } = model.modulus(Complex::new(0.0, TAU));
    let memory = re.abs().max(im.abs());
    elongation(spring, memory, memory * at_m, 0.0)
}

/// `count` frequencies from one to another (Hz), spaced evenly on a logarithmic scale.
pub fn logarithmic(from_hz: f64, to_hz: f64, count: usize) -> Vec<f64> {
    let spacing = (to_hz / from_hz).ln() / (count.max(2) - 1) as f64;
    (0..count).map(|k| if k + 1 == count { to_hz } else { from_hz * (spacing * k as f64).exp() }).collect()
}

/// Lowest frequency (Hz) at which every model has a response.
const MIN_HZ: f64 = 1e-12;
/// Highest such frequency, Hz.
const MAX_HZ: f64 = 1e12;

/// Frequencies at which a response is computed, and of what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Lowest frequency.
    pub from_hz: f64,
    /// Highest frequency.
    pub to_hz: f64,
    /// Number of frequencies, spaced evenly on a logarithmic scale.
    pub points: usize,
    /// Displacement about which a film that is not linear oscillates, m.
    pub at_m: f64,
    /// Steps per second of the law (f32, compressed); none for the continuous Eq. 11.
    pub law_hz: Option<f64>,
}

/// Displacement over force.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Response {
    /// Hz.
    pub frequency_hz: Vec<f64>,
    /// m/N.
    pub magnitude_m_per_n: Vec<f64>,
    /// Negative where the displacement lags, rad.
    pub phase_rad: Vec<f64>,
}

impl Sweep {
    /// Refuses frequencies at which there is no response.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] with the range.
    pub fn check(&self) -> Result<()> {
        let Self { from_hz: from, to_hz: to, points, law_hz, .. } = *self;
        if !(MIN_HZ..=MAX_HZ).contains(&from) {
            return Err(Error::field("from_hz", format!("{from:?} Hz must be from {MIN_HZ:?} to {MAX_HZ:?}")));
        }
        if !(from..=MAX_HZ).contains(&to) {
            return Err(Error::field("to_hz", format!("{to:?} Hz must be from `from_hz` to {MAX_HZ:?}")));
        }
        if !(1..=10_000_000).contains(&points) {
            return Err(Error::field("points", format!("{points} must be from 1 to 10000000")));
        }
        if points == 1 && from != to {
            return Err(Error::field("points", "1 is one frequency, but `from_hz` and `to_hz` are two"));
        }
        let Some(rate) = law_hz else { return Ok(()) };
        if !(rate.is_finite() && rate > 0.0) {
            return Err(Error::field("law_hz", format!("{rate:?} Hz must be finite and greater than 0")));
        }
        if to > 0.5 * rate {
            let cause = format!("{to} Hz is above half the rate; a law at {rate} Hz has no such frequency");
            return Err(Error::field("to_hz", cause));
        }
        Ok(())
    }

    /// The response of `parameters`.
    ///
    /// # Errors
    ///
    /// As [`check`](Self::check), and where the law is refused.
    pub fn run(&self, parameters: &Parameters) -> Result<Response> {
        self.check()?;
        let law = self.law_hz.map(|rate_hz| parameters.film().compressed_law::<f32>(rate_hz)).transpose()?;
        let frequency_hz = logarithmic(self.from_hz, self.to_hz, self.points);
        let (magnitude_m_per_n, phase_rad) = frequency_hz
            .iter()
            .map(|&f| match &law {
                Some(law) => law.frequency_response_about(f, self.at_m),
                None => continuous(parameters, f, self.at_m),
            })
            .map(|response| response.to_polar())
            .unzip();
        Ok(Response { frequency_hz, magnitude_m_per_n, phase_rad })
    }
}
