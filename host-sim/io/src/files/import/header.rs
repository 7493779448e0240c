//! The header above rows of numbers: preamble, names, units.

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
    /// Whether a row of units follows the names.
    pub unit_row: bool,
}

/// Finds the header in the rows `above` the numbers, of which the first has `columns` cells.
pub fn find(above: &[TopRow], columns: usize) -> Head {
    let rows: Vec<&TopRow> = above.iter().filter(|row| !row.comment).collect();
    // A preamble may have numbers, names may not.
    let number = |cell: &String| matches!(numbers::cell(cell, Decimal::Point), Cell::Number(_));
    let named = |row: &TopRow| row.cells.len() > 1 && !row.cells.iter().any(number);
    match rows.as_slice() {
        [before @ .., names, units] if named(names) && is_units(units, columns) => {
            let unit = |index: usize| units.cells.get(index).filter(|unit| !unit.trim().is_empty()).cloned();
            let titles =
                names.cells.iter().enumerate().map(|(k, name)| Title { name: name.trim().into(), unit: unit(k) });
            Head { titles: titles.collect(), line: names.line, preamble: before.len(), unit_row: true }
        }
        [before @ .., names] if named(names) => Head {
            titles: names.cells.iter().map(|name| Title::new(name.trim())).collect(),
            line: names.line,
            preamble: before.len(),
            unit_row: false,
        },
        _ => commented(above, columns).unwrap_or(Head { preamble: rows.len(), ..Head::default() }),
    }
}

/// Names in the last comment: `# time_s voltage_v`, as numpy.savetxt writes them.
fn commented(above: &[TopRow], columns: usize) -> Option<Head> {
    let row = above.iter().rfind(|row| row.comment).filter(|row| row.cells.len() == columns)?;
    let titles = row.cells.iter().map(|name| Title::new(name.trim())).collect();
    Some(Head { titles, line: row.line, preamble: 0, unit_row: false })
}

/// Whether `row` has nothing but units and empty cells, and at least two units where there are two columns.
fn is_units(row: &TopRow, columns: usize) -> bool {
    let mut units = 0;
    for cell in row.cells.iter().map(|cell| cell.trim()).filter(|cell| !cell.is_empty()) {
        let in_brackets = cell.starts_with(['(', '[', '{']) && cell.ends_with([')', ']', '}']);
        match unit_cell(cell) {
            UnitSense::Known(_) | UnitSense::MilliOrMega => units += 1,
            _ if in_brackets || is_other_unit(cell) => {}
            _ => return false,
        }
    }
    units >= columns.min(2)
}

/// Units of quantities that a recording does not have.
fn is_other_unit(cell: &str) -> bool {
    const OTHERS: [&str; 20] = [
        "A", "mA", "µA", "uA", "nA", "°C", "C", "K", "degC", "%", "%RH", "Hz", "kHz", "Pa", "kPa", "MPa", "-", "1",
        "W", "bar",
    ];
    OTHERS.contains(&cell)
}
