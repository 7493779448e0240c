//! Recordings and references through a model, as the commands of the same names run them.

use std::collections::HashMap;

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
use pyo3::types::PyDict;
use serde_json::json;

use crate::arrays::array;
use crate::control::limits;
use crate::errors::{Raise, refused};
use crate::model::PyModel;
use crate::names::choice;
use crate::recording::PyRecording;
use crate::watch;

/// The options of a run by their names.
fn run_options(rate_hz: f64, memory: &str, precision: &str) -> PyResult<RunOptions> {
    let memory = memory.parse::<MemoryChoice>().map_err(|cause| refused("memory", cause))?;
    Ok(RunOptions { rate_hz, memory, precision: choice("precision", precision)? })
}

/// The columns of a response, for `springpot.Response`.
fn columns<'py>(py: Python<'py>, rate_hz: f64, time_s: Vec<f64>, response: Response) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    columns.set_item("time_s", array(py, time_s))?;
    columns.set_item("voltage_v", response.voltage_v.map(|volts| array(py, volts)))?;
    columns.set_item("force_n", array(py, response.force_n))?;
    columns.set_item("displacement_m", array(py, response.displacement_m))?;
    columns.set_item("rate_hz", rate_hz)?;
    Ok(columns)
}

/// `springpot.simulate`.
#[pyfunction]
pub(crate) fn simulate<'py>(
    model: &Bound<'py, PyModel>,
    recording: &Bound<'py, PyRecording>,
    rate_hz: f64,
    memory: &str,
    precision: &str,
    method: &str,
    drive: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let py = model.py();
    let options = run_options(rate_hz, memory, precision)?;
    let direction: Direction = choice("drive", drive)?;
    let parameters = model.get().with_method(method)?;
    let (source, recording) = (&model.get().source, &recording.get().recording);
    let (grid, response) = watch::run(py, None, |caller| {
        let grid = recording.grid(options.rate_hz)?;
        let input = match direction {
            Direction::Force => recording.drive()?,
            Direction::Displacement => recording.displacement_drive()?,
        };
        let response = run::response(&parameters, &input, grid, &options, caller);
        Ok((grid, response.map_err(|e| e.about(source, recording.path()))?))
    })?;
    columns(py, grid.rate_hz, grid.times_s(), response)
}

/// The result of `replay`: the mean of R², and for every recording its agreement and series.
type Replayed<'py> = (f64, Vec<Bound<'py, PyDict>>);

/// `springpot.replay`.
#[pyfunction]
pub(crate) fn replay<'py>(
    model: &Bound<'py, PyModel>,
    recordings: Vec<Bound<'py, PyRecording>>,
    drive: &str,
    rate_hz: f64,
    memory: &str,
    precision: &str,
    method: &str,
) -> PyResult<Replayed<'py>> {
    let py = model.py();
    let options = run_options(rate_hz, memory, precision)?;
    let direction: Direction = choice("drive", drive)?;
    let parameters = model.get().with_method(method)?;
    let source = &model.get().source;
    let sources: Vec<_> = recordings.iter().map(|recording| &recording.get().recording).collect();
    if sources.is_empty() {
        return Err(refused("recordings", "none is given"));
    }
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
    let rows = sources.iter().zip(replayed).map(|(recording, (grid, response, agreement, measured, modelled))| {
        let row = PyDict::new(py);
        row.set_item("file", host_io::error::shown(recording.path()))?;
        row.set_item("r2", agreement.r2)?;
        row.set_item("nrmse_pct", agreement.nrmse_pct)?;
        row.set_item("rmse", agreement.rmse)?;
        row.set_item("samples", agreement.samples)?;
        row.set_item("time_s", array(py, measured.time_s))?;
        row.set_item("measured", array(py, measured.value))?;
        row.set_item("modelled", array(py, modelled))?;
        row.set_item("response", columns(py, grid.rate_hz, grid.times_s(), response)?)?;
        Ok(row)
    });
    Ok((mean_r2(&agreements), rows.collect::<PyResult<Vec<_>>>()?))
}

/// `springpot.feedforward`: the columns, and what the command reports of them.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // of Python's own
pub(crate) fn feedforward<'py>(
    model: &Bound<'py, PyModel>,
    reference: &Bound<'py, PyRecording>,
    rate_hz: f64,
    memory: &str,
    precision: &str,
    method: &str,
    limits: Option<HashMap<String, f64>>,
) -> PyResult<Bound<'py, PyDict>> {
    let py = model.py();
    let options = run_options(rate_hz, memory, precision)?;
    let limits = self::limits(limits, model.get())?;
    let parameters = model.get().with_method(method)?;
    let (source, recording) = (&model.get().source, &reference.get().recording);
    let (grid, plan) = watch::run(py, None, |caller| {
        let (values, grid) = references::on_grid(recording, options.rate_hz)?;
        let plan = planned::plan(&parameters, &values, grid, &options, limits, caller);
        Ok((grid, plan.map_err(|e| e.about(source, recording.path()))?))
    })?;
    let limited: Vec<u8> = plan.limited.iter().map(|limited| limited.bits()).collect();
    let met: Vec<(&str, f64)> =
        LimitShare::from_limited(&plan.limited).into_iter().map(|met| (met.limit, met.pct)).collect();
    let columns = PyDict::new(py);
    columns.set_item("time_s", array(py, grid.times_s()))?;
    columns.set_item("voltage_v", array(py, plan.voltage_v))?;
    columns.set_item("displacement_m", array(py, plan.displacement_m))?;
    columns.set_item("reference_m", array(py, plan.reference_m))?;
    columns.set_item("limited", PyArray1::from_vec(py, limited))?;
    columns.set_item("limits_met", met)?;
    columns.set_item("rate_hz", grid.rate_hz)?;
    Ok(columns)
}

/// `springpot.check_reference`: as JSON.
#[pyfunction]
pub(crate) fn check_reference(
    model: &Bound<'_, PyModel>,
    reference: &Bound<'_, PyRecording>,
    rate_hz: f64,
    method: &str,
    limits: Option<HashMap<String, f64>>,
) -> PyResult<String> {
    let py = model.py();
    let limits = self::limits(limits, model.get())?;
    let parameters = model.get().with_method(method)?;
    let (source, recording) = (&model.get().source, &reference.get().recording);
    let found = watch::run(py, None, |_| {
        let (values, grid) = references::on_grid(recording, rate_hz)?;
        let found = feasibility::check_and_mend(&parameters, &values, grid, &limits);
        found.map_err(|e| e.about(source, recording.path()))
    })?;
    Ok(json!(found).to_string())
}

/// `springpot.observe`: the columns, and the summary of the command.
#[pyfunction]
pub(crate) fn observe<'py>(
    model: &Bound<'py, PyModel>,
    recording: &Bound<'py, PyRecording>,
    rate_hz: f64,
    bandwidth_hz: f64,
    adaptation_s: f64,
    precision: &str,
    method: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let py = model.py();
    let tuning = Tuning::new(bandwidth_hz, adaptation_s).raise()?;
    let precision: Precision = choice("precision", precision)?;
    let parameters = model.get().with_method(method)?;
    let (source, recording) = (&model.get().source, &recording.get().recording);
    let (observed, estimates) = watch::run(py, None, |caller| {
        let observed = ObservedRecording::from_recording(recording, rate_hz)?;
        let estimates = observed.estimate(&parameters, tuning, precision, caller);
        Ok((observed, estimates.map_err(|e| e.about(source, recording.path()))?))
    })?;
    let summary = estimates.summary();
    let columns = PyDict::new(py);
    for (name, values) in [
        ("time_s", observed.grid.times_s()),
        ("voltage_v", observed.voltage_v),
        ("displacement_m", estimates.displacement_m),
        ("sample_m", estimates.sample_m),
        ("disturbance_n", estimates.disturbance_n),
        ("force_scale", estimates.force_scale),
        ("innovation_m", estimates.innovation_m),
        ("innovation_mean_m", estimates.innovation_mean_m),
        ("innovation_std_m", estimates.innovation_std_m),
    ] {
        columns.set_item(name, array(py, values))?;
    }
    columns.set_item("samples", summary.samples)?;
    columns.set_item("innovation_rms_m", summary.innovation_rms_m)?;
    Ok(columns)
}

/// `springpot.frequency_response`: frequencies, magnitudes and phases.
#[pyfunction]
pub(crate) fn frequency_response<'py>(
    model: &Bound<'py, PyModel>,
    from_hz: f64,
    to_hz: f64,
    points: usize,
    at_m: f64,
    law_hz: Option<f64>,
) -> PyResult<[Bound<'py, PyArray1<f64>>; 3]> {
    let py = model.py();
    let sweep = Sweep { from_hz, to_hz, points, at_m, law_hz };
    let (source, parameters) = (&model.get().source, &model.get().parameters);
    let response = watch::run(py, None, |_| sweep.run(parameters).map_err(|e| e.about(source, source.as_ref())))?;
    Ok([response.frequency_hz, response.magnitude_m_per_n, response.phase_rad].map(|values| array(py, values)))
}
