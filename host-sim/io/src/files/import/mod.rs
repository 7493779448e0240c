//! Files as laboratories have them: text of any dialect, spreadsheets and variables of MATLAB, read as columns in SI units.
//!
//! [`crate::files::csv`] reads the files that recordings are described as; everything else comes here. The interpretation is reported
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

/// Quantity of a column.
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
    /// High voltage that was asked of an amplifier.
    Command,
    /// Length of a specimen over its original length.
    Stretch,
    /// Force on a specimen over its original cross-section.
    Stress,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Time,
        Self::Voltage,
        Self::Force,
        Self::Displacement,
        Self::Weight,
        Self::Command,
        Self::Stretch,
        Self::Stress,
    ];

    /// As `--columns` names it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Voltage => "voltage",
            Self::Force => "force",
            Self::Displacement => "displacement",
            Self::Weight => "weight",
            Self::Command => "command",
            Self::Stretch => "stretch",
            Self::Stress => "stress",
        }
    }

    /// Dimension of its units: a command is a voltage.
    fn measure(self) -> Self {
        if self == Self::Command { Self::Voltage } else { self }
    }

    /// Whether it is a number without a unit.
    fn is_bare(self) -> bool {
        matches!(self, Self::Weight | Self::Stretch)
    }

    /// The unit of its values here.
    pub fn si_unit(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Voltage | Self::Command => "V",
            Self::Force => "N",
            Self::Displacement => "m",
            Self::Weight | Self::Stretch => "",
            Self::Stress => "Pa",
        }
    }

    /// A unit for an example.
    fn example_unit(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Voltage | Self::Command => "kV",
            Self::Force => "N",
            Self::Displacement => "mm",
            Self::Weight | Self::Stretch => "",
            Self::Stress => "kPa",
        }
    }

    /// The names that are expected first where the quantities `wanted` are asked for.
    fn expected(self, wanted: &[Self]) -> &'static str {
        match self {
            Self::Voltage if wanted.contains(&Self::Command) => {
                "monitor_v or voltage_v (or such as \"HV monitor (kV)\")"
            }
            Self::Time => "time_s (or such as \"Time (s)\")",
            Self::Voltage => "voltage_v (or such as \"Voltage (kV)\")",
            Self::Force => "force_n",
            Self::Displacement => "displacement_m (or such as \"Laser (mm)\")",
            Self::Weight => "weight",
            Self::Command => "command_v (or such as \"Command (kV)\")",
            Self::Stretch => "stretch",
            Self::Stress => "nominal_stress_pa (or such as \"Stress (kPa)\")",
        }
    }
}

/// Requirements for a file.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Quantities that are taken where they are.
    pub wanted: &'a [Quantity],
    /// One of every set must exist.
    pub needed: &'a [&'a [Quantity]],
}

/// Options of the user for a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hints {
    /// Columns that were named.
    pub choices: Choices,
    /// The spreadsheet of a workbook.
    pub sheet: Option<String>,
}
