//! `Model`: what a parameter file holds.

use std::path::{Path, PathBuf};

use host_io::Error;
use host_io::choice::Choice;
use host_io::files::output::Staged;
use host_io::files::parameters::{ElasticCurve, Parameters};
use host_models::fit::check_recorded;
use pyo3::prelude::*;
use springpot::{Discretisation, Maxwell, Preset, Springpot};

use crate::actuator::PyActuator;
use crate::arrays::{each, finite};
use crate::errors::{Raise, doubt};
use crate::names::choice;

/// A springpot as it is written: c in N·s^α/m, and α.
type Element = (f64, f64);

/// A model with its actuator and its sensor's offset: what a parameter file holds. It does not change once made.
///
/// `main` and both elements of every branch are springpots (c, alpha): c in N s^alpha/m, greater than 0, alpha from 0 to 1. There are
/// at most 5 branches. `topology` is "parallel" (the generalised Maxwell model) or "eq11" (as published). The mass is the actuator's; without
/// an `actuator` it is the paper's. `sensor_offset_m` is what the displacement sensor reads at rest, m.
///
/// Raises InputError for an element that is refused.
#[pyclass(frozen, eq, name = "Model", module = "springpot")]
#[derive(Clone, PartialEq)]
pub(crate) struct PyModel {
    pub(crate) parameters: Parameters,
    /// Its name in errors: a file, `preset:NAME`, or its name.
    pub(crate) source: String,
}

impl PyModel {
    /// The model that `parameters` describe, which came from `source`.
    pub(crate) fn new_from(parameters: Parameters, source: impl Into<String>) -> Self {
        Self { parameters, source: source.into() }
    }

    /// The parameters, stepped by the method of that name.
    pub(crate) fn with_method(&self, method: &str) -> PyResult<Parameters> {
        Ok(self.parameters.clone().with_method(choice("method", method)?))
    }
}

#[pymethods]
impl PyModel {
    #[new]
    #[pyo3(signature = (main, branches=Vec::new(), *, topology="parallel", actuator=None, sensor_offset_m=0.0, name="model"))]
    fn new(
        main: Element,
        branches: Vec<(Element, Element)>,
        topology: &str,
        actuator: Option<&Bound<'_, PyActuator>>,
        sensor_offset_m: f64,
        name: &str,
    ) -> PyResult<Self> {
        let actuator = actuator.map_or(springpot::Actuator::KARNER_2022, |actuator| actuator.get().0);
        finite("sensor_offset_m", sensor_offset_m)?;
        let springpot = |(c, alpha): Element| Springpot::new(c, alpha);
        let branches: Vec<[Springpot; 2]> = branches.into_iter().map(|(a, b)| [springpot(a), springpot(b)]).collect();
        let model = Maxwell::new(springpot(main), &branches, choice("topology", topology)?, actuator.mass_kg)
            .map_err(host_io::Error::from)
            .raise()?;
        let parameters = Parameters {
            name: name.into(),
            actuator,
            assumed_sizes: false,
            model,
            curve: None,
            spring: None,
            temperature: None,
            method: Discretisation::Gl,
            sensor_offset_m,
            sensor_delay_s: 0.0,
            board: None,
            provenance: None,
        };
        Ok(Self::new_from(parameters, name))
    }

    /// Reads parameters from TOML text; errors call it `source`.
    ///
    /// Raises FileError naming the line that cannot be used.
    #[staticmethod]
    #[pyo3(signature = (text, source="model"))]
    fn from_toml(text: &str, source: &str) -> PyResult<Self> {
        let parameters = Parameters::from_toml(Path::new(source), text).raise()?;
        Ok(Self::new_from(parameters, source))
    }

    /// The parameters as TOML text.
    fn to_toml(&self) -> String {
        self.parameters.to_toml()
    }

    /// Name of the set.
    #[getter]
    fn name(&self) -> &str {
        &self.parameters.name
    }

    /// How the branches are connected: parallel or eq11.
    #[getter]
    fn topology(&self) -> &'static str {
        self.parameters.model.topology().name()
    }

    /// The springpot beside the branches: c in N s^alpha/m, and alpha.
    #[getter]
    fn main(&self) -> Element {
        written(self.parameters.model.main())
    }

    /// The branches, two springpots each.
    #[getter]
    fn branches(&self) -> Vec<(Element, Element)> {
        self.parameters.model.branches().iter().map(|&[first, second]| (written(first), written(second))).collect()
    }

    /// The actuator.
    #[getter]
    fn actuator(&self) -> PyActuator {
        PyActuator(self.parameters.actuator)
    }

    /// Reading of the displacement sensor at rest, m.
    #[getter]
    fn sensor_offset_m(&self) -> f64 {
        self.parameters.sensor_offset_m
    }

    /// Whether length, width and thickness are assumed, not the film's own.
    #[getter]
    fn sizes_assumed(&self) -> bool {
        self.parameters.assumed_sizes
    }

    /// Kind of the elastic curve: mooney-rivlin, gent, measure or free; None for a linear film.
    #[getter]
    fn curve(&self) -> Option<&'static str> {
        self.parameters.curve.as_ref().map(ElasticCurve::name)
    }

    /// Where the film has a spring: "beside" the memory, whose strain measure then is the curve, or "in series" with it; None without one.
    #[getter]
    fn spring(&self) -> Option<&'static str> {
        let Parameters { curve, spring, .. } = &self.parameters;
        spring.as_ref().map(|_| if curve.is_some() { "beside" } else { "in series" })
    }

    /// The temperature of the parameters, °C; None for a film that was not fitted at several.
    #[getter]
    fn reference_c(&self) -> Option<f64> {
        self.parameters.temperature.map(|dependence| dependence.reference_c)
    }

    /// The film at `temperature_c` (°C), for one that was fitted at several.
    ///
    /// Raises InputError for another film, and for a temperature that its dependence does not reach.
    fn at_temperature(&self, temperature_c: f64) -> PyResult<Self> {
        Ok(Self::new_from(self.parameters.at_temperature(temperature_c).raise()?, self.source.as_str()))
    }

    /// Force (N/m) left after `time_s` (s; a number or an array) per metre of a step of displacement; without the mass and the curve.
    ///
    /// NaN for times that are not positive.
    fn relaxation_modulus<'py>(&self, time_s: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let model = &self.parameters.model;
        each("time_s", time_s, |t| model.relaxation_modulus(t))
    }

    /// Displacement (m/N) after `time_s` (s; a number or an array) per newton of a step of force; without the mass and the curve.
    ///
    /// NaN for times that are not positive.
    fn creep_compliance<'py>(&self, time_s: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let model = &self.parameters.model;
        each("time_s", time_s, |t| model.creep_compliance(t))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String, String))> {
        let from_toml = py.get_type::<Self>().getattr("from_toml")?;
        Ok((from_toml, (self.to_toml(), self.source.clone())))
    }

    fn __repr__(&self) -> String {
        let model = &self.parameters.model;
        format!("<springpot.Model {:?}: {} with n = {}>", self.name(), self.topology(), model.branches().len())
    }
}

fn written(element: Springpot) -> Element {
    (element.c, element.alpha)
}

/// Reads a parameter file (TOML), or the published parameters `preset:NAME`.
///
/// Raises FileError naming the file and the line, InputError for a preset that there is not.
#[pyfunction]
pub(crate) fn load(py: Python<'_>, path: PathBuf) -> PyResult<PyModel> {
    let name = path.to_string_lossy();
    let parameters = Parameters::load(&name).raise()?;
    check_recorded(&parameters).map_err(|cause| Error::file(&path, cause)).raise()?;
    doubt(py, &parameters.doubts())?;
    Ok(PyModel::new_from(parameters, name))
}

/// Writes `model` as a parameter file (TOML), whole or not at all.
///
/// Raises FileError where it cannot be written.
#[pyfunction]
pub(crate) fn save(model: &Bound<'_, PyModel>, path: PathBuf) -> PyResult<()> {
    let text = model.get().to_toml();
    Staged::new(&path, |file| file.write_all(text.as_bytes())).and_then(Staged::commit).raise()
}

/// Names of the published parameters, for `load`.
#[pyfunction]
pub(crate) fn presets() -> Vec<String> {
    Preset::ALL.iter().map(|preset| format!("preset:{}", preset.name())).collect()
}
