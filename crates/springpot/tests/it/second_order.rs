//! `Discretisation::Bdf2` against closed forms, quadrature, plain arithmetic and the exact answer with full memory.

use std::f64::consts::TAU;

use springpot::{Compressed, Discretisation, Law, LawError, LawOptions, Maxwell, Springpot, Topology};

use crate::continuous_oracle::{model, oracle};
use crate::laws::single;
use crate::support::models::{paper_force, presets};
use crate::support::{METHODS, creep, largest, law_by, relaxation};

/// Γ(1.2)
const GAMMA: f64 = 0.918_168_742_399_760_6;
const OMEGA: f64 = TAU / 7.0;

fn smooth(time_s: f64) -> f64 {
    0.5 * (1.0 - (OMEGA * time_s).cos())
}

/// D^−0.2 of `smooth` by Simpson's rule. With u = (t − τ)^0.2 the integral `∫ (t − τ)^−0.8 f(τ) dτ / Γ(0.2)` has a smooth
/// integrand: `∫ f(t − u⁵) du / Γ(1.2)`.
fn integral(time_s: f64) -> f64 {
    const PANELS: usize = 20_000;
    let width = time_s.powf(0.2) / PANELS as f64;
    let weighted = |k: usize| {
        let weight = if k == 0 || k == PANELS { 1.0 } else { [2.0, 4.0][k % 2] };
        weight * smooth(time_s - (k as f64 * width).powi(5))
    };
    (0..=PANELS).map(weighted).sum::<f64>() * width / 3.0 / GAMMA
}

/// Largest error (m) at 1, 5 and 20 s of the displacement of a springpot of order 0.2 under `force`.
fn largest_error(rate_hz: f64, method: Discretisation, force: impl Fn(f64) -> f64, exact: impl Fn(f64) -> f64) -> f64 {
    let law = law_by::<f64>(&single(1.0, 0.2, 0.0), rate_hz, method);
    let x = creep(&law, (0..=(20.0 * rate_hz) as usize).map(|k| force(k as f64 / rate_hz)));
    largest([1.0, 5.0, 20.0].map(|time_s| x[(time_s * rate_hz).round() as usize] - exact(time_s)))
}

/// How fast errors fall: the exponent of the step.
fn order(coarse: f64, fine: f64) -> f64 {
    (coarse / fine).log2()
}

/// The quadrature of this test against 1F2 at 30 digits: t^0.2 (1 − 1F2(1; 0.6, 1.1; −(ωt)²/4)) / 2Γ(1.2).
#[test]
fn the_quadrature_has_the_closed_form() {
    for (time_s, exact) in
        [(1.0, 0.156_473_918_700_763_01), (5.0, 1.018_449_478_945_627), (20.0, 0.812_370_640_583_640_6)]
    {
        assert!((integral(time_s) / exact - 1.0).abs() < 1e-12, "{time_s} s: {}", integral(time_s));
    }
}

#[test]
fn smooth_input_is_of_second_order() {
    let error = |rate_hz, method| largest_error(rate_hz, method, smooth, integral);
    let rates = [10.0, 20.0, 50.0, 100.0, 200.0, 1000.0];
    for rate_hz in rates {
        println!(
            "{rate_hz} Hz: GL {:.1e}, BDF2 {:.1e}",
            error(rate_hz, Discretisation::Gl),
            error(rate_hz, Discretisation::Bdf2)
        );
    }
    for rate_hz in [10.0, 20.0, 50.0, 100.0] {
        let orders = METHODS.map(|method| order(error(rate_hz, method), error(2.0 * rate_hz, method)));
        println!("{rate_hz} to {} Hz: order {:.2} and {:.2}", 2.0 * rate_hz, orders[0], orders[1]);
        assert!((0.9..1.1).contains(&orders[0]) && (1.8..2.1).contains(&orders[1]), "{rate_hz} Hz: {orders:?}");
    }
    assert!(error(100.0, Discretisation::Gl) > 3e-4);
    assert!(error(100.0, Discretisation::Bdf2) <= 5e-6);
}

/// A step of 1 N creeps as t^0.2 / Γ(1.2). The jump is in the first sample.
#[test]
fn a_jump_is_of_second_order_with_the_mean_of_both_sides() {
    let error = |rate_hz, method, first: f64| {
        largest_error(rate_hz, method, |t| if t == 0.0 { first } else { 1.0 }, |t| t.powf(0.2) / GAMMA)
    };
    for (method, first, expected) in [
        (Discretisation::Gl, 1.0, 1.0),
        (Discretisation::Gl, 0.5, 1.0),
        (Discretisation::Bdf2, 1.0, 1.0),
        (Discretisation::Bdf2, 0.5, 2.0),
    ] {
        let [coarse, fine] = [50.0, 100.0].map(|rate_hz| error(rate_hz, method, first));
        let order = order(coarse, fine);
        println!("{method:?}, {first} N in the jump's sample: {fine:.1e} at 100 Hz, order {order:.2}");
        assert!((expected - 0.2..expected + 0.1).contains(&order), "{method:?} {first}: {order}");
    }
}

/// Largest error from 1 s on, over the peak, of a published model's displacement `x` under the paper's force.
fn error_over_peak(name: &str, x: &[f64], rate_hz: f64) -> f64 {
    let rows = oracle();
    let rows = rows.iter().filter(|row| row.model == name && row.input == "sin_el" && row.time_s >= 1.0);
    let errors = rows.map(|row| x[(row.time_s * rate_hz).round() as usize] - row.displacement_m);
    largest(errors) / x.iter().copied().fold(0.0, f64::max)
}

/// Branches and mass: the published models against inverse Laplace transforms at 40 digits.
#[test]
fn published_models_are_of_second_order() {
    for name in ["sp", "n1", "n2"] {
        let error = |rate_hz: f64, method| {
            let law = law_by::<f64>(&model(name), rate_hz, method);
            error_over_peak(name, &creep(&law, paper_force(1.0 / 7.0, 155.0, rate_hz)), rate_hz)
        };
        let [coarse, fine] = [20.0, 40.0].map(|rate_hz| error(rate_hz, Discretisation::Bdf2));
        let [first, second] = METHODS.map(|method| error(100.0, method));
        let order = order(coarse, fine);
        println!("{name}: of the peak at 100 Hz GL {first:.1e}, BDF2 {second:.1e}; BDF2 order {order:.2}");
        assert!((1.8..2.1).contains(&order), "{name}: {coarse:.1e} and {fine:.1e}");
        assert!(second <= 5e-6 && second < 0.05 * first, "{name}: {second:.1e}");
    }
}

/// Largest error from 1 s on, over the peak, of the published models under the paper's force and of a springpot after a jump, in f32.
fn on_a_controller<const H: usize, const F: usize, const S: usize>(rate_hz: f64, method: Discretisation) -> [f64; 2] {
    let options = LawOptions::at_step(1.0 / rate_hz).with_method(method).with_horizon(3600.0).with_tolerance(1e-3);
    let law = |film: &Maxwell| Law::<f32, Compressed<f32, H, F, S>>::compressed(film, options).expect("valid");
    let smooth = ["sp", "n1", "n2"]
        .map(|name| error_over_peak(name, &creep(&law(&model(name)), paper_force(1.0 / 7.0, 155.0, rate_hz)), rate_hz));
    let force = (0..=(20.0 * rate_hz) as usize).map(|k| if k == 0 { 0.5 } else { 1.0 });
    let jump = creep(&law(&single(1.0, 0.2, 0.0)), force);
    let error = |time_s: f64| jump[(time_s * rate_hz).round() as usize] / (time_s.powf(0.2) / GAMMA) - 1.0;
    [largest(smooth), largest([1.0, 5.0, 20.0].map(error))]
}

/// A controller without an FPU: 100 second-order steps a second instead of 1000 first-order ones, in f32, default and lean.
#[test]
fn a_hundred_hertz_of_second_order_beat_a_kilohertz_of_first() {
    let errors = [
        (1000.0, Discretisation::Gl),
        (100.0, Discretisation::Bdf2),
        (100.0, Discretisation::Gl),
        (50.0, Discretisation::Bdf2),
    ]
    .map(|(rate_hz, method)| {
        let both = [on_a_controller::<12, 12, 24>(rate_hz, method), on_a_controller::<8, 14, 4>(rate_hz, method)];
        for (memory, [smooth, jump]) in ["12+36", "8+18"].into_iter().zip(both) {
            println!("{method:?} at {rate_hz} Hz, {memory}: {smooth:.1e}, jump {jump:.1e}");
        }
        both
    });
    for (first, second) in errors[0].iter().zip(&errors[1]) {
        assert!(10.0 * second[0] < first[0] && 5.0 * second[1] < first[1], "{second:?}, {first:?}");
    }
}

/// Up to which frequency that is so: the error of the law's response in steady state against Eq. 11.
#[test]
fn a_hundred_hertz_of_second_order_are_better_up_to_a_few_hertz() {
    let film = model("n2");
    let laws = [(1000.0, Discretisation::Gl), (100.0, Discretisation::Bdf2)]
        .map(|(rate_hz, method)| law_by::<f64>(&film, rate_hz, method));
    for (frequency_hz, better) in [(0.14, true), (0.5, true), (1.0, true), (2.0, true), (5.0, false), (10.0, false)] {
        let exact = film.frequency_response(frequency_hz);
        let [first, second] =
            [&laws[0], &laws[1]].map(|law| (law.frequency_response(frequency_hz) / exact - 1.0).norm());
        println!("{frequency_hz} Hz: GL at 1 kHz {first:.1e}, BDF2 at 100 Hz {second:.1e}");
        assert_eq!(second < first, better, "{frequency_hz} Hz: {first:.1e}, {second:.1e}");
    }
}

/// A spring, a dashpot and a heavy mass along x = sin⁴(ωt/2), whose force is closed form. Inertia is most of it.
#[test]
fn inertia_is_of_second_order_in_both_directions() {
    let (spring, dashpot, mass, omega) = (100.0, 20.0, 5.0, 10.0);
    let half = dashpot * 2.0;
    let branch = [Springpot::new(half, 1.0), Springpot::new(half, 1.0)];
    let film = Maxwell::new(Springpot::new(spring, 0.0), &[branch], Topology::Parallel, mass).expect("valid");
    let path = |t: f64| (0.5 * omega * t).sin().powi(4);
    let force = |t: f64| {
        let (sin, cos) = (0.5 * omega * t).sin_cos();
        let speed = 2.0 * omega * sin.powi(3) * cos;
        let acceleration = omega * omega * sin * sin * (3.0 * cos * cos - sin * sin);
        spring * path(t) + dashpot * speed + mass * acceleration
    };
    let errors = |rate_hz: f64| {
        let law = law_by::<f64>(&film, rate_hz, Discretisation::Bdf2);
        let times: Vec<f64> = (0..=(2.0 * rate_hz) as usize).map(|k| k as f64 / rate_hz).collect();
        let differ = |found: Vec<f64>, exact: &dyn Fn(f64) -> f64| {
            largest(found.iter().zip(&times).map(|(found, &t)| found - exact(t)))
        };
        let backwards = differ(relaxation(&law, times.iter().map(|&t| path(t))), &force);
        let forwards = differ(creep(&law, times.iter().map(|&t| force(t))), &path);
        (backwards / (mass * omega * omega), forwards)
    };
    let (coarse, fine) = (errors(500.0), errors(1000.0));
    let orders = (order(coarse.0, fine.0), order(coarse.1, fine.1));
    println!("inertia at 1 kHz: {:.1e} and {:.1e}, orders {:.2} and {:.2}", fine.0, fine.1, orders.0, orders.1);
    assert!((1.8..2.1).contains(&orders.0) && (1.8..2.1).contains(&orders.1), "{orders:?}");
}

/// A relaxation time near the step oscillates, which decaying modes cannot follow: refused, and held by a longer head.
#[test]
fn a_relaxation_time_as_short_as_the_step_needs_a_longer_head() {
    for (steps, refused) in [
        (0.2, false),
        (0.5, false),
        (1.0, true),
        (1.5, true),
        (2.0, true),
        (2.0 + 1e-9, true),
        (2.1, true),
        (3.0, false),
        (10.0, false),
    ] {
        let branch = [Springpot::new(1e4, 0.0), Springpot::new(1e4 * steps * 1e-3, 1.0)];
        let film = Maxwell::new(Springpot::new(1.0, 0.2), &[branch], Topology::Parallel, 0.0).expect("valid");
        let options = LawOptions::at_step(1e-3).with_method(Discretisation::Bdf2);
        let usual = Law::<f64>::compressed(&film, options).map(|law| law.memory().tail_error());
        println!("relaxation time {steps} steps: {usual:?}");
        assert_eq!(matches!(usual, Err(LawError::ToleranceMissed { .. })), refused, "{steps} steps: {usual:?}");
        let long = Law::<f64, Compressed<f64, 26, 12, 24>>::compressed(&film, options);
        assert!(long.is_ok(), "{steps} steps: {:?}", long.map(|law| law.memory().tail_error()));
    }
    // Inertia reaches back over three increments.
    let options = LawOptions::at_step(1e-3).with_method(Discretisation::Bdf2).with_tolerance(1.0);
    let short = Law::<f64, Compressed<f64, 2, 12, 24>>::compressed(&single(6e4, 0.2, 0.3), options);
    assert_eq!(short.err(), Some(LawError::HeadTooShort { head: 2, needed: 3 }));
}

/// The frequency response of the law is second-order as well, and an observer designs with it.
#[test]
fn the_frequency_response_is_of_second_order() {
    for (name, model) in presets() {
        let exact = model.frequency_response(1.0);
        let error = |rate_hz| {
            (law_by::<f64>(&model, rate_hz, Discretisation::Bdf2).frequency_response(1.0) - exact).norm() / exact.norm()
        };
        let order = order(error(200.0), error(400.0));
        assert!((1.8..2.1).contains(&order), "{name}: {order}");
    }
}
