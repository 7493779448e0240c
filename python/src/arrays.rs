//! Arrays in and out. What comes in is copied once, into memory that only this side sees, because the interpreter's lock is released while it is
//! read; what goes out is handed over without a copy.

use std::sync::{Mutex, MutexGuard, PoisonError};

use numpy::{Complex64, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyComplex;

use crate::errors::refused;

/// The count or the seed `value` in the argument `name`.
pub(crate) fn count<T: TryFrom<i128>>(name: &str, value: i128) -> PyResult<T> {
    T::try_from(value).map_err(|_| refused(name, format!("{value}; a whole number from 0 on is needed")))
}

/// The numbers of the argument `name`: an array of one dimension, or what NumPy makes one of. Masked values are NaN.
pub(crate) fn series(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let is_masked = value.is_instance(&numpy.getattr("ma")?.getattr("MaskedArray")?)?;
    if let (false, Ok(array)) = (is_masked, value.extract::<PyReadonlyArray1<'_, f64>>()) {
        return Ok(array.as_array().to_vec());
    }
    let array = if is_masked {
        value.clone()
    } else {
        // Such as a list of lists of different lengths.
        let unlike =
            |e: PyErr| if e.is_instance_of::<PyException>(py) { refused(name, "not an array of numbers") } else { e };
        numpy.call_method1("asarray", (value,)).map_err(unlike)?
    };
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if !matches!(kind.as_str(), "f" | "i" | "u") {
        return Err(refused(name, format!("dtype {}; real numbers are needed", array.getattr("dtype")?)));
    }
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    if shape.len() != 1 {
        return Err(refused(name, format!("an array of shape {}; one dimension is needed", array.getattr("shape")?)));
    }
    let array = array.call_method1("astype", (numpy.getattr("float64")?,))?;
    let array = if is_masked { array.call_method1("filled", (f64::NAN,))? } else { array };
    Ok(array.extract::<PyReadonlyArray1<'_, f64>>()?.as_array().to_vec())
}

/// An array that takes over `values`.
pub(crate) fn array(py: Python<'_>, values: Vec<f64>) -> Bound<'_, PyArray1<f64>> {
    PyArray1::from_vec(py, values)
}

/// The same, which cannot be written to: it is shown more than once.
pub(crate) fn read_only(py: Python<'_>, values: Vec<f64>) -> PyResult<Bound<'_, PyArray1<f64>>> {
    let array = array(py, values);
    array.call_method1("setflags", (false,))?;
    Ok(array)
}

/// The number in `value`, if it is one and not an array of numbers.
fn number(value: &Bound<'_, PyAny>) -> Option<f64> {
    // NumPy's arrays of one number can be made a number; they stay arrays.
    let is_array = value.getattr("ndim").and_then(|dimensions| dimensions.extract()).is_ok_and(|n: usize| n > 0);
    if is_array { None } else { value.extract().ok() }
}

/// `function` of a number, or of every number of an array.
pub(crate) fn each<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
    mut function: impl FnMut(f64) -> f64 + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    if let Some(number) = number(value) {
        return Ok(function(number).into_pyobject(py)?.into_any());
    }
    let values = series(name, value)?;
    let results = py.detach(move || values.into_iter().map(&mut function).collect());
    Ok(array(py, results).into_any())
}

/// The same with complex results.
pub(crate) fn each_complex<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
    function: impl Fn(f64) -> Complex64 + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    if let Some(number) = number(value) {
        let result = function(number);
        return Ok(PyComplex::from_doubles(py, result.re, result.im).into_any());
    }
    let values = series(name, value)?;
    let results: Vec<Complex64> = py.detach(move || values.into_iter().map(function).collect());
    Ok(PyArray1::from_vec(py, results).into_any())
}

/// Values between two looks for a signal: some 20 ms.
const LOOK_EVERY: usize = 1 << 18;

/// The state stepped once by a number, or by every number of an array; another thread waits meanwhile. What is not finite is refused, and Ctrl-C
/// ends the steps: then the state is as it was.
pub(crate) fn steps<'py, S: Clone + Send>(
    name: &str,
    value: &Bound<'py, PyAny>,
    state: &Mutex<S>,
    step: impl Fn(&mut S, f64) -> f64 + Sync,
) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    if let Some(number) = number(value) {
        finite(name, number)?;
        return Ok(step(&mut locked(py, state), number).into_pyobject(py)?.into_any());
    }
    let mut values = series(name, value)?;
    if let Some(at) = values.iter().position(|value| !(-MAX_VALUE..=MAX_VALUE).contains(value)) {
        finite(&format!("{name}[{at}]"), values[at])?;
    }
    let mut state = locked(py, state);
    let before = state.clone();
    for part in values.chunks_mut(LOOK_EVERY) {
        let state = &mut *state;
        py.detach(|| part.iter_mut().for_each(|value| *value = step(state, *value)));
        if let Err(raised) = py.check_signals() {
            *state = before;
            return Err(raised);
        }
    }
    Ok(array(py, values).into_any())
}

/// The value in `mutex`, once no other thread uses it; others may use the interpreter until then.
pub(crate) fn locked<'a, T>(py: Python<'_>, mutex: &'a Mutex<T>) -> MutexGuard<'a, T> {
    mutex.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
}

/// Largest number of a step, as of a recording: its square is finite in single precision.
const MAX_VALUE: f64 = 1e15;

/// Refuses a number that is not finite, or not within 1e15: a state would never recover from it.
pub(crate) fn finite(name: &str, number: f64) -> PyResult<()> {
    match number.abs() {
        size if size <= MAX_VALUE => Ok(()),
        size if size.is_finite() => Err(refused(name, format!("{number:e} must be within {MAX_VALUE:e}"))),
        _ => Err(refused(name, format!("{number} must be finite"))),
    }
}
