//! The tracking table: fitted on a film's three recordings, used on references that the fit has not seen, on the nonlinear
//! film.
//!
//! `cargo test -p tests --test tracking -- --nocapture` prints it.

use std::sync::atomic::AtomicBool;

use host_sim::bench::closed_loop::{self, Bench, Run};
use host_sim::bench::controllers::{self, Kind, Settings};
use host_sim::bench::film::{Film, Plant};
use host_sim::files::parameters::Parameters;
use host_sim::files::recording::Recording;
use host_sim::fit::observation::{Direction, observe};
use host_sim::fit::{self, Settings as FitSettings};
use host_sim::grid::Grid;
use host_sim::references::{Reference, Shape};
use host_sim::replay::feedforward;
use indicatif::ProgressBar;
use rayon::prelude::*;
use springpot::{CommandLimits, ObserverOptions, Topology};
use tests::recordings;

static NEVER: AtomicBool = AtomicBool::new(false);

const RATE_HZ: f64 = 1000.0;
const SECONDS: f64 = 155.0;
/// The one bandwidth.
const BANDWIDTH_HZ: f64 = 0.6;
/// Feedback alone is tuned: the best of these for every reference.
const PI_HZ: [f64; 4] = [0.5, 0.8, 0.9, 1.0];
const LOST_S: (f64, f64) = (60.0, 90.0);

/// Parameters from the recordings of a plant, with the structure that `fit` chooses for both films.
fn fitted(plant: &str) -> Parameters {
    let observations: Vec<_> = recordings(plant)
        .iter()
        .map(|path| observe(&Recording::read(path).expect("readable"), Direction::Force, 1.0).expect("fit for it").0)
        .collect();
    let settings = FitSettings {
        topologies: vec![Topology::Parallel],
        branches: vec![4],
        uncertainty: false,
        ..FitSettings::default()
    };
    let candidate = fit::fit(&observations, &settings, &NEVER, &|_| ()).expect("a fit").candidate;
    Parameters {
        name: plant.into(),
        actuator: candidate.actuator,
        model: candidate.model().expect("valid"),
        sensor_offset_m: candidate.offset_m,
        board: None,
        provenance: None,
    }
}

fn references(plant: Plant) -> [(&'static str, Reference); 5] {
    let of = Reference::new;
    match plant {
        Plant::Hossain => [
            ("sine 1/10 Hz", of(Shape::Sine, 1.5e-3, 4e-3, 10.0)),
            ("sine 1/3 Hz", of(Shape::Sine, 2e-3, 4e-3, 3.0)),
            ("triangle 1/10 Hz", of(Shape::Triangle, 1.5e-3, 4e-3, 10.0)),
            ("steps, 60 s", of(Shape::Steps, 1.5e-3, 4e-3, 60.0)),
            ("random walk", of(Shape::RandomWalk, 1e-3, 3.5e-3, 6.0)),
        ],
        Plant::Wang => [
            ("sine 1/10 Hz", of(Shape::Sine, 0.3e-3, 1.2e-3, 10.0)),
            ("sine 1/3 Hz", of(Shape::Sine, 0.6e-3, 1.4e-3, 3.0)),
            ("triangle 1/10 Hz", of(Shape::Triangle, 0.3e-3, 1.2e-3, 10.0)),
            ("steps, 60 s", of(Shape::Steps, 0.3e-3, 1.2e-3, 60.0)),
            ("random walk", of(Shape::RandomWalk, 0.4e-3, 1.4e-3, 6.0)),
        ],
    }
}

/// One run of the bench.
struct Trial<'a> {
    parameters: &'a Parameters,
    film: Film,
    reference: &'a [f64],
    limits: CommandLimits,
    bench: Bench,
    bandwidth_hz: f64,
}

impl Trial<'_> {
    fn run(&self, kind: Kind) -> Run {
        let grid = grid();
        let settings = Settings {
            rate_hz: grid.rate_hz,
            limits: self.limits,
            observer: ObserverOptions::at_bandwidth(self.bandwidth_hz),
            peak_m: self.reference.iter().copied().fold(0.0, f64::max),
        };
        let mut controller = controllers::build::<f32>(kind, self.parameters, &settings).expect("valid");
        closed_loop::run(&self.film, &self.bench, controller.as_mut(), self.reference, grid, &ProgressBar::hidden())
            .expect("the film holds")
    }

    fn rms(&self, kind: Kind) -> f64 {
        self.run(kind).tracked().tracking_rms_pct.expect("it moves")
    }
}

fn grid() -> Grid {
    Grid::covering(SECONDS, RATE_HZ).expect("valid")
}

/// RMS error (% of the reference's peak to peak) from `from` to `to` (s).
fn rms_within(run: &Run, from: f64, to: f64) -> f64 {
    let range = (from * RATE_HZ) as usize..(to * RATE_HZ) as usize;
    let error = &run.error_m()[range.clone()];
    let (low, high) =
        run.reference_m.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
    100.0 / (high - low) * (error.iter().map(|e| e * e).sum::<f64>() / range.len() as f64).sqrt()
}

/// Largest change of voltage in a tick from `from` to `to` (s), V.
fn largest_step_v(run: &Run, from: f64, to: f64) -> f64 {
    run.voltage_v[(from * RATE_HZ) as usize..(to * RATE_HZ) as usize]
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .fold(0.0, f64::max)
}

/// What the README states for feedforward and tracking.
fn stated(plant: Plant, name: &str) -> Option<(String, String)> {
    let readme = include_str!("../README.md");
    let start = format!("| {} | {name}", format!("{plant:?}").to_lowercase());
    let row = readme.lines().find(|line| line.starts_with(&start))?;
    let bold: Vec<&str> = row.split("**").collect();
    Some(((*bold.get(1)?).into(), (*bold.get(3)?).into()))
}

struct Row {
    text: String,
    /// Largest change of voltage in a tick when the sensor goes or comes, V.
    bump_v: f64,
    /// Largest voltage on a film that is a fifth stiffer, V.
    stiff_v: f64,
    missed: Vec<String>,
}

fn row(plant: Plant, parameters: &Parameters, name: &str, reference: &Reference) -> Row {
    let values = reference.on(grid()).expect("valid");
    let limits = CommandLimits::BENCH;
    let trial = Trial {
        parameters,
        film: Film::new(plant),
        reference: &values,
        limits,
        bench: Bench::default(),
        bandwidth_hz: BANDWIDTH_HZ,
    };
    let feasible = feedforward::check(parameters, &values, grid(), &limits).expect("a check");
    let (open_run, closed_run) = (trial.run(Kind::Feedforward), trial.run(Kind::Tracking));
    // At rest, noise may ask for less than 0 V.
    let unlimited = |run: &Run, from: usize| run.limited[from..].iter().all(|limited| limited.is_none());
    let unlimited = unlimited(&open_run, 0) && unlimited(&closed_run, 100);
    let (open, closed) = (open_run.tracked(), closed_run.tracked());
    let (open_pct, closed_pct) = (open.tracking_rms_pct.expect("it moves"), closed.tracking_rms_pct.expect("it moves"));
    let pi = PI_HZ
        .map(|bandwidth_hz| Trial { bench: Bench::default(), film: trial.film, bandwidth_hz, ..trial }.rms(Kind::Pi))
        .into_iter()
        .fold(f64::INFINITY, f64::min);
    let lossy = Bench { sensor_lost_s: vec![LOST_S], ..Bench::default() };
    let lost = Trial { bench: lossy, film: trial.film, ..trial }.run(Kind::Tracking);
    let (without, after) = (rms_within(&lost, LOST_S.0, LOST_S.1), rms_within(&lost, LOST_S.1 + 1.0, LOST_S.1 + 11.0));
    // A film that is stiffer by a fifth needs more than 6 kV.
    let higher = CommandLimits { max_voltage_v: 8000.0, max_field_v_per_m: 6e7, ..limits };
    let off = [(0.8, limits), (1.2, higher)].map(|(factor, limits)| {
        let trial = Trial { film: Film::new(plant).stiffened(factor), limits, bench: Bench::default(), ..trial };
        let tracked = trial.run(Kind::Tracking).tracked();
        (trial.rms(Kind::Feedforward), tracked.tracking_rms_pct.expect("it moves"), tracked.largest_voltage_v)
    });

    let drift = open.drift_pct.map_or("–".into(), |drift| format!("{drift:.3}"));
    let [soft, stiff] = off;
    let text = format!(
        "| {plant:?} | {name} | {:.1} | {:.1} | {:.2} | {:.3} | {drift} | {pi:.2} | {:.3} | {without:.3}, {after:.3} | {:.1}, \
         {:.1} | {:.3}, {:.3} |",
        trial.rms(Kind::None),
        trial.rms(Kind::Static),
        trial.rms(Kind::Window),
        open_pct,
        closed_pct,
        soft.0,
        stiff.0,
        soft.1,
        stiff.1
    );
    let slow = reference.period_s > 3.0;
    let bars = [
        ("no limit met", unlimited),
        ("README.md", stated(plant, name) == Some((format!("{open_pct:.3}"), format!("{closed_pct:.3}")))),
        ("feasible", feasible.feasible && open.infeasible_pct == 0.0),
        ("feedforward ≤ 1 %", open_pct <= 1.0),
        ("drift ≤ 0.9 %", open.drift_pct.is_none_or(|drift| drift.abs() <= 0.9)),
        ("tracking ≤ 0.25 %", closed_pct <= 0.25),
        ("back a second after the sensor", after <= 0.25),
        ("no jump above the slew", largest_step_v(&lost, 0.0, SECONDS) <= limits.max_slew_v_per_s / RATE_HZ * 1.0001),
        ("stiffness off, tracking ≤ 0.5 %", !slow || (soft.1 <= 0.5 && stiff.1 <= 0.5)),
    ];
    let missed = bars.iter().filter(|(_, met)| !met).map(|(bar, _)| format!("{plant:?} {name}: {bar}")).collect();
    let bump_v = [LOST_S.0, LOST_S.1].map(|at| largest_step_v(&lost, at, at + 3.0)).into_iter().fold(0.0, f64::max);
    Row { text, bump_v, stiff_v: stiff.2, missed }
}

#[test]
fn the_tracking_table() {
    let plants = [(Plant::Hossain, "hossain"), (Plant::Wang, "wang")];
    let parameters: Vec<Parameters> = plants.iter().map(|(_, name)| fitted(name)).collect();
    let jobs: Vec<_> = plants
        .iter()
        .zip(&parameters)
        .flat_map(|((plant, _), parameters)| {
            references(*plant).map(|(name, reference)| (*plant, parameters, name, reference))
        })
        .collect();
    let rows: Vec<Row> =
        jobs.par_iter().map(|(plant, parameters, name, reference)| row(*plant, parameters, name, reference)).collect();
    println!("RMS error from t = 0 in % of the reference's peak to peak, {SECONDS} s");
    println!(
        "| film | reference | no compensation | one spring | 10 s window | feedforward | its drift | PI, tuned | tracking | \
         sensor lost 30 s: meanwhile, from 1 s after | stiffness − 20 %, + 20 %: feedforward | tracking |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    rows.iter().for_each(|row| println!("{}", row.text));
    let largest = |of: fn(&Row) -> f64| rows.iter().map(of).fold(0.0, f64::max);
    println!("largest change of voltage when the sensor goes or comes: {:.1} V a tick", largest(|row| row.bump_v));
    println!("largest voltage on the stiffer films: {:.0} V", largest(|row| row.stiff_v));
    let missed: Vec<&String> = rows.iter().flat_map(|row| &row.missed).collect();
    assert!(missed.is_empty(), "{missed:#?}");
}

/// An amplifier that lags, a monitor that reads wrongly, and sensors of other kinds: tracking holds its bar.
#[test]
fn the_bench_may_be_imperfect() {
    let parameters = fitted("hossain");
    let values = Reference::new(Shape::Sine, 1.5e-3, 4e-3, 10.0).on(grid()).expect("valid");
    let plain = Bench::default();
    let benches = [
        ("another seed", Bench { seed: 2, ..plain.clone() }),
        ("amplifier 5 ms late", Bench { amplifier_lag_s: 5e-3, ..plain.clone() }),
        ("monitor 2 % too high", Bench { monitor_error: Some(0.02), amplifier_lag_s: 5e-3, ..plain.clone() }),
        ("monitor 2 % too low", Bench { monitor_error: Some(-0.02), ..plain.clone() }),
        ("sensor at 1 kHz, at once", Bench { sensor_rate_hz: 1000.0, sensor_delay_s: 0.0, ..plain.clone() }),
        ("sensor of 20 µm steps", Bench { sensor_quantum_m: 20e-6, ..plain.clone() }),
        (
            "sensor lost every other second",
            Bench { sensor_lost_s: (0..75).map(|k| (f64::from(2 * k), f64::from(2 * k + 1))).collect(), ..plain },
        ),
    ];
    let errors: Vec<(&str, f64)> = benches
        .into_par_iter()
        .map(|(name, bench)| {
            let trial = Trial {
                parameters: &parameters,
                film: Film::new(Plant::Hossain),
                reference: &values,
                limits: CommandLimits::BENCH,
                bench,
                bandwidth_hz: BANDWIDTH_HZ,
            };
            (name, trial.rms(Kind::Tracking))
        })
        .collect();
    for (name, error) in &errors {
        println!("{name}: {error:.4} %");
    }
    assert!(errors.iter().all(|(_, error)| *error <= 0.25), "{errors:?}");
}

/// The plant's own integration, against the adaptive one of the recordings.
#[test]
fn the_loop_integrates_the_film_truly() {
    let film = Film::new(Plant::Hossain);
    let times: Vec<f64> = (0..=20).map(|k| 0.5 * f64::from(k)).collect();
    let exact = film.states(film.rest(), &times, |_| 5000.0).expect("no pull-in");
    let mut state = film.rest();
    for expected in &exact[1..] {
        state = film.advanced(&state, 5000.0, 0.5, 1000);
        let difference = film.displacement_m(&state) - film.displacement_m(expected);
        // Far below the 5 µm of the sensor.
        assert!(difference.abs() < 1e-9, "{difference}");
    }
}
