//! Control in real time: a tick a sample, the same calls as on the controller.

use std::collections::HashMap;
use std::sync::Mutex;

use host_io::files::parameters::{DisplacementSensor, Parameters};
use host_models::replay::limits::command_limits;
use host_models::replay::memory::Precision;
use host_models::replay::observer::refused as observer_refused;
use host_models::simulation::controllers::{self, Controller, ControllerKind, ControllerOutput};
use host_models::simulation::tuning::ControllerTuning;
use pyo3::prelude::*;
use springpot::{Applied, CommandLimits, Limited, Observer, ObserverOptions, ObserverState, Real, SensorSample};

use crate::arrays::{count, finite, locked};
use crate::errors::{Raise, doubt, refused};
use crate::model::PyModel;
use crate::names::choice;

/// Limits as a dictionary gives them.
pub(crate) type Limits<'py> = HashMap<String, Bound<'py, PyAny>>;

/// The limits that are `given`; what is left out is the board's or the paper's bench's. Warns where the field is not known.
pub(crate) fn limits(py: Python<'_>, given: Option<Limits<'_>>, model: &PyModel) -> PyResult<CommandLimits> {
    let number = |(name, value): (String, Bound<'_, PyAny>)| match value.extract::<f64>() {
        Ok(value) => Ok((name, value)),
        Err(_) => Err(refused(&name, format!("{value:?} is not a number"))),
    };
    let given = given.unwrap_or_default().into_iter().map(number).collect::<PyResult<Vec<_>>>()?;
    doubt(py, model.parameters.field_note().as_slice())?;
    command_limits(model.parameters.board.as_ref(), given.iter().map(|(name, value)| (name.as_str(), *value))).raise()
}

/// The names of `limited`.
fn names(limited: Limited) -> Vec<&'static str> {
    Limited::ALL.iter().filter(|(limit, _)| limited.contains(*limit)).map(|(_, name)| *name).collect()
}

/// The command of a tick: `voltage_v` (V) from now on. `reference_m` (m) is the shaped reference, `displacement_m` (m) the
/// estimate of the film, `disturbance_n` (N) and `force_scale` what the sensor says of the model; None where the controller has none. `limited`
/// names the limits that were met. `ageing` says how far the film has moved from its model, where Tracking `adapts`: fit again from 1 on;
/// `stiffness_change` by how much stiffer it is if nothing else has changed, 0.02 for 2 %, and 0 where that may be chance.
#[pyclass(frozen, get_all, name = "Tick", module = "springpot")]
pub(crate) struct PyTick {
    /// The voltage, V.
    voltage_v: f64,
    /// The shaped reference at the end of the tick, m; None while cycles are learned.
    reference_m: Option<f64>,
    /// The estimated displacement, m.
    displacement_m: Option<f64>,
    /// The estimated disturbance force, N; None without a sensor.
    disturbance_n: Option<f64>,
    /// The estimated force scale; None without a sensor.
    force_scale: Option<f64>,
    /// How far the film has moved from its model; None where Tracking does not adapt.
    ageing: Option<f64>,
    /// The change of its stiffness, 0.02 for 2 % more, 0 where it may be chance; None as `ageing`.
    stiffness_change: Option<f64>,
    /// Names of the limits that were met.
    limited: Vec<&'static str>,
}

#[pymethods]
impl PyTick {
    fn __repr__(&self) -> String {
        let limited =
            if self.limited.is_empty() { String::new() } else { format!(", limited: {}", self.limited.join(", ")) };
        format!("<springpot.Tick {:?} V{limited}>", self.voltage_v)
    }
}

impl From<ControllerOutput> for PyTick {
    fn from(output: ControllerOutput) -> Self {
        Self {
            voltage_v: output.voltage_v,
            reference_m: output.reference_m,
            displacement_m: output.estimate_m,
            disturbance_n: output.disturbance_n,
            force_scale: output.force_scale,
            ageing: output.ageing,
            stiffness_change: output.stiffness_change,
            limited: names(output.limited),
        }
    }
}

/// A controller with its sensor and its last command.
struct Loop {
    controller: Box<dyn Controller + Send>,
    parameters: Parameters,
    sensor: DisplacementSensor,
    rate_hz: f64,
    delay_s: f64,
    /// The last command, V.
    commanded_v: f64,
}

/// Voltages and sample since the last tick.
#[derive(Clone, Copy)]
struct Since {
    applied_v: Option<f64>,
    monitor_v: Option<f64>,
    sample_m: Option<f64>,
    age_s: Option<f64>,
}

impl Loop {
    fn new(
        kind: ControllerKind,
        model: &PyModel,
        tuning: ControllerTuning,
        limits: CommandLimits,
        precision: &str,
    ) -> PyResult<Mutex<Self>> {
        let precision = choice("precision", precision)?;
        let parameters = &model.parameters;
        let settings = tuning.settings(kind, parameters, limits).raise()?;
        let controller = controllers::build(kind, parameters, &settings, precision)
            .map_err(|e| e.about(&model.source, model.source.as_ref()))
            .raise()?;
        let (rate_hz, (_, delay_s)) = (tuning.rate_hz, tuning.sensor(parameters));
        let (sensor, parameters) = (parameters.sensor(), parameters.clone());
        Ok(Mutex::new(Self { controller, parameters, sensor, rate_hz, delay_s, commanded_v: 0.0 }))
    }

    fn tick(&mut self, reference_m: f64, since: Since) -> PyResult<PyTick> {
        if let Some(applied_v) = since.applied_v {
            finite("applied_v", applied_v)?;
        }
        let applied = Applied { commanded_v: since.applied_v.unwrap_or(self.commanded_v), reading_v: since.monitor_v };
        let sample = sample(self.sensor, since, self.delay_s, self.rate_hz)?;
        let output = self.controller.tick(applied, sample, reference_m);
        self.commanded_v = output.voltage_v;
        Ok(output.into())
    }
}

/// The sample that has arrived, if one has; NaN counts as a missing one.
fn sample(sensor: DisplacementSensor, since: Since, delay_s: f64, rate_hz: f64) -> PyResult<Option<SensorSample<f64>>> {
    let age_s = since.age_s.unwrap_or(delay_s);
    finite("age_s", age_s)?;
    if age_s < 0.0 {
        return Err(refused("age_s", format!("{age_s} must not be negative")));
    }
    // Saturates at more than any observer remembers.
    let age_ticks = (age_s * rate_hz).round() as usize;
    let reading_m = since.sample_m.filter(|reading| reading.is_finite());
    Ok(reading_m.map(|reading_m| SensorSample { displacement_m: sensor.film_displacement_m(reading_m), age_ticks }))
}

/// Feedforward with a sensor: the controller's own law of control, a tick a sample, at `rate_hz` ticks per second.
///
/// Below `bandwidth_hz` the estimate follows the sensor, above it the model; a sample comes every 1/`sensor_rate_hz` s and is
/// `sensor_delay_s` old. Over `adaptation_s` a disturbance that swings with the load becomes a change of the force scale. With `harmonics` (at most
/// 6) the errors of a periodic reference are learned; `period_s` is found if left out. With `adapts` the model follows a film that changes, and
/// without a sample goes on with what the film has shown. What is None is the model's board's, or the paper's
/// bench's, with a bandwidth that the model's resonance allows. `limits` as springpot.Limits.
///
/// These limits shape commands; they do not protect people or film. Raises InputError for what is refused.
#[pyclass(frozen, name = "Tracking", module = "springpot")]
pub(crate) struct PyTracking(Mutex<Loop>);

#[pymethods]
impl PyTracking {
    #[new]
    #[pyo3(signature = (model, rate_hz, *, bandwidth_hz=None, adaptation_s=None, sensor_rate_hz=None, sensor_delay_s=None,
                        harmonics=None, period_s=None, adapts=false, limits=None, precision="f32"))]
    fn new(
        model: &Bound<'_, PyModel>,
        rate_hz: f64,
        bandwidth_hz: Option<f64>,
        adaptation_s: Option<f64>,
        sensor_rate_hz: Option<f64>,
        sensor_delay_s: Option<f64>,
        harmonics: Option<i128>,
        period_s: Option<f64>,
        adapts: bool,
        limits: Option<Limits<'_>>,
        precision: &str,
    ) -> PyResult<Self> {
        let (py, model) = (model.py(), model.get());
        let tuning = ControllerTuning {
            rate_hz,
            bandwidth_hz,
            adaptation_s,
            sensor_rate_hz,
            sensor_delay_s,
            harmonics: harmonics.map(|number| count("harmonics", number)).transpose()?,
            period_s,
        };
        let limits = self::limits(py, limits, model)?;
        let kind = if adapts { ControllerKind::Adaptive } else { ControllerKind::Tracking };
        Loop::new(kind, model, tuning, limits, precision).map(Self)
    }

    /// One tick: the voltage that takes the film to `reference_m` (m) at its end. A reference that is not finite is ignored.
    ///
    /// `sample_m` (m) is the sensor's reading that has arrived, None or NaN for none, taken `age_s` (s) ago. `applied_v` (V) is what was
    /// commanded in the end, if not the last tick's voltage; `monitor_v` (V) what a monitor measured of it.
    ///
    /// Raises InputError for an `applied_v` or an `age_s` that is not finite, or a negative age; nothing has changed then.
    #[pyo3(signature = (reference_m, sample_m=None, *, applied_v=None, monitor_v=None, age_s=None))]
    fn tick(
        &self,
        py: Python<'_>,
        reference_m: f64,
        sample_m: Option<f64>,
        applied_v: Option<f64>,
        monitor_v: Option<f64>,
        age_s: Option<f64>,
    ) -> PyResult<PyTick> {
        locked(py, &self.0).tick(reference_m, Since { applied_v, monitor_v, sample_m, age_s })
    }

    /// From now on the film is at `temperature_c` (°C): stiffness and relaxation times of the law come to it within seconds, with or without a
    /// sensor, beside what is learned. As often as it changes.
    ///
    /// Raises InputError for a model without [temperature], and for temperatures out of its reach or of a running law; nothing has changed then.
    fn set_temperature(&self, py: Python<'_>, temperature_c: f64) -> PyResult<()> {
        let mut all = locked(py, &self.0);
        let factors = all.parameters.temperature_factors(temperature_c);
        all.controller.set_temperature_factors(factors.map_err(|cause| refused("temperature_c", cause))?);
        Ok(())
    }
}

/// Feedforward without a sensor: the law's inverse, shaped and limited. Arguments as Tracking.
#[pyclass(frozen, name = "Feedforward", module = "springpot")]
pub(crate) struct PyFeedforward(Mutex<Loop>);

#[pymethods]
impl PyFeedforward {
    #[new]
    #[pyo3(signature = (model, rate_hz, *, limits=None, precision="f32"))]
    fn new(model: &Bound<'_, PyModel>, rate_hz: f64, limits: Option<Limits<'_>>, precision: &str) -> PyResult<Self> {
        let (py, model) = (model.py(), model.get());
        let limits = self::limits(py, limits, model)?;
        Loop::new(ControllerKind::Feedforward, model, ControllerTuning::at_rate(rate_hz), limits, precision).map(Self)
    }

    /// One tick, as of Tracking, without a sensor.
    #[pyo3(signature = (reference_m, *, applied_v=None, monitor_v=None))]
    fn tick(
        &self,
        py: Python<'_>,
        reference_m: f64,
        applied_v: Option<f64>,
        monitor_v: Option<f64>,
    ) -> PyResult<PyTick> {
        locked(py, &self.0).tick(reference_m, Since { applied_v, monitor_v, sample_m: None, age_s: None })
    }
}

/// The estimate of a tick.
#[pyclass(frozen, get_all, name = "Estimate", module = "springpot")]
pub(crate) struct PyEstimate {
    /// The estimated displacement, m.
    displacement_m: f64,
    /// The force that the model does not know, N.
    disturbance_n: f64,
    /// Factor of the force.
    force_scale: f64,
    /// The last sample minus its prediction, m.
    innovation_m: f64,
    /// Running standard deviation of it, m.
    innovation_std_m: f64,
}

#[pymethods]
impl PyEstimate {
    fn __repr__(&self) -> String {
        format!("<springpot.Estimate {:?} m>", self.displacement_m)
    }
}

/// An observer in the arithmetic of the controller, or in twice as many digits.
enum AnyObserver {
    F32(Box<(Observer<f32>, ObserverState<f32>)>),
    F64(Box<(Observer<f64>, ObserverState<f64>)>),
}

/// The observer alone. Arguments as Tracking; `max_voltage_v` (V) is the largest that is expected.
#[pyclass(frozen, name = "Observer", module = "springpot")]
pub(crate) struct PyObserver {
    observer: Mutex<AnyObserver>,
    sensor: DisplacementSensor,
    rate_hz: f64,
    delay_s: f64,
}

fn built<T: Real>(
    model: &PyModel,
    rate_hz: f64,
    max_voltage_v: f64,
    options: ObserverOptions,
) -> host_io::Result<Box<(Observer<T>, ObserverState<T>)>> {
    let law = model.parameters.film().compressed_law::<T>(rate_hz)?;
    let rest = law.state();
    let observer = Observer::new(law, &model.parameters.actuator, max_voltage_v, options).map_err(observer_refused)?;
    let state = observer.state(rest);
    Ok(Box::new((observer, state)))
}

fn observed<T: Real>(
    (observer, state): &mut (Observer<T>, ObserverState<T>),
    voltage_v: f64,
    sample: Option<SensorSample<f64>>,
) -> PyEstimate {
    let sample = sample.map(|s| SensorSample { displacement_m: T::from_f64(s.displacement_m), age_ticks: s.age_ticks });
    let displacement = observer.observe(state, Applied::as_commanded(T::from_f64(voltage_v)), sample);
    PyEstimate {
        displacement_m: displacement.to_f64(),
        disturbance_n: state.disturbance().to_f64(),
        force_scale: state.force_scale().to_f64(),
        innovation_m: state.innovation().to_f64(),
        innovation_std_m: state.statistics().variance().to_f64().max(0.0).sqrt(),
    }
}

#[pymethods]
impl PyObserver {
    #[new]
    #[pyo3(signature = (model, rate_hz, *, bandwidth_hz=None, adaptation_s=None, sensor_rate_hz=None, sensor_delay_s=None,
                        max_voltage_v=None, precision="f32"))]
    fn new(
        model: &Bound<'_, PyModel>,
        rate_hz: f64,
        bandwidth_hz: Option<f64>,
        adaptation_s: Option<f64>,
        sensor_rate_hz: Option<f64>,
        sensor_delay_s: Option<f64>,
        max_voltage_v: Option<f64>,
        precision: &str,
    ) -> PyResult<Self> {
        let model = model.get();
        let largest = max_voltage_v.map(|volts| ("max_voltage_v", volts));
        let limits = command_limits(model.parameters.board.as_ref(), largest).raise()?;
        let tuning = ControllerTuning {
            bandwidth_hz,
            adaptation_s,
            sensor_rate_hz,
            sensor_delay_s,
            ..ControllerTuning::at_rate(rate_hz)
        };
        let (_, delay_s) = tuning.sensor(&model.parameters);
        let options = tuning.settings(ControllerKind::Tracking, &model.parameters, limits).raise()?.observer;
        let observer = match choice("precision", precision)? {
            Precision::F32 => built(model, rate_hz, limits.max_voltage_v, options).map(AnyObserver::F32),
            Precision::F64 => built(model, rate_hz, limits.max_voltage_v, options).map(AnyObserver::F64),
        };
        let observer = observer.map_err(|e| e.about(&model.source, model.source.as_ref())).raise()?;
        Ok(Self { observer: Mutex::new(observer), sensor: model.parameters.sensor(), rate_hz, delay_s })
    }

    /// One tick: the film under `voltage_v` (V) since the last, and the reading `sample_m` (m) that has arrived, taken `age_s` (s) ago; None or NaN
    /// for none.
    ///
    /// Raises InputError for a voltage or an age that is not finite, or a negative age; nothing has changed then.
    #[pyo3(signature = (voltage_v, sample_m=None, *, age_s=None))]
    fn tick(&self, py: Python<'_>, voltage_v: f64, sample_m: Option<f64>, age_s: Option<f64>) -> PyResult<PyEstimate> {
        finite("voltage_v", voltage_v)?;
        let since = Since { applied_v: None, monitor_v: None, sample_m, age_s };
        let sample = sample(self.sensor, since, self.delay_s, self.rate_hz)?;
        Ok(match &mut *locked(py, &self.observer) {
            AnyObserver::F32(observer) => observed(observer, voltage_v, sample),
            AnyObserver::F64(observer) => observed(observer, voltage_v, sample),
        })
    }
}
