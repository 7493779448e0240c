//! Hours and hertz: errors from t = 0 over hours, from 0.05 to 10 Hz, on films that are stiffer or softer than recorded, and on films that
//! warm up while they are driven. The bench is the default one: 5 µm of noise, 100 samples a second, 10 ms late.
//!
//! `SPRINGPOT_SWEEP=full cargo test --release -p host-models --test it hours -- --nocapture` prints the tables of docs/results.md; the default
//! runs a few rows.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use host_io::files::parameters::Parameters;
use host_io::files::recording::Direction;
use host_io::grid::Grid;
use host_models::fit::Settings;
use host_models::fit::observation::Observation;
use host_models::fit::settings::CurveChoice;
use host_models::references::minimum_jerk;
use host_models::simulation::closed_loop::{self, BenchModel, LoopTick};
use host_models::simulation::controllers::ControllerKind;
use host_models::simulation::film::{self, Film, Instruments, Readings};
use host_models::simulation::plant::{FullMemoryPlant, Mismatch, Plant};
use rayon::prelude::*;
use springpot::{Actuator, CommandLimits, LearningOptions};

use crate::plants::{BlendedFilm, Change, LITTLE_CREEP, MUCH_CREEP, Ramp, Stiffening, StiffeningFilm, WarmingStrip};
use crate::recorded::risen_sine_m;
use crate::sweep::full_sweep;
use crate::{curves, measured_curve, recorded, tracking};

const RATE_HZ: f64 = 1000.0;
const RISE_S: f64 = 5.0;
const DAY_S: f64 = 86_400.0;

/// Fast sines need more than the bench's defaults.
const LIMITS: CommandLimits = CommandLimits {
    max_field_v_per_m: 6e7,
    max_acceleration_m_per_s2: 20.0,
    max_velocity_m_per_s: 0.5,
    max_slew_v_per_s: 5e5,
    ..CommandLimits::BENCH
};
/// A film that is a fifth stiffer needs more than 6 kV.
const HIGHER: CommandLimits = CommandLimits { max_voltage_v: 8000.0, max_field_v_per_m: 8e7, ..LIMITS };

/// Effect of the sensor's 5 µm of noise after the observer: 0.7 to 1.1 µm on these films, where all else is compensated.
const NOISE_M: f64 = 1.25e-6;

/// A film, and the law that was fitted to recordings of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Hossain,
    Wang,
    LittleCreep,
    MuchCreep,
    Springpot,
}

const KINDS: [Kind; 5] = [Kind::Hossain, Kind::Wang, Kind::LittleCreep, Kind::MuchCreep, Kind::Springpot];

/// A voltage that is recorded: a sine from `low` times its peak to its peak.
#[derive(Clone, Copy, Debug)]
struct Drive {
    peak_v: f64,
    low: f64,
    hz: f64,
    seconds: f64,
    rate_hz: f64,
}

impl Drive {
    fn volts(&self, t: f64) -> f64 {
        let swing = 0.5 * (1.0 - (TAU * self.hz * t).cos());
        self.peak_v * minimum_jerk(t / RISE_S) * (self.low + (1.0 - self.low) * swing)
    }
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Hossain => "hossain",
            Self::Wang => "wang",
            Self::LittleCreep => "stiffening, little creep",
            Self::MuchCreep => "stiffening, much creep",
            Self::Springpot => "springpot behind a curve",
        }
    }

    /// The strips have the law of the other tables. The others are recorded as long as they are driven, slow and fast and at two amplitudes:
    /// creep of half an hour does not show in a minute.
    fn fit(self) -> Parameters {
        let (peak_v, actuator, branches, curve) = match self {
            Self::Hossain => return tracking::fitted("hossain"),
            Self::Wang => return tracking::fitted("wang"),
            Self::LittleCreep => (3350.0, curves::FILM, 3, CurveChoice::Both),
            Self::MuchCreep => (3000.0, curves::FILM, 3, CurveChoice::Both),
            Self::Springpot => (2600.0, measured_curve::ACTUATOR, 0, CurveChoice::Gent),
        };
        let drive = |share: f64, low, hz, seconds, rate_hz| Drive { peak_v: share * peak_v, low, hz, seconds, rate_hz };
        // A springpot's first steps are coarse at 10 steps a second: it would drift by 1.8 % in half an hour, at 50 by 0.5 %.
        let long_hz = if self == Self::Springpot { 200.0 } else { 10.0 };
        let drives = [
            drive(1.0, 0.6, 0.1, 1800.0, long_hz),
            drive(1.0, 0.0, 0.3, 60.0, 50.0),
            drive(0.65, 0.0, 0.2, 60.0, 50.0),
            drive(1.0, 0.5, 1.0, 40.0, 100.0),
        ];
        let observations: Vec<Observation> =
            drives.par_iter().enumerate().map(|(seed, drive)| self.recorded(drive, seed as u64)).collect();
        let settings = Settings {
            actuator: Actuator { stretch_coupling: 0.0, ..actuator },
            starts: 4,
            curve,
            ..recorded::parallel(vec![branches])
        };
        let fit = recorded::fitted(&observations, &settings);
        let nrmse_pct: Vec<String> = fit.agreements.iter().map(|a| format!("{:.3}", a.nrmse_pct)).collect();
        println!("{}: NRMSE {} %", self.name(), nrmse_pct.join(", "));
        recorded::parameters(&fit, &settings, Direction::Force)
    }

    /// A recording of `drive`, with the noise of the bench's sensor.
    fn recorded(self, drive: &Drive, seed: u64) -> Observation {
        let grid = Grid::covering(drive.seconds, RATE_HZ).expect("a grid");
        let (substeps, substep_s) = closed_loop::substeps(grid);
        let mut plant = Case { seconds: drive.seconds, ..Case::with_film(self) }.plant(grid);
        let mut readings = Readings::new(Instruments::default(), seed);
        let (steps, volts) = (substeps * grid.samples, |t: f64| drive.volts(t));
        recorded::recorded(plant.as_mut(), substep_s, steps, drive.rate_hz, volts, |x| readings.displacement_m(x))
    }

    /// Fitted once for all tests here.
    pub(crate) fn parameters(self) -> Parameters {
        static FITTED: Mutex<BTreeMap<Kind, Arc<OnceLock<Parameters>>>> = Mutex::new(BTreeMap::new());
        let law = FITTED.lock().unwrap_or_else(PoisonError::into_inner).entry(self).or_default().clone();
        law.get_or_init(|| self.fit()).clone()
    }
}

/// A film, its reference, and how it differs from the film that was recorded.
#[derive(Clone, Copy, Debug)]
struct Case {
    film: Kind,
    low_m: f64,
    high_m: f64,
    period_s: f64,
    seconds: f64,
    change: Change,
    /// The change at the end of the run, which is reached evenly.
    warm: Option<Change>,
    limits: CommandLimits,
}

/// The reference's errors (% of peak to peak).
#[derive(Clone, Copy, Debug, Default)]
struct Followed {
    /// From t = 0.
    rms: f64,
    largest: f64,
    /// Over the last third.
    late_rms: f64,
    /// Mean error of a cycle minus that of the first, where it is largest.
    drift: f64,
    /// Share of the time in which a limit was met, %, without the first tenth of a second.
    limited: f64,
}

impl Case {
    /// A sine of 10 s for 155 s.
    fn with_film(film: Kind) -> Self {
        let (low_m, high_m) = match film {
            Kind::Hossain => (2e-3, 4e-3),
            Kind::Wang => (0.6e-3, 1.4e-3),
            Kind::LittleCreep | Kind::MuchCreep => (1e-3, 2.6e-3),
            Kind::Springpot => (6e-3, 10e-3),
        };
        let change = Change::NONE;
        Self { film, low_m, high_m, period_s: 10.0, seconds: 155.0, change, warm: None, limits: LIMITS }
    }

    /// The same over hours: what has crept does not return, so the lowest displacement is higher.
    fn over_hours(film: Kind, seconds: f64) -> Self {
        let low_m = match film {
            Kind::Hossain => 3.2e-3,
            Kind::Wang => 0.6e-3,
            Kind::LittleCreep | Kind::MuchCreep => 1.4e-3,
            Kind::Springpot => 7e-3,
        };
        Self { low_m, seconds, ..Self::with_film(film) }
    }

    fn plant(&self, grid: Grid) -> Box<dyn Plant> {
        let (substeps, substep_s) = closed_loop::substeps(grid);
        let count = substeps * grid.samples;
        let ramp = Ramp { to: self.warm.unwrap_or(Change::NONE), substeps: count };
        let strip = |plant| {
            let film = Film::new(plant).stiffened(self.change.stiffness);
            Box::new(WarmingStrip::at_rest(film, ramp, substep_s))
        };
        let stiffening = |elements| {
            let film = StiffeningFilm::new(Stiffening::with(elements), substep_s).changed(self.change);
            Box::new(if self.warm.is_some() { film.warming(ramp) } else { film })
        };
        match self.film {
            Kind::Hossain => strip(film::Plant::Hossain),
            Kind::Wang => strip(film::Plant::Wang),
            Kind::LittleCreep => stiffening(LITTLE_CREEP),
            Kind::MuchCreep => stiffening(MUCH_CREEP),
            Kind::Springpot if self.warm.is_some() || self.seconds > 3600.0 => {
                Box::new(BlendedFilm::at_rest(&measured_curve::film(), self.warm.map(|_| ramp), substep_s))
            }
            Kind::Springpot => {
                let mismatch = Mismatch { stiffness: self.change.stiffness, alpha: self.change.alpha };
                let plant = FullMemoryPlant::at_rest(&measured_curve::film(), mismatch, substep_s, count);
                Box::new(plant.expect("a plant"))
            }
        }
    }

    fn reference_m(&self, t: f64) -> f64 {
        risen_sine_m(t, RISE_S, self.low_m, self.high_m, 1.0 / self.period_s)
    }

    /// % of peak to peak of so many metres.
    fn percent(&self, m: f64) -> f64 {
        100.0 * m / (self.high_m - self.low_m)
    }

    fn follow(&self, (kind, is_learned): (ControllerKind, bool)) -> Followed {
        let grid = Grid::covering(self.seconds, RATE_HZ).expect("valid");
        let learning = is_learned.then_some(LearningOptions::BENCH);
        let mut controller = recorded::controller(kind, &self.film.parameters(), self.limits, learning, self.high_m);
        let mut plant = self.plant(grid);
        let mut sums = Sums::new(grid, self.period_s);
        let reference = |k: usize| self.reference_m(grid.time_s(k));
        let bench = BenchModel::default();
        closed_loop::follow(plant.as_mut(), &bench, controller.as_mut(), reference, grid, |k, tick| {
            sums.see(k, &tick);
            Ok(())
        })
        .unwrap_or_else(|error| panic!("{self:?}: {error}"));
        sums.followed(|m| self.percent(m))
    }
}

/// Sums over a run, of which nothing else is kept: a day at 1 kHz are 86.4 million ticks.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// Ticks: of all, before the last third, before the first cycle, of a cycle.
    ticks: usize,
    early: usize,
    first: usize,
    cycle: usize,
    squares: f64,
    largest: f64,
    late_squares: f64,
    /// Sum of the cycle so far, m.
    sum: f64,
    first_mean: Option<f64>,
    drift: f64,
    limited: usize,
}

impl Sums {
    fn new(grid: Grid, period_s: f64) -> Self {
        let ticks = |seconds: f64| (seconds * RATE_HZ).round() as usize;
        let early = grid.samples - grid.samples / 3;
        Self { ticks: grid.samples, early, first: ticks(RISE_S), cycle: ticks(period_s), ..Self::default() }
    }

    fn see(&mut self, k: usize, tick: &LoopTick) {
        let error = tick.displacement_m - tick.asked_m;
        self.squares += error * error;
        self.largest = self.largest.max(error.abs());
        if k >= self.early {
            self.late_squares += error * error;
        }
        // At rest, noise may ask for less than 0 V.
        self.limited += usize::from(k > 100 && !tick.output.limited.is_none());
        if k < self.first {
            return;
        }
        self.sum += error;
        if (k - self.first) % self.cycle == self.cycle - 1 {
            let mean = self.sum / self.cycle as f64;
            self.sum = 0.0;
            let moved = mean - *self.first_mean.get_or_insert(mean);
            self.drift = if moved.abs() > self.drift.abs() { moved } else { self.drift };
        }
    }

    fn followed(&self, percent: impl Fn(f64) -> f64) -> Followed {
        let late = self.ticks - self.early;
        Followed {
            rms: percent((self.squares / self.ticks as f64).sqrt()),
            largest: percent(self.largest),
            late_rms: percent((self.late_squares / late as f64).sqrt()),
            drift: percent(self.drift),
            limited: 100.0 * self.limited as f64 / self.ticks as f64,
        }
    }
}

const FEEDFORWARD: (ControllerKind, bool) = (ControllerKind::Feedforward, false);
const TRACKING: (ControllerKind, bool) = (ControllerKind::Tracking, false);
const LEARNED: (ControllerKind, bool) = (ControllerKind::Feedforward, true);

/// Checks each of `cases`, the first ones first; what they miss. The laws are fitted before: a fit that waits for threads of the pool must
/// not find the next case on them, which waits for the fit.
fn run(cases: &[Case], check: impl Fn(&Case) -> Vec<String> + Send + Sync) {
    for case in cases {
        case.film.parameters();
    }
    let missed: Vec<String> = cases.par_iter().with_max_len(1).flat_map_iter(check).collect();
    assert!(missed.is_empty(), "{missed:#?}");
}

/// Runs all three ways, and prints the row.
fn row(case: &Case, title: &str, cells: impl Fn(&Followed) -> Vec<f64>) -> [Followed; 3] {
    let followed = [FEEDFORWARD, TRACKING, LEARNED].map(|way| case.follow(way));
    let text = followed.each_ref().map(|followed| {
        let cells: Vec<String> = cells(followed).iter().map(|cell| format!("{cell:.3}")).collect();
        cells.join(", ")
    });
    println!("| {} | {title} | {} |", case.film.name(), text.join(" | "));
    if followed.iter().any(|followed| followed.limited > 0.0) {
        println!("limits met for {:?} % of the time", followed.each_ref().map(|followed| followed.limited));
    }
    followed
}

fn from_the_start(followed: &Followed) -> Vec<f64> {
    vec![followed.rms, followed.largest]
}

fn with_drift(followed: &Followed) -> Vec<f64> {
    vec![followed.rms, followed.largest, followed.drift]
}

/// Names of the bars that `case` misses.
fn missed(case: &Case, bars: &[(&str, bool)]) -> Vec<String> {
    bars.iter().filter(|(_, met)| !met).map(|(bar, _)| format!("{bar}: {case:?}")).collect()
}

/// Tracking is no worse than feedforward beyond the sensor's noise, from far below the bandwidth (0.6 Hz) to far above it and beyond the
/// resonance of the strips (near 3 Hz). The first swings are worse: it takes two or three to see that a reference is fast.
#[test]
fn tracking_is_never_worse_than_feedforward() {
    let cases = KINDS.into_iter().flat_map(|film| {
        [20.0, 10.0, 3.0, 1.0, 0.5, 0.2, 0.1].map(|period_s| Case { period_s, ..Case::with_film(film) })
    });
    let cases: Vec<Case> = if full_sweep() {
        cases.collect()
    } else {
        [3.0, 0.5].map(|period_s| Case { period_s, ..Case::with_film(Kind::Hossain) }).into()
    };
    run(&cases, |case| {
        let [open, closed, _] = row(case, &format!("{} s", case.period_s), from_the_start);
        let noise = case.percent(NOISE_M);
        let stiffens = matches!(case.film, Kind::LittleCreep | Kind::MuchCreep);
        let most = if case.period_s >= 3.0 { 0.3 } else { 1.0 };
        // Where the law knows the resonance, 1.35; hossain at 0.5 s, near a resonance that it does not know, had 1.60: the observer takes
        // two or three swings to see that a reference is fast.
        let swings = if matches!(case.film, Kind::Hossain | Kind::Wang) { 1.65 } else { 1.35 };
        missed(
            case,
            &[
                ("over the last third", closed.late_rms <= 1.02 * open.late_rms + noise),
                ("over all", closed.rms <= 1.02 * open.rms + noise),
                ("largest", closed.largest <= swings * open.largest + 4.0 * noise),
                ("behind a curve", !stiffens || case.period_s < 1.0 || closed.rms <= most),
            ],
        )
    });
}

/// Minutes, half an hour, a day. The bars of feedforward are those of each law; tracking has one.
#[test]
fn hours_are_followed() {
    let all = [155.0, 1800.0, DAY_S];
    let films = if full_sweep() { KINDS.as_slice() } else { &[Kind::Wang] };
    let durations = if full_sweep() { all.as_slice() } else { &all[..1] };
    // The longest first.
    let cases: Vec<Case> = durations
        .iter()
        .rev()
        .flat_map(|&seconds| films.iter().map(move |&film| Case::over_hours(film, seconds)))
        .collect();
    run(&cases, |case| {
        let title = if case.seconds > 1e4 { "24 h".into() } else { format!("{} s", case.seconds) };
        let [open, closed, learned] = row(case, &title, with_drift);
        let [largest, drift] = match case.film {
            Kind::Wang | Kind::LittleCreep | Kind::Springpot => [1.0, 0.3],
            // What these laws do not hold: the bars are what was measured, with a margin.
            Kind::MuchCreep => [1.3, 0.5],
            Kind::Hossain => [13.0, 14.0],
        };
        let noise = case.percent(NOISE_M);
        missed(
            case,
            &[
                ("feedforward", open.largest < largest && open.drift.abs() < drift),
                ("tracking", closed.rms < 0.05 + noise && closed.drift.abs() < noise),
                ("learned", learned.late_rms < 0.15),
            ],
        )
    });
}

/// Stiffness off by a fifth, with the law as it was.
#[test]
fn a_film_that_is_a_fifth_off_is_followed() {
    let cases = KINDS.into_iter().flat_map(|film| {
        [(0.8, LIMITS), (1.2, HIGHER)].map(|(stiffness, limits)| Case {
            change: Change { stiffness, ..Change::NONE },
            limits,
            ..Case::with_film(film)
        })
    });
    let cases: Vec<Case> = if full_sweep() { cases.collect() } else { cases.skip(2).take(1).collect() };
    run(&cases, |case| {
        let [open, closed, learned] =
            row(case, &format!("{:+.0} %", 100.0 * (case.change.stiffness - 1.0)), from_the_start);
        let noise = case.percent(NOISE_M);
        let is_learned = learned.late_rms < 0.1 * open.late_rms;
        missed(case, &[("tracking", closed.late_rms < 0.15 + noise), ("learned", is_learned)])
    });
}

/// A film that becomes a fifth softer, with relaxation times of a half or orders of 1.1 times, evenly over half an hour.
#[test]
fn a_film_that_warms_up_is_followed() {
    let warm = Some(Change { stiffness: 0.8, times: 0.5, alpha: 1.1 });
    let films = if full_sweep() { KINDS.as_slice() } else { &[Kind::Wang] };
    let cases: Vec<Case> = films.iter().map(|&film| Case { warm, ..Case::over_hours(film, 1800.0) }).collect();
    run(&cases, |case| {
        let [_, closed, learned] = row(case, &format!("{} s", case.seconds), with_drift);
        let noise = case.percent(NOISE_M);
        missed(case, &[("tracking", closed.late_rms < 0.15 + noise), ("learned", learned.late_rms < 3.0)])
    });
}
