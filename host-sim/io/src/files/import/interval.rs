//! Interval of the rows, where the lines above them state it.
//!
//! Every line that may concern it counts: a rate of the sensor, an averaging or a step of the drive beside it is a question.

use super::Quantity;
use super::beside::{self, Beside};
use super::lines::Fault;
use super::names::unit_cell;
use super::numbers::{self, Decimal};
use super::preamble::{common_unit, hertz, is_one_of, name_and_rest, time_unit};
use super::units::Unit;
use crate::terminal::rounded;

/// The interval, s, or the line and the cause where it is not certain.
pub type Stated = Result<f64, Box<Fault>>;

/// Names of an interval of the rows, in small letters, with blanks for underlines, and commas between them.
const INTERVALS: &str = "delta x, sample interval, sampling interval, sample period, sampling period, sampling time, sampling cycle, \
    storage cycle, hresolution, h resolution, x increment, xincrement, xinc, tinc, time increment, interval, abtastintervall, \
    abtastzeit, wf increment, delta t, dt";
/// Names of a rate of the rows.
const RATES: &str = "samplerate, sample rate, sampling rate, sampling frequency, sample frequency, samples per second, abtastrate, \
    abtastfrequenz, scan rate, data rate, acquisition rate";
/// Names of an interval or a rate that may be that of the rows, or of the drive's steps.
const OTHERS: &str = "time step, increment, step time, logging rate, logging interval, log rate, log interval, recording rate, \
    recording interval, storage rate, storage interval, save rate, save interval, output rate, output interval, messrate, \
    messintervall, speicherrate, speicherintervall";
/// Text in brackets behind a name for a rate of all rows of a channel, and for a sum over channels.
const PER_CHANNEL: &str = "per channel, each channel, per chan, pro kanal, je kanal, rows, zeilen";
const IN_TOTAL: &str = "total, all, aggregate, sum, gesamt, summe, alle";
/// Names of the number of channels.
const CHANNELS: &str = "channels, number of channels, channel count, active channels, kanäle, anzahl kanäle, kanalzahl";
/// Units of such a number.
const COUNTS: &str = "x × times time samples sample points scans cycles rows lines values mal fach werte zeilen";

#[derive(Clone, Copy, PartialEq)]
enum Key {
    Interval,
    Rate,
    Other,
}

fn key(name: &str) -> Option<Key> {
    // `actual sample rate` may be that of a sensor.
    let ends_in = |known: &str| known.len() > 8 && name.strip_suffix(known).is_some_and(|rest| rest.ends_with(' '));
    if is_one_of(INTERVALS, name) {
        Some(Key::Interval)
    } else if is_one_of(RATES, name) {
        Some(Key::Rate)
    } else if is_one_of(OTHERS, name) || [INTERVALS, RATES].iter().any(|names| names.split(", ").any(ends_in)) {
        Some(Key::Other)
    } else {
        None
    }
}

/// Whether a row whose first cell is `cell` states an interval or a rate.
pub fn is_named(cell: &str) -> bool {
    matches!(key(&name_and_rest(cell).0), Some(Key::Interval | Key::Rate))
}

/// Statement of a row.
struct Statement<'a> {
    line: u64,
    cells: &'a [String],
    meaning: Meaning,
}

enum Meaning {
    /// Interval of the rows, s.
    Rows(f64),
    /// Interval that may be another, s.
    Other(f64),
    /// Statements beside a stated interval.
    Beside(Beside),
    /// Intervals that it may be, s, and why it is not one of them.
    Unclear(&'static str, Vec<f64>),
}

/// The statements on an interval in the rows of a preamble.
fn statements<'a>(rows: &[(u64, &'a [String])], decimal: Option<Decimal>) -> Vec<Statement<'a>> {
    let common = rows.iter().find_map(|(_, cells)| common_unit(cells));
    let channels = rows.iter().find_map(|(_, cells)| channels(cells));
    let mut device = String::new();
    let mut named: Vec<(String, &'a [String])> = Vec::new();
    for (_, cells) in rows {
        device = beside::heading(cells).unwrap_or(device);
        let name = cells.first().map(|cell| name_and_rest(cell).0).unwrap_or_default();
        named.push((if device.is_empty() { name } else { format!("{device} {name}") }, cells));
    }
    let both = rows.iter().zip(&named);
    let mut statements: Vec<Statement<'a>> = both
        .filter_map(|(&(line, cells), (name, _))| {
            let of_rows = || meaning(name, cells, decimal, common, channels);
            let beside = || beside::meaning(name, cells, decimal).map(Meaning::Beside);
            Some(Statement { line, cells, meaning: of_rows().or_else(beside)? })
        })
        .collect();
    if let Some((place, spans_s)) = beside::from_start_to_end(&named, decimal) {
        let (line, cells) = rows[place];
        statements.push(Statement { line, cells, meaning: Meaning::Beside(Beside::Spans(spans_s)) });
    }
    statements
}

/// The interval that `rows`, their lines and cells, state in a file with this `decimal` sign, if it is known. `count` counts the rows of
/// numbers.
pub fn stated(rows: &[(u64, &[String])], decimal: Option<Decimal>, count: impl Fn() -> usize) -> Option<Stated> {
    let mut statements = statements(rows, decimal);
    let first = statements.iter().find(|statement| !matches!(statement.meaning, Meaning::Beside(_)))?.line;
    let mut possible: Vec<f64> = Vec::new();
    let mut add = |interval_s: f64| {
        if interval_s.is_finite() && possible.iter().all(|other| (other / interval_s - 1.0).abs() > 0.01) {
            possible.push(interval_s);
        }
    };
    for statement in &statements {
        match &statement.meaning {
            Meaning::Rows(interval_s) | Meaning::Other(interval_s) => add(*interval_s),
            Meaning::Unclear(_, intervals_s) => intervals_s.iter().for_each(|interval_s| add(*interval_s)),
            Meaning::Beside(_) => {}
        }
    }
    // What agrees with the stated interval leaves no doubt, and is shown once.
    let mut has_one = false;
    let of_rows = possible.first().copied();
    let rows = if statements.len() > 1 { count() as f64 } else { 0.0 };
    statements.retain(|statement| match (&statement.meaning, of_rows) {
        (Meaning::Beside(beside), Some(of_rows)) => beside.contradicts(of_rows, rows),
        (Meaning::Rows(interval_s), Some(of_rows)) if (interval_s / of_rows - 1.0).abs() <= 0.01 => {
            !std::mem::replace(&mut has_one, true)
        }
        _ => true,
    });
    let is_unclear = statements.iter().any(|s| matches!(s.meaning, Meaning::Unclear(..) | Meaning::Beside(_)));
    let is_of_rows = statements.iter().any(|s| matches!(s.meaning, Meaning::Rows(_)));
    if let ([interval_s], true, false) = (possible.as_slice(), is_of_rows, is_unclear) {
        return Some(Ok(*interval_s));
    }
    for statement in &statements {
        if let (Meaning::Beside(beside), Some(of_rows)) = (&statement.meaning, of_rows) {
            possible.extend(beside.interval_s(of_rows, rows));
        }
    }
    let shown: Vec<String> = statements.iter().take(3).map(Statement::shown).collect();
    let rates: Vec<String> =
        possible.iter().take(4).map(|interval_s| format!("`rate_hz` {}", rounded(1.0 / interval_s))).collect();
    let rates = if rates.is_empty() { "`rate_hz`".into() } else { rates.join(" or ") };
    let cause = format!("the rate of the rows is not certain from {}; import with {rates}", shown.join(" and "));
    Some(Err(Box::new((first, cause))))
}

impl Statement<'_> {
    fn shown(&self) -> String {
        let text: String = self.cells.join(" ").trim().chars().take(40).collect();
        match self.meaning {
            Meaning::Unclear(why, _) => format!("{text:?} ({why})"),
            _ => format!("{text:?}"),
        }
    }
}

/// The number of channels that the row `cells` states.
fn channels(cells: &[String]) -> Option<f64> {
    let (name, rest) = name_and_rest(cells.first()?);
    let value = if rest.is_empty() { cells.get(1)?.trim() } else { rest };
    value.parse().ok().filter(|count| is_one_of(CHANNELS, &name) && *count > 1.0)
}

/// The meaning of the row `cells` for the interval: `Delta_X;0.001`, `Sample rate (kHz): 2`, `SampleRate,1000`. An interval without a unit
/// is in `common`.
fn meaning(
    name: &str,
    cells: &[String],
    decimal: Option<Decimal>,
    common: Option<Unit>,
    channels: Option<f64>,
) -> Option<Meaning> {
    let first = cells.first()?;
    let (_, inline) = name_and_rest(first);
    let key = key(name)?;
    let rest = cells[1..].iter().map(|cell| cell.trim());
    let mut parts = [inline].into_iter().chain(rest).filter(|part| !part.is_empty());
    let value = parts.next()?;
    let has_digit = |text: &str| text.contains(|c: char| c.is_ascii_digit());
    let each = parts.clone().any(|other| has_digit(other) && other != value);
    // 50 ms, or 50ms; the letter of an exponent is followed by a number.
    let is_unit = |(at, c): &(usize, char)| {
        c.is_alphabetic()
            && !(matches!(c, 'e' | 'E') && value[at + 1..].starts_with(|c: char| "+-0123456789".contains(c)))
    };
    let times = value.trim_start_matches(['x', 'X', '×']);
    let (number, unit) = match times.len() == value.len() {
        true => value.split_at(value.char_indices().find(is_unit).map_or(value.len(), |(at, _)| at)),
        false => (times, "x"),
    };
    let bracketed = first.split_once(['(', '[']).and_then(|(_, rest)| rest.split([')', ']']).next()).unwrap_or("");
    let behind = parts.clone().next().filter(|part| !has_digit(part));
    let unit = [unit.trim(), bracketed.trim()].into_iter().find(|unit| !unit.is_empty()).or(behind).unwrap_or("");
    let read = |decimal: Decimal| numbers::number(number.trim(), decimal).filter(|value| *value > 0.0);
    let numbers = match decimal {
        Some(decimal) => vec![read(decimal).or_else(|| read(decimal.other()))],
        None => vec![read(Decimal::Point), read(Decimal::Comma)],
    };
    let mut numbers: Vec<f64> = numbers.into_iter().flatten().collect();
    numbers.dedup();
    if each {
        let others: Option<Vec<f64>> =
            parts.map(|part| numbers::number(part, decimal.unwrap_or(Decimal::Point))).collect();
        numbers = others.map_or_else(Vec::new, |others| [numbers, others].concat());
    }
    let qualifier = bracketed.trim().to_lowercase();
    let is_of_all = qualifier.is_empty()
        || is_one_of(PER_CHANNEL, &qualifier)
        || time_unit(bracketed).is_some()
        || hertz(bracketed).is_some()
        || bracketed == unit;
    let is_count = COUNTS.split(' ').any(|count| unit.eq_ignore_ascii_case(count));
    let time = time_unit(unit);
    let in_seconds = |number: f64| match (time, hertz(unit)) {
        (Some(unit), _) => Some(number * unit.factor),
        (None, Some(hertz)) => Some(1.0 / (number * hertz)),
        (None, None) if !unit.is_empty() => None,
        _ if key == Key::Rate => Some(1.0 / number),
        _ => common.map(|unit| number * unit.factor),
    };
    let intervals: Option<Vec<f64>> = numbers.iter().map(|number| in_seconds(*number)).collect();
    Some(match (numbers.as_slice(), intervals) {
        // A step of a drive, or its mean.
        _ if unit_cell(unit, false).known().is_some_and(|unit| unit.quantity != Quantity::Time) => return None,
        ([1.0], _) if is_count => return None,
        ([count], _) if is_count => Meaning::Beside(Beside::Every(*count)),
        ([_], Some(intervals)) if !each => match key {
            Key::Interval | Key::Rate if is_of_all => Meaning::Rows(intervals[0]),
            Key::Rate if is_one_of(IN_TOTAL, qualifier.split(' ').next().unwrap_or_default()) => {
                Meaning::Unclear("of all channels", [1.0, channels.unwrap_or(1.0)].map(|n| n * intervals[0]).into())
            }
            _ => Meaning::Other(intervals[0]),
        },
        (_, Some(intervals)) if each => Meaning::Unclear("several numbers", intervals),
        ([], _) => Meaning::Unclear("which cannot be read", Vec::new()),
        (_, Some(intervals)) => Meaning::Unclear("thousands or a decimal sign", intervals),
        ([one], None) if unit.is_empty() => Meaning::Unclear("without a unit", vec![*one, one * 1e-3]),
        _ => Meaning::Unclear("with an unknown unit", Vec::new()),
    })
}

/// The interval in the header of an oscilloscope: `Start,Increment` with values in the row of `units`, or `tInc = 1e-5`.
pub fn of_scope(names: &[String], units: Option<&[String]>) -> Option<f64> {
    let number = |text: &str| numbers::number(text.trim(), Decimal::Point).filter(|value| *value > 0.0);
    names.iter().enumerate().find_map(|(index, name)| match name.trim().to_lowercase().as_str() {
        "increment" => number(units?.get(index)?),
        name => name
            .strip_prefix("tinc")
            .and_then(|rest| number(rest.trim_start().strip_prefix('=')?.trim_end_matches('s'))),
    })
}
