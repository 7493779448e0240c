//! `Law` and `LawState`: the step of the controller, sample by sample or along an array.

use std::sync::Mutex;

use host_io::choice::Choice;
use host_models::replay::memory::Precision;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};
use springpot::{Law, LawState, Scalar};

use crate::arrays::{each_complex, finite, locked, steps};
use crate::errors::{Raise, refused};
use crate::model::PyModel;
use crate::names::choice;

/// `$body` with what `$any` holds, in either arithmetic.
macro_rules! either {
    ($any:expr, $kind:ident($($held:pat),+) => $body:expr) => {
        match $any {
            $kind::F32($($held),+) => $body,
            $kind::F64($($held),+) => $body,
        }
    };
}

/// A law in the arithmetic of the controller, or in twice as many digits.
#[allow(clippy::large_enum_variant)] // a handful live at a time
enum AnyLaw {
    F32(Law<f32>),
    F64(Law<f64>),
}

/// The state of such a law.
#[allow(clippy::large_enum_variant)] // a handful live at a time
enum AnyState {
    F32(Law<f32>, Mutex<LawState<f32>>),
    F64(Law<f64>, Mutex<LawState<f64>>),
}

/// The law of a model at `rate_hz` steps per second: what a controller steps, in constant time and memory. It does not change.
///
/// `precision` is "f32" (the bits of the controller) or "f64"; `method` is "gl" (of first order, as in the paper) or "bdf2" (of second).
///
/// Raises InputError for a rate or a model that is refused.
#[pyclass(frozen, name = "Law", module = "springpot")]
pub(crate) struct PyLaw {
    law: AnyLaw,
    /// Its model, with the method.
    model: PyModel,
    rate_hz: f64,
}

#[pymethods]
impl PyLaw {
    #[new]
    #[pyo3(signature = (model, rate_hz, *, method="gl", precision="f32"))]
    fn new(py: Python<'_>, model: &Bound<'_, PyModel>, rate_hz: f64, method: &str, precision: &str) -> PyResult<Self> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(refused("rate_hz", format!("{rate_hz:?} Hz must be finite and greater than 0")));
        }
        let model = model.get();
        let model = PyModel::new_from(model.with_method(method)?, model.source.as_str());
        let (parameters, source) = (&model.parameters, &model.source);
        let precision = choice("precision", precision)?;
        let built = py.detach(|| match precision {
            Precision::F32 => parameters.film().compressed_law(rate_hz).map(AnyLaw::F32),
            Precision::F64 => parameters.film().compressed_law(rate_hz).map(AnyLaw::F64),
        });
        let law = built.map_err(|e| e.about(source, source.as_ref())).raise()?;
        Ok(Self { law, model, rate_hz })
    }

    /// Steps per second.
    #[getter]
    fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// How a derivative becomes a difference: gl or bdf2.
    #[getter]
    fn method(&self) -> &'static str {
        self.model.parameters.method.name()
    }

    /// Arithmetic of a step: f32 or f64.
    #[getter]
    fn precision(&self) -> &'static str {
        match self.law {
            AnyLaw::F32(_) => Precision::F32.name(),
            AnyLaw::F64(_) => Precision::F64.name(),
        }
    }

    /// Force of a step of displacement within one step, N/m.
    #[getter]
    fn stiffness_n_per_m(&self) -> f64 {
        either!(&self.law, AnyLaw(law) => law.stiffness().to_f64())
    }

    /// Bound of the displacement's error through compressed memory, over the largest displacement.
    #[getter]
    fn bound_per_stroke(&self) -> f64 {
        let film = self.model.parameters.film();
        either!(&self.law, AnyLaw(law) => film.compression_bound(law)).displacement_per_stroke.into()
    }

    /// The state of a film that was never moved.
    fn at_rest(slf: &Bound<'_, Self>) -> PyState {
        let state = match &slf.get().law {
            AnyLaw::F32(law) => AnyState::F32(law.clone(), Mutex::new(law.state())),
            AnyLaw::F64(law) => AnyState::F64(law.clone(), Mutex::new(law.state())),
        };
        PyState { state, law: slf.clone().unbind() }
    }

    /// The state of a film that has crept under `force_n` (N) for `duration_s` (s).
    fn settled(slf: &Bound<'_, Self>, force_n: f64, duration_s: f64) -> PyResult<PyState> {
        finite("force_n", force_n)?;
        finite("duration_s", duration_s)?;
        let law = &slf.get().law;
        let state = slf.py().detach(|| match law {
            AnyLaw::F32(law) => AnyState::F32(law.clone(), Mutex::new(law.settled(force_n as f32, duration_s))),
            AnyLaw::F64(law) => AnyState::F64(law.clone(), Mutex::new(law.settled(force_n, duration_s))),
        });
        Ok(PyState { state, law: slf.clone().unbind() })
    }

    /// Displacement over force (m/N, complex) at `frequency_hz` (Hz; a number or an array), for small oscillations about `at_m` (m).
    #[pyo3(signature = (frequency_hz, at_m=0.0))]
    fn frequency_response<'py>(&self, frequency_hz: &Bound<'py, PyAny>, at_m: f64) -> PyResult<Bound<'py, PyAny>> {
        each_complex(
            "frequency_hz",
            frequency_hz,
            |f| either!(&self.law, AnyLaw(law) => law.frequency_response_about(f, at_m)),
        )
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((PyModel, f64), Bound<'py, PyDict>)> {
        let named = [("method", self.method()), ("precision", self.precision())].into_py_dict(py)?;
        Ok(((self.model.clone(), self.rate_hz), named))
    }

    fn __repr__(&self) -> String {
        format!("<springpot.Law at {:?} Hz, {}, {}>", self.rate_hz, self.method(), self.precision())
    }
}

/// How a state is made again: a function, and its law and numbers.
type Saved<'py> = (Bound<'py, PyAny>, (Py<PyLaw>, Vec<f64>));

/// A film that a law steps: it remembers what was done to it. A thread that steps it waits for another that does; `copy` makes another film.
#[pyclass(frozen, name = "State", module = "springpot")]
pub(crate) struct PyState {
    state: AnyState,
    law: Py<PyLaw>,
}

#[pymethods]
impl PyState {
    #[new]
    fn new() -> PyResult<Self> {
        Err(PyTypeError::new_err("a State comes from a Law: law.at_rest() or law.settled(force_n, duration_s)"))
    }

    /// Displacement after the last step, m.
    #[getter]
    fn displacement_m(&self, py: Python<'_>) -> f64 {
        either!(&self.state, AnyState(_, state) => locked(py, state).position().to_f64())
    }

    /// Whether the film is beyond the stroke that its elastic curve or spring was measured over.
    #[getter]
    fn beyond_curve(&self, py: Python<'_>) -> bool {
        either!(&self.state, AnyState(_, state) => locked(py, state).beyond_curve())
    }

    /// Steps the film under `force_n` (N): once for a number, once for every value of an array. Its displacement (m), of the same shape.
    ///
    /// Raises InputError for an array of more dimensions or with values that are not finite; the state stays, as it does after Ctrl-C.
    fn displacement<'py>(&self, force_n: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        either!(&self.state, AnyState(law, state) => {
            steps("force_n", force_n, state, |state, f| law.displacement(state, Scalar::from_f64(f)).to_f64())
        })
    }

    /// Steps the film to `displacement_m` (m): once for a number, once for every value of an array. The force (N) that it takes, likewise.
    ///
    /// Raises InputError for an array of more dimensions or with values that are not finite; the state stays, as it does after Ctrl-C.
    fn force<'py>(&self, displacement_m: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        either!(&self.state, AnyState(law, state) => {
            steps("displacement_m", displacement_m, state, |state, x| law.force(state, Scalar::from_f64(x)).to_f64())
        })
    }

    /// The same film once more.
    fn copy(&self, py: Python<'_>) -> Self {
        let state = match &self.state {
            AnyState::F32(law, state) => AnyState::F32(law.clone(), Mutex::new(locked(py, state).clone())),
            AnyState::F64(law, state) => AnyState::F64(law.clone(), Mutex::new(locked(py, state).clone())),
        };
        Self { state, law: self.law.clone_ref(py) }
    }

    fn __copy__(&self, py: Python<'_>) -> Self {
        self.copy(py)
    }

    /// The film whose state `numbers` were saved.
    #[staticmethod]
    fn _restored(law: &Bound<'_, PyLaw>, numbers: Vec<f64>) -> PyState {
        let (film, mut numbers) = (PyLaw::at_rest(law), numbers.into_iter());
        let mut next = || numbers.next().unwrap_or_default();
        either!(&film.state, AnyState(_, state) => locked(law.py(), state).visit(|number| *number = Scalar::from_f64(next())));
        film
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Saved<'py>> {
        let mut numbers = Vec::new();
        either!(&self.state, AnyState(_, state) => locked(py, state).clone().visit(|number| numbers.push(number.to_f64())));
        Ok((py.get_type::<Self>().getattr("_restored")?, (self.law.clone_ref(py), numbers)))
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        format!("<springpot.State at {:?} m>", self.displacement_m(py))
    }
}
