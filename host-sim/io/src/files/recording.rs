//! Recordings: CSV files of what was applied and what was measured.
//!
//! [`crate::files::layout`] reads them.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use springpot::TemperatureDependence;

use crate::choice;
use crate::error::{Error, Result, short};
use crate::files::digest;
use crate::files::held::Held;
use crate::files::import::{Hints, Names, Quantity, Series, Understood, UnderstoodColumn};
use crate::files::layout::Layout;
use crate::files::table::{Column, MAX_VALUE, Table};
use crate::grid::{Grid, Samples};

/// A recording in SI units, time from its first sample.
///
/// A relaxation or creep test whose clock begins shortly after 0 keeps its clock: the load was applied at 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    path: PathBuf,
    /// Whether it came from a file, not from values at hand.
    is_file: bool,
    time_s: Vec<f64>,
    /// Those that have a value, in the order of [`RECORDING`].
    columns: Vec<(Quantity, Column)>,
    /// Rows whose reading was left out since it repeats the one before.
    repeated: usize,
    /// Interpretation of its file.
    pub(super) understood: Understood,
}

/// The input of a model with its values: [`Samples`] as recorded, or another form of them such as a series on a grid.
#[derive(Clone, Debug, PartialEq)]
pub enum Input<S = Samples> {
    /// Voltage on the electrodes, V.
    Voltage(S),
    /// Total force on the film, N.
    Force(S),
    /// Displacement of the film, m.
    Displacement(S),
}

choice! {
    /// Which of a recording's columns is the input of the model, and which is its output (`--drive`).
    pub enum Direction {
        /// Voltage or force is the input, displacement the output.
        Force = "force",
        /// Displacement is the input, force the output.
        Displacement = "displacement",
    }
}

/// Column names with their units.
const VOLTAGE: &Names = &[("voltage_v", "V"), ("voltage_kv", "kV")];
const DISPLACEMENT: &Names = &[("displacement_m", "m"), ("displacement_mm", "mm"), ("displacement_um", "µm")];

/// Columns of a recording: a voltage or a force.
const RECORDING: Layout<5> = Layout {
    what: "a CSV recording",
    columns: [
        (Quantity::Voltage, VOLTAGE),
        (Quantity::Force, &[("force_n", "N")]),
        (Quantity::Displacement, DISPLACEMENT),
        (Quantity::Weight, &[("weight", "")]),
        (Quantity::Temperature, &[("temperature_c", "")]),
    ],
    needed: &[&[Quantity::Voltage, Quantity::Force]],
};
/// Columns of a reference.
const REFERENCE: Layout<1> = Layout {
    what: "a CSV reference",
    columns: [(Quantity::Displacement, DISPLACEMENT)],
    needed: &[&[Quantity::Displacement]],
};

/// The name that a recording has for the column of `quantity`, in SI units.
fn own_name(quantity: Quantity) -> &'static str {
    RECORDING.columns.iter().find(|(known, _)| *known == quantity).map_or("", |(_, names)| names[0].0)
}

/// The beginning of every recording that is written here.
const OWN: &[u8] = b"time_s,";

/// Largest time on the clock of a held recording's first row that is still the time since its load was applied, as a share of
/// its duration; a recording that begins later was cut out of a longer one.
const MAX_LEAD: f64 = 0.01;

/// Rows below which values are not judged.
const MIN_ROWS: usize = 50;

/// Whether `values` are a load that is held: none is further than 1 % from the first.
fn is_held(values: &[f64]) -> bool {
    values.first().is_some_and(|first| *first != 0.0 && values.iter().all(|v| (v - first).abs() <= 0.01 * first.abs()))
}

impl Recording {
    /// Reads the recording at `path`: a file with the names of recordings, or any that [`crate::files::import`] understands.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file and line of the first thing that cannot be used.
    pub fn read(path: &Path) -> Result<Self> {
        Self::read_with(path, &Hints::default())
    }

    /// Whether there is a file at `path` that does not begin as recordings do that are written here.
    pub fn is_foreign(path: &Path) -> bool {
        let Ok(file) = File::open(path) else { return false };
        let mut begin = Vec::new();
        file.take(OWN.len() as u64).read_to_end(&mut begin).is_ok() && !begin.is_empty() && begin != OWN
    }

    /// Reads the recording at `path`, of which a person says `hints`.
    pub fn read_with(path: &Path, hints: &Hints) -> Result<Self> {
        let (table, understood) = RECORDING.read(path, hints)?;
        Ok(Self::new(path, table, understood))
    }

    /// Reads a recording from CSV text; `path` is what errors name.
    pub fn from_csv(path: &Path, csv: impl Read) -> Result<Self> {
        let (table, understood) = RECORDING.from_csv(path, csv)?;
        Ok(Self::new(path, table, understood))
    }

    /// The recording of the `series` in the file at `path`.
    pub fn from_series(path: &Path, series: Series) -> Self {
        Self::new(path, RECORDING.table(&series), series.understood)
    }

    /// A recording of values that are at hand, in SI units: its rows are at `time_s` (s), the `columns` are of one length with them,
    /// NaN where nothing was measured. Errors call it `name`; there is no such file.
    ///
    /// # Errors
    ///
    /// [`Error::File`] naming the column and the row, from 0, that cannot be used.
    pub fn of_values(name: &str, time_s: Vec<f64>, columns: Vec<(Quantity, Vec<f64>)>) -> Result<Self> {
        let fault = |cause: String| Error::file(Path::new(name), cause);
        if time_s.len() < 2 {
            return Err(fault(format!("time_s has {} rows; a recording needs at least 2", time_s.len())));
        }
        if let Some(row) = time_s.iter().position(|t| t.is_nan() || t.abs() > MAX_VALUE) {
            return Err(fault(format!("time_s[{row}] is {}; no clock shows that", time_s[row])));
        }
        if let Some(row) = (1..time_s.len()).find(|&row| time_s[row] <= time_s[row - 1]) {
            let cause = format!("time_s[{row}] is {:?} after {:?}; times must increase", time_s[row], time_s[row - 1]);
            return Err(fault(cause));
        }
        let start_s = time_s[0];
        let mut found = [const { None }; 5];
        for (quantity, values) in columns {
            let Some(slot) = RECORDING.columns.iter().position(|(known, _)| *known == quantity) else {
                return Err(fault(match quantity {
                    Quantity::Time => "two columns of times".into(),
                    other => format!("a {other} is in no recording"),
                }));
            };
            let name = own_name(quantity);
            if values.len() != time_s.len() {
                return Err(fault(format!("{} values of {name} at {} times", values.len(), time_s.len())));
            }
            if let Some(row) = values.iter().position(|value| value.abs() > MAX_VALUE) {
                return Err(fault(format!("{name}[{row}] is {}; no instrument reads that", values[row])));
            }
            let cells = values.into_iter().map(|value| (!value.is_nan()).then_some(value)).collect();
            let column = Column::empty(name.into()).with_cells(cells);
            found[slot] = column.has_values().then_some(column);
        }
        let from_start = time_s.iter().map(|t| t - start_s).collect();
        let table = Table { time_s: from_start, start_s, columns: found };
        let made = Self { is_file: false, ..Self::new(Path::new(name), table, Understood::default()) };
        // A load that was applied at 0: these are its times, without the rounding of a difference and a sum.
        Ok(if made.time_s[0] == 0.0 { made } else { Self { time_s, ..made } })
    }

    /// SHA-256 of its file in hexadecimal digits; none of a recording that is no file.
    pub fn sha256(&self) -> Result<Option<String>> {
        self.is_file.then(|| digest::sha256(&self.path)).transpose()
    }

    fn new(path: &Path, table: Table<5>, understood: Understood) -> Self {
        let start_s = table.start_s;
        let mut recording = Self::of_table(path, &RECORDING, table, understood);
        // A voltage drives; without one, force or displacement may.
        let drives: &[Quantity] = match recording.column(Quantity::Voltage) {
            Some(_) => &[Quantity::Voltage],
            None => &[Quantity::Force, Quantity::Displacement],
        };
        let held = drives.iter().filter_map(|drive| recording.samples(*drive)).any(|samples| is_held(&samples.value));
        if held && start_s > 0.0 && start_s <= MAX_LEAD * recording.duration_s() {
            recording.time_s.iter_mut().for_each(|t| *t += start_s);
        }
        recording.release_held();
        recording
    }

    /// Leaves out the readings that repeat the one before, and takes the values of a drive between those that are new, where either was logged
    /// more slowly than the rows.
    fn release_held(&mut self) {
        let is_voltage = self.column(Quantity::Voltage).is_some();
        let drives = if is_voltage { Quantity::Voltage } else { Quantity::Force };
        let (Some(drive), Some(stroke)) = (self.column(drives), self.column(Quantity::Displacement)) else { return };
        let held_drive = Held::new(drive);
        // A film that is driven in coarse steps stays between them.
        let is_slow = held_drive.is_some() || Held::stays_behind(stroke, drive);
        let held = Held::new(stroke).filter(|_| is_slow);
        // Without a voltage the displacement may drive.
        let read = held.as_ref().filter(|_| is_voltage).map(|held| held.without_repeats(stroke));
        let stroke = read.as_ref().unwrap_or(stroke);
        let driven =
            held_drive.and_then(|held| Some((held.between(drive, stroke, &self.time_s, is_voltage)?, held.every)));
        if let Some(held) = held {
            let what = match read {
                Some(_) => "those that repeat it are left out; record with the sensor's own rate",
                None => "record with the sensor's own rate, or empty those that repeat the one before",
            };
            let every = held.every;
            self.understood.notes.push(format!("a new reading of the displacement in every {every} rows only: {what}"));
        }
        if let Some(stroke) = read {
            let count = |column: &Column| column.cells().iter().flatten().count();
            self.repeated = self.column(Quantity::Displacement).map_or(0, count) - count(&stroke);
            self.replace(Quantity::Displacement, stroke);
        }
        if let Some((drive, every)) = driven {
            self.replace(drives, drive);
            self.understood.notes.push(format!(
                "a new value of the drive in every {every} rows only, and the film moves in between: the drive is taken along a curve through \
                 them; record it as often as the stroke"
            ));
        }
    }

    /// Rows whose reading was left out since it repeats the one before.
    pub fn repeated(&self) -> usize {
        self.repeated
    }

    fn replace(&mut self, quantity: Quantity, column: Column) {
        self.columns.iter_mut().filter(|(own, _)| *own == quantity).for_each(|(_, own)| *own = column.clone());
    }

    fn of_table<const N: usize>(path: &Path, layout: &Layout<N>, table: Table<N>, understood: Understood) -> Self {
        let columns = layout.columns.iter().zip(table.columns);
        let columns = columns.filter_map(|((quantity, _), column)| Some((*quantity, column?))).collect();
        Self { path: path.into(), is_file: true, time_s: table.time_s, columns, repeated: 0, understood }
    }

    /// Reads a reference at `path`, of which a person says `hints`: displacement over time, no voltage needed.
    pub fn read_reference(path: &Path, hints: &Hints) -> Result<Self> {
        let (table, understood) = REFERENCE.read(path, hints)?;
        Ok(Self::of_table(path, &REFERENCE, table, understood))
    }

    /// The series of the recording, with their times.
    pub fn into_series(self) -> Series {
        Series { clock_s: self.time_s, columns: self.columns, understood: self.understood }
    }

    /// Interpretation of the file, if it has not the names of recordings.
    pub fn understood(&self) -> Option<&Understood> {
        Some(&self.understood).filter(|understood| !understood.is_own())
    }

    /// The remark on a column that may be the film's temperature, and is not used.
    pub fn unused_temperature(&self) -> Option<String> {
        let is_wanted = [Quantity::Voltage, Quantity::Force].iter().any(|drive| self.column(*drive).is_some());
        let name = self.understood.unused_temperature().filter(|_| is_wanted)?;
        // A comma separates columns.
        let which = if name.contains([',', '"']) { "NUMBER".into() } else { format!("{name:?}") };
        let cause = format!("{name:?} is not used; if it is the temperature of the film, in °C");
        Some(format!("{cause}: `columns` temperature={which}"))
    }

    /// The column of `quantity` as it was understood.
    pub(super) fn origin(&self, quantity: Quantity) -> Option<&UnderstoodColumn> {
        self.understood.column(quantity)
    }

    /// Remarks on what was left out, counted or changed as the file was read.
    pub fn notes(&self) -> &[String] {
        &self.understood.notes
    }

    /// All remarks on its rows: the notes, values that are implausible, and drop-outs.
    pub fn remarks(&self) -> Vec<String> {
        // A handful of rows is no measurement, and the fault of its file is reported alone.
        let implausible = match self.time_s.len() {
            0..MIN_ROWS => self.excessive_voltage().into_iter().collect(),
            _ => self.implausible(),
        };
        self.notes().iter().cloned().chain(implausible).chain(self.doubts()).collect()
    }

    /// Remarks on readings that may be drop-outs, and on times that may be numbers of rows.
    pub fn doubts(&self) -> impl Iterator<Item = String> {
        self.drop_outs().map(|drop_outs| drop_outs.to_string()).into_iter().chain(self.numbered_rows())
    }

    /// Times of all rows, s.
    pub fn time_s(&self) -> &[f64] {
        &self.time_s
    }

    /// All columns by their names, NaN in empty cells, as they are written.
    pub fn columns(&self) -> Vec<(&'static str, Vec<f64>)> {
        self.columns.iter().map(|(quantity, column)| (own_name(*quantity), column.values())).collect()
    }

    /// The column of `quantity`, NaN in empty cells.
    pub(super) fn values(&self, quantity: Quantity) -> Option<Vec<f64>> {
        self.column(quantity).map(Column::values)
    }

    /// Where the recording came from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length in seconds.
    pub fn duration_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or(0.0)
    }

    /// The grid at `rate_hz` that covers the recording.
    ///
    /// # Errors
    ///
    /// [`Error`] for a rate that is not positive and finite, or a recording that is too long for it.
    pub fn grid(&self, rate_hz: f64) -> Result<Grid> {
        Grid::covering(self.duration_s(), rate_hz)
            .map_err(|error| if rate_hz > 0.0 && rate_hz.is_finite() { Error::file(&self.path, error) } else { error })
    }

    /// The input of the film: the voltage, or the force where there is no voltage.
    ///
    /// # Errors
    ///
    /// [`Error`] for a column with gaps.
    pub fn drive(&self) -> Result<Input> {
        match (self.column(Quantity::Voltage), self.column(Quantity::Force)) {
            (Some(voltage), _) => Ok(Input::Voltage(self.complete(voltage)?)),
            (None, Some(force)) => Ok(Input::Force(self.complete(force)?)),
            (None, None) => Err(Error::file(&self.path, "neither voltage_v nor force_n has a value")),
        }
    }

    /// The displacement as the input of a model.
    ///
    /// # Errors
    ///
    /// [`Error`] if it is missing or has gaps.
    pub fn displacement_drive(&self) -> Result<Input> {
        let column = self.column(Quantity::Displacement).ok_or_else(|| self.no_displacement())?;
        Ok(Input::Displacement(self.complete(column)?))
    }

    /// The measured displacement in m.
    pub fn displacement(&self) -> Result<Samples> {
        self.samples(Quantity::Displacement).ok_or_else(|| self.no_displacement())
    }

    /// The force in N, where it was measured.
    pub fn force(&self) -> Option<Samples> {
        self.samples(Quantity::Force)
    }

    /// Weights of the squared residuals in a fit, where there is a column of them; an empty cell counts 1.
    pub fn weights(&self) -> Option<Samples> {
        self.samples(Quantity::Weight)
    }

    /// Temperatures of the film, °C, where there is a column of them.
    pub fn temperature_c(&self) -> Option<Samples> {
        self.samples(Quantity::Temperature)
    }

    /// Their mean, °C.
    ///
    /// # Errors
    ///
    /// [`Error::File`] for temperatures that no film has.
    pub fn mean_temperature_c(&self) -> Result<Option<f64>> {
        let Some(Samples { value, .. }) = self.temperature_c() else { return Ok(None) };
        for &temperature_c in &value {
            TemperatureDependence::none(temperature_c)
                .check()
                .map_err(|error| Error::file(&self.path, format!("temperature_c: {}", short(&error))))?;
        }
        Ok(Some(value.iter().sum::<f64>() / value.len() as f64))
    }

    fn no_displacement(&self) -> Error {
        let cause = "no column displacement_m, displacement_mm or displacement_um with values; if another column is the \
                     displacement, name it, as in `columns` displacement=3:mm";
        Error::file(&self.path, cause)
    }

    fn column(&self, quantity: Quantity) -> Option<&Column> {
        self.columns.iter().find(|(which, _)| *which == quantity).map(|(_, column)| column)
    }

    fn samples(&self, quantity: Quantity) -> Option<Samples> {
        self.column(quantity).map(|column| column.present(&self.time_s))
    }

    fn complete(&self, column: &Column) -> Result<Samples> {
        let from_start_s = |time_s: f64| ((time_s - self.time_s[0]) * 1e6).round() / 1e6;
        let advice = match column.covered_s(&self.time_s).map(|covered| covered.map(from_start_s)) {
            Some([from, to]) if from < to => format!("import the part that is, with `from` {from} and `to` {to}"),
            _ => "if it was logged more slowly than the sensor, use `fill` hold or `fill` linear".into(),
        };
        let why = format!("what drives the film must be complete; {advice}");
        column.complete(&self.path, &self.time_s, &why)
    }
}

impl<S> Input<S> {
    /// The values, whatever they are of.
    pub fn samples(&self) -> &S {
        match self {
            Self::Voltage(samples) | Self::Force(samples) | Self::Displacement(samples) => samples,
        }
    }

    /// The same input with its values in another form.
    pub fn map<U>(&self, form: impl FnOnce(&S) -> U) -> Input<U> {
        match self {
            Self::Voltage(samples) => Input::Voltage(form(samples)),
            Self::Force(samples) => Input::Force(form(samples)),
            Self::Displacement(samples) => Input::Displacement(form(samples)),
        }
    }
}
