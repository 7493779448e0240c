//! The Python package's native part: what `springpot` and the host tool compute, called from Python.
//!
//! Nothing is computed here. A file is a class or a group of functions; `springpot/` beside it holds what is written in Python, and
//! the stubs `_native.pyi` say shapes and units. Long calls run on a thread of their own without the interpreter's lock (`watch`).
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![allow(clippy::too_many_arguments)] // keyword arguments

mod actuator;
mod arrays;
mod closed_loop;
mod compare;
mod control;
mod errors;
mod export;
mod film;
mod fit;
mod law;
mod link;
mod model;
mod names;
mod recording;
mod replay;
mod self_sensing;
mod watch;

/// The module `springpot._native`.
#[pyo3::pymodule]
mod _native {
    /// Version of the package.
    #[pymodule_export]
    #[allow(non_upper_case_globals)] // Python's name
    const __version__: &str = env!("CARGO_PKG_VERSION");

    #[pymodule_export]
    use crate::actuator::PyActuator;
    #[pymodule_export]
    use crate::closed_loop::closed_loop;
    #[pymodule_export]
    use crate::compare::{compare, reduce};
    #[pymodule_export]
    use crate::control::{PyEstimate, PyFeedforward, PyObserver, PyTick, PyTracking};
    #[pymodule_export]
    use crate::export::export;
    #[pymodule_export]
    use crate::film::{PySimulatedFilm, record_film, reference};
    #[pymodule_export]
    use crate::fit::fit;
    #[pymodule_export]
    use crate::law::{PyLaw, PyState};
    #[pymodule_export]
    use crate::link::PyLink;
    #[pymodule_export]
    use crate::model::{PyModel, load, presets, save};
    #[pymodule_export]
    use crate::recording::{PyRecording, read_recording, read_reference};
    #[pymodule_export]
    use crate::replay::{check_reference, feedforward, frequency_response, observe, replay, simulate};
    #[pymodule_export]
    use crate::self_sensing::{PySelfSensed, PySelfSensing};
    #[pymodule_export]
    use crate::watch::PyStage;
}
