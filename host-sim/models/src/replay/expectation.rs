//! The error to expect of feedforward, from what was recorded of the film.

use serde::{Deserialize, Serialize};
use toml::Value;

use crate::files::parameters::Parameters;
use crate::grid::Grid;

/// Key of the table in a parameter file's provenance.
const KEY: &str = "recorded";
/// Largest error of feedforward over the error on what was left out: calibrated on random films that stiffen in series with creep.
const MAX_RATIO: f64 = 5.0;
/// Growth of that error with each share by which a reference exceeds what was recorded.
const GROWTH: f64 = 5.0;
/// Share by which a reference may exceed it, which changes nothing.
const SLACK: f64 = 0.02;

/// The range of what was recorded of a film.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recorded {
    /// Smallest and largest displacement, m.
    pub stroke_m: [f64; 2],
    /// Largest voltage, V.
    pub voltage_v: f64,
    /// Largest speed, m/s.
    pub speed_m_per_s: f64,
    /// Duration of the longest recording, s.
    pub time_s: f64,
    /// RMS error on what was left out, without noise, m.
    pub left_out_m: f64,
}

/// A quantity of a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Displacement, m.
    Stroke,
    /// Voltage, V.
    Voltage,
    /// Speed, m/s.
    Speed,
    /// Duration, s.
    Time,
}

/// A quantity in which a reference exceeds all recordings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Beyond {
    /// Which one.
    pub quantity: Quantity,
    /// The value that the reference needs.
    pub needed: f64,
    /// The recorded value.
    pub recorded: f64,
}

/// The error to expect along a reference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Expectation {
    /// Largest RMS error to expect, in % of the reference's peak to peak after 2 s.
    pub largest_pct: f64,
    /// The quantities in which the reference exceeds all recordings, for which the error grows.
    pub beyond: Vec<Beyond>,
}

impl Recorded {
    /// The ranges of the recordings behind `parameters`, if their file has them.
    #[must_use]
    pub fn from_parameters(parameters: &Parameters) -> Option<Self> {
        parameters.provenance.as_ref()?.get(KEY)?.clone().try_into().ok()
    }

    /// The entry of a parameter file's provenance.
    #[must_use]
    pub fn entry(&self) -> Option<(&'static str, Value)> {
        Some((KEY, Value::try_from(self).ok()?))
    }

    /// Largest RMS error of feedforward to expect within what was recorded, m.
    #[must_use]
    pub fn largest_error_m(&self) -> f64 {
        MAX_RATIO * self.left_out_m
    }

    /// The error to expect along `reference` (m, on `grid`), which goes over `range_m` after its rise and needs `voltage_v` at the most.
    #[must_use]
    pub fn expectation(&self, reference: &[f64], grid: Grid, range_m: f64, voltage_v: f64) -> Expectation {
        let [low, high] = self.stroke_m;
        let end = |of: fn(f64, f64) -> f64, from: f64| reference.iter().copied().fold(from, of);
        let speed = reference.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max) * grid.rate_hz;
        let stroke = high - low;
        let quantities = [
            (Quantity::Stroke, end(f64::max, high), high, stroke),
            (Quantity::Stroke, end(f64::min, low), low, stroke),
            (Quantity::Voltage, voltage_v, self.voltage_v, self.voltage_v),
            (Quantity::Speed, speed, self.speed_m_per_s, self.speed_m_per_s),
            (Quantity::Time, grid.step_s() * (reference.len() - 1) as f64, self.time_s, self.time_s),
        ];
        let mut growth = 1.0;
        let mut beyond = Vec::new();
        for (quantity, needed, recorded, size) in quantities {
            let share = match quantity {
                Quantity::Stroke => (needed - recorded).abs(),
                _ => needed - recorded,
            } / size;
            if share > SLACK {
                growth += GROWTH * share;
                beyond.push(Beyond { quantity, needed, recorded });
            }
        }
        Expectation { largest_pct: 100.0 * growth * self.largest_error_m() / range_m.max(f64::MIN_POSITIVE), beyond }
    }
}
