//! The observer over a recording: what a controller would have estimated.

use dea_driver::Control;
use serde::Serialize;
use springpot::{Applied, ControlError, Law, LawState, Memory, Observer, ObserverOptions, Real, SensorSample};

use crate::error::{Error, Result};
use crate::files::parameters::Parameters;
use crate::files::recording::{Input, Recording};
use crate::grid::{Grid, Samples};
use crate::progress::Watch;
use crate::quantity::{at_most, positive};
use crate::replay::memory::{OnLaw, Precision, on_compressed};
use crate::statistics::{differences, median, peak};

/// Estimates, one value per sample of the grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimates {
    /// Bandwidth of the observer, Hz.
    pub bandwidth_hz: f64,
    /// The estimated displacement, m.
    pub displacement_m: Vec<f64>,
    /// The sensor's reading that arrived, offset included, m; NaN where none did.
    pub sample_m: Vec<f64>,
    /// Estimated disturbance force, N.
    pub disturbance_n: Vec<f64>,
    /// Estimated force scale.
    pub force_scale: Vec<f64>,
    /// The last innovation, m.
    pub innovation_m: Vec<f64>,
    /// Running mean of the innovation, m.
    pub innovation_mean_m: Vec<f64>,
    /// Running standard deviation of the innovation, m.
    pub innovation_std_m: Vec<f64>,
}

/// An observer's run over a recording in a few numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ObserverSummary {
    /// Bandwidth of the observer, Hz.
    pub bandwidth_hz: f64,
    /// Sensor samples that were used.
    pub samples: usize,
    /// RMS of the innovation over all of them, m.
    pub innovation_rms_m: f64,
    /// Disturbance at the end, N.
    pub disturbance_n: f64,
    /// Force scale at the end.
    pub force_scale: f64,
}

impl Estimates {
    /// The run in a few numbers.
    pub fn summary(&self) -> ObserverSummary {
        let taken = self.sample_m.iter().zip(&self.innovation_m).filter(|(sample, _)| !sample.is_nan());
        let (samples, square) = taken.fold((0, 0.0), |(n, sum), (_, e)| (n + 1, sum + e * e));
        let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
        ObserverSummary {
            bandwidth_hz: self.bandwidth_hz,
            samples,
            innovation_rms_m: (square / samples as f64).sqrt(),
            disturbance_n: last(&self.disturbance_n),
            force_scale: last(&self.force_scale),
        }
    }
}

/// The options of an observer of `bandwidth_hz` and `adaptation_s` for the sample times of `measured`, on `grid`: the sensor
/// counts as lost after five median intervals.
///
/// # Errors
///
/// [`Error::Computation`] for fewer than two samples.
pub fn options(bandwidth_hz: f64, adaptation_s: f64, measured: &Samples, grid: Grid) -> Result<ObserverOptions> {
    let intervals: Vec<f64> = differences(&measured.time_s).collect();
    if intervals.is_empty() {
        return Err(Error::Computation("one measured displacement; the observer needs at least 2".into()));
    }
    let interval_s = median(&intervals).max(grid.step_s());
    // In the controller's single precision, as the closed loop has them.
    let control = Control {
        bandwidth_hz: bandwidth_hz as f32,
        sample_interval_s: interval_s as f32,
        delay_s: 0.0,
        lost_after_s: (5.0 * interval_s) as f32,
        adaptation_s: adaptation_s as f32,
        ..Control::BENCH
    };
    Ok(control.observer_options())
}

/// How an observer of a recording is tuned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Up to here the estimate follows the sensor, beyond it the model, Hz; that of [`Control::BENCH`], or the most that
    /// sensor and model allow, if `None`.
    bandwidth_hz: Option<f64>,
    /// Time over which a disturbance that swings with the load becomes a change of the force scale, s; 0 for never.
    adaptation_s: f64,
}

impl Tuning {
    /// The bandwidth above 0 Hz, the adaptation from 0 to 1e9 s.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] naming the one that is not.
    pub fn new(bandwidth_hz: Option<f64>, adaptation_s: f64) -> Result<Self> {
        if let Some(hz) = bandwidth_hz {
            positive("bandwidth_hz", hz)?;
        }
        at_most("adaptation_s", adaptation_s, 1e9)?;
        Ok(Self { bandwidth_hz, adaptation_s })
    }
}

/// The inputs of an observer from a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservedRecording {
    /// The observer's ticks.
    pub grid: Grid,
    /// The voltage at each of them, V.
    pub voltage_v: Vec<f64>,
    /// The sensor's readings, when they were measured, m.
    pub measured: Samples,
}

impl ObservedRecording {
    /// The inputs from `recording`, for ticks at `rate_hz`.
    ///
    /// # Errors
    ///
    /// [`Error`] naming a recording without voltage or displacement.
    pub fn from_recording(recording: &Recording, rate_hz: f64) -> Result<Self> {
        let grid = recording.grid(rate_hz)?;
        let Input::Voltage(voltage) = recording.drive()? else {
            let cause = "no column voltage_v or voltage_kv; the observer needs the voltage";
            return Err(Error::file(recording.path(), cause));
        };
        Ok(Self { grid, voltage_v: grid.resample(&voltage), measured: recording.displacement()? })
    }

    /// Runs the observer of `parameters`, tuned to the times of the readings by [`options`].
    ///
    /// # Errors
    ///
    /// As [`options`] and [`estimate`].
    pub fn estimate(
        &self,
        parameters: &Parameters,
        tuning: Tuning,
        precision: Precision,
        progress: &dyn Watch,
    ) -> Result<Estimates> {
        let delay_s = parameters.sensor_delay_s.max(0.0);
        let wanted_hz = tuning.bandwidth_hz.unwrap_or(Control::BENCH.bandwidth_hz.into());
        let mut options =
            ObserverOptions { delay_s, ..options(wanted_hz, tuning.adaptation_s, &self.measured, self.grid)? };
        if tuning.bandwidth_hz.is_none() {
            options.bandwidth_hz = options.bandwidth_hz.min(options.max_bandwidth_hz());
            options = options.below_resonance(&parameters.film().compressed_law::<f64>(self.grid.rate_hz)?);
        }
        let estimates = estimate(parameters, &self.voltage_v, &self.measured, self.grid, options, precision, progress);
        estimates.map_err(|error| match error {
            // Here it is the parameters' own.
            Error::Field { field: "sensor_delay_s", cause } => {
                Error::Computation(format!("sensor_delay_s of the parameters: {cause}"))
            }
            error => error,
        })
    }
}

/// Runs the observer of `parameters` under `voltage_v` (on `grid`) with the sensor's readings `measured` at the times at
/// which they were measured.
///
/// # Errors
///
/// [`Error`] where a law or the observer's options are refused.
pub fn estimate(
    parameters: &Parameters,
    voltage_v: &[f64],
    measured: &Samples,
    grid: Grid,
    options: ObserverOptions,
    precision: Precision,
    progress: &dyn Watch,
) -> Result<Estimates> {
    let run = ObserverRun { parameters, voltage_v, measured, grid, options, progress };
    let estimates = on_compressed(parameters.film(), grid.rate_hz, precision, run)?;
    if !estimates.displacement_m.iter().chain(&estimates.disturbance_n).all(|value| value.is_finite()) {
        return Err(Error::Computation(
            "the estimate leaves the range of the number type; check the units of the recording and the parameters"
                .into(),
        ));
    }
    Ok(estimates)
}

/// An observer's refusal, as an error about its bandwidth, the sensor's delay or the actuator.
pub fn refused(error: ControlError) -> Error {
    match error {
        ControlError::Actuator(error) => error.into(),
        ControlError::SensorTooLate { .. } => Error::field("sensor_delay_s", error.to_string()),
        ControlError::Force { .. } => Error::Computation(error.to_string()),
        error => Error::field("bandwidth_hz", error.to_string()),
    }
}

struct ObserverRun<'a> {
    parameters: &'a Parameters,
    voltage_v: &'a [f64],
    measured: &'a Samples,
    grid: Grid,
    options: ObserverOptions,
    progress: &'a dyn Watch,
}

impl OnLaw for ObserverRun<'_> {
    type Output = Estimates;

    fn on_law<T: Real, M: Memory<T>>(self, law: Law<T, M>, rest: LawState<T, M>) -> Result<Estimates> {
        let sensor = self.parameters.sensor();
        let age_ticks = (sensor.delay_s.max(0.0) * self.grid.rate_hz).round() as usize;
        let largest = peak(self.voltage_v).max(1.0);
        let observer: Observer<T, M> =
            Observer::new(law, &self.parameters.actuator, f64::from(largest as f32), self.options).map_err(refused)?;
        let mut state = observer.state(rest);
        let mut estimates = Estimates { bandwidth_hz: self.options.bandwidth_hz, ..Estimates::default() };
        let mut next = 0;
        for (k, &volts) in self.voltage_v.iter().enumerate() {
            // The newest of the samples that were measured since the last tick.
            let mut reading = f64::NAN;
            while next < self.measured.time_s.len() && self.measured.time_s[next] <= self.grid.time_s(k) + 1e-9 {
                reading = self.measured.value[next];
                next += 1;
            }
            let sample = (!reading.is_nan())
                .then(|| SensorSample { displacement_m: T::from_f64(sensor.film_displacement_m(reading)), age_ticks });
            let estimate = observer.observe(&mut state, Applied::as_commanded(T::from_f64(volts)), sample);
            estimates.displacement_m.push(estimate.to_f64());
            estimates.sample_m.push(reading);
            estimates.disturbance_n.push(state.disturbance().to_f64());
            estimates.force_scale.push(state.force_scale().to_f64());
            estimates.innovation_m.push(state.innovation().to_f64());
            estimates.innovation_mean_m.push(state.statistics().mean().to_f64());
            estimates.innovation_std_m.push(state.statistics().variance().to_f64().max(0.0).sqrt());
            if k % 4096 == 4095 {
                self.progress.advance(4096)?;
            }
        }
        Ok(estimates)
    }
}
