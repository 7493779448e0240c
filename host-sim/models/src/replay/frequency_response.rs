//! Displacement over force of the continuous model, against frequency.

use std::f64::consts::TAU;

use num_complex::Complex;

use crate::files::parameters::Parameters;

/// Of `parameters` for small oscillations about `at_m`, m/N.
pub fn continuous(parameters: &Parameters, frequency_hz: f64, at_m: f64) -> Complex<f64> {
    let model = &parameters.model;
    match &parameters.curve {
        Some(curve) => {
            let s = Complex::new(0.0, TAU * frequency_hz);
            (s * s * model.mass_kg() + model.modulus(s) * curve.pieces().slope(at_m)).inv()
        }
        None => model.frequency_response(frequency_hz),
    }
}

/// `count` frequencies from one to another (Hz), spaced evenly on a logarithmic scale.
pub fn logarithmic(from_hz: f64, to_hz: f64, count: usize) -> Vec<f64> {
    let spacing = (to_hz / from_hz).ln() / (count.max(2) - 1) as f64;
    (0..count).map(|k| if k + 1 == count { to_hz } else { from_hz * (spacing * k as f64).exp() }).collect()
}
