//! The frequency response of a model: magnitude and phase.

use super::figure::{Colour, Line, Panel};
use crate::files::parameters::Parameters;
use crate::replay::frequency_response;

/// Frequencies that are drawn.
const POINTS: usize = 240;

/// Magnitude and phase of the continuous model of `parameters` from one frequency to another (Hz), about `at_m`.
pub fn panels(parameters: &Parameters, (from_hz, to_hz): (f64, f64), at_m: f64) -> [Panel; 2] {
    let frequency = frequency_response::logarithmic(from_hz, to_hz, POINTS);
    let response = frequency.iter().map(|&hz| frequency_response::continuous(parameters, hz, at_m).to_polar());
    let (magnitude, phase): (Vec<f64>, Vec<f64>) = response.unzip();
    bode_panels(&frequency, &magnitude, &phase)
}

/// The panels of a response: magnitude (m/N) and phase (rad) at `frequency` (Hz).
pub fn bode_panels(frequency: &[f64], magnitude: &[f64], phase: &[f64]) -> [Panel; 2] {
    let scaled = |values: &[f64], by: f64| -> Vec<f64> { values.iter().map(|value| by * value).collect() };
    [
        Panel::new("Displacement over force", "frequency (Hz)", "magnitude (mm/N)")
            .with(Line::new("magnitude", frequency, &scaled(magnitude, 1e3)))
            .logarithmic(true, true),
        Panel::new("Phase", "frequency (Hz)", "phase (°)")
            .with(Line::new("phase", frequency, &scaled(phase, 1f64.to_degrees())).coloured(Colour::VERMILION))
            .logarithmic(true, false),
    ]
}
