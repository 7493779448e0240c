//! Lines beside a stated rate that may contradict it: other rates, samples that are fewer rows, and durations.

use std::ops::RangeInclusive;

use super::Quantity;
use super::clock::{self, DAY_S};
use super::names::{UnitSense, unit_cell};
use super::numbers::{self, Decimal};
use super::preamble::{hertz, is_one_of, time_unit};
use super::words::is_of;

/// Parts of words for rows that are fewer than the samples. Those of five letters and more are found within words too.
const FEWER: &str = "every jede thinn binn skip keep kept nth omit decimat dezim averag mittelung gemittel mittelwertbild moyenn downsampl undersampl \
    oversampl subsampl resampl unterabtast überabtast überspr auslass ausdünn reduct reduced reduk reduzier boxcar compress kompr verdicht \
    stride prescal aggreg chaque";
/// The same in several words, with commas between them.
const FEWER_OF: &str = "per row, per line, per point, per sample, per record, per reading, per value, per entry, pro zeile, pro wert, pro punkt, \
    pro messwert, je zeile, je wert, je punkt, rate divi, clock divi, sample divi";
/// Beginnings of words for samples that are left out between rows.
const LEFT_OUT: &str = "skip omit überspr auslass";
/// Words for a number of samples that is not known.
const SOME: &str = "on yes ja ein an true active aktiv enabled second other third fourth fifth tenth zweite zweiten zweiter dritte dritten \
    fünfte fünften zehnte zehnten zehnter";
/// Parts of lines with numbers of samples that do not make the rows fewer.
const NO_COUNTS: &str =
    "moving, running, rolling, exponential, gleitend, bits, byte, trigger, history, buffer, memory, puffer, fft, delay";
/// Words behind a number of samples.
const SAMPLES: &str = "sample samples point points row rows line lines value values reading readings scan scans record records wert werte \
    messwert messwerte zeile zeilen punkt punkte";
/// Names of the number of rows.
const NUMBERS: &str = "points, data points, sample points, number of points, number of samples, no. of samples, no. of points, number of rows, \
    number of readings, number of values, number of records, samples per channel, sample count, point count, row count, record length, \
    datenpunkte, messpunkte, anzahl werte, anzahl messwerte, anzahl punkte, anzahl zeilen";
/// Parts of lines with frequencies of drives, filters and the like.
const NO_RATES: &str = "filter, cutoff, cut off, pass, notch, grenzfreq, band, sine, sinus, triang, dreieck, square, rechteck, wave, signal, drive, \
    driving, excit, anreg, generator, stimul, mains, netz, carrier, resonan, eigenfreq, chirp, sweep, modulat, pulse, impuls, strain, dehn, baud";
/// Parts of lines with rates of sensors, which may be higher than that of the rows.
const SENSORS: &str = "sensor, laser, camera, kamera, gauge";
/// Names of a frequency or period that is a drive's if it is far from the rate.
const BARE: &str = "frequency, freq, f, frequenz, period, periode";
/// Largest number of samples of such a row.
const MAX_BARE: f64 = 100.0;
/// Shortest interval of rows, s.
const MIN_S: f64 = 1e-6;
/// Names of the time from the first row to the last, and of both.
const DURATIONS: &str = "duration, total duration, test duration, recording duration, measurement duration, acquisition duration, record duration, \
    total time, test time, recording time, record time, measurement time, measuring time, acquisition time, elapsed time, elapsed, \
    record length, time span, timespan, dauer, messdauer, aufnahmedauer, aufzeichnungsdauer, messzeit, gesamtzeit, gesamtdauer";
const STARTS: &str = "start, start time, started, started at, begin, start of measurement, startzeit, beginn, messbeginn, measurement start";
const ENDS: &str = "end, end time, ended, ended at, stop, stop time, stopped, finished, end of measurement, endzeit, ende, messende, \
    measurement end";
/// Parts of names of devices whose rates need not be those of the rows.
const DEVICES: &str = "generator, waveform, function, stimul, excit, anreg, signal, drive, output, ausgang, awg, dac, sensor, laser, camera, kamera, \
    amplifier, verstärker, filter, supply, netzteil, controller, regler";

/// Meaning of a line beside a stated rate.
pub enum Beside {
    /// An interval, s, and the numbers of stated intervals that it may be.
    Interval(f64, RangeInclusive<f64>),
    /// Number of samples that are one row.
    Every(f64),
    /// Number of samples that are one row, or of all rows.
    Count(f64),
    /// Fewer rows than samples, of a number that is not stated.
    Some,
    /// Times from the first row to the last that it may be, s.
    Spans(Vec<f64>),
}

impl Beside {
    /// Whether it may change the rate of `rows` at a stated interval of `of_rows` s.
    pub fn contradicts(&self, of_rows: f64, rows: f64) -> bool {
        match self {
            Self::Interval(interval_s, factors) => {
                (interval_s / of_rows - 1.0).abs() > 0.01 && factors.contains(&(interval_s / of_rows))
            }
            Self::Count(count) => (count - rows).abs() > (0.01 * rows).max(1.0),
            Self::Spans(spans_s) => contradict(spans_s, of_rows * rows),
            Self::Every(_) | Self::Some => true,
        }
    }

    /// The interval that it may make of that of `of_rows` s, of `rows`, s.
    pub fn interval_s(&self, of_rows: f64, rows: f64) -> Option<f64> {
        match self {
            Self::Interval(interval_s, _) => Some(*interval_s),
            Self::Every(count) => Some(of_rows * count),
            Self::Count(count) => Some(of_rows * if *count < rows { *count } else { count / rows }),
            Self::Spans(spans_s) => spans_s.first().map(|span_s| span_s / rows),
            Self::Some => None,
        }
    }
}

fn has_part(parts: &str, text: &str) -> bool {
    parts.split(", ").any(|part| text.contains(part))
}

/// The device that `cells` are the heading of, if they are one; empty where it is no device.
pub fn heading(cells: &[String]) -> Option<String> {
    let mut filled = cells.iter().map(|cell| cell.trim()).filter(|cell| !cell.is_empty());
    let (cell, None) = (filled.next()?, filled.next()) else { return None };
    let name = cell.trim_matches(|c: char| "[]{}<>-=*: ".contains(c));
    let is_plain = name.len() == cell.len();
    if name.contains([':', '=']) || name.contains(|c: char| c.is_ascii_digit()) {
        return cell.starts_with('[').then(String::new);
    }
    let is_device = has_part(DEVICES, &name.to_lowercase()) && (!is_plain || name.split_whitespace().count() < 3);
    Some(if is_device { name.to_lowercase() } else { String::new() })
}

/// The numbers in `text`, and the texts behind them up to the next.
fn numbers(text: &str, decimal: Option<Decimal>) -> Vec<(f64, &str)> {
    let is_part = |(at, c): (usize, char)| {
        c.is_ascii_digit() || (matches!(c, '.' | ',') && text[at + 1..].starts_with(|c: char| c.is_ascii_digit()))
    };
    let mut starts: Vec<(usize, usize)> = Vec::new();
    let mut end = 0;
    for (at, _) in text.char_indices().filter(|(_, c)| c.is_ascii_digit()) {
        let before = text[..at].trim_end_matches(['x', '×']);
        if at < end || before.ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            continue;
        }
        end = text[at..].char_indices().find(|(k, c)| !is_part((at + k, *c))).map_or(text.len(), |(k, _)| at + k);
        let exponent = text[end..].strip_prefix(['e', 'E']).map(|rest| rest.trim_start_matches(['+', '-']));
        if exponent.is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit())) {
            end = text[end + 2..].find(|c: char| !c.is_ascii_digit()).map_or(text.len(), |k| end + 2 + k);
        }
        starts.push((at, end));
    }
    let next = |k: usize| starts.get(k + 1).map_or(text.len(), |(at, _)| *at);
    let decimal = decimal.unwrap_or(Decimal::Point);
    let read = |text| numbers::number(text, decimal).or_else(|| numbers::number(text, decimal.other()));
    let number = |(k, (at, end)): (usize, &(usize, usize))| Some((read(&text[*at..*end])?, &text[*end..next(k)]));
    starts.iter().enumerate().filter_map(number).collect()
}

/// The first word behind a number.
fn unit(behind: &str) -> &str {
    let behind = behind.trim_start_matches([' ', '\t', '-', '(', '[']);
    behind.split([' ', '\t', ',', ';', ')', ']', '(']).next().unwrap_or_default()
}

/// Whether the text behind a number is that of samples: `10 points`, `10th sample`, `10. Wert`.
fn is_of_samples(behind: &str) -> bool {
    let behind = ["th", "st", "nd", "rd", "."].iter().find_map(|end| behind.strip_prefix(end)).unwrap_or(behind);
    SAMPLES.split(' ').any(|word| unit(behind).eq_ignore_ascii_case(word))
}

/// The meaning of the row `cells` beside a stated rate. Its `name` is in small letters, with the device that it is below.
pub fn meaning(name: &str, cells: &[String], decimal: Option<Decimal>) -> Option<Beside> {
    let text = cells.join(" ");
    let line = format!("{name} {}", text.replace('_', " ").to_lowercase()).replace('-', "");
    let found = numbers(&text, decimal);
    let is_physical = |unit: &str| match unit_cell(unit, false) {
        UnitSense::Known(unit) => unit.quantity != Quantity::Time,
        _ => unit.starts_with(['%', '°']) || matches!(unit, "C" | "K" | "A" | "mA"),
    };
    if found.iter().any(|(_, behind)| is_physical(unit(behind))) {
        return None;
    }
    let bracketed = text.split_once(['(', '[']).and_then(|(_, rest)| rest.split([')', ']']).next()).unwrap_or("");
    if is_one_of(DURATIONS, name)
        && let Some(spans) = spans(cells, &found, bracketed)
    {
        return Some(Beside::Spans(spans));
    }
    let of_fewer = fewer(name, &line, &found);
    if of_fewer.is_some() || has_part(NO_RATES, &line) {
        return of_fewer;
    }
    let is_rate = name.ends_with("rate") || has_part("per second, pro sekunde, frequen, freq", name);
    let is_period = name.ends_with("interval") || name.ends_with("intervall") || name.starts_with("period");
    let interval = |(number, behind): &(f64, &str)| {
        let own = unit(behind);
        let unit = if own.is_empty() { bracketed } else { own };
        let is_per_second = has_part("per second, pro sekunde", &behind.to_lowercase());
        let hertz = hertz(unit).or((is_per_second || (is_rate && unit.is_empty())).then_some(1.0));
        let period = time_unit(unit).filter(|_| is_period).map(|unit| number * unit.factor);
        hertz.map(|hertz| 1.0 / (number * hertz)).or(period).filter(|interval_s| *interval_s > MIN_S)
    };
    let interval_s = found.iter().filter(|(number, _)| *number > 0.0).find_map(interval)?;
    let fewest = if has_part(SENSORS, &line) { 1.0 } else { 0.0 };
    let most = if is_one_of(BARE, name) { MAX_BARE } else { f64::INFINITY };
    Some(Beside::Interval(interval_s, fewest..=most))
}

/// The number of samples that are a row in a `line` with a `name` and the numbers `found`.
fn fewer(name: &str, line: &str, found: &[(f64, &str)]) -> Option<Beside> {
    if has_part(NO_COUNTS, line) {
        return None;
    }
    let words = || line.split(|c: char| !c.is_alphanumeric());
    let begins = |parts: &str| words().any(|word| parts.split(' ').any(|part| word.starts_with(part)));
    let within = |part: &str| part.chars().count() > 4 && line.contains(part);
    let is_fewer = begins(FEWER) || FEWER.split(' ').any(within) || has_part(FEWER_OF, line);
    let of_rows = || {
        let all = found.first().filter(|(_, behind)| is_one_of(NUMBERS, name) && behind.trim().is_empty());
        found.iter().find(|(_, behind)| is_of_samples(behind)).or(all).map(|(number, _)| Beside::Count(*number))
    };
    if !is_fewer {
        return of_rows().filter(|count| !matches!(count, Beside::Count(1.0)));
    }
    let unit_of = |behind: &str| time_unit(unit(behind));
    if let Some((number, unit)) = found.iter().find_map(|(number, behind)| Some((number, unit_of(behind)?))) {
        return Some(Beside::Interval(number * unit.factor, 0.0..=f64::INFINITY));
    }
    if found.iter().any(|(_, behind)| hertz(unit(behind)).is_some()) {
        return None;
    }
    let count = found.iter().map(|(number, _)| *number).reduce(f64::max);
    // Of two numbers the larger one counts those that are not left out, too.
    let left_out = if found.len() == 1 && begins(LEFT_OUT) { 1.0 } else { 0.0 };
    match count.map(|count| count + left_out) {
        Some(count) if count > 1.0 => Some(Beside::Every(count)),
        None if words().any(|word| is_of(SOME, word)) => Some(Beside::Some),
        _ => None,
    }
}

/// The times that the value of `cells`, with the numbers `found`, may be, s.
fn spans(cells: &[String], found: &[(f64, &str)], bracketed: &str) -> Option<Vec<f64>> {
    if let Some(stamp) = stamp(cells) {
        return Some(vec![stamp]);
    }
    let [(number, behind)] = found else { return None };
    let own = unit(behind);
    match time_unit(if own.is_empty() { bracketed } else { own }) {
        Some(unit) => Some(vec![number * unit.factor]),
        None if own.is_empty() && !has_part(NUMBERS, &cells[0].to_lowercase()) => {
            Some([1.0, 1e-3, 60.0, 3600.0].map(|factor| number * factor).into())
        }
        None => None,
    }
}

/// The time of day in `cells`, s.
fn stamp(cells: &[String]) -> Option<f64> {
    let behind = cells[0].split_once([':', '=']).map_or("", |(_, behind)| behind);
    let value = [behind].into_iter().chain(cells[1..].iter().map(String::as_str)).collect::<Vec<_>>().join(" ");
    let last = value.split_whitespace().next_back().and_then(clock::stamp);
    Some(clock::stamp(&value).or(last)?.of_day_s)
}

/// The times from the start to the end that `rows`, their names and cells, state, s, and the place of the end.
pub fn from_start_to_end(rows: &[(String, &[String])], decimal: Option<Decimal>) -> Option<(usize, Vec<f64>)> {
    let place = |names: &str| rows.iter().position(|(name, _)| is_one_of(names, name));
    let (start, end) = (place(STARTS)?, place(ENDS)?);
    let cells = [rows[start].1, rows[end].1];
    if let [Some(start_s), Some(end_s)] = cells.map(stamp) {
        return Some((end, vec![(end_s - start_s).rem_euclid(DAY_S)]));
    }
    let texts = cells.map(|cells| cells.join(" "));
    let spans = |at: usize| spans(cells[at], &numbers(&texts[at], decimal), "");
    let both = spans(0)?.into_iter().zip(spans(1)?);
    Some((end, both.map(|(start_s, end_s)| end_s - start_s).filter(|span_s| *span_s > 0.0).collect()))
}

/// Whether rows of `rows_s` contradict each of the times `spans_s`, which may be rounded, and be a second apart where a clock shows them.
fn contradict(spans_s: &[f64], rows_s: f64) -> bool {
    let is_far = |span_s: &f64| {
        let rounding_s = if span_s.fract() == 0.0 { 0.5 } else { 0.0 };
        (span_s - rows_s).abs() > 0.1 * span_s.max(rows_s) + rounding_s
    };
    !spans_s.is_empty() && spans_s.iter().all(is_far)
}
