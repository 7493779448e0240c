//! `fit`: parameters of the model from recordings.

use std::path::{Path, PathBuf};
use std::time::Instant;

use host_io::files::parameters::Parameters;
use host_io::files::recording::{Direction, Recording};
use host_models::fit::options::{self, AtGap, Sharing, TopologyChoice, Weight};
use host_models::fit::warnings::Severity;
use host_models::fit::{self as fitting, FitOptions, FitReport, Loss, Method};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use springpot::Actuator;

use crate::actuator::PyActuator;
use crate::arrays::array;
use crate::errors::{Raise, refused, with_arguments};
use crate::model::PyModel;
use crate::names::choice;
use crate::recording::PyRecording;
use crate::watch;

/// A weight of every recording, or a word.
#[derive(FromPyObject)]
pub(crate) enum Weights {
    Word(String),
    Each(Vec<f64>),
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
    fn sized(&self) -> host_io::Result<(Actuator, bool)> {
        match self {
            Self::Actuator(actuator) => Ok((actuator.get().0, false)),
            Self::Model(model) => Ok((model.get().parameters.actuator, model.get().parameters.assumed_sizes)),
            Self::File(path) => Parameters::load_sized_actuator(&path.to_string_lossy()),
        }
    }
}

/// The series of a recording for the result: times, what was measured, what the model gives.
type Series<'py> = [Bound<'py, numpy::PyArray1<f64>>; 3];

/// The model, the report as JSON, the series of every recording, and how much every warning matters.
type Fitted<'py> = (PyModel, String, Vec<Series<'py>>, Vec<&'static str>);

/// `springpot.fit`.
#[pyfunction]
pub(crate) fn fit<'py>(
    py: Python<'py>,
    recordings: Vec<Bound<'py, PyRecording>>,
    options: &Bound<'py, PyDict>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Fitted<'py>> {
    let sources: Vec<&Recording> = recordings.iter().map(|recording| &recording.get().recording).collect();
    if sources.is_empty() {
        return Err(refused("recordings", "none is given"));
    }
    let actuator: Option<ActuatorSource<'_>> = given(options, "actuator")?;
    let actuator = actuator.map(|actuator| actuator.sized()).transpose().raise()?;
    let start: Option<Bound<'_, PyModel>> = given(options, "start")?;
    if let (Some(_), Some(name)) = (&start, ["actuator", "branches"].into_iter().find(|name| is_given(options, name))) {
        return Err(refused("start", format!("gives {name} as well; leave one of them out")));
    }
    let start = start.map(|model| model.get().parameters.clone());
    let asked = asked(options)?;
    let settings = asked.settings_with(start, actuator).raise()?;
    let direction = asked.direction();
    let (mut fit, measured, parameters, seconds) = watch::run(py, progress, |caller| {
        let started = Instant::now();
        let (observations, warnings): (Vec<_>, Vec<_>) = asked.observations(&sources)?.into_iter().unzip();
        let mut fit = fitting::fit(&observations, &settings, caller.stop, &|stage| caller.report(stage))?;
        fit.warnings.splice(0..0, warnings.into_iter().flatten());
        let seconds = started.elapsed().as_secs_f64();
        let parameters = fit.parameters(&settings, direction, &sources)?;
        let measured: Vec<_> = observations.into_iter().map(|observation| observation.measured).collect();
        Ok((fit, measured, parameters, seconds))
    })?;
    fit.warnings.iter_mut().for_each(|warning| warning.text = with_arguments(&warning.text));
    let files: Vec<&Path> = sources.iter().map(|recording| recording.path()).collect();
    let report = json!(FitReport::new(&fit, &parameters, direction, &files, seconds)).to_string();
    let severities = fit.warnings.iter().map(|warning| severity(warning.severity)).collect();
    let series = measured.into_iter().zip(fit.modelled);
    let series = series.map(|(measured, modelled)| [measured.time_s, measured.value, modelled].map(|v| array(py, v)));
    let name = parameters.name.clone();
    Ok((PyModel::new_from(parameters, name), report, series.collect(), severities))
}

/// The value of the option `name`, if there is one.
fn given<'py, T: FromPyObjectOwned<'py>>(options: &Bound<'py, PyDict>, name: &str) -> PyResult<Option<T>> {
    match options.get_item(name)?.filter(|value| !value.is_none()) {
        Some(value) => match value.extract::<T>() {
            Ok(value) => Ok(Some(value)),
            Err(error) => {
                let error: PyErr = error.into();
                Err(refused(name, error.value(options.py())))
            }
        },
        None => Ok(None),
    }
}

fn is_given(options: &Bound<'_, PyDict>, name: &str) -> bool {
    options.get_item(name).is_ok_and(|value| value.is_some_and(|value| !value.is_none()))
}

/// The options of the command, each under its name.
fn asked(options: &Bound<'_, PyDict>) -> PyResult<FitOptions> {
    let mut asked = FitOptions::default();
    if let Some(number) = options.get_item("branches")?.filter(|value| !value.is_none()) {
        asked.branches = options::branches(&number.str()?.to_string()).map_err(|cause| refused("branches", cause))?;
    }
    let word = |name: &str| given::<String>(options, name);
    if let Some(text) = word("topology")? {
        asked.topology = choice::<TopologyChoice>("topology", &text)?;
    }
    if let Some(text) = word("curve")? {
        asked.curve = choice("curve", &text)?;
    }
    if let Some(text) = word("method")? {
        asked.method = choice::<Method>("method", &text)?;
    }
    if let Some(text) = word("drive")? {
        asked.drive = choice::<Direction>("drive", &text)?;
    }
    if let Some(text) = word("loss")? {
        asked.loss = choice::<Loss>("loss", &text)?;
    }
    for (name, sharing) in [("offset", &mut asked.offset), ("gain", &mut asked.gain)] {
        if let Some(text) = word(name)? {
            *sharing = choice::<Sharing>(name, &text)?;
        }
    }
    if let Some(text) = word("at_gap")? {
        asked.at_gap = choice::<AtGap>("at_gap", &text)?;
    }
    asked.weights = match given(options, "weights")? {
        None => Vec::new(),
        Some(Weights::Word(word)) if word == "log-time" => vec![Weight::LogTime],
        Some(Weights::Word(word)) => return Err(refused("weights", format!("{word:?}; give numbers, or log-time"))),
        Some(Weights::Each(weights)) => weights.into_iter().map(Weight::Recording).collect(),
    };
    asked.free = given(options, "free")?.unwrap_or_default();
    asked.hold = given(options, "hold")?.unwrap_or_default();
    asked.gap = given(options, "gap_s")?;
    asked.invert = given(options, "invert")?.unwrap_or_default();
    asked.from = given(options, "from_s")?.unwrap_or(asked.from);
    asked.to = given(options, "to_s")?;
    asked.seed = given(options, "seed")?.unwrap_or(asked.seed);
    asked.starts = given(options, "starts")?.unwrap_or(asked.starts);
    Ok(asked)
}

fn severity(severity: Severity) -> &'static str {
    match severity {
        Severity::Serious => "serious",
        Severity::Caution => "caution",
        Severity::Note => "note",
    }
}
