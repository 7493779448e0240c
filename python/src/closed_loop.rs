//! `closed_loop`: a controller follows a reference on a simulated film.

use host_models::references;
use host_models::replay::memory::Precision;
use host_models::simulation::closed_loop::{BenchModel, substeps, track, track_plant};
use host_models::simulation::controllers::{self, ControllerKind};
use host_models::simulation::film::{Film, Plant};
use host_models::simulation::plant::{FullMemoryPlant, Mismatch};
use host_models::simulation::tuning::ControllerTuning;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use springpot::AmplifierLag;

use crate::arrays::{array, count, finite};
use crate::control::{Limits, limits};
use crate::errors::{Raise, refused};
use crate::model::PyModel;
use crate::names::choice;
use crate::replay::{Source, result};
use crate::watch;

/// A film by its name, or a model that runs with full memory.
#[derive(FromPyObject)]
pub(crate) enum FilmSource<'py> {
    Name(String),
    Model(Bound<'py, PyModel>),
}

/// A closed loop along `reference` on a simulated `film`: "hossain", "wang", or a Model, which runs with full memory.
///
/// `controller` is "none", "static", "window", "pi", "feedforward" or "tracking", for `model`; what it is given as None is the model's board's, or the paper's
/// bench's. The sensor has `sensor_noise_m` (m, RMS) and `sensor_quantum_m` (m), and is lost within the times (s, s) of `sensor_lost_s`. The
/// amplifier has the time constants `amplifier_lag_s` and `amplifier_bleeder_s` (s); a monitor of the relative error `monitor_error` is read if it
/// is given. `stiffness` and `alpha` (of a Model only) are factors on the film. As the command `closed-loop`.
///
/// Raises InputError for what is refused, ComputationError for a film that is torn or pulled in.
#[pyfunction]
#[pyo3(signature = (model, reference, *, film=FilmSource::Name("hossain".to_owned()), controller="tracking", rate_hz=1000.0,
                    bandwidth_hz=None, adaptation_s=None, harmonics=None, period_s=None, limits=None, precision="f32", seed=1,
                    sensor_rate_hz=None, sensor_delay_s=None, sensor_noise_m=5e-6, sensor_quantum_m=1e-6, sensor_lost_s=Vec::new(),
                    amplifier_lag_s=0.0, amplifier_bleeder_s=0.0, monitor_error=None, stiffness=1.0, alpha=1.0),
       text_signature = "(model, reference, *, film='hossain', controller='tracking', rate_hz=1000.0, bandwidth_hz=None, \
                         adaptation_s=None, harmonics=None, period_s=None, limits=None, precision='f32', seed=1, sensor_rate_hz=None, \
                         sensor_delay_s=None, sensor_noise_m=5e-06, sensor_quantum_m=1e-06, sensor_lost_s=(), amplifier_lag_s=0.0, \
                         amplifier_bleeder_s=0.0, monitor_error=None, stiffness=1.0, alpha=1.0)")]
pub(crate) fn closed_loop<'py>(
    model: &Bound<'py, PyModel>,
    reference: Source<'py>,
    film: FilmSource<'py>,
    controller: &str,
    rate_hz: f64,
    bandwidth_hz: Option<f64>,
    adaptation_s: Option<f64>,
    harmonics: Option<i128>,
    period_s: Option<f64>,
    limits: Option<Limits<'py>>,
    precision: &str,
    seed: i128,
    sensor_rate_hz: Option<f64>,
    sensor_delay_s: Option<f64>,
    sensor_noise_m: f64,
    sensor_quantum_m: f64,
    sensor_lost_s: Vec<(f64, f64)>,
    amplifier_lag_s: f64,
    amplifier_bleeder_s: f64,
    monitor_error: Option<f64>,
    stiffness: f64,
    alpha: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let kind: ControllerKind = choice("controller", controller)?;
    let precision: Precision = choice("precision", precision)?;
    let sizes = [
        ("sensor_noise_m", sensor_noise_m, 0.0, 1.0),
        ("sensor_quantum_m", sensor_quantum_m, 0.0, 1.0),
        ("amplifier_lag_s", amplifier_lag_s, 0.0, 10.0),
        ("amplifier_bleeder_s", amplifier_bleeder_s, 0.0, 10.0),
        ("monitor_error", monitor_error.unwrap_or(0.0), -0.5, 0.5),
        ("stiffness", stiffness, 0.2, 5.0),
        ("alpha", alpha, 0.2, 5.0),
    ];
    if let Some((name, value, low, high)) =
        sizes.into_iter().find(|(_, value, low, high)| !(*low..=*high).contains(value))
    {
        return Err(refused(name, format!("{value:?} must be from {low} to {high}")));
    }
    for (from_s, to_s) in &sensor_lost_s {
        finite("sensor_lost_s", *from_s)?;
        if from_s.partial_cmp(to_s) != Some(std::cmp::Ordering::Less) {
            return Err(refused("sensor_lost_s", format!("{from_s:?} s must be before {to_s:?} s")));
        }
    }
    let limits = self::limits(py, limits, model)?;
    let harmonics = harmonics.map(|number| count("harmonics", number)).transpose()?;
    let tuning =
        ControllerTuning { rate_hz, bandwidth_hz, adaptation_s, sensor_rate_hz, sensor_delay_s, harmonics, period_s };
    let parameters = &model.parameters;
    let mut settings = tuning.settings(kind, parameters, limits).raise()?;
    let (sensor_rate_hz, sensor_delay_s) = tuning.sensor(parameters);
    let bench = BenchModel {
        sensor_noise_m,
        sensor_rate_hz,
        sensor_delay_s,
        sensor_quantum_m,
        sensor_lost_s,
        amplifier_lag_s,
        amplifier_bleeder_s,
        // As the driver does, which reads its monitor where the amplifier lags.
        monitor_error: monitor_error.or((limits.amplifier != AmplifierLag::NONE).then_some(0.0)),
        seed: count("seed", seed)?,
    };
    let mismatch = Mismatch { stiffness, alpha };
    let plant: Result<Plant, &PyModel> = match &film {
        FilmSource::Name(_) if alpha != 1.0 => {
            return Err(refused("alpha", "this film has no springpots; its stiffness may differ"));
        }
        FilmSource::Name(name) => Ok(choice("film", name)?),
        FilmSource::Model(film) => Err(film.get()),
    };
    let reference = reference.read(py, true)?;
    let recording = &reference.get().recording;
    let (run, grid) = watch::run(py, None, |caller| {
        let (values, grid) = references::on_grid(recording, rate_hz)?;
        settings.peak_m = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let about = |error: host_io::Error| error.about(&model.source, recording.path());
        let mut controller = controllers::build(kind, parameters, &settings, precision).map_err(about)?;
        let run = match plant {
            Ok(plant) => {
                let film = Film::new(plant).stiffened(stiffness);
                track(&film, &bench, controller.as_mut(), &values, grid, caller)
            }
            Err(film) => {
                let (number, substep_s) = substeps(grid);
                let mut plant = FullMemoryPlant::at_rest(&film.parameters, mismatch, substep_s, number * grid.samples)?;
                track_plant(&mut plant, &bench, controller.as_mut(), &values, grid, caller)
            }
        };
        Ok((run.map_err(about)?, grid))
    })?;
    let columns = PyDict::new(py);
    let quality = json!(run.quality()).to_string();
    columns.set_item("quality", py.import("json")?.call_method1("loads", (quality,))?)?;
    let limited: Vec<u8> = run.limited.iter().map(|limited| limited.bits()).collect();
    columns.set_item("limited", PyArray1::from_vec(py, limited))?;
    for (name, values) in [
        ("time_s", grid.times_s()),
        ("voltage_v", run.voltage_v),
        ("displacement_m", run.displacement_m),
        ("reference_m", run.reference_m),
        ("estimate_m", run.estimate_m),
        ("disturbance_n", run.disturbance_n),
        ("force_scale", run.force_scale),
    ] {
        columns.set_item(name, array(py, values))?;
    }
    columns.set_item("rate_hz", grid.rate_hz)?;
    result("ClosedLoop", &columns)
}
