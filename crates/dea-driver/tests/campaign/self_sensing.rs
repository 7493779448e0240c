//! Films that are their own and only sensor, on models and strips, tracking: one that breaks, a monitor of the current that fails, an amplifier that
//! does not pass the tone, each at a random time, and a monitor whose gain is wrong.
//!
//! Pass: what breaks ends at 0 V within 100 ms, latched with a cause of its own; a film that conducts does if it draws more than the largest current at the
//! lowest drive as well. With less, and with a wrong gain, the film stays within 1.1 times its stroke
//! for the 12 s of the run. The healthy twin of every run does not trip, unless the film is not the model and the trip says so. In every tick the command
//! is within slew and voltage. 60 runs in the sample, 3 000 in full.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use dea_driver::{Blob, Cause, Controller, DriverState, Inputs, Mode, Parameters};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::circuit::{CONVERTERS, Circuit, amplified, converted, sensed_parameters};
use crate::film::Film;
use crate::scale::cases;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Electrode,
    /// A leak of this resistance, Ω, of which the lowest drive shows a short, and one of which a higher one may.
    Short(f64),
    Leak(f64),
    /// The reading of the current stays at this, A.
    Stuck(f64),
    /// Its converter does not answer.
    Silent,
    /// The amplifier gives the mean of the last four commands.
    NoTone,
    /// The monitor of the current shows so many times as much.
    Gain(f64),
}

const FILMS: [&str; 6] = ["model", "stiffer", "softer", "less force", "strip", "warms"];

#[derive(Clone, Debug)]
struct Case {
    number: u64,
    fault: Fault,
    film: &'static str,
    parameter: f64,
    limit_m: f64,
    /// Mean and amplitude, m, and frequency, Hz.
    swing: [f64; 3],
    /// Tick of the fault.
    begins: u32,
}

impl Case {
    fn new(number: u64) -> Self {
        let random = &mut Pcg64::seed_from_u64(number);
        let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let fault = match number % 7 {
            0 => Fault::Electrode,
            1 => Fault::Short(10f64.powf(between(3.0, 5.15))),
            2 => Fault::Stuck(between(-0.25e-3, 0.25e-3)),
            3 => Fault::Silent,
            4 => Fault::NoTone,
            5 => Fault::Leak(10f64.powf(between(5.15, 8.0))),
            _ => Fault::Gain(between(0.9, 1.1)),
        };
        let film = FILMS[(number / 7) as usize % 6];
        let parameter = match film {
            "stiffer" => between(1.05, 1.2),
            "softer" => between(0.8, 0.95),
            "less force" => between(0.7, 0.95),
            "strip" => between(0.05, 1.0),
            "warms" => between(1.1, 1.6),
            _ => 1.0,
        };
        let limit_m = if between(0.0, 1.0) < 0.5 { 1e-3 } else { 2e-3 };
        let most_m = 0.6 * limit_m;
        let mean_m = most_m * between(0.5, 0.8);
        let swing = [mean_m, between(0.0, most_m - mean_m), between(0.05, 1.5)];
        let begins = between(8000.0, 10_000.0) as u32;
        Self { number, fault, film, parameter, limit_m, swing, begins }
    }

    fn reference_m(&self, tick: u32) -> f32 {
        let time_s = f64::from(tick) * 1e-3;
        let [mean_m, amplitude_m, frequency_hz] = self.swing;
        ((time_s / 2.0).min(1.0) * (mean_m - amplitude_m * (TAU * frequency_hz * time_s).cos())) as f32
    }

    /// Whether a healthy film of that kind may trip so.
    fn is_honest(&self, cause: Cause) -> bool {
        match cause {
            Cause::Disturbance => self.film != "model",
            Cause::ModelDisplacement => !["model", "softer", "warms"].contains(&self.film),
            _ => false,
        }
    }
}

#[derive(Clone)]
struct Run {
    controller: Controller,
    parameters: Parameters,
    film: Film,
    circuit: Circuit,
    current_adc_v: Option<f32>,
    has_sensor: bool,
    displacement_m: f64,
    commands_v: [f64; 4],
    passes_tone: bool,
    is_silent: bool,
    film_v: f64,
    furthest_m: f64,
}

impl Run {
    /// A film that its sensor has shown at rest, and that is its own from the begin of the run on.
    fn new(case: &Case) -> Self {
        let mut parameters = sensed_parameters();
        parameters.limits.max_displacement_m = case.limit_m as f32;
        let blob = Blob::with_converters(parameters.clone(), &CONVERTERS).expect("valid");
        let mut run = Self {
            controller: Controller::new(blob),
            parameters,
            film: Film::of_kind(case.film, case.parameter),
            circuit: Circuit::new(!case.number),
            current_adc_v: None,
            has_sensor: true,
            displacement_m: 0.0,
            commands_v: [0.0; 4],
            passes_tone: true,
            is_silent: false,
            film_v: 0.0,
            furthest_m: 0.0,
        };
        run.tick();
        run.controller.arm().expect("healthy");
        run.controller.start(Mode::Tracking).expect("armed");
        run.has_sensor = false;
        run
    }

    fn tick(&mut self) {
        self.controller.note_current(self.current_adc_v.filter(|_| !self.is_silent));
        let before_v = self.controller.supervisor().command_v();
        let outputs = self.controller.tick(Inputs {
            interlock_closed: true,
            monitor_adc_v: Some(converted(self.film_v / 1000.0, 0.0)),
            sensor_adc_v: self.has_sensor.then(|| converted(1.0 + self.displacement_m / 1e-3, 0.0)),
        });
        let (command_v, limits) = (outputs.telemetry.command_v, &self.parameters.limits);
        let is_slow = (command_v - before_v).abs() < 1e-3 * limits.max_slew_v_per_s + 0.01;
        assert!(command_v == 0.0 || is_slow, "{before_v}, {command_v} V");
        assert!((0.0..=limits.max_voltage_v).contains(&command_v), "{command_v} V");
        self.commands_v.rotate_left(1);
        self.commands_v[3] = amplified(&outputs, self.parameters.command_range);
        let mean_v = self.commands_v.iter().sum::<f64>() / 4.0;
        self.film_v = if self.passes_tone || !outputs.enable { self.commands_v[3] } else { mean_v };
        self.displacement_m = self.film.step(self.film_v);
        self.furthest_m = self.furthest_m.max(self.displacement_m.abs());
        self.current_adc_v = Some(self.circuit.tick(self.film_v, self.displacement_m));
    }

    fn spoil(&mut self, fault: Fault) {
        match fault {
            Fault::Electrode => self.circuit.electrodes_ohm = 1e12,
            Fault::Short(ohm) | Fault::Leak(ohm) => self.circuit.leak_ohm = ohm,
            Fault::Stuck(amperes) => self.circuit.stuck_a = Some(amperes),
            Fault::NoTone => self.passes_tone = false,
            Fault::Gain(gain) => self.circuit.gain = gain,
            Fault::Silent => self.is_silent = true,
        }
    }

    /// Goes on for `ticks`: the trip, and its tick.
    fn go_on(&mut self, case: &Case, from: u32, ticks: u32) -> Option<(Cause, u32)> {
        for tick in from..from + ticks {
            if tick.is_multiple_of(10) {
                self.controller.heartbeat();
                self.controller.set_reference(case.reference_m(tick)).expect("within the limits, and live");
            }
            self.tick();
            if let DriverState::Tripped(cause) = self.controller.supervisor().state() {
                assert_eq!(self.film_v, 0.0, "{case:?}");
                return Some((cause, tick - from));
            }
        }
        None
    }
}

#[test]
fn a_film_that_is_its_only_sensor_ends_at_0_v_when_it_breaks() {
    let number = cases(60, 3000);
    let mut ends: BTreeMap<(String, String), u32> = BTreeMap::new();
    let (mut latest, mut farthest, mut spoiled) = (0, 0.0f64, 0);
    for case in (0..number).map(Case::new) {
        let mut twin = Run::new(&case);
        let mut healthy = |run: &mut Run, from, ticks| {
            let trip = run.go_on(&case, from, ticks);
            if let Some((cause, tick)) = trip {
                assert!(case.is_honest(cause), "healthy: {cause:?} in tick {}: {case:?}", from + tick);
                spoiled += 1;
            }
            trip.is_none()
        };
        if !healthy(&mut twin, 0, case.begins) {
            continue;
        }
        let mut faulty = twin.clone();
        healthy(&mut twin, case.begins, 12_000);
        faulty.spoil(case.fault);
        let trip = faulty.go_on(&case, case.begins, 12_000);
        let name = format!("{:?}", case.fault).split('(').next().unwrap_or_default().to_owned();
        *ends.entry((name, format!("{:?}", trip.map(|(cause, _)| cause)))).or_default() += 1;
        if let Fault::Gain(_) | Fault::Leak(_) = case.fault {
            farthest = farthest.max(faulty.furthest_m / case.limit_m);
            assert!(faulty.furthest_m < 1.1 * case.limit_m, "{:e} m, {trip:?}: {case:?}", faulty.furthest_m);
            continue;
        }
        let own = [Cause::NoTone, Cause::FilmShorted, Cause::CurrentMonitor, Cause::Electrode];
        let in_time = trip.is_some_and(|(cause, tick)| own.contains(&cause) && tick < 100);
        assert!(in_time, "{trip:?}: {case:?}");
        latest = latest.max(trip.map_or(0, |(_, tick)| tick + 1));
    }
    println!(
        "self-sensing: {number} runs, {spoiled} ended healthy; within {latest} ms; wrong gain or leak: {farthest:.3} of the stroke"
    );
    println!("{ends:#?}");
}
