//! Columns that were logged more slowly than the rows: each value is repeated until the next.

use super::table::Column;
use crate::grid::{Samples, runs};

/// Smallest median of the rows of one value, and of its changes beside the finest one: coarse values repeat as well.
const MIN_ROWS: usize = 2;
const MIN_CHANGES: f64 = 2.0;
/// Share of the values that are repeated about as often as the others.
const REGULAR: f64 = 0.75;
/// Fewest values.
const MIN_VALUES: usize = 20;
/// Rows by which a film may answer a step late.
const LATE: usize = 2;
/// Correlation of the film with a drive between its values, as a share of that with a drive in steps, from which it was driven so.
const AS_GOOD: f64 = 0.9;

/// The values of a column where they are new.
pub(super) struct Held {
    /// Rows for which a value is repeated.
    pub(super) every: usize,
    /// Rows that begin a value, or a part of so many rows of one that stays.
    rows: Vec<usize>,
}

impl Held {
    /// Where the values of a `column` are new; none where they are in most rows, or at no regular ones.
    pub(super) fn new(column: &Column) -> Option<Self> {
        let present = || column.cells().iter().enumerate().filter_map(|(row, cell)| Some((row, (*cell)?)));
        let values: Vec<f64> = present().map(|(_, value)| value).collect();
        let runs = runs(&values);
        // Where half of the values are repeated, there are this many at the most.
        if runs.len() < MIN_VALUES || 3 * (runs.len() + 1) > 2 * values.len() {
            return None;
        }
        let mut lengths: Vec<usize> = runs.iter().map(|(from, to)| to - from).collect();
        let mut changes: Vec<f64> = runs[1..].iter().map(|&(k, _)| (values[k] - values[k - 1]).abs()).collect();
        lengths.sort_unstable();
        changes.sort_by(f64::total_cmp);
        let every = lengths[lengths.len() / 2];
        let regular = lengths.iter().filter(|length| length.abs_diff(every) <= 1 + every / 4).count();
        let is_held = every >= MIN_ROWS
            && regular as f64 >= REGULAR * lengths.len() as f64
            && *changes.get(changes.len() / 2)? > MIN_CHANGES * changes[0];
        let rows = runs.into_iter().flat_map(|(first, end)| {
            (first..end).step_by(every).filter(move |&row| row == first || 2 * (end - row) > every)
        });
        let row_of: Vec<usize> = present().map(|(row, _)| row).collect();
        is_held.then(|| Self { every, rows: rows.map(|place| row_of[place]).collect() })
    }

    /// Whether another column moves in most rows where `column` repeats its value.
    pub(super) fn stays_behind(column: &Column, other: &Column) -> bool {
        let (cells, others) = (column.cells(), other.cells());
        let repeats = || (1..cells.len()).filter(|&row| cells[row] == cells[row - 1]);
        2 * repeats().filter(|&row| others[row] != others[row - 1]).count() > repeats().count()
    }

    /// The `column` without the cells that repeat a value.
    pub(super) fn without_repeats(&self, column: &Column) -> Column {
        let mut cells = vec![None; column.cells().len()];
        self.rows.iter().for_each(|&row| cells[row] = column.cells()[row]);
        column.with_cells(cells)
    }

    /// The drive `column` between its new values, if the `stroke` shows that the film was driven so, and not in steps. The film moves by the
    /// square of the drive where that is a voltage.
    pub(super) fn between(&self, column: &Column, stroke: &Column, time_s: &[f64], is_voltage: bool) -> Option<Column> {
        let steps: Vec<f64> = column.cells().iter().copied().collect::<Option<_>>()?;
        let at = |values: &[f64]| Samples {
            time_s: self.rows.iter().map(|&row| time_s[row]).collect(),
            value: self.rows.iter().map(|&row| values[row]).collect(),
        };
        let between = at(&steps).curved_at(time_s.iter().copied());
        let read: Vec<(usize, f64)> =
            stroke.cells().iter().enumerate().filter_map(|(row, cell)| cell.map(|x| (row, x))).collect();
        let correlation = |drive: &[f64], late: usize| {
            let load = |row: usize| {
                let value = drive[row.saturating_sub(late)];
                if is_voltage { value * value } else { value }
            };
            let moves = read.windows(2).map(|pair| (load(pair[1].0) - load(pair[0].0), pair[1].1 - pair[0].1));
            let (product, size) =
                moves.fold((0.0, 0.0), |(product, size), (load, x)| (product + load * x, size + load * load));
            f64::abs(product) / f64::sqrt(size)
        };
        let in_steps = (0..=LATE).map(|late| correlation(&steps, late)).fold(0.0, f64::max);
        let is_between = correlation(&between, 0) > AS_GOOD * in_steps;
        is_between.then(|| column.with_cells(between.into_iter().map(Some).collect()))
    }
}
