//! `compare` and `reduce`: other models of creep on the same recordings, and smaller models with the same response.

use host_io::files::recording::{Direction, Recording};
use host_io::quantity::positive;
use host_models::fit::Settings;
use host_models::fit::observation::{Observation, observe_prepared};
use host_models::fit::preparation::{Preparation, Window};
use host_models::fit::settings::{assumed_actuator, checked_starts};
use host_models::reduce::{Criterion, reduced_parameters};
use host_models::studies::compare as study;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::count;
use crate::errors::Raise;
use crate::fit::ActuatorSource;
use crate::model::PyModel;
use crate::names::choice;
use crate::replay::{self, result};
use crate::watch;

/// Other models of creep, fitted to the same `recordings`: springs and dashpots, springpots, Prandtl-Ishlinskii.
///
/// With `to_s` (s) they are fitted up to there and predict the rest. Arguments and errors as `fit`. As the command `compare`.
#[pyfunction]
#[pyo3(signature = (recordings, *, drive="force", actuator=None, to_s=None, seed=1, starts=8, progress=None))]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    recordings: &Bound<'py, PyAny>,
    drive: &str,
    actuator: Option<ActuatorSource<'py>>,
    to_s: Option<f64>,
    seed: i128,
    starts: i128,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let drive: Direction = choice("drive", drive)?;
    let starts = count("starts", starts)?;
    checked_starts(starts).raise()?;
    to_s.map_or(Ok(()), |to_s| positive("to_s", to_s)).raise()?;
    let actuator = match actuator {
        Some(actuator) => actuator.sized().raise()?.0,
        None => assumed_actuator(drive),
    };
    let settings = Settings { seed: count("seed", seed)?, starts, actuator, ..Settings::default() };
    let recordings = replay::recordings(recordings)?;
    let sources: Vec<&Recording> = recordings.iter().map(|recording| &recording.get().recording).collect();
    let rows = watch::run(py, progress, |caller| {
        let within = |window| -> host_io::Result<Vec<Observation>> {
            let preparation = Preparation { window, ..Preparation::NONE };
            sources.iter().map(|recording| Ok(observe_prepared(recording, drive, 1.0, preparation)?.0)).collect()
        };
        let (fitted, beyond) = match to_s {
            None => (within(Window::ALL)?, Vec::new()),
            Some(to_s) => (within(Window { to_s, ..Window::ALL })?, within(Window { from_s: to_s, ..Window::ALL })?),
        };
        study::compare(&fitted, &beyond, &settings, caller.stop, &|stage| caller.report(stage))
    })?;
    let row = |row: study::ModelRow| {
        let fields = PyDict::new(py);
        fields.set_item("model", row.model)?;
        fields.set_item("family", row.family)?;
        fields.set_item("parameters", row.parameters)?;
        fields.set_item("r2_mean", row.r2_mean)?;
        fields.set_item("nrmse_pct", row.nrmse_pct)?;
        fields.set_item("left_out_nrmse_pct", row.left_out_nrmse_pct)?;
        fields.set_item("beyond_pct", row.beyond_pct)?;
        fields.set_item("step_ns", row.step_ns)?;
        result("ComparedModel", &fields)
    };
    rows.into_iter().map(row).collect()
}

/// The smallest model found whose dynamic modulus differs from that of `model` by less than the share `tolerance` from `from_hz` to `to_hz` (Hz).
///
/// As the command `reduce`. Raises InputError for a band or a tolerance that makes no sense.
#[pyfunction]
#[pyo3(signature = (model, *, from_hz=1e-6, to_hz=1e4, tolerance=1e-9))]
pub(crate) fn reduce<'py>(
    model: &Bound<'py, PyModel>,
    from_hz: f64,
    to_hz: f64,
    tolerance: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let py = model.py();
    let source = &model.get().parameters;
    let (parameters, reduction) =
        watch::run(py, None, |_| reduced_parameters(source, Criterion { from_hz, to_hz, tolerance }))?;
    let fields = PyDict::new(py);
    let name = parameters.name.clone();
    fields.set_item("model", PyModel::new_from(parameters, name).into_pyobject(py)?)?;
    fields.set_item("steps", reduction.steps)?;
    fields.set_item("largest_change", reduction.change)?;
    result("Reduction", &fields)
}
