//! A file with the columns of it that are read.

use super::Quantity;
use super::chosen::Chosen;
use super::names::Title;
use super::source::Source;

/// The columns of a file that are read.
#[derive(Clone, Copy)]
pub struct Reading<'a> {
    pub source: &'a Source<'a>,
    /// In the order of their quantities: times are the first.
    pub chosen: &'a [Chosen],
    /// Those of all columns.
    pub titles: &'a [Title],
}

impl<'a> Reading<'a> {
    /// The column of times.
    pub fn time(&self) -> Option<&'a Chosen> {
        self.chosen.first().filter(|column| column.quantity == Quantity::Time)
    }

    /// Whether the column at `index` is read.
    pub fn has(&self, index: usize) -> bool {
        self.chosen.iter().any(|column| column.index == index)
    }

    /// The columns that are not read.
    pub fn others(&self) -> Vec<usize> {
        (0..self.titles.len()).filter(|index| !self.has(*index)).collect()
    }
}
