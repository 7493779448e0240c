//! `Actuator`: Eq. 1 and the weight.

use host_io::choice::Choice;
use host_io::files::parameters::plausibility;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use springpot::Actuator;

use crate::arrays::each;
use crate::errors::{doubt, refused};
use crate::names::choice;

/// An actuator: Eq. 1 and the weight, as the table `[actuator]` of a parameter file has them.
///
/// The defaults are the paper's: 40 mm x 60 mm active, 160 um thick (m), 316 g (kg). `preload` says when the weight acts: "settled"
/// (it has hung for minutes) or "from-start" (it is hung on at t = 0). `stretch_coupling` in 1/m, `saturation_v` in V or None.
///
/// Raises InputError for a size that no film has, such as millimetres read as metres, and warns of doubtful ones.
#[pyclass(frozen, eq, name = "Actuator", module = "springpot")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct PyActuator(pub(crate) Actuator);

#[pymethods]
impl PyActuator {
    #[new]
    #[pyo3(signature = (*, relative_permittivity=4.7, length_m=0.04, width_m=0.06, thickness_m=160e-6, mass_kg=0.316,
                        preload="settled", stretch_coupling=0.0, saturation_v=None))]
    fn new(
        py: Python<'_>,
        relative_permittivity: f64,
        length_m: f64,
        width_m: f64,
        thickness_m: f64,
        mass_kg: f64,
        preload: &str,
        stretch_coupling: f64,
        saturation_v: Option<f64>,
    ) -> PyResult<Self> {
        let actuator = Actuator {
            relative_permittivity,
            length_m,
            width_m,
            thickness_m,
            mass_kg,
            stretch_coupling,
            saturation_v,
            preload: choice("preload", preload)?,
        };
        plausibility::check(&actuator).map_err(|(_, cause)| refused("actuator", cause))?;
        doubt(py, &plausibility::doubts(&actuator, false))?;
        Ok(Self(actuator))
    }

    /// Relative permittivity of the film.
    #[getter]
    fn relative_permittivity(&self) -> f64 {
        self.0.relative_permittivity
    }

    /// One side of the active area, m.
    #[getter]
    fn length_m(&self) -> f64 {
        self.0.length_m
    }

    /// The other side of the active area, m.
    #[getter]
    fn width_m(&self) -> f64 {
        self.0.width_m
    }

    /// Thickness of the film, m.
    #[getter]
    fn thickness_m(&self) -> f64 {
        self.0.thickness_m
    }

    /// The weight that hangs on the film, kg.
    #[getter]
    fn mass_kg(&self) -> f64 {
        self.0.mass_kg
    }

    /// When the weight acts: settled or from-start.
    #[getter]
    fn preload(&self) -> &'static str {
        self.0.preload.name()
    }

    /// Growth of the force with displacement, 1/m.
    #[getter]
    fn stretch_coupling(&self) -> f64 {
        self.0.stretch_coupling
    }

    /// Voltage at which the force saturates, V; None for Eq. 1.
    #[getter]
    fn saturation_v(&self) -> Option<f64> {
        self.0.saturation_v
    }

    /// Force (N; the weight from t = 0 inside) at `voltage_v` (V; a number or an array) on a film displaced by `displacement_m` (m).
    #[pyo3(signature = (voltage_v, displacement_m=0.0))]
    fn force<'py>(&self, voltage_v: &Bound<'py, PyAny>, displacement_m: f64) -> PyResult<Bound<'py, PyAny>> {
        let actuator = self.0;
        each("voltage_v", voltage_v, move |v| actuator.force(v, displacement_m))
    }

    /// Voltage (V) that exerts `force_n` (N; a number or an array) on a film displaced by `displacement_m` (m).
    #[pyo3(signature = (force_n, displacement_m=0.0))]
    fn voltage<'py>(&self, force_n: &Bound<'py, PyAny>, displacement_m: f64) -> PyResult<Bound<'py, PyAny>> {
        let actuator = self.0;
        each("force_n", force_n, move |f| actuator.voltage(f, displacement_m))
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let named = PyDict::new(py);
        let Self(actuator) = self;
        for (name, value) in [
            ("relative_permittivity", actuator.relative_permittivity),
            ("length_m", actuator.length_m),
            ("width_m", actuator.width_m),
            ("thickness_m", actuator.thickness_m),
            ("mass_kg", actuator.mass_kg),
            ("stretch_coupling", actuator.stretch_coupling),
        ] {
            named.set_item(name, value)?;
        }
        named.set_item("saturation_v", actuator.saturation_v)?;
        named.set_item("preload", self.preload())?;
        Ok((PyTuple::empty(py), named))
    }

    fn __repr__(&self) -> String {
        let Actuator {
            relative_permittivity,
            length_m,
            width_m,
            thickness_m,
            mass_kg,
            stretch_coupling,
            saturation_v,
            ..
        } = self.0;
        let saturation = saturation_v.map_or_else(String::new, |volts| format!(", saturation_v={volts:?}"));
        format!(
            "Actuator(relative_permittivity={relative_permittivity:?}, length_m={length_m:?}, width_m={width_m:?}, \
             thickness_m={thickness_m:?}, mass_kg={mass_kg:?}, preload={:?}, stretch_coupling={stretch_coupling:?}{saturation})",
            self.preload()
        )
    }
}
