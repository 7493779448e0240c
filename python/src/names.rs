//! Names of choices, the same as on the command line.

use clap::ValueEnum;
use pyo3::PyResult;

use crate::errors::refused;

/// The choice that `text` names, for the argument `name`.
pub(crate) fn choice<T: ValueEnum>(name: &str, text: &str) -> PyResult<T> {
    T::from_str(text, false).map_err(|_| {
        let names: Vec<String> = T::value_variants()
            .iter()
            .filter_map(ValueEnum::to_possible_value)
            .map(|v| v.get_name().to_owned())
            .collect();
        refused(name, format!("{text:?} is not one of {}", names.join(", ")))
    })
}

/// The word for a choice.
pub(crate) fn name_of<T: ValueEnum>(choice: &T) -> String {
    choice.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}
