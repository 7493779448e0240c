//! Warnings of a fit, and those about recordings before it.

use std::fmt;
use std::ops::Deref;

use super::statistics::{change, range};
use crate::files::recording::{Direction, Input};
use crate::grid::{Grid, Samples};
use serde::{Serialize, Serializer};

/// How much a warning matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// To be settled before anything is built on the result.
    Serious,
    /// The result can be used within what it says.
    Caution,
    /// It changes nothing in what the result is used for.
    Note,
}

/// A warning, which reads and is written as its text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// How much it matters.
    pub severity: Severity,
    /// The problem, and what to do.
    pub text: String,
}

impl Severity {
    /// A warning of this severity.
    pub fn warning(self, text: impl Into<String>) -> Warning {
        Warning { severity: self, text: text.into() }
    }
}

impl Deref for Warning {
    type Target = str;

    fn deref(&self) -> &str {
        &self.text
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.text)
    }
}

/// Input that the steps of the model do not follow: it is sampled at them, with straight lines between.
pub(super) fn between_steps(drive: &Samples, rate_hz: f64) -> Option<String> {
    /// Share of the input's change that is not noise.
    const ALLOWED: f64 = 0.05;
    let grid = Grid::covering(drive.time_s.last().copied()?, rate_hz).ok()?;
    let followed = grid.at(&grid.resample(drive), &drive.time_s);
    let size = change(&drive.value);
    let off = |(value, followed): (&f64, &f64)| (value - followed).abs() / size;
    let worst = drive.value.iter().zip(&followed).map(off).fold(0.0, f64::max);
    (worst > ALLOWED).then(|| {
        format!(
            "the input moves between the model's steps of {:.4} s, by up to {:.0} % of its range: what happens there is not \
             fitted",
            grid.step_s(),
            100.0 * worst
        )
    })
}

/// A measured quantity that falls where the input grows.
pub(super) fn turned(input: &Input, measured: &Samples) -> Option<String> {
    let drive = input.samples();
    let load: Vec<f64> =
        drive.value.iter().map(|v| if matches!(input, Input::Voltage(_)) { v * v } else { *v }).collect();
    let at = |t: f64| load[drive.time_s.partition_point(|&s| s <= t).saturating_sub(1)];
    let pairs: Vec<(f64, f64)> = measured.time_s.iter().zip(&measured.value).map(|(&t, &y)| (at(t), y)).collect();
    let n = pairs.len() as f64;
    let (what, of, centre) = match input {
        Input::Voltage(_) => ("displacement", "voltage", true),
        Input::Force(_) => ("displacement", "force", true),
        // Both are 0 at rest, and a force relaxes while the displacement grows slowly.
        Input::Displacement(_) => ("force", "displacement", false),
    };
    let mean = |of: fn(&(f64, f64)) -> f64| if centre { pairs.iter().map(of).sum::<f64>() / n } else { 0.0 };
    let (load_mean, value_mean) = (mean(|p| p.0), mean(|p| p.1));
    let sum = |of: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|p| of(p.0 - load_mean, p.1 - value_mean)).sum::<f64>();
    let correlation = sum(&|u, y| u * y) / (sum(&|u, _| u * u) * sum(&|_, y| y * y)).sqrt();
    (correlation < -0.3).then(|| format!("the {what} falls where the {of} grows: `invert` turns its sign"))
}

/// The first gap in the input.
pub(super) fn gap(steps: &[f64], median_step_s: f64, drive: &Samples) -> Option<String> {
    // Steps that grow little by little, such as logarithmic ones, are no gap.
    let is_gap = |k: usize| steps[k] > 5.0 * median_step_s && (k == 0 || steps[k] > 2.0 * steps[k - 1]);
    let k = (0..steps.len()).find(|&k| is_gap(k))?;
    let (step, time) = (steps[k], drive.time_s[k]);
    Some(format!(
        "a gap of {step:.3} s at {time:.3} s; the input is interpolated across it (`gap_s` ends there, or skips it)"
    ))
}

/// Measured values that repeat at the ends of their range.
pub(super) fn saturation(direction: Direction, values: &[f64]) -> Vec<String> {
    let (what, unit) = measured_quantity(direction);
    let (low, high) = range(values);
    [(high, "largest"), (low, "smallest")]
        .into_iter()
        .filter_map(|(value, end)| {
            let at_end = runs_at(values, value);
            (at_end * 50 > values.len() && value != values[0]).then(|| {
                format!(
                    "{at_end} values are at the {end} {what} of {value} {unit}; if the sensor saturates there, leave \
                     those cells empty"
                )
            })
        })
        .collect()
}

/// Values that equal `value` in runs of at least four.
fn runs_at(values: &[f64], value: f64) -> usize {
    values.chunk_by(|a, b| a == b).filter(|run| run[0] == value && run.len() >= 4).map(<[f64]>::len).sum()
}

/// Name and SI unit of what is measured.
pub(super) fn measured_quantity(direction: Direction) -> (&'static str, &'static str) {
    match direction {
        Direction::Force => ("displacement", "m"),
        Direction::Displacement => ("force", "N"),
    }
}
