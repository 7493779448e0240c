//! Learning of periodic references, on films that the law does not describe.

use std::f64::consts::TAU;
use std::sync::atomic::AtomicBool;

use host_sim::bench::closed_loop::{self, BenchModel, LoopRun};
use host_sim::bench::controllers::{self, ControllerKind, ControllerSettings};
use host_sim::bench::film::{Film, Plant as Kind};
use host_sim::bench::plant::{NonlinearPlant, Plant};
use host_sim::files::parameters::Parameters;
use host_sim::fit::{self, Settings};
use host_sim::grid::Grid;
use host_sim::references::{Reference, Shape};
use host_sim::replay::memory::Precision;
use indicatif::ProgressBar;
use rayon::prelude::*;
use springpot::{CommandLimits, LearningOptions, ObserverOptions, Topology};

use crate::curves::{FILM, StiffeningFilm, recordings as stiffening_recordings};

impl Plant for StiffeningFilm {
    fn displacement_m(&self) -> f64 {
        self.state[0]
    }
    fn advance(&mut self, voltage_v: f64) {
        self.advance_by(voltage_v, 0.5e-3);
    }
    fn holds(&self) -> bool {
        self.state[0].is_finite()
    }
}

fn nonlinear(plant: &str) -> Parameters {
    crate::tracking::fitted(plant)
}

fn stiffening() -> Parameters {
    let settings = Settings {
        actuator: FILM,
        branches: vec![1, 2],
        topologies: vec![Topology::Parallel],
        uncertainty: false,
        starts: 4,
        ..Settings::default()
    };
    let fit = fit::fit(&stiffening_recordings(), &settings, &AtomicBool::new(false), &|_| ()).expect("a fit");
    let c = fit.candidate;
    Parameters {
        curve: None,
        method: springpot::Method::Gl,
        name: "stiffening".into(),
        actuator: c.actuator,
        model: c.model().expect("valid"),
        sensor_offset_m: c.offset_m,
        assumed_sizes: false,
        board: None,
        provenance: None,
    }
}

fn run(
    kind: ControllerKind,
    film: &str,
    parameters: &Parameters,
    learning: Option<LearningOptions>,
    values: &[f64],
    grid: Grid,
) -> LoopRun {
    let settings = ControllerSettings {
        rate_hz: grid.rate_hz,
        limits: CommandLimits {
            max_acceleration_m_per_s2: 20.0,
            max_velocity_m_per_s: 0.5,
            max_slew_v_per_s: 5e5,
            ..CommandLimits::BENCH
        },
        observer: ObserverOptions::at_bandwidth(0.6),
        learning,
        peak_m: 1.0,
    };
    let bench = BenchModel { sensor_noise_m: 4e-6, ..BenchModel::default() };
    let mut controller = controllers::build(kind, parameters, &settings, Precision::F32).expect("valid");
    let hidden = ProgressBar::hidden();
    let name = match film {
        "hossain" => Kind::Hossain,
        _ => Kind::Wang,
    };
    let nonlinear = Film::new(name);
    let mut plant: Box<dyn Plant> = if film == "stiffening" {
        Box::new(StiffeningFilm::new())
    } else {
        Box::new(NonlinearPlant::at_rest(&nonlinear, closed_loop::substeps(grid).1))
    };
    closed_loop::track_plant(plant.as_mut(), &bench, controller.as_mut(), values, grid, &hidden).expect("holds")
}

fn window(run: &LoopRun, from: f64, to: f64) -> [f64; 2] {
    let range = (from * 1000.0) as usize..(to * 1000.0) as usize;
    let reference = &run.asked_m[100_000..];
    let (low, high) = reference.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
    let error: Vec<f64> = range.map(|k| run.displacement_m[k] - run.asked_m[k]).collect();
    let rms = (error.iter().map(|e| e * e).sum::<f64>() / error.len() as f64).sqrt();
    [100.0 * rms / (high - low), 100.0 * error.iter().fold(0.0, |l: f64, e| l.max(e.abs())) / (high - low)]
}

#[test]
fn periodic_table() {
    let films: Vec<(&str, Parameters)> =
        vec![("stiffening", stiffening()), ("hossain", nonlinear("hossain")), ("wang", nonlinear("wang"))];
    let mut jobs = Vec::new();
    for (name, parameters) in &films {
        for period in [10.0, 3.0, 1.0, 0.5, 0.2, 0.1] {
            for kind in [ControllerKind::Feedforward, ControllerKind::Tracking] {
                jobs.push((*name, parameters, period, kind));
            }
        }
    }
    let rate: f64 = std::env::var("MU").ok().and_then(|v| v.parse().ok()).unwrap_or(1.0);
    let rows: Vec<String> = jobs
        .par_iter()
        .map(|(name, parameters, period, kind)| {
            let grid = Grid::covering(155.0, 1000.0).expect("grid");
            let (low, high) = match *name {
                "wang" => (0.6e-3, 1.2e-3),
                "hossain" => (2e-3, 3.5e-3),
                _ => (1e-3, 2.2e-3),
            };
            let values = Reference::new(Shape::Sine, low, high, *period).on(grid).expect("valid");
            let mut text = format!("{name:10} {period:4} {:12}", kind.name());
            for learning in [
                None,
                Some(LearningOptions { ..LearningOptions::BENCH }),
                Some(LearningOptions { period_s: Some(*period), ..LearningOptions::BENCH }),
            ] {
                let r = run(*kind, name, parameters, learning, &values, grid);
                let (all, last) = (window(&r, period.max(2.0), 150.0), window(&r, 100.0, 150.0));
                let limited = r.limited[2000..].iter().filter(|l| !l.is_none()).count() as f64 / 1530.0;
                if std::env::var("HARM").is_ok() {
                    for h in 0..8 {
                        let (mut c, mut sn) = (0.0, 0.0);
                        for k in 100_000..150_000 {
                            let e = r.displacement_m[k] - r.asked_m[k];
                            let a = TAU * f64::from(h) * k as f64 / 1000.0 / period;
                            c += e * a.cos() / 25_000.0;
                            sn += e * a.sin() / 25_000.0;
                        }
                        text += &format!(" h{h}:{:.2}", 1e6 * (c * c + sn * sn).sqrt());
                    }
                }
                text += &format!(" | {:8.3} {:8.3} {:8.3} {limited:5.1}", all[0], last[0], last[1]);
            }
            text
        })
        .collect();
    for row in rows {
        println!("{row}");
    }
    let _ = TAU;
}
