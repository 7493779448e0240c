//! Tables: columns of numbers over time, in SI units.

use std::path::Path;

use crate::error::{Error, Result};
use crate::grid::Samples;

/// Largest value, in any unit.
pub(super) const MAX_VALUE: f64 = 1e15;

/// Columns in SI units, time from the first row.
#[derive(Clone, Debug, PartialEq)]
pub struct Table<const N: usize> {
    /// Times in s, increasing from 0.
    pub time_s: Vec<f64>,
    /// Time of the first row by the file's clock, s.
    pub start_s: f64,
    /// The requested columns; `None` for a column that is missing or empty throughout.
    pub columns: [Option<Column>; N],
}

/// One quantity over the rows; a cell may be empty where nothing was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    name: String,
    cells: Vec<Option<f64>>,
    /// Line of the first empty cell.
    first_gap: Option<u64>,
}

impl Column {
    /// A column without cells yet.
    pub(super) fn empty(name: String) -> Self {
        Self { name, cells: Vec::new(), first_gap: None }
    }

    /// Adds the cell of `line`.
    pub(super) fn push(&mut self, cell: Option<f64>, line: u64) {
        if cell.is_none() && self.first_gap.is_none() {
            self.first_gap = Some(line);
        }
        self.cells.push(cell);
    }

    /// Whether any cell has a value.
    pub(super) fn has_values(&self) -> bool {
        self.cells.iter().any(Option::is_some)
    }

    /// The cells, row by row.
    pub(super) fn cells(&self) -> &[Option<f64>] {
        &self.cells
    }

    /// The same, NaN where nothing was measured.
    pub(super) fn values(&self) -> Vec<f64> {
        self.cells.iter().map(|cell| cell.unwrap_or(f64::NAN)).collect()
    }

    /// The same column with other cells, of which the first empty one is on a line only if it is the same.
    pub(super) fn with_cells(&self, cells: Vec<Option<f64>>) -> Self {
        let gap = |cells: &[Option<f64>]| cells.iter().position(Option::is_none);
        let first_gap = self.first_gap.filter(|_| gap(&cells).is_some_and(|row| gap(&self.cells) == Some(row)));
        Self { name: self.name.clone(), cells, first_gap }
    }

    /// The cells that are not empty, at their times.
    pub fn present(&self, time_s: &[f64]) -> Samples {
        let (time_s, value) = time_s.iter().zip(&self.cells).filter_map(|(&t, cell)| cell.map(|v| (t, v))).unzip();
        Samples { time_s, value }
    }

    /// The times of the first and the last value (s), if no cell between them is empty.
    pub(super) fn covered_s(&self, time_s: &[f64]) -> Option<[f64; 2]> {
        let first = self.cells.iter().position(Option::is_some)?;
        let last = self.cells.iter().rposition(Option::is_some)?;
        self.cells[first..=last].iter().all(Option::is_some).then(|| [time_s[first], time_s[last]])
    }

    /// All cells.
    ///
    /// # Errors
    ///
    /// [`Error::Line`] where a cell is empty; `why` is the reason that it must not be.
    pub fn complete(&self, path: &Path, time_s: &[f64], why: &str) -> Result<Samples> {
        let empty = |at: &str| format!("{} is empty{at}; {why}", self.name);
        match (self.first_gap, self.cells.iter().position(Option::is_none)) {
            (_, None) => Ok(self.present(time_s)),
            (Some(line), _) => Err(Error::line(path, line, empty(""))),
            (None, Some(row)) => Err(Error::file(path, empty(&format!(" at {} s", time_s[row])))),
        }
    }
}
