//! Columns that were understood.

use super::Quantity;
use super::names::Title;
use super::source::Source;

/// A column that was understood.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// The quantity.
    pub quantity: Quantity,
    /// Its index, from 0.
    pub index: usize,
    /// Its unit, as it is written here.
    pub unit: String,
    /// From the file's numbers to SI.
    pub factor: f64,
    /// Source of the interpretation.
    pub by: By,
}

impl Chosen {
    /// Its name among `titles`, as errors have it.
    pub fn name(&self, titles: &[Title]) -> String {
        match titles[self.index].name.as_str() {
            "" => format!("column {}", self.index + 1),
            name => name.chars().take(40).collect(),
        }
    }
}

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

/// Source of the interpretation of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum By {
    /// Its name, which is that of this tool.
    #[serde(rename = "name")]
    OwnName,
    /// Its name.
    Name,
    /// Its unit alone.
    Unit,
    /// The interval of rows in the preamble.
    Preamble,
    /// `--columns`.
    Choice,
}
