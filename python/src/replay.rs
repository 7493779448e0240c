//! Recordings and references through a model, as the commands of the same names run them.

use std::path::PathBuf;

use host_io::files::recording::Direction;
use host_models::agreement::{Agreement, mean_r2};
use host_models::references;
use host_models::replay::comparison::Comparison;
use host_models::replay::frequency_response::Sweep;
use host_models::replay::memory::{MemoryChoice, Precision, RunOptions};
use host_models::replay::observer::{ObservedRecording, Tuning};
use host_models::replay::simulate::Response;
use host_models::replay::{feasibility, feedforward as planned, simulate as run};
use host_models::simulation::closed_loop::LimitShare;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};
use serde_json::json;

use crate::arrays::{array, count};
use crate::control::{Limits, limits};
use crate::errors::{Raise, refused};
use crate::model::PyModel;
use crate::names::choice;
use crate::recording::{PyRecording, read};
use crate::watch;

/// A recording, or its file.
#[derive(FromPyObject)]
pub(crate) enum Source<'py> {
    Recording(Bound<'py, PyRecording>),
    File(PathBuf),
}

impl<'py> Source<'py> {
    /// The recording, read if need be; of a reference no voltage is needed.
    pub(crate) fn read(self, py: Python<'py>, is_reference: bool) -> PyResult<Bound<'py, PyRecording>> {
        match self {
            Self::Recording(recording) => Ok(recording),
            Self::File(path) => Bound::new(py, read(py, &path, is_reference)?),
        }
    }
}

/// The recordings in `given`: one or several, each as [`Source`].
pub(crate) fn recordings<'py>(given: &Bound<'py, PyAny>) -> PyResult<Vec<Bound<'py, PyRecording>>> {
    let py = given.py();
    if let Ok(one) = given.extract::<Source<'py>>() {
        return Ok(vec![one.read(py, false)?]);
    }
    let unlike = |_| refused("recordings", format!("{given:?}; recordings or their paths are needed"));
    let mut read = Vec::new();
    for one in given.try_iter().map_err(unlike)? {
        read.push(one?.extract::<Source<'py>>().map_err(unlike)?.read(py, false)?);
    }
    if read.is_empty() { Err(refused("recordings", "none is given")) } else { Ok(read) }
}

/// The result of that class of `springpot.results`, with its fields.
pub(crate) fn result<'py>(class: &str, fields: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
    fields.py().import("springpot.results")?.getattr(class)?.call((), Some(fields))
}

/// The options of a run by their names.
fn run_options(rate_hz: f64, memory: &str, precision: &str) -> PyResult<RunOptions> {
    let memory = memory.parse::<MemoryChoice>().map_err(|cause| refused("memory", cause))?;
    Ok(RunOptions { rate_hz, memory, precision: choice("precision", precision)? })
}

fn response<'py>(py: Python<'py>, rate_hz: f64, time_s: Vec<f64>, response: Response) -> PyResult<Bound<'py, PyAny>> {
    let columns = PyDict::new(py);
    columns.set_item("time_s", array(py, time_s))?;
    columns.set_item("voltage_v", response.voltage_v.map(|volts| array(py, volts)))?;
    columns.set_item("force_n", array(py, response.force_n))?;
    columns.set_item("displacement_m", array(py, response.displacement_m))?;
    columns.set_item("rate_hz", rate_hz)?;
    result("Response", &columns)
}

/// The response of `model` to the input of `recording`, at `rate_hz` steps per second.
///
/// The input is the voltage, or the force where there is no voltage; with `drive="displacement"` it is the displacement. It is interpolated to
/// the steps. `memory` is "compressed" (what a controller runs), "full", or "window:10s".
///
/// Raises InputError for a model or an option that is refused, FileError for a recording without an input, ComputationError for a film that is
/// pulled in.
#[pyfunction]
#[pyo3(signature = (model, recording, *, rate_hz=1000.0, memory="compressed", precision="f32", method="gl", drive="force"))]
pub(crate) fn simulate<'py>(
    model: &Bound<'py, PyModel>,
    recording: Source<'py>,
    rate_hz: f64,
    memory: &str,
    precision: &str,
    method: &str,
    drive: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let py = model.py();
    let options = run_options(rate_hz, memory, precision)?;
    let direction: Direction = choice("drive", drive)?;
    let parameters = model.get().with_method(method)?;
    let recording = recording.read(py, false)?;
    let (source, recording) = (&model.get().source, &recording.get().recording);
    let (grid, computed) = watch::run(py, None, |caller| {
        let parameters = parameters.along(recording).map_err(|e| e.about(source, recording.path()))?;
        let grid = recording.grid(options.rate_hz)?;
        let input = match direction {
            Direction::Force => recording.drive()?,
            Direction::Displacement => recording.displacement_drive()?,
        };
        let response = run::response(&parameters, &input, grid, &options, caller);
        Ok((grid, response.map_err(|e| e.about(source, recording.path()))?))
    })?;
    response(py, grid.rate_hz, grid.times_s(), computed)
}

/// Responses of `model` to `recordings`, compared with what was measured, at the times at which it was.
///
/// Options and errors as `simulate`.
#[pyfunction]
#[pyo3(signature = (model, recordings, *, drive="force", rate_hz=1000.0, memory="compressed", precision="f32", method="gl"))]
pub(crate) fn replay<'py>(
    model: &Bound<'py, PyModel>,
    recordings: &Bound<'py, PyAny>,
    drive: &str,
    rate_hz: f64,
    memory: &str,
    precision: &str,
    method: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let py = model.py();
    let options = run_options(rate_hz, memory, precision)?;
    let direction: Direction = choice("drive", drive)?;
    let parameters = model.get().with_method(method)?;
    let source = &model.get().source;
    let recordings = self::recordings(recordings)?;
    let sources: Vec<_> = recordings.iter().map(|recording| &recording.get().recording).collect();
    let replayed = watch::run(py, None, |caller| {
        // All are checked before any is run.
        let comparisons = sources
            .iter()
            .map(|recording| Comparison::new(recording, direction, &parameters, options.rate_hz))
            .collect::<host_io::Result<Vec<_>>>()?;
        let mut replayed = Vec::new();
        for comparison in comparisons {
            let (response, agreement) = comparison
                .run(&parameters, &options, caller)
                .map_err(|e| e.about(source, comparison.recording().path()))?;
            let modelled = comparison.readings(&parameters, &response);
            replayed.push((comparison.grid, response, agreement, comparison.measured, modelled));
        }
        Ok(replayed)
    })?;
    let agreements: Vec<Agreement> = replayed.iter().map(|(_, _, agreement, ..)| *agreement).collect();
    let rows = sources.iter().zip(replayed).map(|(recording, (grid, computed, agreement, measured, modelled))| {
        let row = PyDict::new(py);
        row.set_item("file", host_io::error::shown(recording.path()))?;
        row.set_item("r2", agreement.r2)?;
        row.set_item("nrmse_pct", agreement.nrmse_pct)?;
        row.set_item("rmse", agreement.rmse)?;
        row.set_item("samples", agreement.samples)?;
        row.set_item("time_s", array(py, measured.time_s))?;
        row.set_item("measured", array(py, measured.value))?;
        row.set_item("modelled", array(py, modelled))?;
        row.set_item("response", response(py, grid.rate_hz, grid.times_s(), computed)?)?;
        result("ReplayRecording", &row)
    });
    let fields = PyDict::new(py);
    fields.set_item("r2_mean", mean_r2(&agreements))?;
    fields.set_item("recordings", rows.collect::<PyResult<Vec<_>>>()?)?;
    result("Replay", &fields)
}

/// The voltage that takes `model` along the displacement of `reference` (m over s), within `limits`.
///
/// A path is read with `read_reference`. Options and errors as `simulate`. Warns where the film's sizes are assumed: its field is not known.
#[pyfunction]
#[pyo3(signature = (model, reference, *, rate_hz=1000.0, memory="compressed", precision="f32", method="gl", limits=None))]
pub(crate) fn feedforward<'py>(
    model: &Bound<'py, PyModel>,
    reference: Source<'py>,
    rate_hz: f64,
    memory: &str,
    precision: &str,
    method: &str,
    limits: Option<Limits<'py>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = model.py();
    let options = run_options(rate_hz, memory, precision)?;
    let limits = self::limits(py, limits, model.get())?;
    let parameters = model.get().with_method(method)?;
    let reference = reference.read(py, true)?;
    let (source, recording) = (&model.get().source, &reference.get().recording);
    let (grid, plan) = watch::run(py, None, |caller| {
        let (values, grid) = references::on_grid(recording, options.rate_hz)?;
        let plan = planned::plan(&parameters, &values, grid, &options, limits, caller);
        Ok((grid, plan.map_err(|e| e.about(source, recording.path()))?))
    })?;
    let limited: Vec<u8> = plan.limited.iter().map(|limited| limited.bits()).collect();
    let met = LimitShare::from_limited(&plan.limited).into_iter().map(|met| (met.limit, met.pct));
    let columns = PyDict::new(py);
    columns.set_item("time_s", array(py, grid.times_s()))?;
    columns.set_item("voltage_v", array(py, plan.voltage_v))?;
    columns.set_item("displacement_m", array(py, plan.displacement_m))?;
    columns.set_item("reference_m", array(py, plan.reference_m))?;
    columns.set_item("limited", PyArray1::from_vec(py, limited))?;
    columns.set_item("limits_met", met.into_py_dict(py)?)?;
    columns.set_item("rate_hz", grid.rate_hz)?;
    result("VoltagePlan", &columns)
}

/// Checks whether `model` can follow `reference` within `limits`, and what would make it so: `check` of `feedforward --check --json`.
///
/// ["feasible"] is the answer, ["binding"] the limits in the way, ["least_offset_m"] and ["most_offset_m"] the offsets (m) that make it
/// feasible, ["smaller"] a smaller reference that is.
#[pyfunction]
#[pyo3(signature = (model, reference, *, rate_hz=1000.0, method="gl", limits=None))]
pub(crate) fn check_reference<'py>(
    model: &Bound<'py, PyModel>,
    reference: Source<'py>,
    rate_hz: f64,
    method: &str,
    limits: Option<Limits<'py>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = model.py();
    let limits = self::limits(py, limits, model.get())?;
    let parameters = model.get().with_method(method)?;
    let reference = reference.read(py, true)?;
    let (source, recording) = (&model.get().source, &reference.get().recording);
    let found = watch::run(py, None, |_| {
        let (values, grid) = references::on_grid(recording, rate_hz)?;
        let found = feasibility::check_and_mend(&parameters, &values, grid, &limits);
        found.map_err(|e| e.about(source, recording.path()))
    })?;
    py.import("json")?.call_method1("loads", (json!(found).to_string(),))
}

/// The observer over a recording of voltage and displacement, `rate_hz` ticks per second.
///
/// Below `bandwidth_hz` the estimate follows the sensor, above it the model; 0.6 Hz, or the most that sensor and model allow, if left out. Over
/// `adaptation_s` a disturbance that swings with the load becomes a change of the force scale; 0 for never.
#[pyfunction]
#[pyo3(signature = (model, recording, *, rate_hz=1000.0, bandwidth_hz=None, adaptation_s=30.0, precision="f32", method="gl"))]
pub(crate) fn observe<'py>(
    model: &Bound<'py, PyModel>,
    recording: Source<'py>,
    rate_hz: f64,
    bandwidth_hz: Option<f64>,
    adaptation_s: f64,
    precision: &str,
    method: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let py = model.py();
    let tuning = Tuning::new(bandwidth_hz, adaptation_s).raise()?;
    let precision: Precision = choice("precision", precision)?;
    let parameters = model.get().with_method(method)?;
    let recording = recording.read(py, false)?;
    let (source, recording) = (&model.get().source, &recording.get().recording);
    let (observed, estimates) = watch::run(py, None, |caller| {
        let observed = ObservedRecording::from_recording(recording, rate_hz)?;
        let parameters = parameters.along(recording).map_err(|e| e.about(source, recording.path()))?;
        let estimates = observed.estimate(&parameters, tuning, precision, caller);
        Ok((observed, estimates.map_err(|e| e.about(source, recording.path()))?))
    })?;
    let summary = estimates.summary();
    let columns = [
        ("time_s", observed.grid.times_s()),
        ("voltage_v", observed.voltage_v),
        ("displacement_m", estimates.displacement_m),
        ("sample_m", estimates.sample_m),
        ("disturbance_n", estimates.disturbance_n),
        ("force_scale", estimates.force_scale),
        ("innovation_m", estimates.innovation_m),
        ("innovation_mean_m", estimates.innovation_mean_m),
        ("innovation_std_m", estimates.innovation_std_m),
    ];
    let columns = columns.map(|(name, values)| (name, array(py, values))).into_py_dict(py)?;
    columns.set_item("bandwidth_hz", summary.bandwidth_hz)?;
    columns.set_item("samples", summary.samples)?;
    columns.set_item("innovation_rms_m", summary.innovation_rms_m)?;
    result("Observation", &columns)
}

/// Displacement over force at `points` frequencies, evenly spaced on a logarithmic scale.
///
/// Returns the response of the continuous Eq. 11, or with `law_hz` of the law that a controller steps at that rate; of a film with an
/// elastic curve for small oscillations about `at_m` (m).
#[pyfunction]
#[pyo3(signature = (model, from_hz, to_hz, points=200, *, at_m=0.0, law_hz=None))]
pub(crate) fn frequency_response<'py>(
    model: &Bound<'py, PyModel>,
    from_hz: f64,
    to_hz: f64,
    points: i128,
    at_m: f64,
    law_hz: Option<f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = model.py();
    let sweep = Sweep { from_hz, to_hz, points: count("points", points)?, at_m, law_hz };
    let (source, parameters) = (&model.get().source, &model.get().parameters);
    let response = watch::run(py, None, |_| sweep.run(parameters).map_err(|e| e.about(source, source.as_ref())))?;
    let columns = [
        ("frequency_hz", response.frequency_hz),
        ("magnitude_m_per_n", response.magnitude_m_per_n),
        ("phase_rad", response.phase_rad),
    ];
    result("FrequencyResponse", &columns.map(|(name, values)| (name, array(py, values))).into_py_dict(py)?)
}
