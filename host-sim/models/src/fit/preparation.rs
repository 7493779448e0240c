//! The part of a recording that is fitted, and its weights.

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::recording::{Input, Recording};
use crate::grid::Samples;

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
    let mean = weights.iter().sum::<f64>() / weights.len() as f64;
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
