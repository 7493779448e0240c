//! Displacement sensors that fail in ways that look plausible: frozen within the converter's noise, drifting, with another gain, slipped,
//! late; on the model as a film, on stiffer and softer ones, with less force, that warm, and on nonlinear strips that stiffen or are near
//! pull-in; in every mode, with and without learned cycles, and while tracking also with a law that follows its film, however far it seems to
//! have changed.
//!
//! Pass: it trips within a second of the fault, or the film itself stays within 1.1 times its stroke, near pull-in 1.25 times, for as long
//! as the run lasts: 12 s after the fault, drifts until they have led 1.2 times the stroke away, 120 s at the most. The healthy twin of every
//! run does not trip, unless the film is not the model and the trip says so. 350 runs in the sample, 10 500 in full.

use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::TAU;

use dea_driver::{AdaptationOrder, Blob, Cause, Controller, DriverState, Inputs, Mode, Parameters, SensorFault};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use springpot::{Actuator, Adapted};

use crate::bench::changed_parameters;
use crate::circuit::{amplified, converted};
use crate::film::Film;
use crate::scale::cases;

/// Ticks before the fault, of a millisecond.
const FAULT: u32 = 10_000;
/// Ticks by which a healthy sample is late.
const LATE: usize = 10;
/// Largest overshoot of a film beyond its stroke: the closer to pull-in, the less it is to its model as it was at smaller strokes.
fn margin(film: &str) -> f64 {
    if film == "pulls in" { 1.25 } else { 1.1 }
}

/// Reading of the sensor from the fault on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    /// The value of that moment, with noise of the converter, LSB rms.
    Frozen { noise_lsb: f64 },
    /// A growing error, m/s.
    Drift { m_per_s: f64 },
    /// Another gain.
    Gain(f64),
    /// A constant error, m.
    Slip(f64),
    /// A value that is so many ticks older.
    Delay(usize),
}

const FAULTS: [&str; 5] = ["frozen", "drift", "gain", "slip", "delay"];
const FILMS: [&str; 7] = ["model", "stiffer", "softer", "less force", "strip", "warms", "pulls in"];
/// And the harmonics that are learned.
const MODES: [(Mode, u8); 5] =
    [(Mode::Tracking, 0), (Mode::Feedforward, 0), (Mode::Voltage, 0), (Mode::Tracking, 6), (Mode::Feedforward, 6)];

/// Reference of the film, m.
#[derive(Clone, Debug)]
enum Shape {
    Sine { mean_m: f64, amplitude_m: f64, frequency_hz: f64 },
    Steps { levels_m: Vec<f64>, hold_s: f64 },
    Hold { level_m: f64 },
}

impl Shape {
    fn at(&self, tick: u32) -> f64 {
        let time_s = f64::from(tick) / 1000.0;
        let rise = (time_s / 2.0).min(1.0);
        match self {
            Self::Sine { mean_m, amplitude_m, frequency_hz } => {
                rise * (mean_m - amplitude_m * (TAU * frequency_hz * time_s).cos())
            }
            Self::Steps { levels_m, hold_s } => levels_m[(time_s / hold_s) as usize % levels_m.len()],
            Self::Hold { level_m } => rise * level_m,
        }
    }
}

#[derive(Clone, Debug)]
struct Case {
    number: u64,
    fault: Fault,
    mode: Mode,
    harmonics: u8,
    /// Whether the law follows its film.
    adapts: bool,
    film: &'static str,
    /// The film's stiffness, force or stiffening.
    parameter: f64,
    shape: Shape,
    limit_m: f64,
}

fn between(random: &mut Pcg64, low: f64, high: f64) -> f64 {
    low + (high - low) * random.random::<f64>()
}

/// Evenly over the decades.
fn scaled(random: &mut Pcg64, low: f64, high: f64) -> f64 {
    low * (high / low).powf(random.random::<f64>())
}

impl Case {
    fn new(number: u64) -> Self {
        let random = &mut Pcg64::seed_from_u64(number);
        let sign = if random.random_bool(0.5) { 1.0 } else { -1.0 };
        let fault = match FAULTS[number as usize % 5] {
            "frozen" => Fault::Frozen { noise_lsb: between(random, 0.0, 2.0) },
            "drift" => Fault::Drift { m_per_s: sign * scaled(random, 1e-6, 10e-3) },
            "gain" => Fault::Gain(scaled(random, 0.3, 3.0)),
            "slip" => Fault::Slip(sign * scaled(random, 0.05e-3, 1e-3)),
            _ => Fault::Delay(scaled(random, 10.0, 500.0) as usize),
        };
        let (mode, harmonics) = MODES[(number / 5) as usize % 5];
        let film = FILMS[(number / 25) as usize % 7];
        let parameter = match film {
            "stiffer" => 1.05 + 0.05 * f64::from(random.random_range(0..4u8)),
            "softer" => 0.8 + 0.05 * f64::from(random.random_range(0..4u8)),
            "less force" => between(random, 0.7, 0.95),
            "strip" => between(random, 0.05, 1.0),
            "warms" => between(random, 1.1, 1.6),
            "pulls in" => between(random, 50.0, 250.0),
            _ => 1.0,
        };
        let limit_m = [0.8e-3, 1e-3, 2e-3, 4e-3][random.random_range(0..4usize)];
        // Without the sensor a softer film goes further than its model.
        let most_m = limit_m * if mode == Mode::Tracking { 0.85 } else { 0.65 };
        let shape = match (number / 175) % 3 {
            0 => {
                let peak_m = most_m * between(random, 0.5, 1.0);
                let low_m = peak_m * between(random, 0.3, 0.8);
                let (mean_m, amplitude_m) = (0.5 * (peak_m + low_m), 0.5 * (peak_m - low_m));
                Shape::Sine { mean_m, amplitude_m, frequency_hz: scaled(random, 0.05, 1.5) }
            }
            1 => {
                let levels_m = (0..8).map(|_| most_m * between(random, 0.3, 1.0)).collect();
                Shape::Steps { levels_m, hold_s: between(random, 1.0, 5.0) }
            }
            _ => Shape::Hold { level_m: most_m * between(random, 0.3, 1.0) },
        };
        Self { number, fault, mode, harmonics, adapts: false, film, parameter, shape, limit_m }
    }

    /// Changes of another film that were kept, of every fourth law that adapts: anything that can be learned.
    fn kept(&self) -> Option<Adapted<f32>> {
        let mut random = Pcg64::seed_from_u64(self.number);
        let mut within = |bound: f32| random.random_range(-bound..bound);
        (self.adapts && self.number.is_multiple_of(4)).then(|| Adapted {
            force_scale: within(1.386).exp(),
            uncertainty: 0.1,
            memory: within(0.7),
            rate: within(1.1),
            stretch: within(0.25),
            bias_n: within(0.1),
            ageing: 1.0,
        })
    }

    /// A temperature that is not the film's, of every other fourth law that adapts: anything that can be stated.
    fn stated(&self) -> Option<AdaptationOrder> {
        let mut random = Pcg64::seed_from_u64(self.number);
        let mut within = |bound: f32| random.random_range(-bound..bound).exp();
        (self.adapts && self.number % 4 == 2)
            .then(|| AdaptationOrder::Temperature { stiffness: within(1.386), time: within(1.098) })
    }

    /// Ticks after the fault.
    fn duration(&self) -> u32 {
        match self.fault {
            Fault::Drift { m_per_s } => (1000.0 * (1.2 * self.limit_m / m_per_s.abs() + 3.0).clamp(12.0, 120.0)) as u32,
            _ => 12_000,
        }
    }
}

/// The controller, its film and its converters.
#[derive(Clone)]
struct Run {
    controller: Controller,
    film: Film,
    parameters: Parameters,
    random: Pcg64,
    film_v: f64,
    /// The film's displacement, the newest first, m.
    past_m: VecDeque<f64>,
    held_m: f64,
    furthest_m: f64,
}

impl Run {
    fn new(case: &Case) -> Self {
        let period_s = match case.shape {
            Shape::Sine { frequency_hz, .. } => 1.0 / frequency_hz as f32,
            _ => 2.0,
        };
        let parameters = changed_parameters(|p| {
            (p.limits.max_displacement_m, p.adapted) = (case.limit_m as f32, case.kept());
            (p.control.harmonics, p.control.period_s) = (case.harmonics, period_s);
        });
        let mut controller = Controller::new(Blob::new(parameters.clone()).expect("valid"));
        if case.adapts {
            controller.order_adaptation(AdaptationOrder::Learn { trip_at: f32::INFINITY }).expect("no bounds");
        }
        if let Some(temperature) = case.stated() {
            controller.order_adaptation(temperature).expect("within bounds");
        }
        Self {
            controller,
            film: Film::of_kind(case.film, case.parameter),
            parameters,
            random: Pcg64::seed_from_u64(!case.number),
            film_v: 0.0,
            past_m: VecDeque::from([0.0; 600]),
            held_m: 0.0,
            furthest_m: 0.0,
        }
    }

    /// Reading of an ADC of `volts` and noise, V.
    fn noisy(&mut self, volts: f64, noise_lsb: f64) -> f32 {
        let noise: f64 = StandardNormal.sample(&mut self.random);
        converted(volts, noise_lsb * noise)
    }

    fn state(&self) -> DriverState {
        self.controller.supervisor().state()
    }

    /// One tick; `fault`: the fault and the ticks since.
    fn tick(&mut self, fault: Option<(Fault, u32)>) {
        let noise: f64 = StandardNormal.sample(&mut self.random);
        // The laser's own noise, and what the converter adds.
        let (late_m, laser_m) = (self.past_m[LATE], 3e-6 * noise);
        let healthy_m = late_m + laser_m;
        let (shown_m, noise_lsb) = match fault {
            None => {
                self.held_m = healthy_m;
                (healthy_m, 0.6)
            }
            Some((Fault::Frozen { noise_lsb }, _)) => (self.held_m, noise_lsb),
            Some((Fault::Drift { m_per_s }, since)) => (healthy_m + m_per_s * 1e-3 * f64::from(since), 0.6),
            Some((Fault::Gain(gain), _)) => (gain * healthy_m, 0.6),
            Some((Fault::Slip(slip_m), _)) => (healthy_m + slip_m, 0.6),
            Some((Fault::Delay(ticks), _)) => (self.past_m[LATE + ticks] + laser_m, 0.6),
        };
        let sensor_adc_v = Some(self.noisy(1.0 + shown_m / 1e-3, noise_lsb));
        let monitor_adc_v = Some(self.noisy(self.film_v / 1000.0, 10.0));
        let outputs = self.controller.tick(Inputs { interlock_closed: true, monitor_adc_v, sensor_adc_v });
        self.film_v = amplified(&outputs, self.parameters.command_range);
        let displacement_m = self.film.step(self.film_v);
        self.past_m.pop_back();
        self.past_m.push_front(displacement_m);
        self.furthest_m = self.furthest_m.max(displacement_m.abs());
    }

    /// The request that a host sends every 10 ms.
    fn set(&mut self, case: &Case, tick: u32) {
        self.controller.heartbeat();
        let wanted_m = case.shape.at(tick);
        let set = match case.mode {
            // By a film of the stiffness that the model has after a minute.
            Mode::Voltage => {
                let per_square_volt = Actuator::KARNER_2022.force_per_square_volt();
                self.controller.set_voltage((wanted_m * 27e3 / per_square_volt).sqrt() as f32)
            }
            _ => self.controller.set_reference(wanted_m as f32),
        };
        set.expect("within the limits, and live");
    }

    /// Goes on from tick `from` for `ticks`, or until 50 ticks after a trip. Returns the trip and its tick after `from`.
    fn go_on(&mut self, case: &Case, from: u32, ticks: u32, fault: Option<Fault>) -> Option<(Cause, u32)> {
        for tick in 0..ticks {
            if (from + tick).is_multiple_of(10) {
                self.set(case, from + tick);
            }
            self.tick(fault.map(|fault| (fault, tick)));
            if let DriverState::Tripped(cause) = self.state() {
                for after in 1..=50 {
                    self.tick(fault.map(|fault| (fault, tick + after)));
                }
                return Some((cause, tick));
            }
        }
        None
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum End {
    WithinASecond,
    Later,
    Harmless,
    Violation,
}

/// Whether a healthy film of that kind may trip so: the check notices a film that the model does not describe.
fn is_honest(case: &Case, cause: Cause, furthest_m: f64) -> bool {
    match cause {
        _ if case.kept().is_some() || case.stated().is_some() => true,
        Cause::Displacement => furthest_m > 0.97 * case.limit_m,
        Cause::Disturbance => case.film != "model",
        // It hardly moves while the voltage does.
        Cause::Sensor(SensorFault::Stuck) => ["strip", "warms", "pulls in"].contains(&case.film),
        // It takes more voltage than the model's stroke allows.
        Cause::ModelDisplacement => !["model", "softer", "warms"].contains(&case.film),
        _ => false,
    }
}

#[derive(Debug, Default)]
struct Counts {
    ends: BTreeMap<(&'static str, End), u32>,
    causes: BTreeMap<(&'static str, String), u32>,
    /// Farthest after the fault, in strokes: by mode, learned harmonics, whether the law adapts, fault and film.
    farthest: BTreeMap<(String, u8, bool, &'static str, &'static str), f64>,
    ticks: u64,
    honest: BTreeMap<(&'static str, String), u32>,
    false_trips: Vec<String>,
    violations: Vec<String>,
    /// Beyond the margin, and tripped within a second.
    beyond_in_time: u32,
    spoiled: u32,
}

impl Counts {
    fn run(&mut self, number: u64) {
        let case = Case::new(number);
        let adapts = Case { adapts: true, ..case.clone() };
        if case.mode == Mode::Tracking || case.mode == Mode::Feedforward && adapts.stated().is_some() {
            self.run_case(&adapts);
        }
        self.run_case(&case);
    }

    fn run_case(&mut self, case: &Case) {
        let name = FAULTS[case.number as usize % 5];
        let mut twin = Run::new(case);
        twin.tick(None);
        twin.controller.arm().expect("healthy");
        twin.controller.start(case.mode).expect("armed");
        let trip = twin.go_on(case, 0, FAULT, None);
        if twin.furthest_m > margin(case.film) * case.limit_m {
            self.violations.push(format!("before any fault, {trip:?}: {case:?}"));
        }
        if let Some((cause, tick)) = trip {
            self.spoiled += 1;
            return self.twin_tripped(case, &twin, cause, tick);
        }
        let mut faulty = twin.clone();
        faulty.furthest_m = 0.0;
        if let Some((cause, tick)) = twin.go_on(case, FAULT, case.duration(), None) {
            self.twin_tripped(case, &twin, cause, FAULT + tick);
        }
        let trip = faulty.go_on(case, FAULT, case.duration(), Some(case.fault));
        let farthest = self
            .farthest
            .entry((format!("{:?}", case.mode), case.harmonics, case.adapts, name, case.film))
            .or_default();
        *farthest = farthest.max(faulty.furthest_m / case.limit_m);
        self.ticks += u64::from(FAULT + trip.map_or(case.duration(), |(_, tick)| tick));
        let far = faulty.furthest_m > margin(case.film) * case.limit_m;
        let in_time = trip.is_some_and(|(_, tick)| tick <= 1000);
        let end = match (trip, far) {
            _ if in_time => End::WithinASecond,
            (_, true) => End::Violation,
            (Some(_), false) => End::Later,
            (None, false) => End::Harmless,
        };
        self.beyond_in_time += u32::from(far && in_time);
        *self.ends.entry((name, end)).or_default() += 1;
        if let Some((cause, _)) = trip {
            *self.causes.entry((name, format!("{cause:?}"))).or_default() += 1;
        }
        if end == End::Violation {
            let share = faulty.furthest_m / case.limit_m;
            self.violations.push(format!("{share:.3} of the stroke, {trip:?}: {case:?}"));
        }
    }

    fn twin_tripped(&mut self, case: &Case, twin: &Run, cause: Cause, tick: u32) {
        if is_honest(case, cause, twin.furthest_m) {
            *self.honest.entry((case.film, format!("{cause:?}"))).or_default() += 1;
        } else {
            let share = twin.furthest_m / case.limit_m;
            self.false_trips.push(format!("{cause:?} in tick {tick}, {share:.3} of the stroke: {case:?}"));
        }
    }
}

#[test]
fn sensors_that_fail_plausibly_do_not_lead_the_film_away() {
    let number = cases(350, 10_500);
    let mut counts = Counts::default();
    // The last four are of laws of another film, which once took theirs too far before a sample showed it.
    (0..number).chain([3392, 4952, 6528, 10_316]).for_each(|case| counts.run(case));
    println!("sensor: {number} runs, {counts:#?}");
    assert!(counts.violations.is_empty(), "{} violations", counts.violations.len());
    assert!(counts.false_trips.is_empty(), "{} false trips", counts.false_trips.len());
}
