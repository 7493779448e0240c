//! Spectra of recordings and residuals.

use std::f64::consts::TAU;

use host_fft::Planner;

use crate::grid::{Grid, Samples};
use crate::statistics::mean;

const MAX_SAMPLES: usize = 262_144;
/// Points of a drawn spectrum, evenly spaced on a logarithmic axis.
const POINTS: usize = 160;

/// An amplitude density: root of power per hertz against frequency.
pub struct Spectrum {
    /// Frequencies, Hz.
    pub frequency_hz: Vec<f64>,
    /// Density, the samples' unit per √Hz: the mean square over a band is the integral of its square.
    pub density: Vec<f64>,
}

impl Spectrum {
    /// The spectrum of `samples`, without their mean; none for too few.
    pub fn new(samples: &Samples) -> Option<Self> {
        let (power, step_hz) = power(samples)?;
        let highest = power.len() - 1;
        let edge = |k: usize| (highest as f64).powf(k as f64 / POINTS as f64).round() as usize;
        let (mut frequency_hz, mut density) = (Vec::new(), Vec::new());
        for k in 0..POINTS {
            let lines = edge(k)..edge(k + 1).max(edge(k) + 1).min(highest + 1);
            // Lines that the one before has taken.
            if k > 0 && edge(k) == edge(k - 1) || lines.is_empty() {
                continue;
            }
            let count = lines.len() as f64;
            frequency_hz.push(step_hz * (lines.start as f64 + 0.5 * (count - 1.0)));
            density.push(mean(&power[lines]).sqrt());
        }
        Some(Self { frequency_hz, density })
    }
}

/// The highest frequency (Hz) with an amplitude of at least `share` of the largest.
pub fn highest_hz(samples: &Samples, share: f64) -> Option<f64> {
    let (power, step_hz) = power(samples)?;
    let largest = power.iter().skip(1).fold(0.0_f64, |largest, value| largest.max(*value));
    let line = power.iter().rposition(|value| *value >= share * share * largest)?;
    (largest > 0.0).then_some(step_hz * line as f64)
}

/// Power per hertz at the multiples of a frequency, which comes second, Hz.
fn power(samples: &Samples) -> Option<(Vec<f64>, f64)> {
    let (&first_s, &last_s) = (samples.time_s.first()?, samples.time_s.last()?);
    let duration_s = last_s - first_s;
    let own_hz = (samples.value.len() - 1) as f64 / duration_s;
    if samples.value.len() < 16 || !own_hz.is_finite() {
        return None;
    }
    let from_zero =
        Samples { time_s: samples.time_s.iter().map(|t| t - first_s).collect(), value: samples.value.clone() };
    let even = Grid::covering(duration_s, own_hz).ok()?.resample(&from_zero);
    // Of too many samples the means of a few: noise above half of their rate does not fold into the band below.
    let few = even.len().div_ceil(MAX_SAMPLES);
    let even: Vec<f64> = even.chunks_exact(few).map(mean).collect();
    let rate_hz = own_hz / few as f64;
    let mean = mean(&even);
    let plan = Planner::new().forward(even.len());
    // Hann's window keeps what is strong at one frequency from the others.
    let window = |k: usize| 0.5 - 0.5 * (TAU * k as f64 / even.len() as f64).cos();
    let lines = host_fft::spectrum(&*plan, even.iter().enumerate().map(|(k, value)| window(k) * (value - mean)));
    let squares: f64 = (0..even.len()).map(|k| window(k).powi(2)).sum();
    let power = lines.iter().map(|line| 2.0 * line.norm_sqr() / (rate_hz * squares)).collect();
    Some((power, rate_hz / even.len() as f64))
}
