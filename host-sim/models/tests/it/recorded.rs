//! Recordings that are made of films, fits to them, and controllers with what was fitted.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use host_io::files::import::Quantity;
use host_io::files::parameters::Parameters;
use host_io::files::recording::{Direction, Input, Recording};
use host_io::grid::{Grid, Samples};
use host_models::agreement::mean_nrmse_pct;
use host_models::fit::observation::Observation;
use host_models::fit::readings::Reading;
use host_models::fit::{self, Fit, FitOptions, Settings, Warning};
use host_models::references::minimum_jerk;
use host_models::replay::memory::{MemoryChoice, Precision, RunOptions};
use host_models::replay::{feedforward, simulate};
use host_models::simulation::controllers::{self, Controller, ControllerKind, ControllerSettings};
use host_models::simulation::plant::Plant;
pub(crate) use host_models::statistics::{peak, rms};
use indicatif::ProgressBar;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use springpot::{Actuator, CommandLimits, LearningOptions, ObserverOptions, Topology};

pub(crate) fn observation(name: &str, input: Input, measured: Samples, rate_hz: f64) -> Observation {
    Observation {
        name: name.into(),
        input,
        measured,
        rate_hz,
        weight: 1.0,
        sample_weights: Vec::new(),
        reading: Reading::default(),
        temperature_c: None,
    }
}

/// The recording of rows of time (s), voltage (V) and displacement (m).
pub(crate) fn recording(name: &str, rows: &[[f64; 3]]) -> Recording {
    let column = |k: usize| rows.iter().map(|row| row[k]).collect::<Vec<f64>>();
    let columns = vec![(Quantity::Voltage, column(1)), (Quantity::Displacement, column(2))];
    Recording::of_values(name, column(0), columns).expect("valid")
}

/// `plant` under `volts` for so many `steps` of `step_s`, and what a sensor `reads` of it `rate_hz` times a second.
pub(crate) fn recorded(
    plant: &mut dyn Plant,
    step_s: f64,
    steps: usize,
    rate_hz: f64,
    volts: impl Fn(f64) -> f64,
    mut reads: impl FnMut(f64) -> f64,
) -> Observation {
    let every = (1.0 / (rate_hz * step_s)).round() as usize;
    let (mut time_s, mut drive, mut measured) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..steps {
        let t = k as f64 * step_s;
        if k.is_multiple_of(every) {
            time_s.push(t);
            drive.push(volts(t));
            measured.push(reads(plant.displacement_m()));
        }
        plant.advance(volts(t + 0.5 * step_s));
    }
    let input = Input::Voltage(Samples { time_s: time_s.clone(), value: drive });
    observation("a film", input, Samples { time_s, value: measured }, rate_hz)
}

/// Normal noise of this RMS.
pub(crate) fn noise(seed: u64, rms: f64) -> impl FnMut() -> f64 {
    let (mut random, noise) = (Pcg64::seed_from_u64(seed), Normal::new(0.0, rms).expect("valid"));
    move || noise.sample(&mut random)
}

/// Displacement (m) of the model of `parameters` under `voltage_v` at `rate_hz`, in double precision.
pub(crate) fn moved_m(parameters: &Parameters, voltage_v: Vec<f64>, rate_hz: f64, memory: MemoryChoice) -> Vec<f64> {
    let grid = Grid { rate_hz, samples: voltage_v.len() };
    let input = Input::Voltage(Samples { time_s: grid.times_s(), value: voltage_v });
    let options = RunOptions { memory, precision: Precision::F64, rate_hz };
    simulate::response(parameters, &input, grid, &options, &ProgressBar::hidden()).expect("moves").displacement_m
}

/// Displacements (m) of `plant` after each of `volts`.
pub(crate) fn driven(plant: &mut dyn Plant, volts: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let step = |volts| {
        plant.advance(volts);
        plant.displacement_m()
    };
    volts.into_iter().map(step).collect()
}

/// Settings with parallel branches, without uncertainty.
pub(crate) fn parallel(branches: Vec<usize>) -> Settings {
    Settings { branches, topologies: vec![Topology::Parallel], uncertainty: false, ..Settings::default() }
}

pub(crate) fn fitted(observations: &[Observation], settings: &Settings) -> Fit {
    fit::fit(observations, settings, &AtomicBool::new(false), &|_| {}).expect("a fit")
}

/// The fit to `recordings` of a film of this actuator, its settings, and the warnings about the rows.
pub(crate) fn fitted_to(
    recordings: &[Recording],
    options: &FitOptions,
    actuator: Actuator,
) -> host_io::Result<(Fit, Settings, Vec<Warning>)> {
    let settings = options.settings(None, Some((actuator, false)))?;
    let observed = options.observations(&recordings.iter().collect::<Vec<_>>())?;
    let (observations, warnings): (Vec<_>, Vec<_>) = observed.into_iter().unzip();
    let fit = fit::fit(&observations, &settings, &AtomicBool::new(false), &|_| ())?;
    Ok((fit, settings, warnings.concat()))
}

/// The parameters of `fit`, read from its file.
pub(crate) fn parameters(fit: &Fit, settings: &Settings, direction: Direction) -> Parameters {
    let text = fit.parameters(settings, direction, &[]).expect("parameters").to_toml();
    Parameters::from_toml(Path::new("fit.toml"), &text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Mean NRMSE over the recordings, %.
pub(crate) fn nrmse_pct(fit: &Fit) -> f64 {
    mean_nrmse_pct(&fit.agreements)
}

/// A rise to `low_m` within `rise_s`, and a sine of `hz` from there to `high_m` behind it.
pub(crate) fn risen_sine_m(t: f64, rise_s: f64, low_m: f64, high_m: f64, hz: f64) -> f64 {
    let swing = if t < rise_s { 0.0 } else { 1.0 - (std::f64::consts::TAU * (hz * (t - rise_s)).fract()).cos() };
    low_m * minimum_jerk(t / rise_s) + 0.5 * (high_m - low_m) * swing
}

/// The bench's observer at 1 kHz, slower where the law of `parameters` rings.
pub(crate) fn observer(parameters: &Parameters) -> ObserverOptions {
    ObserverOptions::at_bandwidth(0.6).below_resonance(&parameters.film().compressed_law::<f32>(1000.0).expect("a law"))
}

/// A controller at 1 kHz in single precision, with the bench's observer.
pub(crate) fn controller(
    kind: ControllerKind,
    parameters: &Parameters,
    limits: CommandLimits,
    learning: Option<LearningOptions>,
    peak_m: f64,
) -> Box<dyn Controller> {
    let observer = observer(parameters);
    let settings = ControllerSettings { rate_hz: 1000.0, limits, observer, learning, peak_m };
    controllers::build(kind, parameters, &settings, Precision::F32).expect("valid")
}

/// Errors (m) of `plant` under the voltages that feedforward finds for `wanted` (m), at 1 kHz.
pub(crate) fn feedforward_errors_m(
    parameters: &Parameters,
    wanted: &[f64],
    limits: CommandLimits,
    plant: &mut dyn Plant,
) -> Vec<f64> {
    let (options, bar) = (RunOptions::default(), ProgressBar::hidden());
    let grid = Grid { rate_hz: 1000.0, samples: wanted.len() };
    let plan = feedforward::plan(parameters, wanted, grid, &options, limits, &bar).expect("a plan");
    driven(plant, plan.voltage_v).iter().zip(wanted).map(|(x, wanted)| x - wanted).collect()
}

/// Largest difference of two series.
pub(crate) fn far(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |far: f64, (a, b)| far.max((a - b).abs()))
}
