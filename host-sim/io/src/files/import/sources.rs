//! Rows of several films, sensors or kinds that a column of names distinguishes: they are not one recording.

use std::collections::BTreeMap;

use super::Quantity;
use super::clock;
use super::lines::Fault;
use super::names::{self, Title};
use super::numbers::Cell;
use super::reading::Reading;
use super::source::Source;

/// Most films or sensors of a file.
const MAX_SOURCES: usize = 64;
/// Fewest rows with another name than the row before.
const MIN_CHANGES: usize = 4;
/// One row of this many has another name than the row before, at least.
const MAX_ROWS_OF_ONE: usize = 3;
/// Readings of one name are closer to each other than to those of the row before, by this factor.
const MIN_CLOSER: f64 = 2.0;

/// A column that may name what its row is of, and the readings of each name.
#[derive(Default)]
struct Sources {
    index: usize,
    may_number: bool,
    before: Option<String>,
    rows: usize,
    changes: usize,
    /// Line of the first change.
    line: u64,
    /// Whether whole numbers go up and down by one, as a staircase does.
    by_one: bool,
    last: BTreeMap<String, Vec<Option<f64>>>,
    /// The distances of each used column from the row before and from the last row of the same name.
    across: Vec<f64>,
    within: Vec<f64>,
}

impl Sources {
    fn new(index: usize, title: &Title, used: usize) -> Self {
        let may_number = !title.name.is_empty() && !title.increases && !names::may_be_read(title);
        let distances = vec![0.0; used];
        Self { index, may_number, by_one: true, across: distances.clone(), within: distances, ..Self::default() }
    }

    /// Takes a row. Returns whether the column may still name sources.
    fn take(&mut self, line: u64, value: Cell<'_>, readings: &[Option<f64>]) -> bool {
        let name = match value {
            Cell::Text(text) if clock::stamp(text).is_none() => text.to_owned(),
            Cell::Number(number) if self.may_number && number.fract() == 0.0 => number.to_string(),
            Cell::Number(_) | Cell::Text(_) => return false,
            _ => return true,
        };
        self.rows += 1;
        if let Some(before) = self.before.as_ref().filter(|before| **before != name) {
            self.changes += 1;
            if self.changes == 1 {
                self.line = line;
            }
            let numbers = before.parse::<f64>().ok().zip(name.parse::<f64>().ok());
            self.by_one &= numbers.is_some_and(|(before, now)| (now - before).abs() <= 1.0);
            if let (Some(others), Some(own)) = (self.last.get(before), self.last.get(&name)) {
                for (k, reading) in readings.iter().enumerate() {
                    if let (Some(now), Some(other), Some(own)) = (reading, others[k], own[k]) {
                        self.across[k] += (now - other).abs();
                        self.within[k] += (now - own).abs();
                    }
                }
            }
        }
        self.last.insert(name.clone(), readings.to_vec());
        self.before = Some(name);
        self.last.len() <= MAX_SOURCES
    }

    /// Whether its names alternate, and the readings with them.
    fn are_several(&self) -> bool {
        let is_staircase = self.by_one && self.last.len() > 2;
        let alternate = self.changes >= MIN_CHANGES && self.changes * MAX_ROWS_OF_ONE >= self.rows;
        let mut pairs = self.across.iter().zip(&self.within);
        alternate && !is_staircase && pairs.any(|(across, within)| *across > MIN_CLOSER * within)
    }
}

/// Refuses a column that is not read whose names alternate from row to row where one that is read alternates with them.
pub fn refuse(reading: Reading<'_>) -> Result<(), Fault> {
    let Reading { source, chosen, titles } = reading;
    let used: Vec<usize> =
        chosen.iter().filter(|column| column.quantity != Quantity::Time).map(|column| column.index).collect();
    let may_name = |index: &usize| titles[*index].text || !names::may_be_read(&titles[*index]);
    let others = reading.others().into_iter().filter(may_name);
    let mut columns: Vec<(usize, Sources)> =
        others.map(|index| Sources::new(index, &titles[index], used.len())).enumerate().collect();
    if matches!(source, Source::Series(_)) || columns.is_empty() || used.is_empty() {
        return Ok(());
    }
    let count = columns.len();
    let indices: Vec<usize> = columns.iter().map(|(_, column)| column.index).chain(used).collect();
    // A row that cannot be read is found later; without columns the rest of the rows says nothing.
    let _ = source.each(&indices, |line, values| {
        let readings: Vec<Option<f64>> = values[count..].iter().map(|cell| cell.number()).collect();
        columns.retain_mut(|(place, column)| column.take(line, values[*place], &readings));
        if columns.is_empty() { Err(String::new()) } else { Ok(()) }
    });
    let Some((_, found)) = columns.iter().find(|(_, column)| column.are_several()) else { return Ok(()) };
    let shown: Vec<String> = found.last.keys().take(2).map(|name| format!("{name:?}")).collect();
    let (name, shown) = (&titles[found.index].name, shown.join(", "));
    let cause = format!(
        "{name:?} alternates ({shown}) and the readings with it: the rows may be of several films, sensors or kinds, or of one; write each as a \
         file or columns of its own, or remove this column if all rows are of one film"
    );
    Err((found.line, cause))
}
