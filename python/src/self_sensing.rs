//! The film as its own displacement sensor, a tick a reading.

use std::path::PathBuf;
use std::sync::Mutex;

use host_io::Error;
use host_io::files::capacitance::CapacitanceFile;
use pyo3::prelude::*;
use springpot::{FilmReading, SelfSensed, SelfSensing, SelfSensingFault, SelfSensingState, SensorSample};

use crate::arrays::{finite, locked};
use crate::errors::{Raise, refused};

/// A sample of the film as its own sensor, after a block of the tone: `displacement_m` (m), `age_s` (s) ago, with the standard deviation `uncertainty_m` (m);
/// `capacitance_f` (F) of film and cable, apparent series resistance `resistance_ohm` (Ω).
#[pyclass(frozen, get_all, name = "SelfSensed", module = "springpot")]
pub(crate) struct PySelfSensed {
    /// Displacement, m.
    displacement_m: f64,
    /// How long ago that was, s.
    age_s: f64,
    /// Standard deviation of the displacement, m.
    uncertainty_m: f64,
    /// Capacitance of film and cable, F.
    capacitance_f: f64,
    /// Apparent series resistance, Ω.
    resistance_ohm: f64,
}

#[pymethods]
impl PySelfSensed {
    fn __repr__(&self) -> String {
        format!("<springpot.SelfSensed {:?} m>", self.displacement_m)
    }
}

/// The film as its own sensor, in the arithmetic of the controller: a tone on the drive, its current, the capacitance, the displacement.
///
/// `path` is a file that `springpot self-sensing` wrote; it has the tone and its rate. In every tick first `tick` with the readings since the last
/// one, then `drive` for the voltage of the next. A Tracking takes the displacement as `sample_m` with `age_s`; make it with the `sensor_rate_hz` and the
/// `sensor_delay_s` that are attributes here. Raises FileError for another file, InputError for a relation or a tone that is refused.
#[pyclass(frozen, name = "SelfSensing", module = "springpot")]
pub(crate) struct PySelfSensing {
    sensing: SelfSensing<f32>,
    state: Mutex<SelfSensingState<f32>>,
    /// Ticks per second.
    #[pyo3(get)]
    rate_hz: f64,
    /// Amplitude of the tone, V: the drive stays so far from 0 V and from the largest voltage.
    #[pyo3(get)]
    tone_v: f64,
    /// Samples per second.
    #[pyo3(get)]
    sensor_rate_hz: f64,
    /// Age of a sample, s.
    #[pyo3(get)]
    sensor_delay_s: f64,
}

#[pymethods]
impl PySelfSensing {
    #[new]
    fn new(path: PathBuf) -> PyResult<Self> {
        let CapacitanceFile { relation, options } = CapacitanceFile::read(&path).raise()?;
        let sensing = SelfSensing::new(&relation, options).map_err(|error| Error::file(&path, error)).raise()?;
        Ok(Self {
            state: Mutex::new(sensing.state()),
            sensing,
            rate_hz: 1.0 / options.step_s,
            tone_v: options.tone_v,
            sensor_rate_hz: 1.0 / options.sample_interval_s(),
            sensor_delay_s: options.step_s * options.age_ticks() as f64,
        })
    }

    /// Takes the readings of the tick that has ended: `voltage_v` (V) at its end, `current_a` (A) its mean current into cable and film. Returns
    /// what the film shows with the tick after each block, otherwise None. A reading that is not finite counts as the one before.
    fn tick(&self, py: Python<'_>, voltage_v: f64, current_a: f64) -> Option<PySelfSensed> {
        let reading = FilmReading { voltage_v: voltage_v as f32, current_a: current_a as f32 };
        let sensed = self.sensing.sense(&mut locked(py, &self.state), reading)?;
        let SelfSensed { sample, capacitance_f, resistance_ohm, .. } = sensed;
        Some(PySelfSensed {
            displacement_m: sample.displacement_m.into(),
            age_s: sample.age_ticks as f64 / self.rate_hz,
            uncertainty_m: sensed.uncertainty_m().into(),
            capacitance_f: capacitance_f.into(),
            resistance_ohm: resistance_ohm.into(),
        })
    }

    /// Returns `voltage_v` (V) with the tone of this tick, at least 0 V.
    ///
    /// Raises InputError for a voltage that is not finite.
    fn drive(&self, py: Python<'_>, voltage_v: f64) -> PyResult<f64> {
        finite("voltage_v", voltage_v)?;
        Ok(self.sensing.drive(&locked(py, &self.state), voltage_v as f32).into())
    }

    /// Takes a displacement (m) by another sensor, of the standard deviation `uncertainty_m` (m), from `age_s` (s) ago: it corrects what
    /// the film shows from then on.
    ///
    /// Raises InputError for what is not finite, an uncertainty that is not above 0, and a negative age; nothing has changed then.
    #[pyo3(signature = (displacement_m, uncertainty_m, *, age_s=0.0))]
    fn correct(&self, py: Python<'_>, displacement_m: f64, uncertainty_m: f64, age_s: f64) -> PyResult<()> {
        for (name, number) in [("displacement_m", displacement_m), ("uncertainty_m", uncertainty_m), ("age_s", age_s)] {
            finite(name, number)?;
        }
        if uncertainty_m <= 0.0 {
            return Err(refused("uncertainty_m", format!("{uncertainty_m} must be above 0")));
        }
        if age_s < 0.0 {
            return Err(refused("age_s", format!("{age_s} must not be negative")));
        }
        // Saturates at more than is remembered.
        let age_ticks = (age_s * self.rate_hz).round() as usize;
        let sample = SensorSample { displacement_m: displacement_m as f32, age_ticks };
        self.sensing.correct(&mut locked(py, &self.state), sample, (uncertainty_m * uncertainty_m) as f32);
        Ok(())
    }

    /// Why the film cannot be sensed: "no-tone", "shorted", "current-monitor" or "electrode"; None while it can. Go to 0 V then.
    #[getter]
    fn fault(&self, py: Python<'_>) -> Option<&'static str> {
        locked(py, &self.state).fault().map(|fault| match fault {
            SelfSensingFault::NoTone => "no-tone",
            SelfSensingFault::Shorted => "shorted",
            SelfSensingFault::CurrentMonitor => "current-monitor",
            SelfSensingFault::Electrode => "electrode",
            _ => "other",
        })
    }

    fn __repr__(&self) -> String {
        format!("<springpot.SelfSensing {:?} V at {:?} Hz>", self.tone_v, self.rate_hz)
    }
}
