//! Times of rows: a column of numbers or of times of day, or an interval that is the same for all.

use super::Quantity;
use super::clock::{self, Clock, Digits};
use super::numbers::Cell;
use super::source::si;
use super::units::{self, Unit};
use crate::grid::usual_step;

/// Latest time since 1970 or a later beginning, s.
const MAX_TIME_S: f64 = 1e11;

/// Where the times of a file come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A column.
    Column,
    /// A column, or the interval that the preamble states.
    Preamble,
    /// The rate that a person gave.
    Person,
}

/// The times of rows as they are read.
#[derive(Default)]
pub struct Times {
    /// Interval of the rows where the file or a person states it, s.
    interval_s: Option<f64>,
    /// Whether rows may have one time.
    may_repeat: bool,
    /// First lines of runs of rows.
    starts: Vec<u64>,
    clock: Clock,
    digits: Digits,
    clock_s: Vec<f64>,
    /// Rows without a time.
    counted: usize,
}

impl Times {
    /// No rows yet, of runs that begin in the lines `starts`.
    pub fn new(interval_s: Option<f64>, may_repeat: bool, starts: Vec<u64>) -> Self {
        Self { interval_s, may_repeat, starts, ..Self::default() }
    }

    /// Takes a row without a time.
    pub fn count(&mut self) {
        self.counted += 1;
    }

    /// Takes the time of the row in `line`, in the column `name`; a time of day with the fraction of its second.
    /// It must follow that of the row before.
    pub fn push(&mut self, line: u64, name: &str, value: Cell<'_>, factor: f64, fraction_s: f64) -> Result<(), String> {
        let now = match value {
            // An empty column where the preamble states the interval.
            Cell::Nothing if self.interval_s.is_some() && self.clock_s.is_empty() => {
                self.count();
                return Ok(());
            }
            Cell::Text(text) => match clock::stamp(text) {
                Some(stamp) => {
                    self.digits.take(text);
                    Some(self.clock.seconds(stamp)? + fraction_s)
                }
                None if clock::is_two_parts(text) => {
                    let cause = "hours and minutes, or minutes and seconds; write hours, minutes and seconds";
                    return Err(format!("{name} is {text:?}: {cause}"));
                }
                None => {
                    let begin: String = text.chars().take(40).collect();
                    let advice = if self.clock_s.is_empty() {
                        "write seconds, 10:00:01.5 or 2026-11-24 10:00:01.5, or state the rate of the rows with `rate_hz`"
                    } else {
                        "remove the line, or begin it with # if it is a remark"
                    };
                    return Err(format!("{name} is {begin:?}, which is not a time; {advice}"));
                }
            },
            value => si(name, value, factor)?,
        };
        let now = now.filter(|_| self.counted == 0);
        let now = now.ok_or_else(|| format!("no value for {name}; every row needs its time"))?;
        if now.abs() > MAX_TIME_S {
            let cause = "beyond the year 5000: are they milliseconds or microseconds? State their unit with `columns`, as in time=1:ms";
            return Err(format!("{name} is {now} s, {cause}"));
        }
        match self.clock_s.last() {
            Some(&before) if now < before && self.starts.len() > 1 && self.starts.contains(&line) => {
                let runs = self.starts.len();
                return Err(format!(
                    "{name} begins again in this one of {runs} runs of rows; choose one with `segment` 1 to {runs}"
                ));
            }
            Some(&before) if now < before && !self.digits.are_milliseconds() => {
                return Err(format!(
                    "{name} goes backwards at {now} s; sort the rows and remove doubles, or, if they are in order and the clock is not, state their \
                     rate with `rate_hz`"
                ));
            }
            Some(&before) if now == before && !self.may_repeat && !self.digits.are_milliseconds() => {
                return Err(format!(
                    "{name} does not increase at {now} s; sort the rows and remove doubles, or state what rows of one time mean with \
                     `repeated_times` spread (a slow timer) or `repeated_times` mean"
                ));
            }
            _ => {}
        }
        self.clock_s.push(now);
        Ok(())
    }

    /// The times, s, and the unit of their column (its number and name) if the preamble states their interval instead. `runs` counts the
    /// runs of rows.
    pub fn finish(
        self,
        without_unit: Option<(usize, &str)>,
        runs: impl FnOnce() -> usize,
    ) -> Result<(Vec<f64>, Option<Unit>), String> {
        let Self { interval_s, mut clock_s, counted, digits, .. } = self;
        if digits.are_milliseconds() || digits.may_be_milliseconds(&clock_s) {
            return Err("the times have milliseconds without leading zeros, so .5 may be 5 or 500 ms; write three digits, or state the rate of the \
                        rows with `rate_hz`"
                .into());
        }
        if let Some(interval_s) = interval_s.filter(|_| counted > 0) {
            return match runs() {
                0 | 1 => Ok(((0..counted).map(|row| row as f64 * interval_s).collect(), None)),
                runs => Err(format!(
                    "{runs} runs of rows without times, which a header, an empty line or a new count of the rows separates; choose one with \
                     `segment` 1 to {runs}, or remove the lines between them if they are one"
                )),
            };
        }
        let (Some((number, name)), Some(interval_s)) = (without_unit, interval_s) else { return Ok((clock_s, None)) };
        let step = usual_step(&clock_s).unwrap_or(0.0);
        let fits = |unit: &Unit| (step * unit.factor / interval_s - 1.0).abs() < 0.01;
        let unit = units::units_of(Quantity::Time).find(fits).ok_or_else(|| {
            format!("the rows are {step} apart in {name:?} and {interval_s} s in the preamble; state the unit with `columns` time={number}:s")
        })?;
        clock_s.iter_mut().for_each(|t| *t *= unit.factor);
        Ok((clock_s, Some(unit)))
    }
}
