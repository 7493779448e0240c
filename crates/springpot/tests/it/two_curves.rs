//! Springs and strain measures, and laws with both, against closed forms and laws without them.

use proptest::prelude::*;
use springpot::{
    Coefficients, Curve, CurveError, Discretisation, Knot, Law, LawError, LawOptions, Maxwell, Measure, Real, Rubber,
    Spring, Springpot, Topology,
};

use crate::support::bent_films::{STEP_S, film, hencky, spring};
use crate::support::models::random_models;
use crate::support::{METHODS, law_by};

fn law<T: Real>(model: &Maxwell, method: Discretisation) -> Law<T> {
    law_by(model, 1.0 / STEP_S, method)
}

#[test]
fn coefficients_of_a_spring_that_falls_too_steeply_are_refused() {
    for method in METHODS {
        let model = film(0.3);
        let law: Law<f32> = law::<f32>(&model, method).beside(&spring(5), &hencky()).expect("a law");
        let coefficients = law.coefficients();
        // A curve alone has no spring, and a spring that falls too steeply is refused from numbers as well.
        let alone = self::law::<f32>(&model, method).behind(&hencky()).expect("a law").coefficients();
        assert!(!alone.has_spring());
        let mut steep = coefficients.clone();
        steep
            .curve
            .iter_mut()
            .skip(9)
            .for_each(|knot| (knot.value, knot.slope) = (-1e6 * knot.value, -1e6 * knot.slope));
        let refused = Law::from_coefficients(&steep, STEP_S, 0.0).err();
        assert!(matches!(refused, Some(LawError::Unstable { stiffness, .. }) if stiffness < 0.0), "{refused:?}");
        let mut lonely: Coefficients<f32> = coefficients.clone();
        lonely.curve.truncate(10);
        let refused = Law::from_coefficients(&lonely, STEP_S, 0.0).err();
        assert_eq!(refused, Some(LawError::Curve(CurveError::Knots(1))));
    }
}

#[test]
fn no_force_makes_a_step_blow_up() {
    // Forces far beyond what a film withstands, where T'' times the memory's force is more than all stiffness within a step.
    let law: Law<f32> = law(&film(0.0), Discretisation::Gl).beside(&spring(8), &hencky()).expect("a law");
    let mut state = law.state();
    for k in 0..20_000 {
        let force = if k % 300 < 150 { 4e3 } else { -4e3 };
        let x = law.displacement(&mut state, force);
        assert!(x.is_finite() && x.abs() < 10.0, "step {k}: {x}");
    }
}

#[test]
fn invalid_springs_and_measures_are_refused_with_their_place() {
    let knot = |x: f64, value, slope| Knot { displacement: x, value, slope };
    assert_eq!(Spring::new(&[]).err(), Some(CurveError::Knots(0)));
    let many: Vec<(f64, f64)> = (0..10).map(|k| (1e-3 * f64::from(k), f64::from(k))).collect();
    assert_eq!(Spring::through(&many).err(), Some(CurveError::Knots(10)));
    assert_eq!(Spring::linear(f64::NAN).err(), Some(CurveError::Knot { index: 0 }));
    let shifted = Spring::new(&[knot(-1e-3, 1.0, 1e3), knot(1e-3, 3.0, 1e3)]).err();
    assert!(matches!(shifted, Some(CurveError::ForceAtRest { force_n }) if (force_n - 2.0).abs() < 1e-12));
    let right = Spring::new(&[knot(1e-3, 1.0, 1e3), knot(2e-3, 2.0, 1e3)]).err();
    assert_eq!(right, Some(CurveError::Range { low_m: 1e-3, high_m: 2e-3 }));

    let measure = |exponent, length_m| Measure { exponent, length_m }.curve(-1e-3, 5e-3).err();
    assert_eq!(measure(f64::INFINITY, 0.06), Some(CurveError::Measure));
    assert_eq!(measure(0.0, 0.0), Some(CurveError::Measure));
    assert!(matches!(measure(0.0, 1e-3), Some(CurveError::Taut { displacement_m: -1e-3, .. })));
    assert!(matches!(measure(-9.0, 1e-3 + 1e-9), Some(CurveError::Taut { .. })));
    let range = Measure { exponent: 0.0, length_m: 0.06 }.curve(1e-3, 5e-3).err();
    assert_eq!(range, Some(CurveError::Range { low_m: 1e-3, high_m: 5e-3 }));

    let many = Curve::through(&many).expect("rises");
    let refused = law::<f64>(&film(0.0), Discretisation::Gl).beside(&Spring::linear(0.0).expect("valid"), &many).err();
    assert_eq!(refused, Some(LawError::Curve(CurveError::Knots(10))));

    // Spring and memory together have to resist within a step; a slower step leaves less of the memory.
    let falling = Spring::linear(-2e4).expect("springs may fall");
    let model = Maxwell::new(Springpot::new(9e3, 0.2), &[], Topology::Eq11, 0.0).expect("valid");
    let at = |rate_hz| law_by::<f64>(&model, rate_hz, Discretisation::Gl).beside(&falling, &hencky()).err();
    assert_eq!(at(1000.0), None);
    assert!(matches!(at(10.0), Some(LawError::Unstable { stiffness, .. }) if stiffness < 0.0), "{:?}", at(10.0));
}

#[test]
fn measures_are_their_formula() {
    for exponent in [-2.0, -1e-12, 0.0, 0.31, 1.0, 2.5] {
        let curve = Measure { exponent, length_m: 0.06 }.curve(-5e-3, 20e-3).expect("rises");
        for k in 0..=100 {
            let x = -5e-3 + 25e-3 * f64::from(k) / 100.0;
            let stretch = 1.0 + x / 0.06;
            let exact = if exponent.abs() < 1e-9 {
                0.06 * stretch.ln()
            } else {
                0.06 / exponent * (stretch.powf(exponent) - 1.0)
            };
            // A cubic is off by as much as the fourth derivative is large.
            let bent = ((exponent - 1.0) * (exponent - 2.0) * (exponent - 3.0)).abs().max(1.0);
            let off =
                [curve.value(x) - exact, curve.slope(x) - stretch.powf(exponent - 1.0)].map(|off| off.abs() / bent);
            assert!(off[0] < 2e-8 && off[1] < 5e-6, "m = {exponent}, x = {x}: {off:?}");
        }
    }
}

/// A random curve of memory: rubber or a measure, from −3 to 6 mm.
fn random_measure(kind: bool, shape: f64, length_m: f64) -> Curve {
    let rubber = Rubber { share: 0.2 + 0.6 * shape, limit: 60.0, rest_stretch: 1.0 + shape, free_length_m: length_m };
    let measure = Measure { exponent: 4.0 * shape - 1.5, length_m };
    if !kind {
        return measure.curve(-3e-3, 6e-3).expect("rises");
    }
    // Every second knot: a measure has nine at the most.
    let knots = rubber.curve(-3e-3, 6e-3).expect("rises");
    let knots: Vec<Knot<f64>> = knots.knots().iter().step_by(2).copied().collect();
    Curve::scaled(&knots).expect("rises")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Over any closed path the film takes work, whatever its curves, by both discretisations (docs/equations.md).
    #[test]
    fn a_closed_path_takes_work(
        seed in any::<u64>(),
        second_order in any::<bool>(),
        kind in any::<bool>(),
        shape in 0.0..1.0f64,
        length_m in 0.02..0.1f64,
        stiffness in 0.0..1e5f64,
        increments in prop::collection::vec(-4e-4..4e-4f64, 2..200),
        hold in 1usize..30,
        turns in 1usize..4,
    ) {
        let (name, model) = random_models(seed, 1).swap_remove(0);
        let model = Maxwell::new(model.main(), model.branches(), model.topology(), 0.0).expect("valid");
        let measure = random_measure(kind, shape, length_m);
        let rises = Rubber { share: shape, limit: 80.0, rest_stretch: 2.0 - shape, free_length_m: 0.03 };
        let spring = Spring::of_curve(&rises.curve(-3e-3, 6e-3).expect("rises"), stiffness).expect("valid");
        let method = METHODS[usize::from(second_order)];
        // Fast relaxation may need a longer head by the second order.
        prop_assume!(Law::<f64>::compressed(&model, LawOptions::at_step(STEP_S).with_method(method)).is_ok());
        let law: Law<f64> = law(&model, method).beside(&spring, &measure).expect("a law");
        let (mut state, mut x, mut work, mut gross) = (law.state(), 0.0f64, 0.0, 0.0f64);
        let mut go = |to: f64| {
            let force = law.force(&mut state, to);
            work += force * (to - x);
            gross += (force * (to - x)).abs();
            x = to;
        };
        for _ in 0..turns {
            let mut at = 0.0f64;
            for &increment in &increments {
                for _ in 0..hold {
                    at = (at + increment / hold as f64).clamp(-2.9e-3, 5.9e-3);
                    go(at);
                }
            }
            // Back in as many steps as a clamped path needs.
            for _ in 0..50 {
                at *= 0.7;
                go(at);
            }
            go(0.0);
        }
        prop_assert!(work >= -1e-9 * gross, "{name}: {work} J of {gross} J");
    }
}
