//! Columns of tables that the tool writes.

use std::fs;
use std::path::Path;

/// The column `name` of the CSV at `path`, below its comments; NaN where a cell is empty.
///
/// # Panics
///
/// Where there is no such column, or a cell that is not a number.
pub fn column(path: &Path, name: &str) -> Vec<f64> {
    let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut rows = text.lines().filter(|line| !line.starts_with('#'));
    let index = rows.next().and_then(|header| header.split(',').position(|title| title == name));
    let index = index.unwrap_or_else(|| panic!("{}: no column {name}", path.display()));
    let number = |cell: &str| if cell.is_empty() { f64::NAN } else { cell.parse().expect("a number") };
    rows.map(|row| number(row.split(',').nth(index).unwrap_or_default())).collect()
}
