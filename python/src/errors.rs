//! Errors of the host tool as exceptions with the same one line.

use std::ffi::CString;

use host_io::Error;
use host_io::error::with_names;
use pyo3::exceptions::{PyKeyboardInterrupt, PyUserWarning};
use pyo3::{PyErr, PyResult, Python};

/// The exceptions, which Python defines: each has two bases.
mod raised {
    pyo3::import_exception!(springpot.errors, ComputationError);
    pyo3::import_exception!(springpot.errors, FileError);
    pyo3::import_exception!(springpot.errors, InputError);
    pyo3::import_exception!(springpot.errors, LinkError);
}

/// Turns a result of the host tool into one of Python.
pub(crate) trait Raise<T> {
    /// The value, or the exception.
    fn raise(self) -> PyResult<T>;
}

impl<T> Raise<T> for host_io::Result<T> {
    fn raise(self) -> PyResult<T> {
        self.map_err(|error| exception(&error))
    }
}

/// The exception of `error`.
pub(crate) fn exception(error: &Error) -> PyErr {
    let line = with_arguments(&error.to_string());
    match innermost(error) {
        Error::File { .. } | Error::Line { .. } => raised::FileError::new_err(line),
        Error::Link { .. } => raised::LinkError::new_err(line),
        Error::Computation(_) => raised::ComputationError::new_err(line),
        Error::Interrupted => PyKeyboardInterrupt::new_err(line),
        _ => raised::InputError::new_err(line),
    }
}

fn innermost(error: &Error) -> &Error {
    match error {
        Error::At { error, .. } => innermost(error),
        error => error,
    }
}

/// The `text` of an error or a warning with the fields in it as arguments: they have the same names.
pub(crate) fn with_arguments(text: &str) -> String {
    with_names(text, |field| Some(field.to_owned()))
}

/// The exception of an argument that cannot be used: `name: cause`.
pub(crate) fn refused(name: &str, cause: impl std::fmt::Display) -> PyErr {
    raised::InputError::new_err(format!("{name}: {cause}"))
}

/// Warns of `doubts`, as Python does.
pub(crate) fn doubt(py: Python<'_>, doubts: &[String]) -> PyResult<()> {
    let category = py.get_type::<PyUserWarning>();
    doubts.iter().try_for_each(|text| {
        let text = CString::new(with_arguments(text).replace('\0', " "))?;
        PyErr::warn(py, &category, &text, 1)
    })
}
