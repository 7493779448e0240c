//! `export`: the blob for a controller, or the law of a film in another language.

use std::path::PathBuf;

use host_emit::output::Output;
use host_io::files::parameters::controller_rate;
use pyo3::prelude::*;

use crate::errors::{doubt, refused};
use crate::model::PyModel;
use crate::names::choice;
use crate::watch;

/// Writes `model` at `rate_hz` (Hz) for a controller or another language, and returns the paths of the files.
///
/// `emit` is "blob", "rust", "c", "arduino" (a folder), "sfunction", "fmu" or "fmu2"; without it the ending of `path` chooses (.bin, .rs, .c,
/// .fmu). As the command `export`. Warns where the film's sizes are assumed.
///
/// Raises InputError for a contradicting ending or a film that a controller refuses, FileError for a file that cannot be written.
#[pyfunction]
#[pyo3(signature = (model, path, *, rate_hz=1000.0, emit=None, method="gl"))]
pub(crate) fn export(
    model: &Bound<'_, PyModel>,
    path: PathBuf,
    rate_hz: f64,
    emit: Option<&str>,
    method: &str,
) -> PyResult<Vec<PathBuf>> {
    let (py, model) = (model.py(), model.get());
    let emit = emit.map(|emit| choice("emit", emit)).transpose()?;
    let parameters = model.with_method(method)?;
    if !(1.0..=100_000.0).contains(&rate_hz) {
        return Err(refused("rate_hz", format!("{rate_hz:?} Hz must be from 1 to 100000")));
    }
    let written = watch::run(py, None, |_| {
        let output = Output::new(emit, &path, &[model.source.as_ref()])?;
        let written = output.write(&parameters, controller_rate(rate_hz));
        written.map_err(|error| error.about(&model.source, model.source.as_ref()))
    })?;
    doubt(py, &parameters.field_note().into_iter().chain(written.platform_note).collect::<Vec<_>>())?;
    Ok(written.files.into_iter().map(|(path, _)| path).collect())
}
