//! Contents of a file: rows or series of numbers under titles.

use super::clock;
use super::header::Head;
use super::lines::Fault;
use super::mat;
use super::names::Title;
use super::numbers::{self, Cell, Decimal};
use super::text::TextTable;
use crate::files::table::MAX_VALUE;

/// Rows of numbers with titles.
pub enum Source<'a> {
    /// A text, or a spreadsheet as text, and its description.
    Text(String, Box<TextTable<'a>>),
    /// Variables.
    Series(Vec<mat::Series>),
}

/// A cell that is asked for.
#[derive(Clone, Copy, Debug)]
pub enum Value<'a> {
    /// Nothing was measured.
    Nothing,
    /// A reading out of range.
    OutOfRange,
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
            Self::Series(series) => series
                .iter()
                .map(|series| Title { increases: numbers::increase(&series.values), ..Title::new(&series.name) })
                .collect(),
        }
    }

    /// Lines above the numbers; nothing for variables.
    pub fn head(&self) -> Option<&Head> {
        match self {
            Self::Text(_, table) => Some(&table.head),
            Self::Series(_) => None,
        }
    }

    /// Description of the file, in a few words.
    pub fn format(&self) -> String {
        match self {
            Self::Text(format, table) if table.sheet => format.clone(),
            Self::Text(format, table) => {
                let decimal = match table.decimal {
                    Decimal::Point => "decimal point",
                    Decimal::Comma => "decimal comma",
                };
                format!("{format}, separated by {}, {decimal}", table.separator.name())
            }
            Self::Series(_) => "MATLAB variables".into(),
        }
    }

    /// First lines of the runs of rows, between which the header is repeated.
    pub fn starts(&self) -> Vec<u64> {
        match self {
            Self::Text(_, table) => table.starts(),
            Self::Series(_) => Vec::new(),
        }
    }

    /// Number of runs of rows, also without a header between them.
    pub fn runs(&self) -> usize {
        match self {
            Self::Text(_, table) => table.runs().len(),
            Self::Series(_) => 1,
        }
    }

    /// Passes every row's line and its cells `indices` to `take`. Variables have no lines: their rows count.
    ///
    /// # Errors
    ///
    /// The line and the cause where a row cannot be read, and what `take` returns.
    pub fn each(
        &self,
        indices: &[usize],
        mut take: impl FnMut(u64, &[Value<'_>]) -> Result<(), String>,
    ) -> Result<(), Fault> {
        match self {
            Self::Text(_, table) => {
                for row in table.rows() {
                    let (line, cells) = row?;
                    let value = |index: &usize| match cells.get(*index).map(|text| numbers::cell(text, table.decimal)) {
                        None if table.sheet => Value::Nothing,
                        None => Value::Ended,
                        Some(Cell::Nothing) => Value::Nothing,
                        Some(Cell::OutOfRange) => Value::OutOfRange,
                        Some(Cell::Number(value)) => Value::Number(value),
                        Some(Cell::Text(text)) => Value::Text(text),
                    };
                    let values: Vec<Value<'_>> = indices.iter().map(value).collect();
                    take(line, &values).map_err(|cause| (line, cause))?;
                }
            }
            Self::Series(series) => {
                for row in 0..same_length(series, indices).map_err(|cause| (0, cause))? {
                    let line = row as u64 + 1;
                    let value = |index: &usize| match series[*index].values[row] {
                        number if number.is_nan() => Value::Nothing,
                        number if number.is_infinite() => Value::OutOfRange,
                        number => Value::Number(number),
                    };
                    let values: Vec<Value<'_>> = indices.iter().map(value).collect();
                    take(line, &values).map_err(|cause| (0, format!("{cause} (number {line})")))?;
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

/// The value of a cell in SI units; nothing where nothing was measured.
pub fn si(name: &str, value: Value<'_>, factor: f64) -> Result<Option<f64>, String> {
    match value {
        Value::Nothing | Value::OutOfRange => Ok(None),
        Value::Ended => Err(format!("the row ends before {name}")),
        Value::Number(number) if number.is_finite() && (number * factor).abs() <= MAX_VALUE => {
            // Not −0.
            Ok(Some(number * factor + 0.0))
        }
        Value::Number(number) => Err(format!("{name} is {number:?}; no instrument reads that")),
        Value::Text(text) => {
            if text.starts_with('@') && clock::is_clock(text) {
                return Err(format!("{name} is a date in the spreadsheet; format its cells as numbers"));
            }
            let begin: String = text.chars().take(40).collect();
            Err(format!("{name} is {begin:?}, which is not a number; leave the cell empty where nothing was measured"))
        }
    }
}
