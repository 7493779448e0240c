//! A controller on the nonlinear film, through a sensor, an amplifier and a voltage monitor that are not ideal.

use std::collections::VecDeque;

use indicatif::ProgressBar;
use serde::Serialize;
use springpot::{Applied, Limited, Sample};

use crate::bench::controllers::Controller;
use crate::bench::film::{Film, Instruments, Readings};
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::references::Periods;

/// The bench between controller and film.
#[derive(Clone, Debug, PartialEq)]
pub struct Bench {
    /// RMS noise of the displacement sensor, m.
    pub sensor_noise_m: f64,
    /// Samples of the displacement sensor per second.
    pub sensor_rate_hz: f64,
    /// Time until a sample arrives, s.
    pub sensor_delay_s: f64,
    /// Steps in which the sensor reads, m; nought for none.
    pub sensor_quantum_m: f64,
    /// Times (s) from which and to which the sensor is lost.
    pub sensor_lost_s: Vec<(f64, f64)>,
    /// Time constant of the amplifier, s; nought for none.
    pub amplifier_lag_s: f64,
    /// What the voltage monitor reads too much, as a share; without a monitor the controller takes its command.
    pub monitor_error: Option<f64>,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Bench {
    /// 5 µm of noise, 100 Hz, 10 ms late, steps of 1 µm; no monitor, no lag.
    fn default() -> Self {
        let instruments = Instruments::default();
        Self {
            sensor_noise_m: instruments.displacement_noise_m,
            sensor_rate_hz: 100.0,
            sensor_delay_s: 0.01,
            sensor_quantum_m: instruments.displacement_quantum_m,
            sensor_lost_s: Vec::new(),
            amplifier_lag_s: 0.0,
            monitor_error: None,
            seed: 1,
        }
    }
}

/// What happened, one value per sample of the grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// The reference as it was given, m.
    pub asked_m: Vec<f64>,
    /// The shaped reference, m: the same while it keeps within the limits of speed and acceleration.
    pub reference_m: Vec<f64>,
    /// Where the film really was, m.
    pub displacement_m: Vec<f64>,
    /// The voltage that was commanded from this sample on, V.
    pub voltage_v: Vec<f64>,
    /// Limits that the command met.
    pub limited: Vec<Limited>,
    /// Estimated displacement, m.
    pub estimate_m: Vec<f64>,
    /// Estimated disturbance, N.
    pub disturbance_n: Vec<f64>,
    /// Estimated force scale.
    pub force_scale: Vec<f64>,
}

/// How well a film followed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tracked {
    /// RMS error in % of the shaped reference's peak to peak, from t = 0; none for a constant reference.
    pub tracking_rms_pct: Option<f64>,
    /// The same against the reference as it was given: larger where that asks for more than the limits allow.
    pub asked_rms_pct: Option<f64>,
    /// RMS error, m.
    pub rms_m: f64,
    /// Mean error of the last cycle minus that of the first, in % of peak to peak, where the reference is periodic.
    pub drift_pct: Option<f64>,
    /// Share of the time at 0 V while a negative force was asked for, %.
    pub infeasible_pct: f64,
    /// Largest error, m.
    pub largest_error_m: f64,
    /// Largest voltage, V.
    pub largest_voltage_v: f64,
}

impl Run {
    /// Error, m.
    pub fn error_m(&self) -> Vec<f64> {
        self.displacement_m.iter().zip(&self.reference_m).map(|(x, r)| x - r).collect()
    }

    /// How well the film followed.
    pub fn tracked(&self) -> Tracked {
        let error = self.error_m();
        let asked: Vec<f64> = self.displacement_m.iter().zip(&self.asked_m).map(|(x, r)| x - r).collect();
        let below = self.limited.iter().filter(|limited| limited.contains(Limited::BELOW_ZERO)).count();
        let percent = percent_of(&self.reference_m);
        let periods = Periods::of(&self.reference_m).filter(|_| percent.is_some());
        Tracked {
            tracking_rms_pct: percent.map(|percent| percent * rms(&error)),
            asked_rms_pct: percent_of(&self.asked_m).map(|percent| percent * rms(&asked)),
            rms_m: rms(&error),
            drift_pct: periods.zip(percent).map(|(periods, percent)| percent * periods.drift(&error)),
            infeasible_pct: 100.0 * below as f64 / error.len() as f64,
            largest_error_m: error.iter().fold(0.0, |largest: f64, e| largest.max(e.abs())),
            largest_voltage_v: bounds(&self.voltage_v).1,
        }
    }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|e| e * e).sum::<f64>() / values.len() as f64).sqrt()
}

/// What makes metres percent of a reference's peak to peak; nothing for a constant one.
fn percent_of(reference: &[f64]) -> Option<f64> {
    let (low, high) = bounds(reference);
    (high > low).then(|| 100.0 / (high - low))
}

fn bounds(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)))
}

/// Steps of integration per tick, so that each is at most half a millisecond.
fn parts(grid: Grid) -> usize {
    ((2000.0 * grid.step_s()).ceil() as usize).max(1)
}

/// Runs `controller` along `reference` (m, on `grid`) on `film`; `progress` counts samples.
///
/// The tick at sample k sees the film as it is there and commands the voltage until sample k + 1, where the reference is
/// to be met.
///
/// # Errors
///
/// [`Error::Computation`] where the film is torn.
pub fn run(
    film: &Film,
    bench: &Bench,
    controller: &mut dyn Controller,
    reference: &[f64],
    grid: Grid,
    progress: &ProgressBar,
) -> Result<Run> {
    let instruments = Instruments {
        displacement_noise_m: bench.sensor_noise_m,
        displacement_quantum_m: bench.sensor_quantum_m,
        monitor_noise_v: if bench.monitor_error.is_some() { Instruments::default().monitor_noise_v } else { 0.0 },
    };
    let mut readings = Readings::new(instruments, bench.seed);
    let step = grid.step_s();
    let delay = (bench.sensor_delay_s * grid.rate_hz).round() as usize;
    let mut on_the_way: VecDeque<(usize, f64)> = VecDeque::new();
    let mut samples_taken = 0.0;

    let parts = parts(grid);
    let part = step / parts as f64;
    let lag = if bench.amplifier_lag_s > 0.0 { -(-part / bench.amplifier_lag_s).exp_m1() } else { 1.0 };
    let (mut commanded, mut actual) = (0.0, 0.0);
    let mut state = film.rest();
    let mut shaped = reference.first().copied().unwrap_or(0.0);
    let mut run = Run::default();
    for k in 0..grid.samples {
        let now = grid.time_s(k);
        let displacement = film.displacement_m(&state);
        if now >= samples_taken / bench.sensor_rate_hz - 1e-9 {
            samples_taken += 1.0;
            let lost = bench.sensor_lost_s.iter().any(|&(from, to)| (from..to).contains(&now));
            let reading = readings.displacement_m(displacement);
            if !lost {
                on_the_way.push_back((k, reading));
            }
        }
        let arrived = on_the_way.front().filter(|(taken, _)| k - taken >= delay).copied();
        let sample = arrived.map(|(taken, reading)| {
            on_the_way.pop_front();
            Sample { displacement: reading, age_ticks: k - taken }
        });
        let applied = match bench.monitor_error {
            Some(share) => Applied::as_monitored(commanded, readings.voltage_v(actual * (1.0 + share))),
            None => Applied::as_commanded(commanded),
        };
        let target = reference.get(k + 1).or(reference.last()).copied().unwrap_or(0.0);
        let output = controller.tick(applied, sample, target);

        run.asked_m.push(reference.get(k).copied().unwrap_or(shaped));
        run.reference_m.push(shaped);
        run.displacement_m.push(displacement);
        run.voltage_v.push(output.voltage_v);
        run.limited.push(output.limited);
        run.estimate_m.push(output.estimate_m.unwrap_or(f64::NAN));
        run.disturbance_n.push(output.disturbance_n.unwrap_or(f64::NAN));
        run.force_scale.push(output.force_scale.unwrap_or(f64::NAN));

        shaped = output.reference_m.unwrap_or(target);
        commanded = output.voltage_v;
        for _ in 0..parts {
            actual += lag * (commanded - actual);
            state = film.advanced(&state, actual, part, 1);
        }
        if !film.holds(&state) {
            return Err(Error::Computation(format!(
                "the film is torn or pulled in at {now:.3} s under {commanded:.0} V; lower the reference or --max-voltage"
            )));
        }
        if k % 4096 == 4095 {
            progress.inc(4096);
        }
    }
    Ok(run)
}
