//! Long calls: on a thread of their own, without the interpreter's lock, ended by Ctrl-C.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

use host_io::Error;
use host_io::progress::{Stage, Watch};
use pyo3::prelude::*;

use crate::errors::Raise;

/// Time between two looks for a signal.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// The caller of long work: says when it is to end, and receives its stages.
pub(crate) struct Caller<'a> {
    /// Set where the work is to end: a search with the best so far, anything else without a result.
    pub(crate) stop: &'a AtomicBool,
    stages: Sender<Stage>,
}

impl Caller<'_> {
    /// Reports the stage that begins.
    pub(crate) fn report(&self, stage: &Stage) {
        // No receiver is left once the call has ended.
        let _ = self.stages.send(stage.clone());
    }
}

impl Watch for Caller<'_> {
    fn advance(&self, _: u64) -> host_io::Result<()> {
        if self.stop.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
    }
}

/// A stage of a fit as it begins.
#[pyclass(frozen, get_all, name = "Stage", module = "springpot")]
pub(crate) struct PyStage {
    /// The work that begins.
    what: String,
    /// Its number, from one.
    number: Option<usize>,
    /// How many stages there are at the most.
    of: Option<usize>,
    /// Share of the work before it, from 0 to 1.
    share: Option<f64>,
}

impl From<Stage> for PyStage {
    fn from(Stage { what, count, work: (before, all) }: Stage) -> Self {
        let (number, of) = count.unzip();
        Self { what, number, of, share: (all > 0).then(|| before as f64 / all as f64) }
    }
}

#[pymethods]
impl PyStage {
    fn __repr__(&self) -> String {
        let count =
            self.number.zip(self.of).map_or_else(String::new, |(number, of)| format!(", number={number}, of={of}"));
        format!("Stage({:?}{count})", self.what)
    }
}

/// Runs `work` without the interpreter's lock. Ctrl-C ends it and is raised. `progress` is called with every stage; what it raises
/// ends the work and is raised, and False ends it.
pub(crate) fn run<R: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Caller<'_>) -> host_io::Result<R> + Send,
) -> PyResult<R> {
    let stop = AtomicBool::new(false);
    let (stages, received) = mpsc::channel();
    thread::scope(|scope| {
        let worker = scope.spawn(|| work(&Caller { stop: &stop, stages }));
        let listened = listen(py, progress, &stop, received);
        if listened.is_err() {
            stop.store(true, Ordering::Relaxed);
        }
        let done = py.detach(|| worker.join());
        listened?;
        done.unwrap_or_else(|panic| resume_unwind(panic)).raise()
    })
}

/// Passes on the stages that are `received`, until the work has ended or something was raised.
fn listen(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    stop: &AtomicBool,
    mut received: Receiver<Stage>,
) -> PyResult<()> {
    loop {
        let next;
        (next, received) = py.detach(move || (received.recv_timeout(LOOK_EVERY), received));
        match (next, progress) {
            (Ok(stage), Some(progress)) => {
                let answer = progress.call1((PyStage::from(stage),))?;
                if answer.extract().is_ok_and(|goes_on: bool| !goes_on) {
                    stop.store(true, Ordering::Relaxed);
                }
            }
            (Ok(_), None) | (Err(RecvTimeoutError::Timeout), _) => {}
            (Err(RecvTimeoutError::Disconnected), _) => return Ok(()),
        }
        py.check_signals()?;
    }
}
