//! `fit`: parameters of the model from recordings.

use std::path::{Path, PathBuf};
use std::time::Instant;

use host_io::files::parameters::Parameters;
use host_io::files::recording::{Direction, Recording};
use host_io::grid::Samples;
use host_models::fit::options::{Branches as Asked, Weight};
use host_models::fit::{self as fitting, Fit, FitOptions, FitReport, Severity};
use pyo3::prelude::*;
use serde_json::json;
use springpot::Actuator;

use crate::actuator::PyActuator;
use crate::arrays::{array, count};
use crate::errors::{Raise, refused, with_arguments};
use crate::model::PyModel;
use crate::names::choice;
use crate::{replay, watch};

/// A number of branches, or a word.
#[derive(FromPyObject)]
pub(crate) enum Branches {
    Word(String),
    Number(i128),
}

impl Branches {
    fn number(self) -> PyResult<Asked> {
        let text = match self {
            Self::Word(word) => word,
            Self::Number(number) => number.to_string(),
        };
        text.parse().map_err(|cause: String| refused("branches", cause))
    }
}

/// A weight of every recording, or a word.
#[derive(FromPyObject)]
pub(crate) enum Weights {
    Word(String),
    Each(Vec<f64>),
}

impl Weights {
    fn each(self) -> PyResult<Vec<Weight>> {
        match self {
            Self::Word(word) if word == "log-time" => Ok(vec![Weight::LogTime]),
            Self::Word(word) => Err(refused("weights", format!("{word:?}; give numbers, or log-time"))),
            Self::Each(weights) => Ok(weights.into_iter().map(Weight::Recording).collect()),
        }
    }
}

/// An actuator, or where one is to be found.
#[derive(FromPyObject)]
pub(crate) enum ActuatorSource<'py> {
    Actuator(Bound<'py, PyActuator>),
    Model(Bound<'py, PyModel>),
    File(PathBuf),
}

impl ActuatorSource<'_> {
    /// The actuator, and whether its sizes are assumed.
    pub(crate) fn sized(&self) -> host_io::Result<(Actuator, bool)> {
        match self {
            Self::Actuator(actuator) => Ok((actuator.get().0, false)),
            Self::Model(model) => Ok((model.get().parameters.actuator, model.get().parameters.assumed_sizes)),
            Self::File(path) => Parameters::load_sized_actuator(&path.to_string_lossy()),
        }
    }
}

/// The parameters of a model from `recordings`, jointly; every option is that of the command `fit`.
///
/// Without `actuator` the paper's sizes are assumed, and a warning says so. `start` gives branches and topology.
///
/// `progress` is called with every stage as it begins, on the thread of the caller. If it returns False the search ends with the best so far
/// (`interrupted`); what it raises ends the search and is raised. Ctrl-C raises KeyboardInterrupt.
///
/// Raises FileError for a recording that cannot be fitted, InputError for an option that cannot be used, ComputationError where no start leads
/// to a fit.
#[pyfunction]
#[pyo3(signature = (recordings, *, branches=None, topology="auto", curve="auto", method="lm", drive="force", free=Vec::new(),
                    hold=Vec::new(), actuator=None, start=None, loss="square", weights=None, offset="joint", gain="joint", sensor_delay_s=None, gap_s=None,
                    at_gap="end", invert=false, from_s=0.0, to_s=None, seed=1, starts=8, progress=None))]
pub(crate) fn fit<'py>(
    py: Python<'py>,
    recordings: &Bound<'py, PyAny>,
    branches: Option<Branches>,
    topology: &str,
    curve: &str,
    method: &str,
    drive: &str,
    free: Vec<String>,
    hold: Vec<String>,
    actuator: Option<ActuatorSource<'py>>,
    start: Option<Bound<'py, PyModel>>,
    loss: &str,
    weights: Option<Weights>,
    offset: &str,
    gain: &str,
    sensor_delay_s: Option<f64>,
    gap_s: Option<f64>,
    at_gap: &str,
    invert: bool,
    from_s: f64,
    to_s: Option<f64>,
    seed: i128,
    starts: i128,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let options = FitOptions {
        branches: branches.map_or(Ok(Asked::Auto), Branches::number)?,
        topology: choice("topology", topology)?,
        curve: choice("curve", curve)?,
        method: choice("method", method)?,
        drive: choice("drive", drive)?,
        free,
        hold,
        loss: choice("loss", loss)?,
        weights: weights.map_or(Ok(Vec::new()), Weights::each)?,
        offset: choice("offset", offset)?,
        gain: choice("gain", gain)?,
        sensor_delay_s,
        gap_s,
        at_gap: choice("at_gap", at_gap)?,
        invert,
        from_s,
        to_s,
        seed: count("seed", seed)?,
        starts: count("starts", starts)?,
    };
    let given = [("actuator", actuator.is_some()), ("branches", options.branches != Asked::Auto)];
    if let (Some(_), Some((name, _))) = (&start, given.into_iter().find(|(_, given)| *given)) {
        return Err(refused("start", format!("gives {name} as well; leave one of them out")));
    }
    let actuator = actuator.map(|actuator| actuator.sized()).transpose().raise()?;
    let settings = options.settings(start.map(|model| model.get().parameters.clone()), actuator).raise()?;
    let recordings = replay::recordings(recordings)?;
    let sources: Vec<&Recording> = recordings.iter().map(|recording| &recording.get().recording).collect();
    let direction = options.drive;
    let (fit, measured, parameters, seconds) = watch::run(py, progress, |caller| {
        let started = Instant::now();
        let (observations, warnings): (Vec<_>, Vec<_>) = options.observations(&sources)?.into_iter().unzip();
        let mut fit = fitting::fit(&observations, &settings, caller.stop, &|stage| caller.report(stage))?;
        fit.warnings.splice(0..0, warnings.into_iter().flatten());
        let seconds = started.elapsed().as_secs_f64();
        let parameters = fit.parameters(&settings, direction, &sources)?;
        let measured: Vec<_> = observations.into_iter().map(|observation| observation.measured).collect();
        Ok((fit, measured, parameters, seconds))
    })?;
    let sources: Vec<&Path> = sources.iter().map(|recording| recording.path()).collect();
    result(py, fit, measured, parameters, &FitRun { direction, sources: &sources, seconds })
}

/// The recordings of a fit, and its duration.
struct FitRun<'a> {
    direction: Direction,
    sources: &'a [&'a Path],
    seconds: f64,
}

/// The `FitResult` of a fit.
fn result<'py>(
    py: Python<'py>,
    mut fit: Fit,
    measured: Vec<Samples>,
    parameters: Parameters,
    run: &FitRun<'_>,
) -> PyResult<Bound<'py, PyAny>> {
    fit.warnings.iter_mut().for_each(|warning| warning.text = with_arguments(&warning.text));
    let report = json!(FitReport::new(&fit, &parameters, run.direction, run.sources, run.seconds)).to_string();
    let severities: Vec<&str> = fit.warnings.iter().map(|warning| severity(warning.severity)).collect();
    let series: Vec<_> = measured
        .into_iter()
        .zip(fit.modelled)
        .map(|(measured, modelled)| [measured.time_s, measured.value, modelled].map(|values| array(py, values)))
        .collect();
    let name = parameters.name.clone();
    let class = py.import("springpot.results")?.getattr("FitResult")?;
    class.call_method1("_from_report", (PyModel::new_from(parameters, name), report, series, severities))
}

fn severity(severity: Severity) -> &'static str {
    match severity {
        Severity::Serious => "serious",
        Severity::Caution => "caution",
        Severity::Note => "note",
    }
}
