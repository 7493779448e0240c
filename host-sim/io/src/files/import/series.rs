//! The columns of a file in SI units, and their interpretation.

use serde::Serialize;

use super::chosen::By;
use super::{Quantity, names};
use crate::files::table::Column;

/// The columns of a file.
#[derive(Clone, Debug)]
pub struct Series {
    /// Times as the file has them, s; increasing.
    pub clock_s: Vec<f64>,
    /// The other columns.
    pub columns: Vec<(Quantity, Column)>,
    /// Interpretation.
    pub understood: Understood,
}

impl Series {
    /// The column of `quantity`.
    pub fn column(&self, quantity: Quantity) -> Option<&Column> {
        self.columns.iter().find(|(which, _)| *which == quantity).map(|(_, column)| column)
    }
}

/// Interpretation of a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Understood {
    /// The file.
    pub file: String,
    /// Kind, encoding, separator and decimal sign.
    pub format: String,
    /// Line of the names; 0 if it is missing.
    pub header_line: u64,
    /// Lines above the names.
    pub preamble_lines: usize,
    /// The columns that are used.
    pub columns: Vec<UnderstoodColumn>,
    /// Names of the others.
    pub ignored: Vec<String>,
    /// Remarks on rows and readings that were left out, counted or changed.
    pub notes: Vec<String>,
}

/// A column that is used.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnderstoodColumn {
    /// The quantity.
    pub quantity: Quantity,
    /// Its number, from one.
    pub column: usize,
    /// Its name in the file.
    pub name: String,
    /// Its unit there; empty where a factor alone was given.
    pub unit: String,
    /// From the file's numbers to SI.
    pub factor: f64,
    /// Source of the interpretation.
    pub by: By,
}

impl Understood {
    /// Whether the file is CSV with the names of this tool, or no file.
    pub fn is_own(&self) -> bool {
        self.columns.iter().all(|column| column.by == By::OwnName)
    }

    /// Name of the first column that may be a temperature, where none is used.
    pub fn unused_temperature(&self) -> Option<&str> {
        let is_used = self.column(Quantity::Temperature).is_some();
        self.ignored.iter().map(String::as_str).find(|name| !is_used && names::is_temperature(name))
    }

    /// The column of `quantity`, if one is used.
    pub fn column(&self, quantity: Quantity) -> Option<&UnderstoodColumn> {
        self.columns.iter().find(|column| column.quantity == quantity)
    }

    /// One line: `time = "Zeit [s]" (s), …`.
    pub fn line(&self) -> String {
        let column = |column: &UnderstoodColumn| {
            let unit = match (column.unit.as_str(), column.by) {
                ("", _) => format!("× {}", column.factor),
                (unit, By::Unit) => format!("{unit}, by its unit"),
                (unit, By::Preamble) => format!("{unit}, by the preamble"),
                (unit, _) => unit.to_owned(),
            };
            format!("{} = {:?} ({unit})", column.quantity, column.name)
        };
        let columns: Vec<String> = self.columns.iter().map(column).collect();
        format!("{}: {}: {}", self.file, self.format, columns.join(", "))
    }
}
