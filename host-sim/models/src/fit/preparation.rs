//! The part of a recording that is fitted, its weights, and warnings about it.

use std::fmt;
use std::ops::Deref;
use std::path::Path;

use serde::{Serialize, Serializer};

use crate::error::{Error, Result};
use crate::files::recording::{Direction, Input, Recording};
use crate::grid::Samples;
use crate::sampling;
use crate::statistics::{mean, noise, peak, range};

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
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.text)
    }
}

/// Fewest measured values of a fit.
pub(super) const MIN_VALUES: usize = 10;

/// How the measured values of a recording are prepared and weighted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preparation {
    /// The part that is fitted.
    pub window: Window,
    /// Treatment of drop-outs.
    pub gaps: Gaps,
    /// Whether the measured quantity has the other sign.
    pub inverted: bool,
    /// Whether all decades of time count the same.
    pub log_time: bool,
}

impl Preparation {
    /// All values as they are.
    pub const NONE: Self = Self { window: Window::ALL, gaps: Gaps::Interpolate, inverted: false, log_time: false };
}

/// Treatment of rows that are missing for longer than a time (s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gaps {
    /// Nothing: the input is interpolated, and there is a warning.
    Interpolate,
    /// The recording ends there.
    End(f64),
    /// The input is interpolated, and as much time after the gap as it lasted is not compared.
    Skip(f64),
}

/// The part of a recording whose measured values are fitted, s of its time. Before it the model runs along the input all the
/// same: what a film remembers is not cut off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// First time.
    pub from_s: f64,
    /// Last time.
    pub to_s: f64,
}

impl Window {
    /// All of a recording.
    pub const ALL: Self = Self { from_s: 0.0, to_s: f64::INFINITY };

    /// `measured` and `input` of the recording at `path` in this window.
    pub(super) fn cut(self, path: &Path, input: &Input, measured: &Samples) -> Result<(Input, Samples)> {
        let kept = |samples: &Samples, from_s: f64| {
            let pairs = samples.time_s.iter().zip(&samples.value);
            let (time_s, value) = pairs.filter(|&(&t, _)| from_s <= t && t <= self.to_s).unzip();
            Samples { time_s, value }
        };
        let (input, inside) = (input.map(|samples| kept(samples, 0.0)), kept(measured, self.from_s));
        if inside.value.len() < MIN_VALUES || input.samples().value.len() < 2 {
            let last_s = measured.time_s.last().copied().unwrap_or(0.0);
            let until = if self.to_s.is_finite() { format!("to {} s", self.to_s) } else { "on".into() };
            let cause = format!(
                "{} measured values from {} s {until} (`from_s`, `to_s`); a fit needs at least {MIN_VALUES}, and the \
                 recording ends at {last_s} s",
                inside.value.len(),
                self.from_s
            );
            return Err(Error::file(path, cause));
        }
        Ok((input, inside))
    }
}

impl Gaps {
    /// The window and the `measured` values that gaps leave, and a warning about what they take.
    pub(super) fn apply(self, window: Window, drive: &Samples, measured: &mut Samples) -> (Window, Option<String>) {
        let longer = |limit_s: f64| {
            let pairs = drive.time_s.windows(2).map(|pair| (pair[0], pair[1] - pair[0]));
            pairs.filter(move |(_, step)| *step > limit_s).collect::<Vec<(f64, f64)>>()
        };
        match self {
            Self::Interpolate => (window, None),
            Self::End(limit_s) => match longer(limit_s).first() {
                Some(&(at, step)) if at < window.to_s => {
                    let warning = format!("a gap of {step:.3} s at {at:.3} s; the recording ends there (`gap_s`)");
                    (Window { to_s: at, ..window }, Some(warning))
                }
                _ => (window, None),
            },
            Self::Skip(limit_s) => {
                let gaps = longer(limit_s);
                let inside = |t: f64| gaps.iter().any(|(at, step)| *at < t && t < at + 2.0 * step);
                let before = measured.value.len();
                let pairs = measured.time_s.iter().copied().zip(measured.value.iter().copied());
                (measured.time_s, measured.value) = pairs.filter(|(t, _)| !inside(*t)).unzip();
                let taken = before - measured.value.len();
                let warning = format!(
                    "{} gaps of more than {limit_s} s; the input is interpolated across them, and {taken} values after them are \
                     not compared (`gap_s`)",
                    gaps.len()
                );
                (window, (!gaps.is_empty()).then_some(warning))
            }
        }
    }
}

/// Square roots of the weights of the `measured` values, of mean square 1: those of the recording's column `weight`, times those
/// of logarithmic time. Empty if there are neither.
pub(super) fn sample_weights(recording: &Recording, measured: &Samples, log_time: bool) -> Result<Vec<f64>> {
    let column = recording.weights();
    if column.is_none() && !log_time {
        return Ok(Vec::new());
    }
    let mut weights = vec![1.0; measured.value.len()];
    if let Some(column) = column {
        if let Some(k) = column.value.iter().position(|weight| *weight < 0.0) {
            let cause = format!("weight is {} at {} s; weights are at least 0", column.value[k], column.time_s[k]);
            return Err(Error::file(recording.path(), cause));
        }
        for (weight, time) in weights.iter_mut().zip(&measured.time_s) {
            if let Ok(row) = column.time_s.binary_search_by(|t| t.total_cmp(time)) {
                *weight = column.value[row];
            }
        }
    }
    if log_time {
        weights.iter_mut().zip(logarithmic_shares(&measured.time_s)).for_each(|(weight, share)| *weight *= share);
    }
    let mean = mean(&weights);
    if mean == 0.0 {
        return Err(Error::file(recording.path(), "every weight is 0; there is nothing to fit"));
    }
    Ok(weights.into_iter().map(|weight| (weight / mean).sqrt()).collect())
}

/// The share of ln t of each of `times`: from half way to the one before to half way to the one after.
fn logarithmic_shares(times: &[f64]) -> Vec<f64> {
    let last = times.len() - 1;
    let middle = |k: usize| 0.5 * (times[k] + times[k + 1]);
    let share = |k: usize| {
        let after = if k == last { times[k] } else { middle(k) };
        let before = if k == 0 { times[k] } else { middle(k - 1) };
        if before > 0.0 { (after / before).ln() } else { f64::NAN }
    };
    let mut shares: Vec<f64> = (0..=last).map(share).collect();
    // At t = 0 there is no logarithm: as much as the next.
    for k in (0..last).rev() {
        if shares[k].is_nan() {
            shares[k] = shares[k + 1];
        }
    }
    shares
}

/// Input that the steps of the model do not follow.
pub(super) fn between_steps(drive: &Samples, rate_hz: f64) -> Option<String> {
    /// Share of the input's change that is not noise.
    const ALLOWED: f64 = 0.05;
    let worst = peak(&sampling::missed(drive, rate_hz));
    (worst > ALLOWED).then(|| sampling::between_steps(rate_hz, worst))
}

/// The load at `times_s`: the square of a voltage, otherwise the input.
fn loads(input: &Input, times_s: &[f64]) -> Vec<f64> {
    let drive = input.samples();
    let load = |value: f64| if matches!(input, Input::Voltage(_)) { value * value } else { value };
    let at = |&t: &f64| load(drive.value[drive.time_s.partition_point(|&s| s <= t).saturating_sub(1)]);
    times_s.iter().map(at).collect()
}

/// A measured quantity that falls where the input grows.
pub(super) fn turned(input: &Input, measured: &Samples) -> Option<String> {
    let pairs: Vec<(f64, f64)> =
        loads(input, &measured.time_s).into_iter().zip(measured.value.iter().copied()).collect();
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

/// Measured values that repeat at the ends of their range; those of the first row only where the input acts.
pub(super) fn saturation(direction: Direction, input: &Input, measured: &Samples) -> Vec<String> {
    /// Share of the largest load up to which a film is at rest.
    const REST: f64 = 0.03;
    let (what, unit) = measured_quantity(direction);
    let values = &measured.value;
    let (low, high) = range(values);
    let loads = loads(input, &measured.time_s);
    let rest = REST * peak(&loads);
    [(high, "largest"), (low, "smallest")]
        .into_iter()
        .filter_map(|(value, end)| {
            let is_at_end = |k: usize| values[k] == value && (value != values[0] || loads[k].abs() > rest);
            let rows: Vec<bool> = (0..values.len()).map(is_at_end).collect();
            let at_end: usize =
                rows.chunk_by(|a, b| a == b).filter(|run| run[0] && run.len() >= 4).map(<[_]>::len).sum();
            (at_end * 50 > values.len()).then(|| {
                format!(
                    "{at_end} values are at the {end} {what} of {value} {unit}; if the sensor saturates there, leave \
                     those cells empty"
                )
            })
        })
        .collect()
}

/// A specimen that is slack: after its largest force it moves without one.
pub(super) fn slack(input: &Input, measured: &Samples) -> Option<String> {
    /// Share of the largest force that counts as zero, and of the displacement's range beyond which it moves.
    const ZERO: f64 = 0.01;
    const MOVES: f64 = 0.05;
    let Input::Displacement(moved) = input else { return None };
    let (times, forces) = (&measured.time_s, &measured.value);
    let most = peak(forces);
    let zero = (ZERO * most).max(3.0 * noise(forces));
    let first = forces.iter().position(|force| force.abs() == most)?;
    let (low, high) = range(&moved.value);
    let at = moved.at(times.iter().copied());
    let rows: Vec<usize> = (first..forces.len()).collect();
    let runs = rows.chunk_by(|&a, &b| (forces[a].abs() < zero) == (forces[b].abs() < zero));
    let mut slack = runs.filter(|run| forces[run[0]].abs() < zero).filter(|run| {
        let (least, most) = range(&at[run[0]..=run[run.len() - 1]]);
        most - least > MOVES * (high - low)
    });
    slack.next().map(|run| {
        let [from, to] = [run[0], run[run.len() - 1]];
        format!(
            "from {:.3} to {:.3} s the displacement goes from {:.3} to {:.3} mm without a force: the specimen is slack, which no model follows; fit \
             up to there (`to_s`), or leave those cells of the force empty",
            times[from],
            times[to],
            1e3 * at[from],
            1e3 * at[to]
        )
    })
}

/// Name and SI unit of what is measured.
pub(super) fn measured_quantity(direction: Direction) -> (&'static str, &'static str) {
    match direction {
        Direction::Force => ("displacement", "m"),
        Direction::Displacement => ("force", "N"),
    }
}
