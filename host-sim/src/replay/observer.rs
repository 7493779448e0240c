//! The observer over a recording: what the controller would have known.

use indicatif::ProgressBar;
use serde::Serialize;
use springpot::{Observer, ObserverOptions, Real, Sample};

use crate::error::{Error, Result};
use crate::files::parameters::Parameters;
use crate::files::recording::Samples;
use crate::grid::Grid;
use crate::replay::simulate::{Precision, compressed_law};

/// Estimates, one value per sample of the grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimates {
    /// The estimated displacement, m.
    pub displacement_m: Vec<f64>,
    /// The sample that arrived, m; NaN where none did.
    pub sample_m: Vec<f64>,
    /// Estimated disturbance force, N.
    pub disturbance_n: Vec<f64>,
    /// Estimated force scale.
    pub force_scale: Vec<f64>,
    /// The last innovation, m.
    pub innovation_m: Vec<f64>,
    /// Its running mean and standard deviation, m.
    pub innovation_mean_m: Vec<f64>,
    /// See `innovation_mean_m`.
    pub innovation_std_m: Vec<f64>,
}

/// What an observer made of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Observed {
    /// Sensor samples that were taken in.
    pub samples: usize,
    /// RMS of the innovation over all of them, m.
    pub innovation_rms_m: f64,
    /// Disturbance at the end, N.
    pub disturbance_n: f64,
    /// Force scale at the end.
    pub force_scale: f64,
}

impl Estimates {
    /// What is worth telling.
    pub fn observed(&self) -> Observed {
        let taken = self.sample_m.iter().zip(&self.innovation_m).filter(|(sample, _)| !sample.is_nan());
        let (samples, square) = taken.fold((0, 0.0), |(n, sum), (_, e)| (n + 1, sum + e * e));
        let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
        Observed {
            samples,
            innovation_rms_m: (square / samples as f64).sqrt(),
            disturbance_n: last(&self.disturbance_n),
            force_scale: last(&self.force_scale),
        }
    }
}

/// Runs the observer of `parameters` under `voltage_v` (on `grid`) with the `measured` displacements, whose times are those
/// at which they were measured.
///
/// # Errors
///
/// [`Error`] where a law or the observer's options are refused.
pub fn observe(
    parameters: &Parameters,
    voltage_v: &[f64],
    measured: &Samples,
    grid: Grid,
    options: ObserverOptions,
    precision: Precision,
    progress: &ProgressBar,
) -> Result<Estimates> {
    match precision {
        Precision::F32 => run::<f32>(parameters, voltage_v, measured, grid, options, progress),
        Precision::F64 => run::<f64>(parameters, voltage_v, measured, grid, options, progress),
    }
}

fn run<T: Real>(
    parameters: &Parameters,
    voltage_v: &[f64],
    measured: &Samples,
    grid: Grid,
    options: ObserverOptions,
    progress: &ProgressBar,
) -> Result<Estimates> {
    let law = compressed_law::<T>(&parameters.model, grid.rate_hz)?;
    let rest = law.state();
    let largest = voltage_v.iter().fold(1.0, |largest: f64, v| largest.max(v.abs()));
    let observer: Observer<T> =
        Observer::new(law, &parameters.actuator, largest, options).map_err(|error| match error {
            springpot::ControlError::Actuator(error) => error.into(),
            error => Error::option("--bandwidth", error.to_string()),
        })?;
    let mut state = observer.state(rest);
    let mut estimates = Estimates::default();
    let mut next = 0;
    for (k, &volts) in voltage_v.iter().enumerate() {
        // The newest of the samples that were measured since the last tick.
        let mut reading = f64::NAN;
        while next < measured.time_s.len() && measured.time_s[next] <= grid.time_s(k) + 1e-9 {
            reading = measured.value[next];
            next += 1;
        }
        let sample = (!reading.is_nan())
            .then(|| Sample { displacement: T::from_f64(reading - parameters.sensor_offset_m), age_ticks: 0 });
        let estimate = observer.observe(&mut state, T::from_f64(volts), sample);
        estimates.displacement_m.push(estimate.to_f64());
        estimates.sample_m.push(reading);
        estimates.disturbance_n.push(state.disturbance().to_f64());
        estimates.force_scale.push(state.force_scale().to_f64());
        estimates.innovation_m.push(state.innovation().to_f64());
        estimates.innovation_mean_m.push(state.statistics().mean().to_f64());
        estimates.innovation_std_m.push(state.statistics().variance().to_f64().max(0.0).sqrt());
        if k % 4096 == 4095 {
            progress.inc(4096);
        }
    }
    if !estimates.displacement_m.iter().chain(&estimates.disturbance_n).all(|value| value.is_finite()) {
        return Err(Error::Computation(
            "the estimate leaves the range of the number type; check the units of the recording and the parameters"
                .into(),
        ));
    }
    Ok(estimates)
}
