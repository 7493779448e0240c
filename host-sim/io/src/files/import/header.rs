//! The header above rows of numbers: preamble, names, units.

use super::Quantity;
use super::names::{Title, UnitSense, unit_cell};
use super::numbers::{self, Cell, Decimal};

/// A row above the numbers, or the first of them.
#[derive(Clone, Debug, PartialEq)]
pub struct TopRow {
    /// Its line in the file, from one.
    pub line: u64,
    /// Its cells.
    pub cells: Vec<String>,
    /// Whether it was a comment.
    pub comment: bool,
}

/// Lines above the numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Head {
    /// The columns' titles; empty where there is no header.
    pub titles: Vec<Title>,
    /// Line of the names; 0 without.
    pub line: u64,
    /// Rows above the names.
    pub preamble: usize,
    /// Interval of the rows that the preamble states, s.
    pub interval_s: Option<f64>,
    /// Line of a row between names and numbers that has gains or the like, which are not applied.
    pub gains: Option<u64>,
}

impl Head {
    /// The first title here that is another in `other`, and that one.
    pub fn differs(&self, other: &Self) -> Option<(String, String)> {
        let shown = |title: Option<&Title>| {
            let title = title.cloned().unwrap_or_default();
            let unit = title.unit.as_deref().map_or_else(String::new, |unit| format!(" {}", unit.trim()));
            format!("{:?}{unit}", title.name)
        };
        let count = self.titles.len().max(other.titles.len());
        let pairs = (0..count).map(|k| (shown(self.titles.get(k)), shown(other.titles.get(k))));
        pairs.into_iter().find(|(one, other)| one != other)
    }
}

/// Content of a row of a preamble.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Key {
    Names,
    Units,
    Interval,
    Rate,
    Gains,
}

/// The first cells of such rows, in small letters, with blanks for underlines, and commas between them.
const KEYS: &[(Key, &str)] = &[
    (
        Key::Names,
        "tracename, trace name, channelname, channel name, channel names, channeltitle, channel title, signal name",
    ),
    (Key::Units, "vunit, v unit, y unit label, y unit, y units, unit, units, unitname, unit name, einheit, einheiten"),
    (
        Key::Interval,
        "delta x, sample interval, sampling interval, sample period, sampling period, sampling time, sampling cycle, \
         storage cycle, hresolution, h resolution, x increment, xincrement, xinc, tinc, time increment, time step, \
         increment, interval, abtastintervall, abtastzeit, wf increment, delta t, dt",
    ),
    (
        Key::Rate,
        "samplerate, sample rate, sampling rate, sampling frequency, sample frequency, samples per second, abtastrate, \
         abtastfrequenz, scan rate, data rate, acquisition rate",
    ),
    (
        Key::Gains,
        "gain, gains, scale, scales, scaling, scale factor, factor, factors, faktor, skalierung, verstärkung, \
         sensitivity, empfindlichkeit, range, bereich, offset, offsets, calibration, slope, conversion, multiplier, min, \
         max, mean, zero",
    ),
];

fn key(cell: &str) -> Option<Key> {
    let name = cell.split(['(', '[', ':', '=']).next().unwrap_or_default().replace('_', " ").to_lowercase();
    KEYS.iter().find(|(_, names)| names.split(", ").any(|known| known == name.trim())).map(|(key, _)| *key)
}

/// Finds the header in the rows `above` the numbers, of which the first has `columns` cells. A person may say that the names are in line
/// `forced`.
///
/// # Errors
///
/// The line and the cause where a row between names and numbers is neither.
pub fn find(above: &[TopRow], columns: usize, forced: Option<u64>) -> Result<Head, (u64, String)> {
    let rows: Vec<&TopRow> = above.iter().filter(|row| !row.comment || forced == Some(row.line)).collect();
    let with_key = |wanted: Key| rows.iter().rev().find(|row| key(&row.cells[0]) == Some(wanted)).copied();
    let mut head = Head { interval_s: one_interval(above), ..Head::default() };
    let (mut units, mut odd) = (None, None);
    let mut names = None;
    for (index, row) in rows.iter().enumerate().rev() {
        let filled = row.cells.iter().filter(|cell| !cell.trim().is_empty()).count();
        let is_numeric = row.cells.iter().any(is_number);
        let key = key(&row.cells[0]);
        if forced == Some(row.line) {
            names = Some(index);
            break;
        }
        if units.is_none() && is_units(row, columns) {
            units = Some((index, *row));
        } else if key == Some(Key::Gains) && is_numeric {
            head.gains = Some(row.line);
        } else if forced.is_some()
            || filled == 0
            || (filled == 1 && columns > 1)
            || key.is_some_and(|key| is_numeric || matches!(key, Key::Units | Key::Names))
        {
            // No names.
        } else if is_numeric {
            odd = odd.or(Some(*row));
        } else if row.cells.len() > 1 || columns == 1 {
            names = Some(index);
            break;
        }
    }
    if let (None, Some(line)) = (names, forced) {
        return Err((line, "`header_line`: no names in this line above the rows of numbers".into()));
    }
    // A line of names by its key counts more than a line above the numbers; units alone are names as well.
    if let Some(row) = with_key(Key::Names).filter(|_| forced.is_none()) {
        names = rows.iter().position(|other| other.line == row.line);
        (odd, head.gains) = (None, None);
    }
    if let (None, Some((index, _))) = (names, units) {
        names = Some(index);
        units = None;
    }
    let Some(index) = names else {
        return Ok(commented(above, columns, &head).unwrap_or(Head { preamble: rows.len(), gains: None, ..head }));
    };
    let row = rows[index];
    if let Some(odd) =
        odd.filter(|odd| odd.line > row.line && odd.cells.len() == row.cells.len() && row.cells.len() == columns)
    {
        let text = odd.cells.iter().find(|cell| !cell.is_empty() && !is_number(cell)).map_or("", String::as_str);
        let cause =
            format!("{text:?} is not a number here, and this row below the names has no units; correct or remove it");
        return Err((odd.line, cause));
    }
    let units = units.map(|(_, row)| row).or_else(|| with_key(Key::Units).filter(|row| row.cells.len() > 1));
    let is_key = |cell: &String| key(cell) == Some(Key::Units);
    let unit = |index: usize| {
        units.and_then(|units| units.cells.get(index)).filter(|unit| !unit.trim().is_empty() && !is_key(unit)).cloned()
    };
    // A key, or the numbers of the rows.
    let is_no_name = |index: usize, name: &str| {
        let counts = unit(index).is_some_and(|unit| unit.trim().eq_ignore_ascii_case("sequence"));
        counts || (index == 0 && key(name) == Some(Key::Names))
    };
    head.titles = row
        .cells
        .iter()
        .enumerate()
        .map(|(k, name)| Title {
            name: if is_no_name(k, name) { String::new() } else { name.trim().into() },
            unit: unit(k),
            ..Title::default()
        })
        .collect();
    // Oscilloscopes put start and increment behind the names, and their values in the row of units.
    if head.interval_s.is_none() {
        head.interval_s = scope_interval(row, units);
    }
    let is_setting = |title: &Title| {
        let name = title.name.to_lowercase();
        matches!(name.as_str(), "start" | "increment")
            || name.split_once('=').is_some_and(|(name, _)| matches!(name.trim(), "t0" | "tinc"))
    };
    if head.interval_s.is_some() {
        for title in head.titles.iter_mut().filter(|title| is_setting(title)) {
            *title = Title::default();
        }
    }
    (head.line, head.preamble) = (row.line, index);
    Ok(head)
}

fn is_number(cell: impl AsRef<str>) -> bool {
    let number = |decimal| matches!(numbers::cell(cell.as_ref(), decimal), Cell::Number(_));
    number(Decimal::Point) || number(Decimal::Comma)
}

/// Names in the last comment: `# time_s voltage_v`, as numpy.savetxt writes them.
fn commented(above: &[TopRow], columns: usize, head: &Head) -> Option<Head> {
    let row = above.iter().rfind(|row| row.comment).filter(|row| row.cells.len() == columns)?;
    let titles = row.cells.iter().map(|name| Title::new(name.trim())).collect();
    Some(Head { titles, line: row.line, preamble: 0, ..head.clone() })
}

/// The interval that all of `rows` state which state one.
fn one_interval(rows: &[TopRow]) -> Option<f64> {
    let mut stated = rows.iter().filter_map(interval);
    let first = stated.next()?;
    stated.all(|other| (other / first - 1.0).abs() < 0.01).then_some(first)
}

/// The interval that `row` states, for all channels: `Delta_X;0.001`, `Sample rate (kHz): 2`, `SampleRate,1000`.
fn interval(row: &TopRow) -> Option<f64> {
    let first = row.cells.first()?;
    let key = key(first).filter(|key| matches!(key, Key::Interval | Key::Rate))?;
    let (name, inline) = first.split_once([':', '=']).unwrap_or((first, ""));
    let rest = row.cells[1..].iter().map(|cell| cell.trim()).filter(|cell| !cell.is_empty());
    let mut parts = std::iter::once(inline.trim()).filter(|part| !part.is_empty()).chain(rest);
    let value = parts.next()?;
    if parts.clone().any(|other| is_number(other) && other != value) {
        return None;
    }
    // 50 ms, or 50ms; the letter of an exponent is followed by a number.
    let is_unit = |(at, c): &(usize, char)| {
        c.is_alphabetic()
            && !(matches!(c, 'e' | 'E') && value[at + 1..].starts_with(|c: char| "+-0123456789".contains(c)))
    };
    let (number, unit) = value.split_at(value.char_indices().find(is_unit).map_or(value.len(), |(at, _)| at));
    let number = number.trim();
    let number = [Decimal::Point, Decimal::Comma].into_iter().find_map(|decimal| numbers::number(number, decimal))?;
    let bracketed = name.split_once(['(', '[']).map_or("", |(_, unit)| unit.trim_end_matches([')', ']', ' ']));
    let unit = [unit.trim(), bracketed].into_iter().find(|unit| !unit.is_empty()).or(parts.next()).unwrap_or("");
    let positive = |value: f64| (value > 0.0 && value.is_finite()).then_some(value);
    if key == Key::Interval {
        return match unit_cell(unit, false) {
            UnitSense::Known(unit) if unit.quantity == Quantity::Time => positive(number * unit.factor),
            // The same again, for the next channel.
            _ if unit.is_empty() || is_number(unit) => positive(number),
            _ => None,
        };
    }
    let lower = unit.to_lowercase();
    let factor = match lower.trim_end_matches("a/s").trim_end_matches("/s").trim_end_matches("hz") {
        "" | "s" | "1" | "samples" => 1.0,
        "k" | "ks" => 1e3,
        "m" | "ms" if unit.starts_with('M') => 1e6,
        other if is_number(other) => 1.0,
        _ => return None,
    };
    positive(number * factor).map(|rate_hz| 1.0 / rate_hz)
}

/// The interval behind the names of an oscilloscope: `Start,Increment` with values below, or `tInc = 1e-5`.
fn scope_interval(names: &TopRow, units: Option<&TopRow>) -> Option<f64> {
    let number = |text: &str| numbers::number(text.trim(), Decimal::Point).filter(|value| *value > 0.0);
    names.cells.iter().enumerate().find_map(|(index, name)| match name.trim().to_lowercase().as_str() {
        "increment" => number(units?.cells.get(index)?),
        name => name
            .strip_prefix("tinc")
            .and_then(|rest| number(rest.trim_start().strip_prefix('=')?.trim_end_matches('s'))),
    })
}

/// Whether `row` has nothing but units and empty cells, and at least two units where there are two columns. An oscilloscope's has settings too.
fn is_units(row: &TopRow, columns: usize) -> bool {
    let is_scope = row.cells[0].trim().eq_ignore_ascii_case("sequence");
    let mut units = usize::from(is_scope);
    for cell in row.cells.iter().skip(usize::from(is_scope)).map(|cell| cell.trim()).filter(|cell| !cell.is_empty()) {
        let in_brackets = cell.starts_with(['(', '[', '{']) && cell.ends_with([')', ']', '}']);
        match unit_cell(cell, false) {
            UnitSense::Known(_) | UnitSense::MilliOrMega => units += 1,
            _ if in_brackets || is_other_unit(cell) || (is_scope && is_number(cell)) => {}
            _ => return false,
        }
    }
    units >= columns.min(2)
}

/// Units of quantities that a recording does not have.
fn is_other_unit(cell: &str) -> bool {
    const OTHERS: [&str; 22] = [
        "A", "mA", "µA", "uA", "nA", "°C", "C", "K", "degC", "%", "%RH", "Hz", "kHz", "Pa", "kPa", "MPa", "-", "1",
        "W", "bar", "Nm", "g",
    ];
    OTHERS.contains(&cell)
}
