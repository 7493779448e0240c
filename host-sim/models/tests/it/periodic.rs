//! Periodic references that are learned, on films that their law does not describe.
//!
//! `cargo test -p host-models --test it periodic -- --nocapture` prints the rows of docs/results.md; `cargo xtask sweep` runs all of them.

use std::f64::consts::TAU;

use host_io::choice::Choice;
use host_io::files::parameters::Parameters;
use host_io::grid::Grid;
use host_models::references::{Reference, Shape};
use host_models::simulation::closed_loop::{self, BenchModel, LoopRun};
use host_models::simulation::controllers::ControllerKind;
use host_models::simulation::film::{Film, Plant};
use host_models::simulation::tuning::ControllerTuning;
use indicatif::ProgressBar;
use rayon::prelude::*;
use springpot::{CommandLimits, LearningOptions};

use crate::recorded::{controller, peak, rms};
use crate::sweep::full_sweep;
use crate::tracking::both_films;

/// Fast sines need more than the bench's defaults.
const LIMITS: CommandLimits = CommandLimits {
    max_acceleration_m_per_s2: 20.0,
    max_velocity_m_per_s: 0.5,
    max_slew_v_per_s: 5e5,
    ..CommandLimits::BENCH
};

#[derive(Clone, Copy, Debug)]
struct Row {
    plant: Plant,
    period_s: f64,
    kind: ControllerKind,
    /// Largest RMS error over the last 50 of 150 s with learning, % of peak to peak.
    most_pct: f64,
}

/// Far below the resonance of these films (near 3 Hz, which their laws do not know), beside it and above it. The sensor's noise is 0.2 % of
/// the hossain film's swing, and 0.5 % of the wang film's.
const ROWS: [Row; 16] = {
    const fn row(plant: Plant, period_s: f64, kind: ControllerKind, most_pct: f64) -> Row {
        Row { plant, period_s, kind, most_pct }
    }
    use ControllerKind::{Feedforward, Tracking};
    use Plant::{Hossain, Wang};
    [
        row(Hossain, 1.0, Feedforward, 0.08),
        row(Wang, 0.1, Feedforward, 45.0),
        row(Hossain, 10.0, Feedforward, 0.05),
        row(Hossain, 3.0, Feedforward, 0.08),
        row(Hossain, 3.0, Tracking, 0.15),
        row(Hossain, 1.0, Tracking, 0.3),
        row(Hossain, 0.5, Feedforward, 1.0),
        row(Hossain, 0.5, Tracking, 2.0),
        row(Hossain, 0.2, Feedforward, 50.0),
        row(Hossain, 0.1, Feedforward, 40.0),
        row(Wang, 10.0, Feedforward, 0.1),
        row(Wang, 3.0, Feedforward, 0.15),
        row(Wang, 1.0, Feedforward, 0.3),
        row(Wang, 1.0, Tracking, 0.5),
        row(Wang, 0.5, Feedforward, 3.0),
        row(Wang, 0.2, Feedforward, 10.0),
    ]
};

fn run(row: Row, parameters: &Parameters, learning: Option<LearningOptions>) -> LoopRun {
    let grid = Grid::covering(150.0, 1000.0).expect("valid");
    let (low_m, high_m) = match row.plant {
        Plant::Hossain => (2e-3, 3.5e-3),
        Plant::Wang => (0.6e-3, 1.2e-3),
    };
    let reference = Reference::new(Shape::Sine, low_m, high_m, row.period_s).on(grid).expect("valid");
    let mut controller = controller(row.kind, parameters, LIMITS, learning, high_m);
    let bench = BenchModel { sensor_noise_m: 3e-6, ..BenchModel::default() };
    let film = Film::new(row.plant);
    closed_loop::track(&film, &bench, controller.as_mut(), &reference, grid, &ProgressBar::hidden()).expect("it holds")
}

/// RMS and largest error over the last 50 s, % of peak to peak.
fn last(run: &LoopRun) -> [f64; 2] {
    let from = run.asked_m.len() - 50_000;
    let asked = &run.asked_m[from..];
    let bounds = asked.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
    let errors: Vec<f64> = run.displacement_m[from..].iter().zip(asked).map(|(x, r)| x - r).collect();
    [rms(&errors), peak(&errors)].map(|error| 100.0 * error / (bounds.1 - bounds.0))
}

#[test]
fn cycles_are_learned() {
    let count = if full_sweep() { ROWS.len() } else { 2 };
    // Fitted before: a fit that waits for threads of the pool must not find a row on them that waits for the fit.
    let films = both_films();
    let missed: Vec<String> = ROWS[..count]
        .par_iter()
        .filter_map(|&row| {
            let (_, parameters) = films.iter().find(|(plant, _)| *plant == row.plant).expect("one of both");
            let [without, taken, given] =
                [None, Some(None), Some(Some(row.period_s))].map(|period_s: Option<Option<f64>>| {
                    let learning = period_s.map(|period_s| LearningOptions { period_s, ..LearningOptions::BENCH });
                    last(&run(row, parameters, learning))
                });
            let cells = [without, taken, given].map(|[rms, largest]| format!("{rms:.3}, {largest:.3}"));
            let Row { plant, period_s, kind, most_pct } = row;
            println!("| {plant:?} | {period_s} s | {} | {} |", kind.name(), cells.join(" | "));
            let holds = |[rms, _]: [f64; 2]| rms < most_pct && rms < 1.02 * without[0];
            (!(holds(taken) && holds(given))).then(|| format!("{row:?}: {cells:?}"))
        })
        .collect();
    assert!(missed.is_empty(), "{missed:#?}");
}

/// A period that is not the reference's, and a reference without one, are stated.
#[test]
fn cycles_that_are_not_those_of_the_reference_are_named() {
    let rate_hz = 50.0;
    let note = |shape: fn(f64) -> f64, harmonics: usize, period_s: Option<f64>| {
        let reference: Vec<f64> = (0..3000).map(|k| 1e-3 * shape(f64::from(k) / rate_hz)).collect();
        ControllerTuning { harmonics: Some(harmonics), period_s, ..ControllerTuning::at_rate(rate_hz) }
            .cycles_note(&reference)
    };
    let sine = |time_s: f64| (TAU * time_s / 5.0).sin();
    for (harmonics, period_s) in [(0, Some(7.0)), (3, None), (1, Some(5.0)), (3, Some(5.05)), (2, Some(10.0))] {
        assert_eq!(note(sine, harmonics, period_s), None, "{harmonics} harmonics of {period_s:?} s");
    }
    for (harmonics, period_s) in [(3, 100.0), (6, 7.0), (1, 5.2), (1, 10.0), (6, 2.5)] {
        let note = note(sine, harmonics, Some(period_s)).unwrap_or_default();
        let words =
            format!("repeats every 5 s, a period that harmonics 1 to {harmonics} of {period_s} s do not contain");
        assert!(note.contains(&words), "{harmonics} harmonics of {period_s} s: {note}");
    }
    for period_s in [None, Some(5.0)] {
        let note = note(|time_s| time_s * time_s, 3, period_s).unwrap_or_default();
        assert!(note.starts_with("no period was found"), "{note}");
    }
}
