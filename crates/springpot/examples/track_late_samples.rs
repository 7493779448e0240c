//! Follows a sine with a sensor of 100 Hz whose samples arrive 15 ms late, on a film that is stiffer than its model.
//!
//! `cargo run --example track_late_samples`

use std::collections::VecDeque;
use std::error::Error;
use std::f64::consts::TAU;

use springpot::{
    Actuator, Applied, CommandLimits, Feedforward, Law, LawOptions, LawState, Maxwell, ObserverOptions, SensorSample,
    Springpot, Topology, Tracking, VoltageDrive,
};

const STEP_S: f64 = 1e-3;
const INTERVAL: usize = 10;
const DELAY: usize = 15;

/// The film: a quarter stiffer than the model that the controller has.
struct Film {
    law: Law<f64>,
    drive: VoltageDrive<f64>,
    state: LawState<f64>,
}

impl Film {
    fn new(model: &Maxwell) -> Result<Self, Box<dyn Error>> {
        let law: Law<f64> = Law::compressed(&model.clone().scaled(1.25)?, LawOptions::at_step(STEP_S))?;
        let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6000.0, law.stiffness())?;
        Ok(Self { state: law.state(), law, drive })
    }

    fn step(&mut self, voltage: f32) -> f64 {
        self.law.displacement_under(&mut self.state, self.drive.load(voltage.into()))
    }
}

/// Samples on their way: measured every tenth tick, received 15 ticks later.
#[derive(Default)]
struct Line {
    measured: VecDeque<(usize, f32)>,
}

impl Line {
    fn read(&mut self, tick: usize, displacement_m: f64) -> Option<SensorSample<f32>> {
        if tick.is_multiple_of(INTERVAL) {
            self.measured.push_back((tick, displacement_m as f32));
        }
        let due = self.measured.front().is_some_and(|(at, _)| at + DELAY <= tick);
        let (at, displacement) = if due { self.measured.pop_front()? } else { return None };
        // The age says which prediction the sample is compared with.
        Some(SensorSample { displacement_m: displacement, age_ticks: tick - at })
    }
}

/// The reference rises within 4 s, then swings between 0.5 and 0.9 mm at 0.1 Hz.
fn reference_m(tick: usize) -> f32 {
    let time = STEP_S * tick as f64;
    let share = (time / 4.0).min(1.0);
    let rise = share * share * (3.0 - 2.0 * share);
    let wave = if time < 4.0 { 0.0 } else { 0.2e-3 * (1.0 - (TAU * 0.1 * (time - 4.0)).cos()) };
    (0.5e-3 * rise + wave) as f32
}

/// RMS error (m) after a minute, of a controller given by its tick: displacement of the film → voltage.
fn error_m(model: &Maxwell, mut tick_of: impl FnMut(usize, f64) -> f32) -> Result<f64, Box<dyn Error>> {
    let mut film = Film::new(model)?;
    let (mut x, mut squares) = (0.0, 0.0);
    for tick in 0..90_000 {
        let voltage = tick_of(tick, x);
        x = film.step(voltage);
        if tick >= 60_000 {
            squares += (x - f64::from(reference_m(tick))).powi(2);
        }
    }
    Ok((squares / 30_000.0_f64).sqrt())
}

fn main() -> Result<(), Box<dyn Error>> {
    let springpot = Springpot::new;
    let branches = [[springpot(1.1e4, 0.0), springpot(9e3, 1.0)], [springpot(7e3, 0.02), springpot(7e4, 0.95)]];
    let model = Maxwell::new(springpot(4e4, 0.03), &branches, Topology::Parallel, 0.316)?;
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(STEP_S))?;
    let (actuator, limits) = (Actuator::KARNER_2022, CommandLimits::BENCH);

    // Without the sensor.
    let feedforward = Feedforward::new(law.clone(), &actuator, limits)?;
    let mut state = feedforward.state(law.state());
    let mut voltage = 0.0;
    let without = error_m(&model, |tick, _| {
        feedforward.apply(&mut state, Applied::as_commanded(voltage));
        voltage = feedforward.command(&mut state, reference_m(tick)).voltage_v;
        voltage
    })?;

    // With the sensor. The observer knows its delay and keeps the predictions of the last 64 ticks.
    let options = ObserverOptions {
        sample_interval_s: INTERVAL as f64 * STEP_S,
        delay_s: DELAY as f64 * STEP_S,
        ..ObserverOptions::at_bandwidth(0.6)
    };
    let tracking: Tracking<f32> = Tracking::new(law.clone(), &actuator, limits, options)?;
    let mut state = tracking.state(law.state());
    let mut line = Line::default();
    let mut voltage = 0.0;
    let with = error_m(&model, |tick, displacement_m| {
        let sample = line.read(tick, displacement_m);
        tracking.observe(&mut state, Applied::as_commanded(voltage), sample);
        voltage = tracking.command(&mut state, reference_m(tick)).voltage_v;
        voltage
    })?;

    println!("RMS error without the sensor: {:.1} µm", 1e6 * without);
    println!("RMS error with late samples:  {:.4} µm", 1e6 * with);
    println!("force scale: {:.3} (the film is 1.25 times as stiff)", state.observer().force_scale());
    if with > 0.02 * without { Err("the sensor did not help".into()) } else { Ok(()) }
}
