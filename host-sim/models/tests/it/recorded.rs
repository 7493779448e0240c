//! Recordings that are made of films, fits to them, and controllers with what was fitted.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use host_io::files::parameters::Parameters;
use host_io::files::recording::{Direction, Input};
use host_io::grid::{Grid, Samples};
use host_models::fit::observation::{Observation, Reading};
use host_models::fit::{self, Fit, Settings};
use host_models::references::minimum_jerk;
use host_models::replay::feedforward;
use host_models::replay::memory::{Precision, RunOptions};
use host_models::simulation::controllers::{self, Controller, ControllerKind, ControllerSettings};
use host_models::simulation::plant::Plant;
use indicatif::ProgressBar;
use springpot::{CommandLimits, LearningOptions, ObserverOptions};

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

pub(crate) fn fitted(observations: &[Observation], settings: &Settings) -> Fit {
    fit::fit(observations, settings, &AtomicBool::new(false), &|_| {}).expect("a fit")
}

/// The parameters of `fit`, read from its file.
pub(crate) fn parameters(fit: &Fit, settings: &Settings, direction: Direction) -> Parameters {
    let text = fit.parameters(settings, direction, &[]).expect("parameters").to_toml();
    Parameters::from_toml(Path::new("fit.toml"), &text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Mean NRMSE over the recordings, %.
pub(crate) fn nrmse_pct(fit: &Fit) -> f64 {
    fit.agreements.iter().map(|a| a.nrmse_pct).sum::<f64>() / fit.agreements.len() as f64
}

/// A rise to `low_m` within `rise_s`, and a sine of `hz` from there to `high_m` behind it.
pub(crate) fn risen_sine_m(t: f64, rise_s: f64, low_m: f64, high_m: f64, hz: f64) -> f64 {
    let swing = if t < rise_s { 0.0 } else { 1.0 - (std::f64::consts::TAU * (hz * (t - rise_s)).fract()).cos() };
    low_m * minimum_jerk(t / rise_s) + 0.5 * (high_m - low_m) * swing
}

/// A controller at 1 kHz in single precision, with the bench's observer.
pub(crate) fn controller(
    kind: ControllerKind,
    parameters: &Parameters,
    limits: CommandLimits,
    learning: Option<LearningOptions>,
    peak_m: f64,
) -> Box<dyn Controller> {
    let observer = ObserverOptions::at_bandwidth(0.6);
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
    let error = |(&volts, wanted): (&f64, &f64)| {
        plant.advance(volts);
        plant.displacement_m() - wanted
    };
    plan.voltage_v.iter().zip(wanted).map(error).collect()
}

/// Root of the mean of the squares.
pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}
