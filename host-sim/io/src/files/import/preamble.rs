//! Names, values and units in the rows of a preamble.

use super::Quantity;
use super::names::unit_cell;
use super::units::Unit;

/// Names of the unit of the intervals that have none.
const UNITS: &str =
    "horizontal units, hunit, h unit, x unit, x units, x unit label, x dimension, time unit, time units, zeiteinheit";

/// Whether `names`, with commas between them, have `name`.
pub fn is_one_of(names: &str, name: &str) -> bool {
    names.split(", ").any(|known| known == name)
}

/// The name in the first cell of a row, as the lists above have it, and the text behind it: `Sample_rate (Hz): 8`, `dt = 5 ms`, `Rate 8 Hz`.
pub fn name_and_rest(cell: &str) -> (String, &str) {
    let digit =
        cell.char_indices().skip(1).find(|(at, c)| c.is_ascii_digit() && cell[..*at].ends_with([' ', '\t', 'x']));
    let end = [cell.find([':', '=']), digit.map(|(at, _)| cell[..at].trim_end_matches('x').len())];
    let end = end.into_iter().flatten().min().unwrap_or(cell.len());
    let name = cell[..end].split(['(', '[']).next().unwrap_or_default();
    (name.replace('_', " ").trim().to_lowercase(), cell[end..].trim_start_matches([':', '=', ' ', '\t']).trim_end())
}

/// The unit that the row `cells` states for the intervals.
pub fn common_unit(cells: &[String]) -> Option<Unit> {
    let (name, rest) = name_and_rest(cells.first()?);
    let unit = [rest].into_iter().chain(cells[1..].iter().map(|cell| cell.trim())).find(|cell| !cell.is_empty())?;
    if !is_one_of(UNITS, &name) {
        return None;
    }
    // LabVIEW has seconds where the dimension is time.
    time_unit(if unit.eq_ignore_ascii_case("time") { "s" } else { unit })
}

/// The unit of time that `text` is.
pub fn time_unit(text: &str) -> Option<Unit> {
    unit_cell(text, false).known().filter(|unit| unit.quantity == Quantity::Time)
}

/// Hertz of a unit of rates.
pub fn hertz(unit: &str) -> Option<f64> {
    const ENDS: [&str; 11] = [
        "hz",
        "samples per second",
        "samples/sec",
        "samples/s",
        "scans/s",
        "sps",
        "sa/s",
        "s/s",
        "1/s",
        "/s",
        "per second",
    ];
    let lower = unit.to_lowercase();
    match ENDS.iter().find_map(|end| lower.strip_suffix(end))?.trim() {
        "" => Some(1.0),
        "k" => Some(1e3),
        "m" if unit.starts_with('M') => Some(1e6),
        _ => None,
    }
}
