//! Costs of a fit, as a table: three recordings of 15 501 samples, jointly.
//!
//! `cargo bench -p tests --bench fit`; `-- --short` skips the one that takes minutes.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use host_sim::files::recording::{Direction, Recording};
use host_sim::fit::candidate::{Candidate, Variable};
use host_sim::fit::objective::Objective;
use host_sim::fit::observation::{self, Observation};
use host_sim::fit::{self, Method, Settings};
use springpot::{Actuator, Preload, Springpot, Topology};

static NEVER: AtomicBool = AtomicBool::new(false);

fn main() {
    let short = std::env::args().any(|argument| argument == "--short");
    let observations: Vec<Observation> = tests::recordings("hossain")
        .iter()
        .map(|path| {
            let recording = Recording::read(path).expect("committed");
            observation::observe(&recording, Direction::Force, 1.0).expect("fit for fitting").0
        })
        .collect();
    let objective = Objective::new(&observations, Preload::Settled).expect("valid");
    println!(
        "| 3 × {} samples, {} threads | time |",
        observations[0].measured.value.len(),
        rayon::current_num_threads()
    );
    println!("| --- | --- |");
    for (coupling, name) in [(0.0, "no coupling"), (30.0, "with coupling")] {
        let sp = Springpot::new;
        let elements = vec![sp(4e4, 0.08), sp(2.2e4, 0.12), sp(1.4e4, 0.85), sp(1.1e4, 0.05), sp(1.5e5, 0.92)];
        let actuator = Actuator { stretch_coupling: coupling, ..Actuator::KARNER_2022 };
        let candidate = Candidate::linear(actuator, elements, Topology::Parallel);
        let mut variables = Variable::of_model(2);
        if coupling > 0.0 {
            variables.extend([Variable::StretchCoupling, Variable::Offset]);
        }
        let evaluation = objective.evaluate(&candidate).expect("a response");
        row(
            &format!("evaluation, n = 2, {name}"),
            &median(100, || {
                objective.residuals(&objective.evaluate(&candidate).expect("a response"));
            }),
        );
        row(
            &format!("Jacobian, {} variables, {name}", variables.len()),
            &median(30, || {
                objective.jacobian(&candidate, &evaluation, &variables);
            }),
        );
    }
    let two =
        Settings { branches: vec![2], topologies: vec![Topology::Parallel], uncertainty: false, ..Settings::default() };
    fitted("fit, n = 2, parallel, one start", &observations, &Settings { starts: 1, ..two.clone() });
    fitted("fit, n = 2, parallel, 8 starts, intervals", &observations, &Settings { uncertainty: true, ..two.clone() });
    fitted("fit, auto: both topologies, n = 0…5, intervals", &observations, &Settings::default());
    let uncoupled = Settings { freed: Vec::new(), topologies: vec![Topology::Eq11], ..two };
    fitted("fit, n = 2, eq11, no coupling, 8 starts", &observations, &uncoupled);
    if !short {
        let paper = Settings { method: Method::PatternSearch, ..uncoupled };
        fitted("pattern search, n = 2, eq11, no coupling, to its own stop", &observations, &paper);
    }
}

fn row(what: &str, time: &str) {
    println!("| {what} | {time} |");
}

fn median(times: usize, mut work: impl FnMut()) -> String {
    let mut all: Vec<f64> = (0..times)
        .map(|_| {
            let started = Instant::now();
            work();
            started.elapsed().as_secs_f64()
        })
        .collect();
    all.sort_by(f64::total_cmp);
    format!("{:.1} ms", 1e3 * all[times / 2])
}

fn fitted(what: &str, observations: &[Observation], settings: &Settings) {
    let started = Instant::now();
    let fit = fit::fit(observations, settings, &NEVER, &|_| ()).expect("a fit");
    let seconds = started.elapsed().as_secs_f64();
    row(what, &format!("{seconds:.2} s, {} evaluations, R² mean {:.6}", fit.evaluations, fit.r2_mean));
}
