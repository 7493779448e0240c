//! Simulated films and references to follow: what a first try needs.

use std::sync::Mutex;

use host_io::Error;
use host_io::files::import::Quantity;
use host_io::files::recording::Recording;
use host_models::references::{Reference, Shape};
use host_models::simulation::film::{Film, FilmState, Instruments, Plant, Waveform};
use host_models::simulation::film_recording::Session;
use pyo3::prelude::*;

use crate::arrays::{count, finite, locked};
use crate::errors::{Raise, refused};
use crate::names::choice;
use crate::recording::PyRecording;
use crate::watch;

/// A recording of a simulated nonlinear film, `plant` "hossain" or "wang", from rest: not a measurement.
///
/// Its voltage is the sum of V/2 (1 - cos 2 pi f t) over `frequency_hz` (Hz) with the peak `peak_voltage_v` (V); `seed` is that of the
/// instruments' noise. As the command `plant`.
///
/// Raises InputError for what no bench has, ComputationError for a film that is pulled in.
#[pyfunction]
#[pyo3(signature = (plant="hossain", *, frequency_hz=vec![0.1], duration_s=60.0, rate_hz=100.0, peak_voltage_v=6000.0, seed=1,
                    name="film"))]
pub(crate) fn record_film(
    py: Python<'_>,
    plant: &str,
    frequency_hz: Vec<f64>,
    duration_s: f64,
    rate_hz: f64,
    peak_voltage_v: f64,
    seed: i128,
    name: &str,
) -> PyResult<PyRecording> {
    let film = Film::new(choice("plant", plant)?);
    let waveform = Waveform { peak_v: peak_voltage_v, frequencies_hz: frequency_hz };
    let session =
        Session { waveform, duration_s, rate_hz, instruments: Instruments::default(), seed: count("seed", seed)? };
    let recorded = watch::run(py, None, |_| {
        let recorded = session.record(&film)?;
        let columns = vec![
            (Quantity::Voltage, recorded.voltage_v.clone()),
            (Quantity::Displacement, recorded.displacement_m.clone()),
        ];
        Recording::of_values(name, recorded.grid().times_s(), columns)
    })?;
    Ok(recorded.into())
}

/// A reference to follow: displacement from `low_m` to `high_m` (m) after a rise from 0, as the command `reference`.
///
/// `shape` is "sine", "triangle", "steps" or "random-walk" of `period_s` (s), over `duration_s` (s) at `rate_hz` samples per second.
///
/// Raises InputError for sizes and times that make no sense.
#[pyfunction]
#[pyo3(signature = (shape, *, low_m, high_m, period_s, duration_s=155.0, rate_hz=1000.0, rise_s=None, seed=1))]
pub(crate) fn reference(
    py: Python<'_>,
    shape: &str,
    low_m: f64,
    high_m: f64,
    period_s: f64,
    duration_s: f64,
    rate_hz: f64,
    rise_s: Option<f64>,
    seed: i128,
) -> PyResult<PyRecording> {
    let shape: Shape = choice("shape", shape)?;
    let reference = Reference { seed: count("seed", seed)?, ..Reference::new(shape, low_m, high_m, period_s) };
    let made = watch::run(py, None, |_| {
        let (values, grid) = reference.over(duration_s, rate_hz, rise_s)?;
        Recording::of_values("reference", grid.times_s(), vec![(Quantity::Displacement, values)])
    })?;
    Ok(made.into())
}

/// A simulated nonlinear film in motion, `plant` "hossain" or "wang": a bench without high voltage.
/// Threads that advance one film take turns.
#[pyclass(frozen, name = "SimulatedFilm", module = "springpot")]
pub(crate) struct PySimulatedFilm {
    film: Film,
    state: Mutex<FilmState>,
}

/// Longest part of an advance, s: as in the host tool's closed loops.
const MAX_PART_S: f64 = 5e-4;

#[pymethods]
impl PySimulatedFilm {
    #[new]
    #[pyo3(signature = (plant="hossain"))]
    fn new(plant: &str) -> PyResult<Self> {
        let film = Film::new(choice::<Plant>("plant", plant)?);
        Ok(Self { state: Mutex::new(film.rest()), film })
    }

    /// Displacement from where the weight holds it, m.
    #[getter]
    fn displacement_m(&self, py: Python<'_>) -> f64 {
        self.film.displacement_m(&locked(py, &self.state))
    }

    /// Goes on for `duration_s` (s) under a constant `voltage_v` (V); the displacement (m) then.
    ///
    /// Raises ComputationError for a film that is torn or pulled in; its state stays.
    fn advance(&self, py: Python<'_>, voltage_v: f64, duration_s: f64) -> PyResult<f64> {
        finite("voltage_v", voltage_v)?;
        if !(0.0..=1e3).contains(&duration_s) {
            return Err(refused("duration_s", format!("{duration_s:?} s must be from 0 to 1000")));
        }
        let parts = ((duration_s / MAX_PART_S).ceil() as usize).max(1);
        let mut state = locked(py, &self.state);
        let next = py.detach(|| self.film.advanced(&state, voltage_v, duration_s, parts));
        if !self.film.holds(&next) {
            let cause = format!("the film is torn or pulled in under {voltage_v:.0} V; lower the voltage");
            return Err(Error::Computation(cause)).raise();
        }
        *state = next;
        Ok(self.film.displacement_m(&state))
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        format!("<springpot.SimulatedFilm at {:?} m>", self.displacement_m(py))
    }
}
