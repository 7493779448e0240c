//! Files as laboratories have them: text of any dialect, spreadsheets and variables of MATLAB, read as columns in SI units.
//!
//! [`crate::files::csv`] reads the files that recordings are described as; everything else comes here. What is understood is told
//! ([`Understood`]), and what may be read in two ways is an error that shows both.

mod choice;
mod edit;
mod encoding;
mod extract;
mod header;
mod kind;
mod mapping;
mod mat;
mod names;
mod numbers;
mod source;
mod text;
mod units;
mod workbook;

pub use choice::Choices;
pub use edit::{Blank, Edits};
pub use extract::{Series, Understood, UnderstoodColumn, read};
pub use mapping::By;
pub(super) use text::{Separator, more_cells};

/// What a column of a recording is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// Time.
    Time,
    /// Voltage on the electrodes.
    Voltage,
    /// Total force on the film.
    Force,
    /// Measured displacement.
    Displacement,
    /// Weight of a row in a fit.
    Weight,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Time, Self::Voltage, Self::Force, Self::Displacement, Self::Weight];

    /// As `--columns` names it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Voltage => "voltage",
            Self::Force => "force",
            Self::Displacement => "displacement",
            Self::Weight => "weight",
        }
    }

    /// The unit of its values here.
    pub fn si_unit(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Voltage => "V",
            Self::Force => "N",
            Self::Displacement => "m",
            Self::Weight => "",
        }
    }

    /// A unit for an example.
    fn example_unit(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Voltage => "kV",
            Self::Force => "N",
            Self::Displacement => "mm",
            Self::Weight => "",
        }
    }

    /// The names that are expected first.
    fn expected(self) -> &'static str {
        match self {
            Self::Time => "time_s (or such as \"Time (s)\")",
            Self::Voltage => "voltage_v (or such as \"Voltage (kV)\")",
            Self::Force => "force_n",
            Self::Displacement => "displacement_m (or such as \"Laser (mm)\")",
            Self::Weight => "weight",
        }
    }
}

/// What is asked of a file.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Quantities that are taken where they are.
    pub wanted: &'a [Quantity],
    /// Of every set one must be there.
    pub needed: &'a [&'a [Quantity]],
}

/// What a person says about a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hints {
    /// Columns that were named.
    pub choices: Choices,
    /// The spreadsheet of a workbook.
    pub sheet: Option<String>,
}
