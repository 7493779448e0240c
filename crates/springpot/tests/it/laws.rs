//! Promises of a law beyond its accuracy: size, both directions, exactness, warm starts, responses, errors.

use num_complex::Complex;
use springpot::{
    Compressed, Feedforward, FeedforwardState, Law, LawError, LawOptions, LawState, Learning, LearningState, Load,
    Maxwell, ModelElement, ModelError, Observer, ObserverState, Preset, Scalar, Springpot, Topology, Tracking,
    TrackingState, Window,
};

use crate::support::models::{TOPOLOGIES, hard_models, paper_force, presets, random_models};
use crate::support::{METHODS, all_models, creep, largest, law_by, relaxation};

pub const STEP: f64 = 1e-3;

pub fn law<T: Scalar>(model: &Maxwell) -> Law<T> {
    Law::compressed(model, LawOptions::at_step(STEP)).expect("valid")
}

pub fn single(c: f64, alpha: f64, mass_kg: f64) -> Maxwell {
    Maxwell::new(Springpot::new(c, alpha), &[], Topology::Eq11, mass_kg).expect("valid")
}

/// The crate's page states the sizes of configurations and states.
#[test]
fn sizes_are_those_of_the_crate_page() {
    type Lean = Compressed<f32, 8, 14, 4>;
    for (row, configuration, state) in [
        ("creep/12+36", size_of::<Law<f32>>(), size_of::<LawState<f32>>()),
        ("creep/8+18", size_of::<Law<f32, Lean>>(), size_of::<LawState<f32, Lean>>()),
        ("feedforward/12+36", size_of::<Feedforward<f32>>(), size_of::<FeedforwardState<f32>>()),
        ("observer/12+36", size_of::<Observer<f32>>(), size_of::<ObserverState<f32>>()),
        ("tracking/12+36", size_of::<Tracking<f32>>(), size_of::<TrackingState<f32>>()),
        ("learning/12+36", size_of::<Learning<f32>>(), size_of::<LearningState<f32>>()),
    ] {
        let mut lines = include_str!("../../README.md").lines();
        let line = lines.find(|line| line.starts_with(&format!("| `{row}` |"))).expect("a row of the table");
        let cells: Vec<String> = line.split('|').map(|cell| cell.replace(' ', "")).collect();
        assert_eq!(cells[5..7], [configuration.to_string(), state.to_string()], "{row}");
    }
}

/// Feeding the output of one direction to the other returns the input, to the rounding of a step's stiffness.
#[test]
fn both_directions_are_inverse() {
    for (name, model) in all_models(50) {
        for method in METHODS {
            let law = law_by::<f64>(&model, 1.0 / STEP, method);
            let force = paper_force(1.0 / 7.0, 20.0, 1.0 / STEP);
            let x = creep(&law, force.iter().copied());
            let back = relaxation(&law, x.iter().copied());
            let worst = largest(back.iter().zip(&force).map(|(back, force)| back - force));
            // One rounding of x is worth this force.
            let unit = largest(x) * law.stiffness() * f64::EPSILON;
            assert!(worst <= 8.0 * unit + 1e-12, "{name}, {method:?}: {worst:.1e} N, a rounding of x is {unit:.1e} N");
            let path: Vec<f64> = (0..20_000).map(|k| 1e-3 * (1.0 - (f64::from(k) * 1e-3).cos())).collect();
            let back = creep(&law, relaxation(&law, path.iter().copied()));
            let worst = largest(back.iter().zip(&path).map(|(back, x)| back - x));
            assert!(worst <= 1e-12 * 1e-3, "{name}, {method:?}: {worst:.1e} m");
        }
    }
}

/// A spring, a dashpot and a mass alone are plain arithmetic: difference quotients, written out for both methods.
#[test]
fn orders_0_and_1_and_the_inertia_are_exact() {
    let (spring, dashpot, mass) = (400.0, 30.0, 0.5);
    // Two dashpots in series are one of half the coefficient.
    let branch = [Springpot::new(2.0 * dashpot, 1.0); 2];
    let model = Maxwell::new(Springpot::new(spring, 0.0), &[branch], Topology::Parallel, mass).expect("valid");
    let bdf2 = ([3.0, -4.0, 1.0], [9.0, -24.0, 22.0, -8.0, 1.0], 2.0);
    for (method, (speed, acceleration, divisor)) in
        METHODS.into_iter().zip([([1.0, -1.0, 0.0], [1.0, -2.0, 1.0, 0.0, 0.0], 1.0), bdf2])
    {
        let step = divisor * STEP;
        let weight = |j: usize| dashpot / step * speed.get(j).unwrap_or(&0.0) + mass / (step * step) * acceleration[j];
        let force: Vec<f64> = (0..50_000).map(|k| (0.02 * f64::from(k)).sin()).collect();
        let mut past = [0.0; 4];
        for (k, (modelled, force)) in
            creep(&law_by::<f64>(&model, 1.0 / STEP, method), force.iter().copied()).iter().zip(&force).enumerate()
        {
            let known: f64 = past.iter().enumerate().map(|(j, x)| weight(j + 1) * x).sum();
            let x = (force - known) / (spring + weight(0));
            past = [x, past[0], past[1], past[2]];
            assert!((modelled - x).abs() < 1e-12, "{method:?}, step {k}: {modelled} for {x}");
        }
    }
}

/// A standard linear solid relaxes by its closed form, at any later step.
#[test]
fn a_plain_relaxation_time_is_exact() {
    let (spring, branch, dashpot) = (5e3, 2e4, 7e3);
    let model = Maxwell::new(
        Springpot::new(spring, 0.0),
        &[[Springpot::new(branch, 0.0), Springpot::new(dashpot, 1.0)]],
        Topology::Parallel,
        0.0,
    )
    .expect("valid");
    let law = law::<f64>(&model);
    let mut state = law.state();
    let rate = branch / dashpot;
    for k in 0..50_000 {
        let force = law.force(&mut state, 1.0);
        let exact = spring + branch * (1.0 + rate * STEP).powi(-(k + 1));
        assert!((force / exact - 1.0).abs() < 1e-12, "step {k}: {force} for {exact}");
    }
}

/// Settling under a constant force is the same as stepping there, and goes on the same way. It has no inertia, whatever the law has.
#[test]
fn settled_state_equals_steps() {
    for (k, (name, heavy)) in presets().into_iter().take(6).chain(random_models(5, 12)).chain(hard_models()).enumerate()
    {
        let method = METHODS[k % 2];
        let model = Maxwell::new(heavy.main(), heavy.branches(), heavy.topology(), 0.0).expect("valid");
        let [law, heavy] = [&model, &heavy].map(|model| law_by::<f64>(model, 1.0 / STEP, method));
        for seconds in [0.0, 0.01, 1.0, 60.0, 900.0] {
            let mut stepped = law.state();
            law.warm_up(&mut stepped, std::iter::repeat_n(10.0, (seconds / STEP).round() as usize));
            let mut settled = law.settled(10.0, seconds);
            let scale = stepped.position().abs().max(10.0 / law.stiffness());
            for settled in [settled.position(), heavy.settled(10.0, seconds).position()] {
                let error = (settled - stepped.position()).abs() / scale;
                assert!(error < 1e-6, "{name}, {method:?} after {seconds} s: {error:.1e}");
            }
            for k in 0..3000 {
                let force = 10.0 + (0.003 * k as f64).sin();
                let (a, b) = (law.displacement(&mut stepped, force), law.displacement(&mut settled, force));
                assert!((a - b).abs() < 1e-6 * scale.max(a.abs()), "{name} {k} steps after {seconds} s: {b} for {a}");
            }
        }
    }
}

/// A day of settling takes thousands of steps, not 86 million, and agrees with the creep compliance.
#[test]
fn settling_for_a_day_follows_the_creep_compliance() {
    for (name, model) in presets() {
        let state = law::<f32>(&model).settled(10.0, 86_400.0);
        let exact = 10.0 * model.creep_compliance(86_400.0);
        let error = f64::from(state.position()) / exact - 1.0;
        assert!(error.abs() < 3e-6, "{name}: {error:.1e}");
    }
}

#[test]
fn a_warmed_state_goes_on_as_if_it_had_run() {
    let model = Preset::ALL[1].model().expect("valid");
    let law = law::<f32>(&model);
    let force: Vec<f32> = paper_force(0.2, 10.0, 1.0 / STEP).into_iter().map(|f| f as f32).collect();
    let (mut run, mut warmed, mut led) = (law.state(), law.state(), law.state());
    let path: Vec<f32> = force.iter().map(|&f| law.displacement(&mut run, f)).collect();
    law.warm_up(&mut warmed, force.iter().copied());
    assert_eq!(run, warmed);
    law.warm_up_along(&mut led, path);
    // The path was rounded to f32, and one rounding of x is worth this force.
    let unit = run.position() * law.stiffness() * f32::EPSILON;
    assert!((led.base_force() - run.base_force()).abs() < 8.0 * unit);
    // Zeroing the sensor moves the origin and nothing else.
    let (base, origin) = (run.base_force(), run.position());
    run.move_origin(origin);
    assert_eq!(run.base_force(), base);
    assert!(run.position().abs() <= f32::EPSILON * origin);
    let shifted = law.displacement(&mut run, 5.0);
    let unshifted = law.displacement(&mut warmed, 5.0);
    assert!((shifted + origin - unshifted).abs() <= 2.0 * f32::EPSILON * origin);
}

/// One solve with a load that depends on the answer.
#[test]
fn a_dependent_load_is_met_where_the_film_goes() {
    let model = Preset::ALL[1].model().expect("valid");
    let law = law::<f64>(&model);
    let (mut under, mut check) = (law.state(), law.state());
    for f in paper_force(0.2, 10.0, 1.0 / STEP) {
        let load = Load { force_n: f, slope_n_per_m: 60.0 * f };
        let x = law.displacement_under(&mut under, load);
        let force = law.force(&mut check, x);
        assert!((force - (load.force_n + load.slope_n_per_m * x)).abs() < 1e-9, "{force}");
    }
}

#[test]
fn topologies_differ_for_more_than_one_branch_only() {
    for preset in Preset::ALL {
        let model = preset.model().expect("valid");
        let [eq11, parallel] = TOPOLOGIES.map(|t| model.clone().with_topology(t).modulus(Complex::new(0.0, 1.0)));
        let same = (eq11 - parallel).norm() < 1e-12 * eq11.norm();
        assert_eq!(same, model.branches().len() == 1, "{}", preset.name());
    }
    // Equal branches: the harmonic mean of n is one of them, their sum is n of them.
    let branch = [Springpot::new(1e4, 0.3), Springpot::new(3e4, 0.8)];
    let main = Springpot::new(1.0, 0.5);
    let modulus = |branches: &[[Springpot; 2]], topology| {
        Maxwell::new(main, branches, topology, 0.0).expect("valid").modulus(Complex::new(0.0, 2.0))
            - Maxwell::new(main, &[], topology, 0.0).expect("valid").modulus(Complex::new(0.0, 2.0))
    };
    let one = modulus(&[branch], Topology::Eq11);
    assert!((modulus(&[branch; 4], Topology::Eq11) - one).norm() < 1e-9 * one.norm());
    assert!((modulus(&[branch; 4], Topology::Parallel) - one * 4.0).norm() < 1e-9 * one.norm());
}

#[test]
fn material_and_actuator_constants_convert_both_ways() {
    // c = η A / L with the paper's 49 mm × 0.16 mm across and 60 mm along.
    let (area, length) = (49e-3 * 0.16e-3, 60e-3);
    let element = Springpot::from_material(3.0e6, 0.3, area, length);
    assert!((element.c - 392.0).abs() < 1e-9);
    assert!((element.material_constant(area, length) / 3.0e6 - 1.0).abs() < 1e-15);
    let material = Maxwell::new(Springpot::new(3.0e6, 0.3), &[], Topology::Eq11, 0.0).expect("valid");
    let actuator = material.scaled(area / length).expect("valid");
    assert!((actuator.main().c - 392.0).abs() < 1e-9);
    assert!(actuator.scaled(f64::NAN).is_err());
}

#[test]
fn invalid_models_and_options_are_refused() {
    let good = Springpot::new(1e4, 0.5);
    let new = |main, branches: &[[Springpot; 2]], mass| Maxwell::new(main, branches, Topology::Eq11, mass);
    for c in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = new(Springpot::new(c, 0.5), &[], 0.1);
        assert!(matches!(refused, Err(ModelError::Coefficient { element: ModelElement::Main, .. })), "{c}");
    }
    for alpha in [-1e-9, 1.000_001, f64::NAN] {
        let refused = new(good, &[[good, good], [good, Springpot::new(1.0, alpha)]], 0.1);
        let Err(ModelError::Order { element: ModelElement::Branch { branch: 1, element: 1 }, .. }) = refused else {
            panic!("{refused:?}");
        };
    }
    for mass in [-0.1, f64::NAN, f64::INFINITY] {
        assert!(matches!(new(good, &[], mass), Err(ModelError::Mass(_))));
    }
    assert_eq!(new(good, &[[good, good]; 6], 0.1), Err(ModelError::Branches(6)));

    let model = new(good, &[], 0.1).expect("valid");
    let build = |options| Law::<f32>::compressed(&model, options).err();
    for step in [0.0, -1e-3, f64::NAN, f64::INFINITY] {
        assert!(matches!(build(LawOptions::at_step(step)), Some(LawError::Step(_))), "{step}");
    }
    for horizon in [0.0, 0.01, f64::NAN, f64::INFINITY] {
        assert!(matches!(build(LawOptions::at_step(1e-3).with_horizon(horizon)), Some(LawError::Horizon { .. })));
    }
    for tolerance in [0.0, -1.0, f64::NAN] {
        assert!(matches!(build(LawOptions::at_step(1e-3).with_tolerance(tolerance)), Some(LawError::Tolerance(_))));
    }
    let missed = build(LawOptions::at_step(1e-3).with_tolerance(1e-12));
    assert!(matches!(missed, Some(LawError::ToleranceMissed { reached, .. }) if reached > 1e-12 && reached < 1e-6));
    // A stiffness that f32 cannot hold, though f64 can.
    for c in [1e-44, 1e42] {
        let model = single(c, 0.0, 0.0);
        assert_eq!(Law::<f32>::compressed(&model, LawOptions::at_step(1e-3)).err(), Some(LawError::NothingToSolve));
        assert!(Law::<f64>::compressed(&model, LawOptions::at_step(1e-3)).is_ok());
    }
    // Five plain relaxation times and a spring do not fit four modes.
    let branch = |k: f64| [Springpot::new(1e4 * k, 0.0), Springpot::new(1e4, 1.0)];
    let branches = [1.0, 2.0, 3.0, 4.0, 5.0].map(branch);
    let model = Maxwell::new(Springpot::new(1e4, 0.0), &branches, Topology::Parallel, 0.0).expect("valid");
    let few = Law::<f64, Compressed<f64, 8, 0, 4>>::compressed(&model, LawOptions::at_step(1e-3));
    assert_eq!(few.err(), Some(LawError::TooFewModes { modes: 4, needed: 6 }));

    let empty: Result<Law<f64, Window<f64, Vec<f64>>>, _> = Law::window(&model, 1e-3, Vec::new());
    assert_eq!(empty.err(), Some(LawError::EmptyWindow));
    let window: Law<f64, Window<f64, Vec<f64>>> = Law::window(&model, 1e-3, vec![0.0; 3]).expect("valid");
    assert_eq!(window.state(vec![0.0; 2]).err(), Some(LawError::Storage { given: 2, needed: 3 }));
    // Every error is one line.
    for error in [LawError::NothingToSolve, LawError::ToleranceMissed { reached: 1e-3, asked: 1e-5 }] {
        assert!(!error.to_string().contains('\n'));
    }
}
