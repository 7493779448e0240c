//! Columns that were understood.

use super::Quantity;
use super::names::Title;

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
