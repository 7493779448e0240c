//! `Recording`: what was applied and what was measured.

use std::path::{Path, PathBuf};

use host_io::Error;
use host_io::error::shown;
use host_io::files::import::{Blank, Choices, Edits, Hints, Quantity, Understood};
use host_io::files::output;
use host_io::files::recording::Recording;
use host_io::quantity::positive;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;

use crate::arrays::{array, count, read_only, series};
use crate::errors::{Raise, exception, refused};
use crate::names::choice;

/// Columns as arrays, by their names.
type Columns = Vec<(&'static str, Py<PyArray1<f64>>)>;

/// Arguments of the constructor: the times, and others by their names.
type Arguments<'py> = ((Py<PyArray1<f64>>,), Bound<'py, PyDict>);

/// Applied and measured quantities over time: read from a file (`read_recording`), or made of arrays.
///
/// The arrays are of one dimension and one length: `time_s` (s, increasing), `voltage_v` (V) or `force_n` (N, the total force on the
/// film), `displacement_m` (m), `weight` (of the squared residuals in a fit). NaN and masked cells are empty; what drives a film
/// must have none. The values are copied. `name` is what errors and reports call it.
///
/// Raises InputError for an array of another shape or kind, or with values that no recording has. A pickled recording keeps its values, not the file
/// that they are from.
#[pyclass(frozen, name = "Recording", module = "springpot")]
pub(crate) struct PyRecording {
    pub(crate) recording: Recording,
    /// Times and columns, once they were asked for.
    time_s: PyOnceLock<Py<PyArray1<f64>>>,
    columns: PyOnceLock<Columns>,
}

impl From<Recording> for PyRecording {
    fn from(recording: Recording) -> Self {
        Self { recording, time_s: PyOnceLock::new(), columns: PyOnceLock::new() }
    }
}

impl PyRecording {
    /// The column of that name, NaN where nothing was measured.
    fn column(&self, py: Python<'_>, name: &str) -> PyResult<Option<Py<PyArray1<f64>>>> {
        let columns = self.columns.get_or_try_init(py, || {
            let columns = self.recording.columns().into_iter();
            columns
                .map(|(name, values)| PyResult::Ok((name, read_only(py, values)?.unbind())))
                .collect::<PyResult<Vec<_>>>()
        })?;
        Ok(columns.iter().find(|(which, _)| *which == name).map(|(_, values)| values.clone_ref(py)))
    }
}

#[pymethods]
impl PyRecording {
    #[new]
    #[pyo3(signature = (time_s, *, voltage_v=None, force_n=None, displacement_m=None, weight=None, temperature_c=None, name="recording"))]
    fn new(
        time_s: &Bound<'_, PyAny>,
        voltage_v: Option<&Bound<'_, PyAny>>,
        force_n: Option<&Bound<'_, PyAny>>,
        displacement_m: Option<&Bound<'_, PyAny>>,
        weight: Option<&Bound<'_, PyAny>>,
        temperature_c: Option<&Bound<'_, PyAny>>,
        name: &str,
    ) -> PyResult<Self> {
        let columns = [
            (Quantity::Voltage, "voltage_v", voltage_v),
            (Quantity::Force, "force_n", force_n),
            (Quantity::Displacement, "displacement_m", displacement_m),
            (Quantity::Weight, "weight", weight),
            (Quantity::Temperature, "temperature_c", temperature_c),
        ];
        let columns = columns
            .into_iter()
            .filter_map(|(quantity, name, values)| Some((quantity, name, values?)))
            .map(|(quantity, name, values)| Ok((quantity, series(name, values)?)))
            .collect::<PyResult<Vec<_>>>()?;
        let time_s = series("time_s", time_s)?;
        // There is no file here: the arrays are at fault.
        let made = Recording::of_values(name, time_s, columns).map_err(|error| match error {
            Error::File { path, cause } => refused(&shown(&path), cause),
            error => exception(&error),
        });
        Ok(made?.into())
    }

    /// Times of the rows, s, from 0. The array cannot be written to.
    #[getter]
    fn time_s(&self, py: Python<'_>) -> PyResult<Py<PyArray1<f64>>> {
        let made = || read_only(py, self.recording.time_s().to_vec()).map(Bound::unbind);
        Ok(self.time_s.get_or_try_init(py, made)?.clone_ref(py))
    }

    /// Voltage on the electrodes, V; None without such a column.
    #[getter]
    fn voltage_v(&self, py: Python<'_>) -> PyResult<Option<Py<PyArray1<f64>>>> {
        self.column(py, "voltage_v")
    }

    /// Total force on the film, N; None without such a column.
    #[getter]
    fn force_n(&self, py: Python<'_>) -> PyResult<Option<Py<PyArray1<f64>>>> {
        self.column(py, "force_n")
    }

    /// Measured displacement, m; None without such a column.
    #[getter]
    fn displacement_m(&self, py: Python<'_>) -> PyResult<Option<Py<PyArray1<f64>>>> {
        self.column(py, "displacement_m")
    }

    /// Weights of the squared residuals; None without such a column.
    #[getter]
    fn weight(&self, py: Python<'_>) -> PyResult<Option<Py<PyArray1<f64>>>> {
        self.column(py, "weight")
    }

    /// Temperatures of the film, °C; None without such a column.
    #[getter]
    fn temperature_c(&self, py: Python<'_>) -> PyResult<Option<Py<PyArray1<f64>>>> {
        self.column(py, "temperature_c")
    }

    /// The file, or the name.
    #[getter]
    fn path(&self) -> String {
        shown(self.recording.path())
    }

    /// Length, s.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.recording.duration_s()
    }

    /// How a file with other names than those of recordings was understood; None otherwise.
    #[getter]
    fn understood(&self) -> Option<String> {
        self.recording.understood().map(Understood::line)
    }

    /// Writes the recording as CSV with the names of recordings, whole or not at all.
    ///
    /// Raises FileError where it cannot be written.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let columns = self.recording.columns();
        let mut written = vec![("time_s", Some(self.recording.time_s()))];
        written.extend(columns.iter().map(|(name, values)| (*name, Some(values.as_slice()))));
        output::write_columns(&path, &written).raise()
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<Arguments<'py>> {
        let named = PyDict::new(py);
        named.set_item("name", self.path())?;
        for (name, values) in self.recording.columns() {
            named.set_item(name, array(py, values))?;
        }
        Ok(((self.time_s(py)?,), named))
    }

    fn __len__(&self) -> usize {
        self.recording.time_s().len()
    }

    fn __repr__(&self) -> String {
        let names: Vec<&str> = self.recording.columns().iter().map(|(name, _)| *name).collect();
        format!("<springpot.Recording {:?}: {} rows, {}>", self.path(), self.__len__(), names.join(", "))
    }
}

/// Arguments about a file with other names.
#[derive(Default)]
struct Asked<'a> {
    columns: Option<&'a str>,
    sheet: Option<String>,
    header_line: Option<i128>,
    segment: Option<i128>,
    decimal: Option<&'a str>,
    repeated_times: Option<&'a str>,
    fill: Option<&'a str>,
    rate_hz: Option<f64>,
    invert: bool,
}

impl Asked<'_> {
    fn hints(self) -> PyResult<Hints> {
        let choices = self.columns.map(|text| text.parse::<Choices>().map_err(|cause| Error::field("columns", cause)));
        if let Some(rate_hz) = self.rate_hz {
            positive("rate_hz", rate_hz).raise()?;
        }
        Ok(Hints {
            choices: choices.transpose().raise()?.unwrap_or_default(),
            sheet: self.sheet,
            header_line: self.header_line.map(|line| count("header_line", line)).transpose()?,
            segment: self.segment.map(|segment| count("segment", segment)).transpose()?,
            decimal: self.decimal.map(|name| choice("decimal", name)).transpose()?,
            repeated_times: self.repeated_times.map(|name| choice("repeated_times", name)).transpose()?,
            fill: self.fill.map(|name| choice("fill", name)).transpose()?,
            rate_hz: self.rate_hz,
            invert: self.invert,
            ..Hints::default()
        })
    }
}

/// Reads a recording: text with any separator, decimal sign and encoding, .xlsx, or .mat of version 5 to 7.
///
/// `columns` says which column is what, as `--columns` does: 'time=Zeit:s,voltage="HV mon"*2000,displacement=3:mm'. What is left
/// out is found by names and units. `sheet` is the spreadsheet of a workbook. Rows from `from_s` to `to_s` (s from the first) are kept,
/// every `decimate` of them are averaged into one, and readings such as 'displacement=-9999' are emptied by `blank`.
///
/// `header_line`, `segment`, `decimal` ('point' or 'comma'), `repeated_times` ('spread' or 'mean'), `fill` ('hold' or 'linear') and `rate_hz`
/// answer the questions that errors ask about a file, as the options of `import` do. `invert` turns the sign of the displacement.
///
/// Raises FileError naming the file, the line and what would be right; InputError for an option that cannot be used.
#[pyfunction]
#[pyo3(signature = (path, *, columns=None, sheet=None, from_s=0.0, to_s=None, decimate=1, blank=Vec::new(), header_line=None,
    segment=None, decimal=None, repeated_times=None, fill=None, rate_hz=None, invert=false))]
pub(crate) fn read_recording(
    py: Python<'_>,
    path: PathBuf,
    columns: Option<&str>,
    sheet: Option<String>,
    from_s: f64,
    to_s: Option<f64>,
    decimate: i128,
    blank: Vec<String>,
    header_line: Option<i128>,
    segment: Option<i128>,
    decimal: Option<&str>,
    repeated_times: Option<&str>,
    fill: Option<&str>,
    rate_hz: Option<f64>,
    invert: bool,
) -> PyResult<PyRecording> {
    let decimate = count("decimate", decimate)?;
    let asked = Asked { columns, sheet, header_line, segment, decimal, repeated_times, fill, rate_hz, invert };
    let hints = asked.hints()?;
    let read = || {
        let blanks = blank.iter().map(|text| text.parse::<Blank>().map_err(|cause| Error::field("blank", cause)));
        let edits = Edits::new(blanks.collect::<host_io::Result<Vec<_>>>()?, from_s, to_s, decimate)?;
        let asked = Hints { words: Blank::words(&edits.blanks), ..hints };
        let recording = Recording::read_with(&path, &asked)?;
        if edits == Edits::NONE {
            return Ok(recording);
        }
        let (series, _) =
            recording.into_series().edited(&edits, asked.fill).map_err(|cause| Error::file(&path, cause))?;
        Ok(Recording::from_series(&path, series))
    };
    Ok(py.detach(read).raise()?.into())
}

/// Reads the recording or the reference at `path`.
pub(crate) fn read(py: Python<'_>, path: &Path, is_reference: bool) -> PyResult<PyRecording> {
    let read = || {
        if is_reference {
            Recording::read_reference(path, &Hints::default())
        } else {
            Recording::read_with(path, &Hints::default())
        }
    };
    Ok(py.detach(read).raise()?.into())
}

/// Reads a reference: displacement over time, no voltage needed. Arguments and errors as `read_recording`.
#[pyfunction]
#[pyo3(signature = (path, *, columns=None, sheet=None, header_line=None, segment=None, decimal=None, repeated_times=None, rate_hz=None,
    invert=false))]
pub(crate) fn read_reference(
    py: Python<'_>,
    path: PathBuf,
    columns: Option<&str>,
    sheet: Option<String>,
    header_line: Option<i128>,
    segment: Option<i128>,
    decimal: Option<&str>,
    repeated_times: Option<&str>,
    rate_hz: Option<f64>,
    invert: bool,
) -> PyResult<PyRecording> {
    let asked =
        Asked { columns, sheet, header_line, segment, decimal, repeated_times, rate_hz, invert, ..Asked::default() };
    let hints = asked.hints()?;
    Ok(py.detach(|| Recording::read_reference(&path, &hints)).raise()?.into())
}
