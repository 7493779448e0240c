//! Intervals of a fit hold: of many draws of the noise, at least nine in ten contain the value that a fit without noise finds.
//!
//! `SPRINGPOT_SWEEP=full cargo test -p host-models --test it intervals -- --nocapture` draws 200 times and prints the shares.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use crate::recorded;
use crate::sweep::full_sweep;
use host_io::files::recording::Input;
use host_io::grid::{Grid, Samples};
use host_models::fit::candidate::Candidate;
use host_models::fit::objective::Objective;
use host_models::fit::observation::Observation;
use host_models::fit::{self, Fit, Settings};
use rayon::prelude::*;
use springpot::{Actuator, Preload, Springpot, Topology};

/// RMS of the noise, m.
const NOISE_M: f64 = 5e-6;

/// A springpot with one branch.
fn film() -> Candidate {
    let elements = vec![Springpot::new(4e4, 0.08), Springpot::new(2.2e4, 0.12), Springpot::new(1.4e4, 0.85)];
    let actuator = Actuator { stretch_coupling: 30.0, ..Actuator::KARNER_2022 };
    Candidate { offset_m: 1e-4, ..Candidate::linear(actuator, elements, Topology::Parallel) }
}

/// Sines of two frequencies, 20 values a second, without noise.
fn observations() -> Vec<Observation> {
    let record = |hz: f64| {
        let time_s = Grid { rate_hz: 20.0, samples: 1000 }.times_s();
        let value = time_s.iter().map(|t| 3000.0 * (1.0 - (TAU * hz * t).cos())).collect();
        let input = Input::Voltage(Samples { time_s: time_s.clone(), value });
        let measured = Samples { value: vec![0.0; time_s.len()], time_s };
        recorded::observation(&format!("{hz} Hz"), input, measured, 20.0)
    };
    let mut observations = vec![record(0.2), record(0.07)];
    let modelled =
        Objective::new(&observations, Preload::Settled).expect("valid").evaluate(&film()).expect("a response").modelled;
    observations.iter_mut().zip(modelled).for_each(|(observation, values)| observation.measured.value = values);
    observations
}

/// With noise, of which so much follows from the value before.
fn noisy(observations: &[Observation], seed: u64, follows: f64) -> Vec<Observation> {
    let mut fresh = recorded::noise(seed, NOISE_M * (1.0 - follows * follows).sqrt());
    let mut noise = 0.0;
    let mut add = |x: &f64| {
        noise = follows * noise + fresh();
        x + noise
    };
    let with = |observation: &Observation| {
        let value = observation.measured.value.iter().map(&mut add).collect();
        Observation { measured: Samples { value, ..observation.measured.clone() }, ..observation.clone() }
    };
    observations.iter().map(with).collect()
}

fn fitted(observations: &[Observation], branches: usize) -> Fit {
    let settings =
        Settings { starts: 3, sensor_delay_s: Some(0.0), uncertainty: true, ..recorded::parallel(vec![branches]) };
    recorded::fitted(observations, &settings)
}

#[test]
fn the_value_without_noise_is_in_nine_intervals_of_ten() {
    let draws = if full_sweep() { 200 } else { 16 };
    for (what, branches, follows) in [
        ("the film's own structure", 1, 0.0),
        ("noise of ten rows", 1, 0.8),
        ("a structure that is too small", 0, 0.0),
        ("a structure that is too large", 2, 0.0),
    ] {
        let plain = observations();
        let truth = fitted(&plain, branches);
        let values: BTreeMap<String, f64> =
            truth.uncertainty.expect("computed").estimates.into_iter().map(|e| (e.name, e.value)).collect();
        let inside: Vec<(String, bool)> = (1..=draws)
            .into_par_iter()
            .flat_map_iter(|seed| {
                let fit = fitted(&noisy(&plain, seed, follows), branches);
                let uncertainty = fit.uncertainty.expect("computed");
                // Of what the data leave open, the search may not find the end; what they determine has its interval beside it.
                let is_larger = branches > 1;
                assert!(is_larger || uncertainty.no_intervals.is_none(), "{what}, draw {seed}");
                let has_one = uncertainty.no_intervals.is_none();
                let counts = |e: &&fit::Estimate| has_one && !(is_larger && e.name.starts_with("branches"));
                let contains = |e: &fit::Estimate| {
                    let value = values[&e.name];
                    let (low, high) = (e.low.unwrap_or(f64::NEG_INFINITY), e.high.unwrap_or(f64::INFINITY));
                    (e.name.clone(), low <= value && value <= high)
                };
                uncertainty.estimates.iter().filter(counts).map(contains).collect::<Vec<_>>()
            })
            .collect();
        let share = |of: &dyn Fn(&str) -> bool| {
            let of: Vec<_> = inside.iter().filter(|(name, _)| of(name)).collect();
            of.iter().filter(|(_, inside)| *inside).count() as f64 / of.len() as f64
        };
        assert!(inside.len() as u64 > 2 * draws, "{what}: {} intervals", inside.len());
        for name in values.keys() {
            println!("{what}, {name}: {:.3} of {draws}", share(&|other| other == name));
        }
        let all = share(&|_| true);
        println!("{what}: {all:.3}");
        // Of few draws one in a hundred thousand has so few.
        assert!(all >= if full_sweep() { 0.9 } else { 0.8 }, "{what}: {all}");
    }
}
