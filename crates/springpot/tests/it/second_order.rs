//! `Discretisation::Bdf2` against closed forms, quadrature, plain arithmetic and the exact answer with full memory.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use springpot::{Compressed, Discretisation, Law, LawError, LawOptions, Maxwell, Scalar, Springpot, Topology};

use crate::continuous_oracle::{model, oracle};
use crate::laws::single;
use crate::support::full_memory::FullMemory;
use crate::support::models::{hard_models, paper_force, presets, random_models};
use crate::support::{relative_rms, sample};

/// Γ(1.2)
const GAMMA: f64 = 0.918_168_742_399_760_6;
const OMEGA: f64 = TAU / 7.0;
const METHODS: [Discretisation; 2] = [Discretisation::Gl, Discretisation::Bdf2];

fn law<T: Scalar>(model: &Maxwell, rate_hz: f64, method: Discretisation) -> Law<T> {
    Law::compressed(model, LawOptions::at_step(1.0 / rate_hz).with_method(method)).expect("valid")
}

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
    let law = law::<f64>(&single(1.0, 0.2, 0.0), rate_hz, method);
    let mut state = law.state();
    let x: Vec<f64> =
        (0..=(20.0 * rate_hz) as usize).map(|k| law.displacement(&mut state, force(k as f64 / rate_hz))).collect();
    let error = |time_s: f64| (x[(time_s * rate_hz).round() as usize] - exact(time_s)).abs();
    [1.0, 5.0, 20.0].map(error).into_iter().fold(0.0, f64::max)
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

/// Branches and mass: the published models against inverse Laplace transforms at 40 digits.
#[test]
fn published_models_are_of_second_order() {
    let force = |rate_hz| paper_force(1.0 / 7.0, 155.0, rate_hz);
    for name in ["sp", "n1", "n2"] {
        let run = |rate_hz: f64, method| -> Vec<f64> {
            let law = law::<f64>(&model(name), rate_hz, method);
            let mut state = law.state();
            force(rate_hz).into_iter().map(|f| law.displacement(&mut state, f)).collect()
        };
        // Largest error from 1 s on, over the peak.
        let error = |rate_hz: f64, method| {
            let x = run(rate_hz, method);
            let peak = x.iter().copied().fold(0.0, f64::max);
            oracle()
                .iter()
                .filter(|row| row.model == name && row.input == "sin_el" && row.time_s >= 1.0)
                .map(|row| (x[(row.time_s * rate_hz).round() as usize] - row.displacement_m).abs() / peak)
                .fold(0.0, f64::max)
        };
        let [coarse, fine] = [20.0, 40.0].map(|rate_hz| error(rate_hz, Discretisation::Bdf2));
        let (first, second) = (error(100.0, Discretisation::Gl), error(100.0, Discretisation::Bdf2));
        println!(
            "{name}: of the peak at 100 Hz GL {first:.1e}, BDF2 {second:.1e}; BDF2 order {:.2}",
            order(coarse, fine)
        );
        assert!((1.8..2.1).contains(&order(coarse, fine)), "{name}: {coarse:.1e} and {fine:.1e}");
        assert!(second <= 5e-6 && second < 0.05 * first, "{name}: {second:.1e}");
    }
}

/// Largest error from 1 s on, over the peak, of the published models under the paper's force and of a springpot after a jump, in f32.
fn on_a_controller<const H: usize, const F: usize, const S: usize>(rate_hz: f64, method: Discretisation) -> [f64; 2] {
    type Slim<const H: usize, const F: usize, const S: usize> = Law<f32, Compressed<f32, H, F, S>>;
    let options = LawOptions::at_step(1.0 / rate_hz).with_method(method).with_horizon(3600.0).with_tolerance(1e-3);
    let run = |film: &Maxwell, force: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
        let law = Slim::<H, F, S>::compressed(film, options).expect("valid");
        let mut state = law.state();
        force.map(|f| f64::from(law.displacement(&mut state, f as f32))).collect()
    };
    let smooth = ["sp", "n1", "n2"].map(|name| {
        let x = run(&model(name), &mut paper_force(1.0 / 7.0, 155.0, rate_hz).into_iter());
        let peak = x.iter().copied().fold(0.0, f64::max);
        oracle()
            .iter()
            .filter(|row| row.model == name && row.input == "sin_el" && row.time_s >= 1.0)
            .map(|row| (x[(row.time_s * rate_hz).round() as usize] - row.displacement_m).abs() / peak)
            .fold(0.0, f64::max)
    });
    let jump =
        run(&single(1.0, 0.2, 0.0), &mut (0..=(20.0 * rate_hz) as usize).map(|k| if k == 0 { 0.5 } else { 1.0 }));
    let error = |time_s: f64| (jump[(time_s * rate_hz).round() as usize] / (time_s.powf(0.2) / GAMMA) - 1.0).abs();
    [smooth.into_iter().fold(0.0, f64::max), [1.0, 5.0, 20.0].map(error).into_iter().fold(0.0, f64::max)]
}

/// A controller without an FPU: 100 second-order steps a second instead of 1000 first-order ones, in f32, default and lean.
#[test]
fn a_hundred_hertz_of_second_order_beat_a_kilohertz_of_first() {
    for (rate_hz, method) in [
        (1000.0, Discretisation::Gl),
        (100.0, Discretisation::Gl),
        (100.0, Discretisation::Bdf2),
        (50.0, Discretisation::Bdf2),
    ] {
        let default = on_a_controller::<12, 12, 24>(rate_hz, method);
        let lean = on_a_controller::<8, 14, 4>(rate_hz, method);
        println!(
            "{method:?} at {rate_hz} Hz: 12+36 {:.1e}, jump {:.1e}; 8+18 {:.1e}, jump {:.1e}",
            default[0], default[1], lean[0], lean[1]
        );
    }
    let first = on_a_controller::<12, 12, 24>(1000.0, Discretisation::Gl);
    let second = on_a_controller::<12, 12, 24>(100.0, Discretisation::Bdf2);
    assert!(10.0 * second[0] < first[0] && 5.0 * second[1] < first[1], "{second:?}, {first:?}");
    let (first, second) = (
        on_a_controller::<8, 14, 4>(1000.0, Discretisation::Gl),
        on_a_controller::<8, 14, 4>(100.0, Discretisation::Bdf2),
    );
    assert!(10.0 * second[0] < first[0] && 5.0 * second[1] < first[1], "{second:?}, {first:?}");
}

/// Up to which frequency that is so: the error of the law's response in steady state against Eq. 11.
#[test]
fn a_hundred_hertz_of_second_order_are_better_up_to_a_few_hertz() {
    let film = model("n2");
    let laws = [(1000.0, Discretisation::Gl), (100.0, Discretisation::Bdf2)]
        .map(|(rate_hz, method)| law::<f64>(&film, rate_hz, method));
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
        let law = law::<f64>(&film, rate_hz, Discretisation::Bdf2);
        let (mut relaxation, mut creep) = (law.state(), law.state());
        let (mut backwards, mut forwards) = (0f64, 0f64);
        for k in 0..=(2.0 * rate_hz) as usize {
            let t = k as f64 / rate_hz;
            backwards = backwards.max((law.force(&mut relaxation, path(t)) - force(t)).abs());
            forwards = forwards.max((law.displacement(&mut creep, force(t)) - path(t)).abs());
        }
        (backwards / (mass * omega * omega), forwards)
    };
    let (coarse, fine) = (errors(500.0), errors(1000.0));
    let orders = (order(coarse.0, fine.0), order(coarse.1, fine.1));
    println!("inertia at 1 kHz: {:.1e} and {:.1e}, orders {:.2} and {:.2}", fine.0, fine.1, orders.0, orders.1);
    assert!((1.8..2.1).contains(&orders.0) && (1.8..2.1).contains(&orders.1), "{orders:?}");
}

/// The second-order difference quotients, written out.
#[test]
fn orders_0_and_1_and_the_inertia_are_plain_arithmetic() {
    const STEP: f64 = 1e-3;
    let (spring, dashpot, mass) = (400.0, 30.0, 0.5);
    let branch = [Springpot::new(2.0 * dashpot, 1.0), Springpot::new(2.0 * dashpot, 1.0)];
    let film = Maxwell::new(Springpot::new(spring, 0.0), &[branch], Topology::Parallel, mass).expect("valid");
    let law = law::<f64>(&film, 1.0 / STEP, Discretisation::Bdf2);
    let mut state = law.state();
    let (viscous, inertia) = (dashpot / (2.0 * STEP), mass / (4.0 * STEP * STEP));
    let mut past = [0.0; 4];
    for k in 0..20_000 {
        let force = (0.02 * f64::from(k)).sin();
        let [a, b, c, d] = past;
        let known = viscous * (4.0 * a - b) + inertia * (24.0 * a - 22.0 * b + 8.0 * c - d);
        let x = (force + known) / (spring + 3.0 * viscous + 9.0 * inertia);
        past = [x, a, b, c];
        let modelled = law.displacement(&mut state, force);
        assert!((modelled - x).abs() < 1e-12, "step {k}: {modelled} for {x}");
    }
}

#[test]
fn modes_are_positive_and_decay_at_every_rate() {
    let models: Vec<_> = presets().into_iter().chain(random_models(2022, 200)).chain(hard_models()).collect();
    for rate_hz in [100.0, 1000.0, 5000.0] {
        let mut largest = 0f64;
        for (name, model) in &models {
            let law = law::<f64>(model, rate_hz, Discretisation::Bdf2);
            largest = largest.max(law.memory().tail_error());
            for (loss, weight) in law.memory().modes() {
                assert!((0.0..1.0).contains(&loss) && weight >= 0.0, "{name}: loss {loss}, weight {weight}");
            }
        }
        println!("{rate_hz} Hz: {} models, tail error at most {largest:.1e}", models.len());
    }
}

#[test]
fn both_directions_are_inverse_with_either_method() {
    for (name, model) in presets().into_iter().chain(random_models(3, 50)).chain(hard_models()) {
        for method in METHODS {
            let law = law::<f64>(&model, 1000.0, method);
            let (mut creep, mut relaxation) = (law.state(), law.state());
            let (mut worst, mut largest) = (0f64, 0f64);
            for f in paper_force(1.0 / 7.0, 20.0, 1000.0) {
                let x = law.displacement(&mut creep, f);
                worst = worst.max((law.force(&mut relaxation, x) - f).abs());
                largest = largest.max(x.abs());
            }
            // One rounding of x is worth this force.
            let unit = largest * law.stiffness() * f64::EPSILON;
            assert!(worst <= 8.0 * unit + 1e-12, "{name}, {method:?}: {worst:.1e} N, a rounding of x is {unit:.1e} N");
        }
    }
}

/// Errors of creep and of relaxation, relative RMS, with either method.
type Errors = [(f64, f64); 2];

/// The memory compresses one discretisation as well as the other, forwards and backwards.
#[test]
fn compression_loses_no_more_than_with_grunwald_letnikov() {
    let all = || presets().into_iter().chain(random_models(2022, 200)).chain(hard_models()).collect();
    for (rate_hz, count) in [(100.0, 60), (1000.0, 12)] {
        let force = paper_force(1.0 / 7.0, 155.0, rate_hz);
        let full = [FullMemory::new, FullMemory::of_second_order].map(|new| new(force.len(), 1.0 / rate_hz));
        let models: Vec<_> = sample(all(), count);
        let errors: Vec<Errors> = models
            .par_iter()
            .map(|(_, model)| {
                [0, 1].map(|which| {
                    let law = law::<f64>(model, rate_hz, METHODS[which]);
                    let exact = full[which].displacement(model, &force);
                    let (mut creep, mut relaxation) = (law.state(), law.state());
                    let x: Vec<f64> = force.iter().map(|&f| law.displacement(&mut creep, f)).collect();
                    let back: Vec<f64> = exact.iter().map(|&x| law.force(&mut relaxation, x)).collect();
                    (relative_rms(&x, &exact), relative_rms(&back, &force))
                })
            })
            .collect();
        let largest = |of: fn(&Errors) -> f64| errors.iter().map(of).fold(0.0, f64::max);
        println!(
            "{rate_hz} Hz, {} laws: creep GL {:.1e}, BDF2 {:.1e}; relaxation GL {:.1e}, BDF2 {:.1e}",
            errors.len(),
            largest(|e| e[0].0),
            largest(|e| e[1].0),
            largest(|e| e[0].1),
            largest(|e| e[1].1)
        );
        for ((name, _), [gl, bdf2]) in models.iter().zip(&errors) {
            // 1e-9 is what both promise at the least, and near what is left of the exact answer itself.
            assert!(bdf2.0 <= 1.1 * gl.0 + 1e-9, "{name} at {rate_hz} Hz: {:.1e}, GL {:.1e}", bdf2.0, gl.0);
            assert!(bdf2.1 <= 1.1 * gl.1 + 1e-9, "{name} at {rate_hz} Hz, back: {:.1e}, GL {:.1e}", bdf2.1, gl.1);
        }
    }
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

/// A controller gets the same law from a host, bit for bit, with second-order inertia.
#[test]
fn coefficients_make_the_same_law() {
    for (name, model) in presets().into_iter().chain(random_models(8, 20)) {
        let sent = law::<f32>(&model, 1000.0, Discretisation::Bdf2);
        let received = Law::from_coefficients(&sent.coefficients(), 1e-3, model.mass_kg());
        assert_eq!(received.as_ref(), Ok(&sent), "{name}");
        assert_eq!(received.map(|law| law.method()), Ok(Discretisation::Bdf2));
    }
}

#[test]
fn settling_equals_steps() {
    for (name, model) in presets().into_iter().take(6).chain(random_models(5, 8)) {
        // Settling has no inertia; the law it is asked of has.
        let massless = Maxwell::new(model.main(), model.branches(), model.topology(), 0.0).expect("valid");
        let (heavy, light) =
            (law::<f64>(&model, 1000.0, Discretisation::Bdf2), law::<f64>(&massless, 1000.0, Discretisation::Bdf2));
        for seconds in [0.01, 1.0, 60.0] {
            let mut stepped = light.state();
            light.warm_up(&mut stepped, std::iter::repeat_n(10.0, (seconds * 1000f64).round() as usize));
            let settled = heavy.settled(10.0, seconds);
            let error = (settled.position() / stepped.position() - 1.0).abs();
            assert!(error < 1e-6, "{name} after {seconds} s: {error:.1e}");
        }
    }
}

/// The frequency response of the law is second-order as well, and an observer designs with it.
#[test]
fn the_frequency_response_is_of_second_order() {
    for (name, model) in presets() {
        let exact = model.frequency_response(1.0);
        let error = |rate_hz| {
            (law::<f64>(&model, rate_hz, Discretisation::Bdf2).frequency_response(1.0) - exact).norm() / exact.norm()
        };
        let order = order(error(200.0), error(400.0));
        assert!((1.8..2.1).contains(&order), "{name}: {order}");
    }
}

/// The controller's arithmetic: close to f64, bounded under random forces, and at rest after them.
#[test]
fn single_precision_stays_close_and_bounded() {
    sample(presets(), 4).into_par_iter().for_each(|(name, model)| {
        let (single, double) =
            (law::<f32>(&model, 1000.0, Discretisation::Bdf2), law::<f64>(&model, 1000.0, Discretisation::Bdf2));
        let (mut low, mut high) = (single.state(), double.state());
        let (x32, x64): (Vec<f64>, Vec<f64>) = paper_force(1.0 / 7.0, 155.0, 1000.0)
            .into_iter()
            .map(|f| (f64::from(single.displacement(&mut low, f as f32)), double.displacement(&mut high, f)))
            .unzip();
        let error = relative_rms(&x32, &x64);
        println!("{name}: f32 loses {error:.1e} in 155 s");
        assert!(error <= 1e-6, "{name}: {error:.1e}");

        let mut state = single.state();
        let mut random = Pcg64::seed_from_u64(5);
        let bound = (140.0 * model.creep_compliance(1e3)) as f32;
        for _ in 0..1_000_000 {
            let x = single.displacement(&mut state, random.random_range(-140.0..140.0f32));
            assert!(x.abs() < bound, "{name}: {x} m");
        }
        single.warm_up(&mut state, std::iter::repeat_n(0.0, 1_000_000));
        assert!(state.position().abs() < 0.1 * bound, "{name} does not come to rest");
    });
}
