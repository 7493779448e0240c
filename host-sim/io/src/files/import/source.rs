//! Contents of a file: rows or series of numbers under titles.

use super::clock;
use super::header::Head;
use super::lines::Fault;
use super::mat;
use super::names::Title;
use super::numbers::{self, Cell};
use super::text::TextTable;
use crate::choice::Choice;
use crate::files::table::MAX_VALUE;

/// Rows of numbers with titles.
pub enum Source<'a> {
    /// A text, or a spreadsheet as text, and its description.
    Text(String, Box<TextTable<'a>>),
    /// Variables.
    Series(Vec<mat::Series>),
}

impl Source<'_> {
    /// Titles of all columns.
    pub fn titles(&self) -> Vec<Title> {
        let title =
            |series: &mat::Series| Title { increases: numbers::increase(&series.values), ..Title::new(&series.name) };
        match self {
            Self::Text(_, table) => table.titles(),
            Self::Series(series) => series.iter().map(title).collect(),
        }
    }

    /// The text; nothing for variables.
    pub fn text(&self) -> Option<&TextTable<'_>> {
        match self {
            Self::Text(_, table) => Some(table),
            Self::Series(_) => None,
        }
    }

    /// Lines above the numbers; nothing for variables.
    pub fn head(&self) -> Option<&Head> {
        self.text().map(|table| &table.head)
    }

    /// Description of the file, in a few words.
    pub fn format(&self) -> String {
        match self {
            Self::Text(format, table) if table.sheet => format.clone(),
            Self::Text(format, table) => {
                format!("{format}, separated by {}, decimal {}", table.separator.name(), table.decimal.name())
            }
            Self::Series(_) => "MATLAB variables".into(),
        }
    }

    /// First lines of the runs of rows, between which the header is repeated.
    pub fn starts(&self) -> Vec<u64> {
        self.text().map_or_else(Vec::new, |table| table.segments.iter().map(|(line, _)| *line).collect())
    }

    /// Number of runs of rows, also without a header between them.
    pub fn runs(&self) -> usize {
        self.text().map_or(1, |table| table.runs().len())
    }

    /// Passes every row's line and its cells `indices` to `take`. Variables have no lines: their rows count.
    /// Ends with a row that cannot be read, or that `take` refuses.
    pub fn each(
        &self,
        indices: &[usize],
        mut take: impl FnMut(u64, &[Cell<'_>]) -> Result<(), String>,
    ) -> Result<(), Fault> {
        match self {
            Self::Text(_, table) => {
                for row in table.rows() {
                    let (line, cells) = row?;
                    let missing = if table.sheet { Cell::Nothing } else { Cell::Ended };
                    let value =
                        |index: &usize| cells.get(*index).map_or(missing, |text| numbers::cell(text, table.decimal));
                    let values: Vec<Cell<'_>> = indices.iter().map(value).collect();
                    take(line, &values).map_err(|cause| (line, cause))?;
                }
            }
            Self::Series(series) => {
                for row in 0..same_length(series, indices).map_err(|cause| (0, cause))? {
                    let line = row as u64 + 1;
                    let value = |index: &usize| match series[*index].values[row] {
                        number if number.is_nan() => Cell::Nothing,
                        number if number.is_infinite() => Cell::OutOfRange,
                        number => Cell::Number(number),
                    };
                    let values: Vec<Cell<'_>> = indices.iter().map(value).collect();
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
pub fn si(name: &str, value: Cell<'_>, factor: f64) -> Result<Option<f64>, String> {
    match value {
        Cell::Nothing | Cell::OutOfRange => Ok(None),
        Cell::Ended => Err(format!("the row ends before {name}")),
        Cell::Number(number) if number.is_finite() && (number * factor).abs() <= MAX_VALUE => {
            // Not −0.
            Ok(Some(number * factor + 0.0))
        }
        Cell::Number(number) => Err(format!("{name} is {number:?}; no instrument reads that")),
        Cell::Text(text) => {
            if text.starts_with('@') && clock::is_clock(text) {
                return Err(format!("{name} is a date in the spreadsheet; format its cells as numbers"));
            }
            let begin: String = text.chars().take(40).collect();
            Err(format!("{name} is {begin:?}, which is not a number; leave the cell empty where nothing was measured"))
        }
    }
}
