//! A controller on a simulated film, through a sensor, an amplifier and a voltage monitor that are not ideal.
//!
//! The simulated sensor has no offset: its readings are displacements of the film plus noise.

use std::collections::VecDeque;

use serde::Serialize;
use springpot::{Applied, Limited, SensorSample};

use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::progress::Watch;
use crate::references::Periods;
use crate::simulation::controllers::{Controller, ControllerOutput};
use crate::simulation::film::{Film, Instruments, Readings};
use crate::simulation::plant::{NonlinearPlant, Plant};
use crate::statistics::{peak, range, rms};

/// Sensor, amplifier and voltage monitor between controller and film.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchModel {
    /// RMS noise of the displacement sensor, m.
    pub sensor_noise_m: f64,
    /// Samples of the displacement sensor per second.
    pub sensor_rate_hz: f64,
    /// Time until a sample arrives, s.
    pub sensor_delay_s: f64,
    /// Resolution of the sensor, m; 0 for none.
    pub sensor_quantum_m: f64,
    /// Times (s) from which and to which the sensor is lost.
    pub sensor_lost_s: Vec<(f64, f64)>,
    /// Time constant of the amplifier, s; 0 for none.
    pub amplifier_lag_s: f64,
    /// Time constant with which its voltage falls at the most, s: of its bleeder; 0 for no such limit.
    pub amplifier_bleeder_s: f64,
    /// Relative error of the voltage monitor; without a monitor the controller assumes its command.
    pub monitor_error: Option<f64>,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for BenchModel {
    /// 5 µm of noise, 100 Hz, 10 ms late, 1 µm resolution; no monitor, no lag.
    fn default() -> Self {
        let instruments = Instruments::default();
        Self {
            sensor_noise_m: instruments.displacement_noise_m,
            sensor_rate_hz: 100.0,
            sensor_delay_s: 0.01,
            sensor_quantum_m: instruments.displacement_quantum_m,
            sensor_lost_s: Vec::new(),
            amplifier_lag_s: 0.0,
            amplifier_bleeder_s: 0.0,
            monitor_error: None,
            seed: 1,
        }
    }
}

/// A closed loop's run, one value per sample of the grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoopRun {
    /// The reference as given, m.
    pub asked_m: Vec<f64>,
    /// The shaped reference, m: equal to the given one within the limits of speed and acceleration.
    pub reference_m: Vec<f64>,
    /// Displacement of the film, m.
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

/// How well a film followed its reference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrackingQuality {
    /// RMS error in % of the shaped reference's peak to peak, from t = 0; `None` for a constant reference.
    pub tracking_rms_pct: Option<f64>,
    /// The largest error in % of peak to peak.
    pub largest_pct: Option<f64>,
    /// RMS error of the last third of the run, in % of peak to peak.
    pub late_rms_pct: Option<f64>,
    /// Largest error of the last third of the run, in % of peak to peak.
    pub late_largest_pct: Option<f64>,
    /// RMS error against the reference as given, in % of its peak to peak: larger where that exceeds the limits.
    pub asked_rms_pct: Option<f64>,
    /// RMS error, m.
    pub rms_m: f64,
    /// Mean error of the last cycle minus that of the first, in % of peak to peak, where the reference is periodic.
    pub drift_pct: Option<f64>,
    /// Share of the time at 0 V while a negative force was asked for, %.
    pub infeasible_pct: f64,
    /// Share of the time in which any limit was met, %.
    pub limited_pct: f64,
    /// The limits that were met.
    pub limits_met: Vec<LimitShare>,
    /// Largest error, m.
    pub largest_error_m: f64,
    /// Largest voltage, V.
    pub largest_voltage_v: f64,
}

impl LoopRun {
    /// Keeps tick `k`; `progress` counts ticks and may end the run.
    pub(super) fn keep(&mut self, k: usize, tick: &LoopTick, progress: &dyn Watch) -> Result<()> {
        let output = &tick.output;
        self.asked_m.push(tick.asked_m);
        self.reference_m.push(tick.reference_m);
        self.displacement_m.push(tick.displacement_m);
        self.voltage_v.push(output.voltage_v);
        self.limited.push(output.limited);
        self.estimate_m.push(output.estimate_m.unwrap_or(f64::NAN));
        self.disturbance_n.push(output.disturbance_n.unwrap_or(f64::NAN));
        self.force_scale.push(output.force_scale.unwrap_or(f64::NAN));
        if k % 4096 == 4095 { progress.advance(4096) } else { Ok(()) }
    }

    /// Error, m.
    pub fn error_m(&self) -> Vec<f64> {
        self.displacement_m.iter().zip(&self.reference_m).map(|(x, r)| x - r).collect()
    }

    /// How well the film followed the reference.
    pub fn quality(&self) -> TrackingQuality {
        let error = self.error_m();
        let asked: Vec<f64> = self.displacement_m.iter().zip(&self.asked_m).map(|(x, r)| x - r).collect();
        let percent = percent_of(&self.reference_m);
        let periods = Periods::from_series(&self.reference_m).filter(|_| percent.is_some());
        let late = &error[error.len() - error.len() / 3..];
        TrackingQuality {
            tracking_rms_pct: percent.map(|percent| percent * rms(&error)),
            largest_pct: percent.map(|percent| percent * peak(&error)),
            late_rms_pct: percent.map(|percent| percent * rms(late)),
            late_largest_pct: percent.map(|percent| percent * peak(late)),
            asked_rms_pct: percent_of(&self.asked_m).map(|percent| percent * rms(&asked)),
            rms_m: rms(&error),
            drift_pct: periods.zip(percent).map(|(periods, percent)| percent * periods.drift(&error)),
            infeasible_pct: percent_where(&self.limited, |limited| limited.contains(Limited::BELOW_ZERO)),
            limited_pct: percent_where(&self.limited, |limited| !limited.is_none()),
            limits_met: LimitShare::from_limited(&self.limited),
            largest_error_m: peak(&error),
            largest_voltage_v: range(&self.voltage_v).1,
        }
    }
}

/// A limit, and how often it was met.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LimitShare {
    /// Its name.
    pub limit: &'static str,
    /// Share of the time in which it was met, %.
    pub pct: f64,
}

impl LimitShare {
    /// The limits that the samples in `limited` met.
    pub fn from_limited(limited: &[Limited]) -> Vec<Self> {
        let share = |&(limit, name): &(Limited, &'static str)| Self {
            limit: name,
            pct: percent_where(limited, |met| met.contains(limit)),
        };
        Limited::ALL.iter().map(share).filter(|met| met.pct > 0.0).collect()
    }

    /// `shares` in words, of the time.
    pub fn text(shares: &[Self]) -> String {
        if shares.is_empty() {
            return "no limit met".into();
        }
        let each: Vec<String> = shares.iter().map(|met| format!("{} {:.2} %", met.limit, met.pct)).collect();
        format!("limits met: {} of the time", each.join(", "))
    }
}

/// Share of the samples in `limited` to which `applies`, %.
fn percent_where(limited: &[Limited], applies: impl Fn(&Limited) -> bool) -> f64 {
    100.0 * limited.iter().filter(|limited| applies(limited)).count() as f64 / limited.len() as f64
}

/// Factor from metres to percent of a reference's peak to peak; `None` for a constant one.
fn percent_of(reference: &[f64]) -> Option<f64> {
    let (low, high) = range(reference);
    (high > low).then(|| 100.0 / (high - low))
}

/// The instruments and the amplifier while a loop runs.
struct RunningBench<'a> {
    model: &'a BenchModel,
    readings: Readings,
    delay_ticks: usize,
    /// Samples that have not arrived yet, with the tick at which each was taken.
    in_transit: VecDeque<(usize, f64)>,
    samples_taken: f64,
    /// Steps of the plant per tick.
    substeps: usize,
    /// Share of the remaining change that the amplifier makes in a substep.
    lag: f64,
    /// Share of its voltage that the bleeder leaves at least.
    left: f64,
    /// Voltage on the film, V.
    actual_v: f64,
}

impl<'a> RunningBench<'a> {
    fn new(model: &'a BenchModel, grid: Grid) -> Self {
        let instruments = Instruments {
            displacement_noise_m: model.sensor_noise_m,
            displacement_quantum_m: model.sensor_quantum_m,
            monitor_noise_v: if model.monitor_error.is_some() { Instruments::default().monitor_noise_v } else { 0.0 },
        };
        let (substeps, substep_s) = substeps(grid);
        let lag = if model.amplifier_lag_s > 0.0 { -(-substep_s / model.amplifier_lag_s).exp_m1() } else { 1.0 };
        Self {
            model,
            readings: Readings::new(instruments, model.seed),
            delay_ticks: (model.sensor_delay_s * grid.rate_hz).round() as usize,
            in_transit: VecDeque::new(),
            samples_taken: 0.0,
            substeps,
            lag,
            left: if model.amplifier_bleeder_s > 0.0 { (-substep_s / model.amplifier_bleeder_s).exp() } else { 0.0 },
            actual_v: 0.0,
        }
    }

    /// Measures `displacement` (m) at tick `k`, `now` (s), if a sample is due, and gives the sample that arrives.
    fn sample(&mut self, k: usize, now: f64, displacement: f64) -> Option<SensorSample<f64>> {
        if now >= self.samples_taken / self.model.sensor_rate_hz - 1e-9 {
            self.samples_taken += 1.0;
            let lost = self.model.sensor_lost_s.iter().any(|&(from, to)| (from..to).contains(&now));
            // Lost samples draw their noise as well: the rest of the run keeps its noise.
            let reading = self.readings.displacement_m(displacement);
            if !lost {
                self.in_transit.push_back((k, reading));
            }
        }
        let &(taken, displacement) = self.in_transit.front().filter(|(taken, _)| k - taken >= self.delay_ticks)?;
        self.in_transit.pop_front();
        Some(SensorSample { displacement_m: displacement, age_ticks: k - taken })
    }

    /// The applied voltage as the controller knows it, of which it `commanded` (V).
    fn applied(&mut self, commanded: f64) -> Applied<f64> {
        match self.model.monitor_error {
            Some(share) => Applied::as_monitored(commanded, self.readings.voltage_v(self.actual_v * (1.0 + share))),
            None => Applied::as_commanded(commanded),
        }
    }

    /// Advances `plant` for a tick under the `commanded` voltage (V).
    fn advance(&mut self, plant: &mut dyn Plant, commanded: f64) {
        for _ in 0..self.substeps {
            let followed_v = self.actual_v + self.lag * (commanded - self.actual_v);
            self.actual_v = followed_v.max(self.left * self.actual_v);
            plant.advance(self.actual_v);
        }
    }
}

/// Substeps of a plant in a tick of `grid`, and the duration of one, s: at most half a millisecond each.
pub fn substeps(grid: Grid) -> (usize, f64) {
    let substeps = ((2000.0 * grid.step_s()).ceil() as usize).max(1);
    (substeps, grid.step_s() / substeps as f64)
}

/// [`track_plant`] on `film`, from its rest.
pub fn track(
    film: &Film,
    bench: &BenchModel,
    controller: &mut dyn Controller,
    reference: &[f64],
    grid: Grid,
    progress: &dyn Watch,
) -> Result<LoopRun> {
    let mut plant = NonlinearPlant::at_rest(film, substeps(grid).1);
    track_plant(&mut plant, bench, controller, reference, grid, progress)
}

/// A tick of a closed loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopTick {
    /// The reference as given, m.
    pub asked_m: f64,
    /// The shaped reference, m.
    pub reference_m: f64,
    /// Displacement of the film, m.
    pub displacement_m: f64,
    /// The command of the controller from this tick on.
    pub output: ControllerOutput,
}

/// Runs `controller` along `reference` (m, on `grid`) on `plant`, which is at rest and advances in [`substeps`] of `grid`;
/// `progress` counts samples and may end the run. As [`follow`], with every tick kept.
pub fn track_plant(
    plant: &mut dyn Plant,
    bench: &BenchModel,
    controller: &mut dyn Controller,
    reference: &[f64],
    grid: Grid,
    progress: &dyn Watch,
) -> Result<LoopRun> {
    let mut run = LoopRun::default();
    follow(plant, bench, controller, held(reference), grid, |k, tick| run.keep(k, &tick, progress))?;
    Ok(run)
}

/// `reference` by the number of a sample: behind its end the last value.
pub(super) fn held(reference: &[f64]) -> impl Fn(usize) -> f64 {
    move |k| reference.get(k).or(reference.last()).copied().unwrap_or(0.0)
}

/// The error of a film that a loop has torn or pulled in at `time_s` under `volts`.
pub(super) fn torn(time_s: f64, volts: f64) -> Error {
    Error::Computation(format!(
        "the film is torn or pulled in at {time_s:.3} s under {volts:.0} V; lower the reference or `max_voltage_v`"
    ))
}

/// Runs `controller` along `reference` (m, of the number of a sample of `grid`) on `plant`, which is at rest and advances in [`substeps`]
/// of `grid`. `seen` is shown every tick with its number; nothing is kept, so that a run may last for days.
///
/// The tick at sample k measures the film as it is then and commands the voltage until sample k + 1, where the reference is
/// to be met.
///
/// # Errors
///
/// [`Error::Computation`] where the film is torn or pulled in, and what `seen` returns.
pub fn follow(
    plant: &mut dyn Plant,
    bench: &BenchModel,
    controller: &mut dyn Controller,
    reference: impl Fn(usize) -> f64,
    grid: Grid,
    mut seen: impl FnMut(usize, LoopTick) -> Result<()>,
) -> Result<()> {
    let mut bench = RunningBench::new(bench, grid);
    let mut commanded = 0.0;
    let mut asked = reference(0);
    let mut shaped = asked;
    for k in 0..grid.samples {
        let now = grid.time_s(k);
        let displacement = plant.displacement_m();
        let sample = bench.sample(k, now, displacement);
        let applied = bench.applied(commanded);
        let target = reference(k + 1);
        let output = controller.tick(applied, sample, target);
        seen(k, LoopTick { asked_m: asked, reference_m: shaped, displacement_m: displacement, output })?;

        asked = target;
        shaped = output.reference_m.unwrap_or(target);
        commanded = output.voltage_v;
        bench.advance(plant, commanded);
        if !plant.holds() {
            return Err(torn(now, commanded));
        }
    }
    Ok(())
}
