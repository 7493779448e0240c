//! `fit`: parameters of the model from recordings.

use std::path::{Path, PathBuf};
use std::time::Instant;

use host_io::choice::Choice;
use host_io::files::parameters::Parameters;
use host_io::files::recording::Recording;
use host_models::fit::options::Weight;
use host_models::fit::warnings::Severity;
use host_models::fit::{self as fitting, FitOptions, FitReport};
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
    let settings = asked.settings(start, actuator).raise()?;
    let direction = asked.drive;
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
    /// The choice of the option `name`, if it is given.
    fn chosen<T: Choice>(options: &Bound<'_, PyDict>, name: &str, default: T) -> PyResult<T> {
        given::<String>(options, name)?.map_or(Ok(default), |text| choice(name, &text))
    }
    let usual = FitOptions::default();
    let branches = options.get_item("branches")?.filter(|value| !value.is_none());
    let branches = branches.map(|number| PyResult::Ok(number.str()?.to_string())).transpose()?;
    Ok(FitOptions {
        branches: branches.map_or(Ok(usual.branches), |text| text.parse()).map_err(|cause: String| refused("branches", cause))?,
        topology: chosen(options, "topology", usual.topology)?,
        curve: chosen(options, "curve", usual.curve)?,
        method: chosen(options, "method", usual.method)?,
        drive: chosen(options, "drive", usual.drive)?,
        loss: chosen(options, "loss", usual.loss)?,
        offset: chosen(options, "offset", usual.offset)?,
        gain: chosen(options, "gain", usual.gain)?,
        at_gap: chosen(options, "at_gap", usual.at_gap)?,
        weights: match given(options, "weights")? {
            None => Vec::new(),
            Some(Weights::Word(word)) if word == "log-time" => vec![Weight::LogTime],
            Some(Weights::Word(word)) => return Err(refused("weights", format!("{word:?}; give numbers, or log-time"))),
            Some(Weights::Each(weights)) => weights.into_iter().map(Weight::Recording).collect(),
        },
        free: given(options, "free")?.unwrap_or_default(),
        hold: given(options, "hold")?.unwrap_or_default(),
        gap_s: given(options, "gap_s")?,
        invert: given(options, "invert")?.unwrap_or_default(),
        from_s: given(options, "from_s")?.unwrap_or(usual.from_s),
        to_s: given(options, "to_s")?,
        seed: given(options, "seed")?.unwrap_or(usual.seed),
        starts: given(options, "starts")?.unwrap_or(usual.starts),
    })
}

fn severity(severity: Severity) -> &'static str {
    match severity {
        Severity::Serious => "serious",
        Severity::Caution => "caution",
        Severity::Note => "note",
    }
}
