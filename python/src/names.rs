//! Names of choices, the same as on the command line.

use host_io::choice::Choice;
use pyo3::PyResult;

use crate::errors::refused;

/// The choice that `text` names, for the argument `name`.
pub(crate) fn choice<T: Choice>(name: &str, text: &str) -> PyResult<T> {
    T::from_name(text).ok_or_else(|| {
        let names: Vec<&str> = T::CHOICES.iter().map(|(_, name, _)| *name).collect();
        refused(name, format!("{text:?} is not one of {}", names.join(", ")))
    })
}
