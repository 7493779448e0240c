//! The law against exact responses of the continuous Eq. 11.
//!
//! `tests/oracle/continuous.csv` holds them from two independent inverse Laplace transforms at 40 digits.

use springpot::{Discretisation, Maxwell, Preset, Springpot, Topology};

use crate::support::models::paper_force;
use crate::support::{creep, law_by};

pub struct Row {
    pub model: String,
    pub input: String,
    pub time_s: f64,
    pub displacement_m: f64,
}

pub fn oracle() -> Vec<Row> {
    include_str!("../oracle/continuous.csv")
        .lines()
        .filter(|line| !line.starts_with('#') && !line.starts_with("model,"))
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            Row {
                model: cells[0].into(),
                input: cells[1].into(),
                time_s: cells[2].parse().expect("a time"),
                displacement_m: cells[3].parse().expect("a displacement"),
            }
        })
        .collect()
}

pub fn model(name: &str) -> Maxwell {
    match name {
        "sp" => Maxwell::new(Springpot::new(62_740.0, 0.2), &[], Topology::Eq11, 0.0).expect("valid"),
        "n1" => Preset::TABLE3_N1.model().expect("valid"),
        "n2" => Preset::TABLE3_N2.model().expect("valid"),
        _ => panic!("unknown model {name}"),
    }
}

/// Displacement of the law at every sample. `jump` is the first sample of the step of 1 N, which has no value of its own.
fn response(name: &str, input: &str, rate_hz: f64, jump: f64) -> Vec<f64> {
    let force = match input {
        "step1N" => std::iter::once(jump).chain(std::iter::repeat_n(1.0, (155.0 * rate_hz) as usize)).collect(),
        "sin_el" => paper_force(1.0 / 7.0, 155.0, rate_hz),
        _ => panic!("unknown input {input}"),
    };
    creep(&law_by::<f64>(&model(name), rate_hz, Discretisation::Gl), force)
}

fn at(series: &[f64], time_s: f64, rate_hz: f64) -> f64 {
    series[(time_s * rate_hz).round() as usize]
}

/// The step is sampled with the mean of both sides at its jump, as Fourier's theorem has it.
#[test]
fn agrees_with_the_continuous_model_and_converges() {
    let rows = oracle();
    assert_eq!(rows.len(), 36);
    for name in ["sp", "n1", "n2"] {
        for input in ["step1N", "sin_el"] {
            let coarse = response(name, input, 1000.0, 0.5);
            let fine = response(name, input, 2000.0, 0.5);
            let peak = coarse.iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
            for row in rows.iter().filter(|row| row.model == name && row.input == input) {
                let error = (at(&coarse, row.time_s, 1000.0) - row.displacement_m).abs();
                let half = (at(&fine, row.time_s, 2000.0) - row.displacement_m).abs();
                let relative = error / row.displacement_m;
                println!(
                    "{name} {input} {:>5} s: relative {relative:.1e}, of the peak {:.1e}, at half the step {:.2} of it",
                    row.time_s,
                    error / peak,
                    half / error
                );
                if row.time_s == 1.0 {
                    assert!(relative <= 5e-4);
                }
                if row.time_s >= 5.0 {
                    assert!(relative <= 1e-4);
                }
                assert!(error <= 5e-5 * peak, "{:.1e} of the peak", error / peak);
                assert!((0.4..0.6).contains(&(half / error)), "first order in the step");
            }
        }
    }
}

/// With the whole newton in the first sample the discretisation itself, as a sum of binomials, is off by
/// α(1 + α)h/2t: 7.6e-5 of the value after 155 s at 0.5 s, and below 5e-5 of it from 1 s on.
#[test]
fn a_step_sampled_on_its_upper_side_has_the_error_of_its_binomials() {
    for name in ["sp", "n1", "n2"] {
        let x = response(name, "step1N", 1000.0, 1.0);
        let peak = x.iter().copied().fold(0.0, f64::max);
        for row in oracle().iter().filter(|row| row.model == name && row.input == "step1N") {
            let error = at(&x, row.time_s, 1000.0) - row.displacement_m;
            let expected = 0.2 * 1.2 * 1e-3 / (2.0 * row.time_s);
            assert!((error / row.displacement_m / expected - 1.0).abs() < 0.05, "{name} at {} s", row.time_s);
            assert!(row.time_s < 1.0 || error < 5e-5 * peak);
        }
    }
}
