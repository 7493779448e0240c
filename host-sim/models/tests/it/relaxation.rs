//! Fits to relaxation tests whose force is known in closed form: strain held, stepped, or reached by a ramp.
//!
//! A springpot c D^α answers a step of the displacement by c x t^-α / Γ(1 − α), and a springpot in series with a spring by
//! k x E_α(−(t/τ)^α), E_α being the Mittag-Leffler function. Neither knows of a step of time.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;

use host_io::files::recording::{Direction, Recording};
use host_models::excitation::check;
use host_models::fit::observation;
use host_models::fit::options::FitOptions;
use host_models::fit::preparation::Preparation;
use host_models::fit::{Fit, Settings, Warning};
use springpot::Actuator;

use crate::recorded::{self, noise};

/// The displacement that is held, m.
const HELD_M: f64 = 0.01;
/// Seconds between even rows.
const STEP_S: f64 = 0.1;
const ROWS: usize = 1000;
/// Smallest R² of noise-free recordings; the discretisation causes the rest.
const MIN_R2: f64 = 0.9999;

/// A springpot alone.
const C: f64 = 2000.0;
const ALPHA: f64 = 0.2;
/// Γ(1 − α) and Γ(2 − α) = (1 − α) Γ(1 − α) for α = 0.2.
const GAMMA_0_8: f64 = 1.164_229_713_725_303_4;
const GAMMA_1_8: f64 = 0.8 * GAMMA_0_8;

/// A spring in series with a springpot of order 1/2 and coefficient k √τ.
const SPRING: f64 = 3000.0;
const TAU_S: f64 = 8.0;
const ORDER: f64 = 0.5;

/// E_α(−y) for 0 < α < 1 and y > 0 by its spectrum: sin(πα)/(πα) ∫ e^{−(y u)^{1/α}} / (u² + 2 u cos πα + 1) du.
fn mittag_leffler(alpha: f64, y: f64) -> f64 {
    if y <= 0.0 {
        return 1.0;
    }
    // The trapezoidal rule in ln u converges exponentially.
    let step = 0.02;
    let sum: f64 = (-1500..=1500)
        .map(|i| {
            let u = (f64::from(i) * step).exp();
            u * (-(y * u).powf(1.0 / alpha)).exp() / (u * u + 2.0 * u * (PI * alpha).cos() + 1.0)
        })
        .sum();
    (PI * alpha).sin() / (PI * alpha) * step * sum
}

/// Force of the springpot `t` seconds after the step, N.
fn springpot_n(t: f64) -> f64 {
    if t > 0.0 { C * HELD_M * t.powf(-ALPHA) / GAMMA_0_8 } else { 0.0 }
}

/// Force of the springpot under a displacement that grows by `HELD_M` a second, N.
fn springpot_ramp_n(t: f64) -> f64 {
    if t > 0.0 { C * HELD_M * t.powf(1.0 - ALPHA) / GAMMA_1_8 } else { 0.0 }
}

/// Force of spring and springpot in series `t` seconds after the step, N.
fn series_n(t: f64) -> f64 {
    if t >= 0.0 { SPRING * HELD_M * mittag_leffler(ORDER, (t / TAU_S).powf(ORDER)) } else { 0.0 }
}

/// Force (N, unit stiffness) of a spring and exponentials beside it whose weights fall as those of a springpot, under a displacement that rises to 1 in `ramp_s`
/// and is held.
fn ramp_and_hold_n(t: f64, ramp_s: f64) -> f64 {
    let of = |tau_s: f64| {
        let risen = t.min(ramp_s);
        tau_s / ramp_s * (1.0 - (-risen / tau_s).exp()) * (-(t - risen) / tau_s).exp()
    };
    let modes = (-8..10).map(|k| 2.5f64.powi(k));
    0.6 * (t / ramp_s).min(1.0) + modes.map(|tau_s| 0.12 * tau_s.powf(-0.15) * of(tau_s)).sum::<f64>()
}

/// A relaxation with its loading ramp, of which a springpot alone follows the hold: the structure is chosen that follows both, to the noise.
#[test]
fn a_relaxation_is_fitted_with_its_ramp() {
    for (ramp_s, seed) in [(0.5, 1), (0.05, 2)] {
        let mut noise = noise(seed, 0.15);
        let rows = (0..1200).map(|k| {
            let t = 0.1 * f64::from(k);
            let from_start = (t - 1.0).max(0.0);
            let force = 100.0 * ramp_and_hold_n(from_start, ramp_s) + noise();
            (t, HELD_M * (from_start / ramp_s).min(1.0), force)
        });
        let recording = recording(rows);
        // Held for two minutes, and so `check` says.
        let report = check::check(std::slice::from_ref(&recording));
        let texts: Vec<&str> = report.findings.iter().map(|finding| finding.finding.as_str()).collect();
        println!("{texts:?}");
        assert!(report.recordings[0].driven_by == "displacement" && report.recordings[0].drive.hold_s > 110.0);
        assert!(report.identifies && texts.iter().any(|text| text.contains(" and no cycle: relaxation at")));
        let options = FitOptions { drive: Direction::Displacement, ..FitOptions::default() };
        let settings = options.settings(None, None).expect("settings");
        let (observation, _) = options.observations(&[&recording]).expect("rows").swap_remove(0);
        let fit = recorded::fitted(&[observation], &settings);
        let rmse = fit.agreements[0].rmse;
        println!("{ramp_s} s: R² {:.6}, {rmse} N, {:?}", fit.r2_mean, fit.structures);
        // Of a ramp between two rows the rows do not show the end.
        assert!(rmse < if ramp_s > 0.1 { 1.1 } else { 1.5 } * 0.15, "{rmse} N of noise 0.15");
    }
}

/// A specimen that is unloaded beyond its length at rest is slack, and is called so; one that is held at rest is not.
#[test]
fn a_slack_specimen_is_named() {
    let warnings = |back_to: f64, force_n: &dyn Fn(f64) -> f64| {
        let rows = (0..=600).map(|k| {
            let t = 0.1 * f64::from(k);
            let x = HELD_M * if t < 30.0 { t / 30.0 } else { 1.0 - (1.0 - back_to) * (t - 30.0) / 30.0 };
            (t, x, force_n(x / HELD_M) * if t < 30.0 { 1.0 } else { 0.9 })
        });
        let observed = observation::observe(&recording(rows), Direction::Displacement, 1.0).expect("rows");
        observed.1.into_iter().map(|warning| warning.text).filter(|text| text.contains("slack")).collect::<Vec<_>>()
    };
    // Of 12.6 N 1 % is at 3.078 mm.
    let slack = warnings(0.0, &|x| 20.0 * (x - 0.3).max(0.0));
    assert!(slack.len() == 1 && slack[0].starts_with("relaxation.csv: from 50.800 to 60.000 s"), "{slack:?}");
    assert!(slack[0].contains("from 3.067 to 0.000 mm"), "{slack:?}");
    // A rubber's force falls to zero at once, and a specimen that is held back is not slack.
    assert!(warnings(0.0, &|x| 20.0 * x).is_empty());
    assert!(warnings(0.4, &|x| 20.0 * (x - 0.3).max(0.0)).is_empty());
}

/// The recording of rows of time (s), displacement (m) and force (N).
fn recording(rows: impl IntoIterator<Item = (f64, f64, f64)>) -> Recording {
    let mut csv = "time_s,displacement_m,force_n\n".to_owned();
    for (time_s, x, force) in rows {
        writeln!(csv, "{time_s:?},{x:?},{force:?}").expect("written");
    }
    Recording::from_csv(Path::new("relaxation.csv"), csv.as_bytes()).expect("readable")
}

/// One springpot, or one branch beside a springpot, fitted to such rows, with the warnings about them.
fn fitted(rows: impl IntoIterator<Item = (f64, f64, f64)>, branches: usize) -> (Fit, Vec<Warning>) {
    let (observation, warnings) =
        observation::observe(&recording(rows), Direction::Displacement, 1.0).expect("fit for fitting");
    let actuator = Actuator { mass_kg: 0.0, ..Actuator::KARNER_2022 };
    let settings = Settings { actuator, ..recorded::parallel(vec![branches]) };
    let fit = recorded::fitted(&[observation], &settings);
    println!("R² {:.8}, {:?}, {warnings:?}", fit.r2_mean, fit.candidate.elements);
    (fit, warnings)
}

fn close(value: f64, truth: f64, share: f64) {
    assert!((value - truth).abs() <= share * truth, "{value} instead of {truth}");
}

/// The springpot alone, found within 2 %.
fn finds_the_springpot(rows: impl IntoIterator<Item = (f64, f64, f64)>) -> Vec<Warning> {
    let (fit, warnings) = fitted(rows, 0);
    assert!(fit.r2_mean >= MIN_R2, "{}", fit.r2_mean);
    close(fit.candidate.elements[0].c, C, 0.02);
    close(fit.candidate.elements[0].alpha, ALPHA, 0.02);
    warnings
}

/// Spring and springpot in series, found within 5 %: the spring is the stiffer element of the branch.
fn finds_the_series(rows: impl IntoIterator<Item = (f64, f64, f64)>) -> Vec<Warning> {
    let (fit, warnings) = fitted(rows, 1);
    assert!(fit.r2_mean >= MIN_R2, "{}", fit.r2_mean);
    let [_, spring, springpot] = fit.candidate.elements[..] else { panic!("one branch") };
    close(spring.c, SPRING, 0.05);
    close(springpot.c, SPRING * TAU_S.powf(ORDER), 0.05);
    close(springpot.alpha, ORDER, 0.05);
    assert!(spring.alpha < 0.01, "{}", spring.alpha);
    warnings
}

/// Spring and springpot in series, followed from the sample of the step itself, whose force the law spreads over a step. The
/// springpot beside them takes up the difference, so that parameters are not compared.
fn follows_the_series(rows: impl IntoIterator<Item = (f64, f64, f64)>) -> Vec<Warning> {
    let (fit, warnings) = fitted(rows, 1);
    assert!(fit.r2_mean >= MIN_R2, "{}", fit.r2_mean);
    warnings
}

fn even_s(row: usize) -> f64 {
    row as f64 * STEP_S
}

/// Rows at the times that a logarithmic clock shows, 50 to a decade from 0.1 s, the displacement held since 0.
fn logarithmic(rows: i32, force_n: impl Fn(f64) -> f64) -> impl Iterator<Item = (f64, f64, f64)> {
    (0..rows).map(move |k| 0.1 * 10f64.powf(f64::from(k) / 50.0)).map(move |t| (t, HELD_M, force_n(t)))
}

#[test]
fn the_mittag_leffler_function_has_its_known_values() {
    // E_½(−1) = e erfc(1), and E_½(−y) → 1/(y √π) for large y.
    close(mittag_leffler(0.5, 1.0), 0.427_583_576_155_807, 1e-9);
    close(mittag_leffler(0.5, 1e4), 1.0 / (1e4 * PI.sqrt()), 1e-6);
    close(mittag_leffler(0.5, 1e-6), 1.0 - 1e-6 * 2.0 / PI.sqrt(), 1e-9);
}

/// The clock begins at the first row, and the step was made between it and the row that is missing before it.
#[test]
fn a_displacement_held_from_the_first_row() {
    finds_the_springpot((0..ROWS).map(|k| (even_s(k), HELD_M, springpot_n(even_s(k) + 0.5 * STEP_S))));
    finds_the_series((0..ROWS).map(|k| (even_s(k), HELD_M, series_n(even_s(k) + 0.5 * STEP_S))));
    follows_the_series((0..ROWS).map(|k| (even_s(k), HELD_M, series_n(even_s(k)))));
}

/// Compression has the other sign, and a measured displacement is constant but for its noise.
#[test]
fn a_held_displacement_may_be_negative_and_noisy() {
    follows_the_series((0..ROWS).map(|k| (even_s(k), -HELD_M, -series_n(even_s(k)))));
    let noise = |k: usize| 1.0 + 1e-7 * (k as f64 * 12.9898).sin();
    follows_the_series((0..ROWS).map(|k| (even_s(k), HELD_M * noise(k), series_n(even_s(k)))));
}

#[test]
fn a_displacement_stepped_in_the_middle() {
    let from_s = even_s(ROWS / 2) - 0.5 * STEP_S;
    let path = |t: f64| if t > from_s { HELD_M } else { 0.0 };
    let row = |k: usize, force: fn(f64) -> f64| (even_s(k), path(even_s(k)), force(even_s(k) - from_s));
    finds_the_springpot((0..ROWS).map(|k| row(k, springpot_n)));
    finds_the_series((0..ROWS).map(|k| row(k, series_n)));
}

#[test]
fn a_ramp_and_a_hold() {
    let ramp_s = 2.0;
    finds_the_springpot((0..ROWS).map(|k| {
        let t = even_s(k);
        let force = (springpot_ramp_n(t) - springpot_ramp_n(t - ramp_s)) / ramp_s;
        (t, HELD_M * (t / ramp_s).min(1.0), force)
    }));
}

/// A clock that counts from the step: the first row is not the step.
#[test]
fn a_clock_that_counts_from_the_step() {
    finds_the_springpot((1..=ROWS).map(|k| (even_s(k), HELD_M, springpot_n(even_s(k)))));
    finds_the_series((1..=ROWS).map(|k| (even_s(k), HELD_M, series_n(even_s(k)))));
}

/// Rows of material tests are often logarithmic: the fit says at which rate it runs, and which rows that leaves out.
#[test]
fn logarithmic_rows() {
    let says = |warnings: &[Warning], what: &str| warnings.iter().any(|warning| warning.contains(what));
    // Four decades: more steps than a fit takes at the rate of the first rows.
    let warnings = finds_the_springpot(logarithmic(200, springpot_n));
    assert!(says(&warnings, "the model runs at") && says(&warnings, "10 rows fall between"), "{warnings:?}");
    let warnings = finds_the_series(logarithmic(150, series_n));
    assert!(says(&warnings, "the model runs at") && !says(&warnings, "a gap"), "{warnings:?}");
}

/// A ramp in dense rows and a long hold in logarithmic ones, and a hold that is recorded in bursts.
#[test]
fn ramps_and_holds_at_uneven_times() {
    let ramp_s = 2.0;
    let ramp = |t: f64| {
        let force = (springpot_ramp_n(t) - springpot_ramp_n(t - ramp_s)) / ramp_s;
        (t, HELD_M * (t / ramp_s).min(1.0), force)
    };
    let dense = (0..40).map(|k| 0.05 * f64::from(k));
    let logarithmic = (0..=120).map(|k| ramp_s * 10f64.powf(f64::from(k) / 50.0));
    finds_the_springpot(dense.clone().chain(logarithmic).map(ramp));
    let bursts = (0..12).flat_map(|burst| (0..20).map(move |k| ramp_s + 20.0 * f64::from(burst) + 0.1 * f64::from(k)));
    finds_the_springpot(dense.chain(bursts).map(ramp));
}

/// Changes of the input between the model's steps are not fitted, and there is a warning.
#[test]
fn an_input_that_moves_between_the_steps_is_reported() {
    let pulse = |t: f64| if (t - 50.05).abs() < 0.002 { HELD_M } else { 0.1 * HELD_M * (0.2 * t).sin() };
    let mut times: Vec<f64> = (0..ROWS).map(even_s).chain((1..=8).map(|k| 50.04 + 0.002 * f64::from(k))).collect();
    times.sort_by(f64::total_cmp);
    let (_, warnings) = fitted(times.into_iter().map(|t| (t, pulse(t), 20.0 * pulse(t) + 1e-3 * (3.0 * t).sin())), 0);
    assert!(warnings.iter().any(|w| w.contains("moves between the model's steps of 0.1000 s")), "{warnings:?}");
}

/// With logarithmic-time weights every decade counts the same: of even rows, each as 1/t.
#[test]
fn logarithmic_time_weights() {
    let mut csv = "time_s,displacement_m,force_n,weight\n".to_owned();
    for k in 1..=ROWS {
        let (t, weight) = (even_s(k), if k == 500 { "0" } else { "" });
        writeln!(csv, "{t:?},{HELD_M:?},{:?},{weight}", springpot_n(t)).expect("written");
    }
    let recording = Recording::from_csv(Path::new("relaxation.csv"), csv.as_bytes()).expect("readable");
    let log_time = Preparation { log_time: true, ..Preparation::NONE };
    let observed = observation::observe_prepared(&recording, Direction::Displacement, 1.0, log_time);
    let (observation, _) = observed.expect("fit for fitting");
    let squares: Vec<f64> = observation.sample_weights.iter().map(|w| w * w).collect();
    assert!((squares.iter().sum::<f64>() / ROWS as f64 - 1.0).abs() < 1e-12);
    assert_eq!(squares[499], 0.0);
    for (k, square) in squares.iter().enumerate().take(ROWS - 1).skip(10).filter(|(k, _)| *k != 499) {
        close(square * even_s(k + 1), squares[20] * even_s(21), 0.01);
    }
}
