//! Contents of a file: rows or series of numbers under titles.

use super::header::Head;
use super::mat;
use super::names::Title;
use super::numbers::{self, Cell};
use super::text::TextTable;
use super::workbook::{Sheet, SheetCell};

/// Rows of numbers with titles.
pub enum Source<'a> {
    /// A text in an encoding.
    Text(&'static str, TextTable<'a>),
    /// A spreadsheet.
    Sheet(Sheet),
    /// Variables.
    Series(Vec<mat::Series>),
}

/// A cell that is asked for.
pub enum Value<'a> {
    /// Nothing was measured.
    Nothing,
    /// A number.
    Number(f64),
    /// Not a number.
    Text(&'a str),
    /// The row ends before it.
    Ended,
}

impl Source<'_> {
    /// Titles of all columns.
    pub fn titles(&self) -> Vec<Title> {
        match self {
            Self::Text(_, table) => table.titles(),
            Self::Sheet(sheet) => sheet.titles(),
            Self::Series(series) => series.iter().map(|series| Title::new(&series.name)).collect(),
        }
    }

    /// Lines above the numbers; nothing for variables.
    pub fn head(&self) -> Option<&Head> {
        match self {
            Self::Text(_, table) => Some(&table.head),
            Self::Sheet(sheet) => Some(&sheet.head),
            Self::Series(_) => None,
        }
    }

    /// Description of the file, in a few words.
    pub fn format(&self) -> String {
        match self {
            Self::Text(encoding, table) => {
                let decimal = match table.decimal {
                    numbers::Decimal::Point => "decimal point",
                    numbers::Decimal::Comma => "decimal comma",
                };
                format!("text ({encoding}), separated by {}, {decimal}", table.separator.name())
            }
            Self::Sheet(sheet) => format!("spreadsheet {:?}", sheet.name),
            Self::Series(_) => "MATLAB variables".into(),
        }
    }

    /// Passes the cells `indices` of every row and its line to `take`, each with its place in `indices`. Variables have no lines: their rows
    /// count.
    ///
    /// # Errors
    ///
    /// The line and the cause where a row cannot be read, and what `take` returns.
    pub fn each(
        &self,
        indices: &[usize],
        mut take: impl FnMut(u64, usize, Value<'_>) -> Result<(), String>,
    ) -> Result<(), (u64, String)> {
        match self {
            Self::Text(_, table) => {
                for row in table.rows() {
                    let (line, cells) = row?;
                    for (place, &index) in indices.iter().enumerate() {
                        let value = match cells.get(index).map(|text| numbers::cell(text, table.decimal)) {
                            None => Value::Ended,
                            Some(Cell::Nothing) => Value::Nothing,
                            Some(Cell::Number(value)) => Value::Number(value),
                            Some(Cell::Text(text)) => Value::Text(text),
                        };
                        take(line, place, value).map_err(|cause| (line, cause))?;
                    }
                }
            }
            Self::Sheet(sheet) => {
                for (line, cells) in &sheet.rows {
                    for (place, &index) in indices.iter().enumerate() {
                        let value = match cells.get(index) {
                            None | Some(SheetCell::Nothing) => Value::Nothing,
                            Some(SheetCell::Number(value)) => Value::Number(*value),
                            Some(SheetCell::Text(text)) => Value::Text(text),
                        };
                        take(*line, place, value).map_err(|cause| (*line, cause))?;
                    }
                }
            }
            Self::Series(series) => {
                for row in 0..same_length(series, indices).map_err(|cause| (0, cause))? {
                    let line = row as u64 + 1;
                    for (place, &index) in indices.iter().enumerate() {
                        let number = series[index].values[row];
                        let value = if number.is_nan() { Value::Nothing } else { Value::Number(number) };
                        take(line, place, value).map_err(|cause| (0, format!("{cause} (number {line})")))?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// Length of the `series` at `indices`.
fn same_length(series: &[mat::Series], indices: &[usize]) -> Result<usize, String> {
    let length = |index: &usize| series[*index].values.len();
    let rows = indices.first().map_or(0, length);
    match indices.iter().find(|index| length(index) != rows) {
        None => Ok(rows),
        Some(&other) => Err(format!(
            "{} has {rows} numbers and {} has {}; save series of one length",
            series[indices[0]].name,
            series[other].name,
            series[other].values.len()
        )),
    }
}
