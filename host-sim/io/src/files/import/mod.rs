//! Files of columns: CSV with the names of this tool, and files as laboratories have them (text of any dialect, spreadsheets and variables
//! of MATLAB), read as columns in SI units.
//!
//! The interpretation is reported ([`Understood`]), and what may be read in two ways is an error that shows both.

mod beginnings;
mod beside;
mod channels;
mod choice;
mod chosen;
mod clock;
mod cut_off;
mod dates;
mod doubts;
mod edit;
mod encoding;
mod extract;
mod factors;
mod fractions;
mod header;
mod interval;
mod kind;
mod lines;
mod mapping;
mod mat;
mod mat_hdf5;
mod names;
mod numbers;
mod other_times;
mod own_names;
mod preamble;
mod rates;
mod reading;
mod reshaped;
mod rows;
mod runs;
mod separator;
mod series;
mod shape;
mod shifted;
mod short;
mod source;
mod sources;
mod status;
mod text;
mod times;
mod units;
mod words;
mod workbook;

use std::fmt;

pub use choice::Choices;
pub use chosen::By;
pub use edit::{Blank, Edits};
pub use extract::{from_csv, read};
pub use numbers::Decimal;
pub use rows::{Fill, RepeatedTimes};
pub use series::{Series, Understood, UnderstoodColumn};

crate::choice! {
    /// Quantity of a column.
    #[derive(PartialOrd, Ord, serde::Serialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Quantity {
        /// Time.
        Time = "time",
        /// Voltage on the electrodes.
        Voltage = "voltage",
        /// Total force on the film.
        Force = "force",
        /// Measured displacement.
        Displacement = "displacement",
        /// Weight of a row in a fit.
        Weight = "weight",
        /// Temperature of the film.
        Temperature = "temperature",
        /// High voltage that was asked of an amplifier.
        Command = "command",
        /// Length of a specimen over its original length.
        Stretch = "stretch",
        /// Force on a specimen over its original cross-section.
        Stress = "stress",
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Quantity {
    /// As `--columns` names it.
    pub fn name(self) -> &'static str {
        crate::choice::Choice::name(self)
    }

    /// Dimension of its units: a command is a voltage.
    fn measure(self) -> Self {
        if self == Self::Command { Self::Voltage } else { self }
    }

    /// Whether it is a number without a unit.
    fn is_bare(self) -> bool {
        self.si_unit().is_empty()
    }

    /// The unit of its values here.
    pub fn si_unit(self) -> &'static str {
        units::units_of(self.measure()).find(|unit| unit.factor == 1.0).map_or("", |unit| unit.name)
    }

    /// A unit for an example.
    fn example_unit(self) -> &'static str {
        match self {
            Self::Voltage | Self::Command => "kV",
            Self::Displacement => "mm",
            Self::Stress => "kPa",
            _ => self.si_unit(),
        }
    }

    /// The names that are expected first in a file of `request`.
    fn expected(self, request: &Request<'_>) -> &'static str {
        match self {
            Self::Voltage if request.wants(Self::Command) => "monitor_v or voltage_v (or such as \"HV monitor (kV)\")",
            Self::Time => "time_s (or such as \"Time (s)\")",
            Self::Voltage => "voltage_v (or such as \"Voltage (kV)\")",
            Self::Force => "force_n",
            Self::Displacement => "displacement_m (or such as \"Laser (mm)\")",
            Self::Weight => "weight",
            Self::Temperature => "temperature_c",
            Self::Command => "command_v (or such as \"Command (kV)\")",
            Self::Stretch => "stretch",
            Self::Stress => "nominal_stress_pa (or such as \"Stress (kPa)\")",
        }
    }
}

/// Names that a column has in a file of this tool, with their units.
pub type Names = [(&'static str, &'static str)];

/// Requirements for a file.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Quantities that are taken where they are, with their names in a file of this tool.
    pub wanted: &'a [(Quantity, &'static Names)],
    /// One of every set must exist.
    pub needed: &'a [&'a [Quantity]],
}

impl Request<'_> {
    fn wants(&self, quantity: Quantity) -> bool {
        self.wanted.iter().any(|(wanted, _)| *wanted == quantity)
    }
}

/// Options of the user for a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hints {
    /// Columns that were named.
    pub choices: Choices,
    /// The spreadsheet of a workbook.
    pub sheet: Option<String>,
    /// The line of the names.
    pub header_line: Option<u64>,
    /// Which run of rows is read, from one, where the header is repeated.
    pub segment: Option<usize>,
    /// The decimal sign.
    pub decimal: Option<Decimal>,
    /// Words for a reading that is missing.
    pub words: Vec<String>,
    /// Rate of the rows, Hz, instead of a column of times.
    pub rate_hz: Option<f64>,
    /// Meaning of rows of one time.
    pub repeated_times: Option<RepeatedTimes>,
    /// Value of an empty cell of what drives the film.
    pub fill: Option<Fill>,
    /// Whether the displacement is taken with the opposite sign.
    pub invert: bool,
}

impl Hints {
    /// Whether a file with the names of this tool is read as that: nothing is stated about its columns.
    fn allow_own_names(&self) -> bool {
        let Self { words, repeated_times, fill, invert, .. } = self.clone();
        *self == Self { words, repeated_times, fill, invert, ..Self::default() }
    }

    fn dialect(&self) -> text::Dialect<'_> {
        text::Dialect { hints: self, single: self.rate_hz.is_some(), sheet: None }
    }
}
