//! `Link`: a conversation with a controller.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use dea_driver::wire::{Answer, Command, Identity, Mode, Telemetry};
use host_io::files::parameters::controller_rate;
use host_io::link::{Client, Port, named};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};

use crate::arrays::{count, finite, locked};
use crate::errors::{Raise, refused};
use crate::model::PyModel;

/// A controller at a serial port such as "/dev/ttyUSB0" or "COM3", or at "tcp:HOST:PORT": the requests of the command `link`.
///
/// `with Link(port) as link:` disarms at the end. Once armed, the controller trips if it hears nothing for its heartbeat_s: send set-points more
/// often, or `heartbeat`. Threads that share a Link take turns.
///
/// Raises LinkError where no controller answers, or it refuses; its message is that of the command.
#[pyclass(frozen, name = "Link", module = "springpot")]
pub(crate) struct PyLink {
    client: Mutex<Client>,
    identity: Identity,
    port: String,
}

impl PyLink {
    /// `talk` without the interpreter's lock; other threads wait for its end.
    fn talk<R: Send>(
        &self,
        py: Python<'_>,
        talk: impl FnOnce(&mut Client) -> host_io::Result<R> + Send,
    ) -> PyResult<R> {
        let mut client = locked(py, &self.client);
        let client = &mut *client;
        py.detach(move || talk(client)).raise()
    }

    fn order(&self, py: Python<'_>, command: Command) -> PyResult<()> {
        self.talk(py, |client| client.order(command))
    }
}

#[pymethods]
impl PyLink {
    #[new]
    fn new(py: Python<'_>, port: &str) -> PyResult<Self> {
        let (client, identity) = py.detach(|| Client::new(Port::open(port)?)).raise()?;
        Ok(Self { client: Mutex::new(client), identity, port: port.into() })
    }

    /// Firmware, number of the board, and name and checksum of its parameters, as a dictionary.
    fn identify<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let parameters = self.talk(py, |client| client.ask(Command::Query))?;
        let (name, checksum) = match parameters {
            Answer::Parameters { name, checksum } => (Some(name.to_string()), checksum),
            _ => (None, None),
        };
        let known = PyDict::new(py);
        known.set_item("firmware", self.identity.firmware.to_string())?;
        known.set_item("board", self.identity.board)?;
        known.set_item("parameters", name)?;
        known.set_item("checksum", checksum.map(|checksum| format!("{checksum:08x}")))?;
        Ok(known)
    }

    /// State, rate (Hz), voltages (V) and ticks, as a dictionary; a monitor that does not answer reads NaN.
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let status = self.talk(py, Client::status)?;
        let known = PyDict::new(py);
        known.set_item("state", named(status.state))?;
        known.set_item("rate_hz", status.rate_hz)?;
        known.set_item("ticks", status.ticks)?;
        known.set_item("command_v", status.command_v)?;
        known.set_item("monitor_v", status.monitor_v)?;
        known.set_item("live", status.live)?;
        Ok(known)
    }

    /// Sends `model` for `rate_hz` ticks per second; the controller keeps it over a reset with `keep`. `bench` allows calibrations and limits of
    /// the paper's bench where the model has none: no film of yours is safe with them.
    #[pyo3(signature = (model, *, rate_hz=1000.0, bench=false, keep=true))]
    fn upload(&self, model: &Bound<'_, PyModel>, rate_hz: f64, bench: bool, keep: bool) -> PyResult<()> {
        let (py, model) = (model.py(), model.get());
        if !(1.0..=100_000.0).contains(&rate_hz) {
            return Err(refused("rate_hz", format!("{rate_hz:?} Hz must be from 1 to 100000")));
        }
        let blob = model.parameters.blob_to_drive(controller_rate(rate_hz), bench);
        let blob = blob.map_err(|e| e.about(&model.source, model.source.as_ref())).raise()?;
        self.talk(py, |client| client.upload(&blob, keep))
    }

    /// Enables the amplifier at 0 V. From here on this Link may start a run.
    fn arm(&self, py: Python<'_>) -> PyResult<()> {
        self.talk(py, |client| client.arm().map(drop))
    }

    /// Begins a run: `mode` is "voltage", "feedforward" or "tracking".
    fn start(&self, py: Python<'_>, mode: &str) -> PyResult<()> {
        let mode = match mode {
            "voltage" => Mode::Voltage,
            "feedforward" => Mode::Feedforward,
            "tracking" => Mode::Tracking,
            _ => return Err(refused("mode", format!("{mode:?} is not one of voltage, feedforward, tracking"))),
        };
        self.order(py, Command::Start(mode))
    }

    /// The voltage of a run in voltage mode, V at the film.
    fn set_voltage(&self, py: Python<'_>, voltage_v: f64) -> PyResult<()> {
        finite("voltage_v", voltage_v)?;
        self.order(py, Command::SetVoltage(voltage_v as f32))
    }

    /// The displacement of a run in the other modes, m.
    fn set_reference(&self, py: Python<'_>, reference_m: f64) -> PyResult<()> {
        finite("reference_m", reference_m)?;
        self.order(py, Command::SetReference(reference_m as f32))
    }

    /// Keeps the controller waiting for the next set-point.
    fn heartbeat(&self, py: Python<'_>) -> PyResult<()> {
        self.order(py, Command::Heartbeat)
    }

    /// Back to 0 V, amplifier enabled.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.order(py, Command::Stop)
    }

    /// Back to 0 V, amplifier disabled. The film is at 0 V once `status` says so, and can be armed again after `discharge_s` at 0 V.
    fn disarm(&self, py: Python<'_>) -> PyResult<()> {
        self.order(py, Command::Disarm)
    }

    /// Acknowledges a trip, after its cause was found.
    fn acknowledge(&self, py: Python<'_>) -> PyResult<()> {
        self.order(py, Command::Acknowledge)
    }

    /// Records of every so many ticks from now on, which `samples` returns; 0 ends them.
    fn stream(&self, py: Python<'_>, every: i128) -> PyResult<()> {
        self.order(py, Command::Stream { every: count("every", every)? })
    }

    /// Records that arrive within `duration_s` (s), as dictionaries of floats in SI units.
    fn samples<'py>(&self, py: Python<'py>, duration_s: f64) -> PyResult<Vec<Bound<'py, PyDict>>> {
        if !(0.0..=10.0).contains(&duration_s) {
            return Err(refused("duration_s", format!("{duration_s:?} s must be from 0 to 10")));
        }
        let until = Instant::now() + Duration::from_secs_f64(duration_s);
        let samples = self.talk(py, |client| {
            let mut samples = Vec::new();
            while let Some(sample) = client.sample(until)? {
                samples.push(sample);
            }
            Ok(samples)
        })?;
        samples.iter().map(|sample| record(py, sample)).collect()
    }

    fn __enter__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    /// Disarms, whatever happened.
    fn __exit__(
        &self,
        py: Python<'_>,
        _kind: &Bound<'_, PyAny>,
        _value: &Bound<'_, PyAny>,
        _traceback: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        self.disarm(py)
    }

    fn __repr__(&self) -> String {
        format!("<springpot.Link at {}, firmware {}>", self.port, self.identity.firmware)
    }
}

/// A record as a dictionary.
fn record<'py>(py: Python<'py>, sample: &Telemetry) -> PyResult<Bound<'py, PyDict>> {
    let values = [
        ("command_v", sample.command_v),
        ("monitor_v", sample.monitor_v),
        ("displacement_m", sample.displacement_m),
        ("predicted_m", sample.predicted_m),
        ("reference_m", sample.reference_m),
        ("learned_m", sample.learned_m),
        ("disturbance_n", sample.disturbance_n),
        ("force_scale", sample.force_scale),
        ("innovation_m", sample.innovation_m),
    ];
    let record = values.into_py_dict(py)?;
    record.set_item("tick", sample.tick)?;
    record.set_item("dropped", sample.dropped)?;
    record.set_item("limited", sample.limited)?;
    Ok(record)
}
