//! A spring in series with the memory of a law, against the same spring in the model, stepping, and what a film can give back.

use proptest::prelude::*;
use springpot::{
    CompressionBound, Discretisation, Knot, Law, LawError, LawOptions, Maxwell, Spring, Springpot, Topology,
};

use crate::support::bent_films::{STEP_S, film, in_series, load};
use crate::support::law_by;

fn springpot(c: f64, alpha: f64) -> Springpot {
    Springpot::new(c, alpha)
}

fn law(mass_kg: f64, method: Discretisation) -> Law<f64> {
    law_by::<f64>(&film(mass_kg), 1.0 / STEP_S, method).in_series(&in_series(4)).expect("a law")
}

/// In a film that was held the memory went on slowly: it remembers less than one that was at its end all the time, by a few per cent.
#[test]
fn a_film_that_was_held_is_about_where_stepping_brings_it() {
    let law = law(0.0, Discretisation::Gl);
    let mut stepped = law.state();
    law.warm_up_along(&mut stepped, (0..20_000).map(|_| 3e-3));
    let mut held = law.held(3e-3, 20.0);
    let relaxed = [held.base_force() / stepped.base_force(), held.elongation() / stepped.elongation()];
    println!("force and elongation of a film that was held, over those of steps: {relaxed:.4?}");
    assert!(relaxed.iter().all(|ratio| (0.98..1.0).contains(ratio)) && held.elongation() > 2e-4, "{relaxed:?}");
    let mut most = 1.0f64;
    for step in 0..1000 {
        let left = [&mut held, &mut stepped].map(|state| law.displacement(state, 0.0));
        most = most.max(left[0] / left[1]);
        assert!(left[0] > left[1], "step {step}: {left:?}");
    }
    println!("what is left of its creep, over that of steps: at most {most:.4}");
    assert!(most < 1.05, "{most}");
}

/// A spring that is soft, steep and soft again: Newton's method alone jumps from one soft part to the other.
#[test]
fn a_held_film_has_the_force_of_its_spring() {
    let points = [(-1e-4, -0.1), (0.0, 0.0), (1e-4, 0.1), (1.1e-4, 50.0), (3e-3, 51.0), (5e-3, 52.0)];
    let spring = Spring::through(&points).expect("valid");
    for c in [100.0, 1000.0, 10_000.0, 100_000.0] {
        let model = Maxwell::new(springpot(c, 0.2), &[], Topology::Parallel, 0.0).expect("valid");
        let law = law_by::<f64>(&model, 1e-3, Discretisation::Gl).in_series(&spring).expect("rises");
        for held_m in (1..200).map(|k| 5e-5 * f64::from(k)) {
            let held = law.held(held_m, 20.0);
            let off = spring.force(held.elongation()) / held.base_force() - 1.0;
            assert!(off.abs() < 1e-6, "{c}, {held_m} m: {off}");
        }
    }
}

#[test]
fn hours_in_single_precision_do_not_drift() {
    // The spring's elongation is a sum of as many increments as there are ticks.
    let (wide, model) = (law(0.1, Discretisation::Gl), film(0.1));
    let single = law_by::<f32>(&model, 1.0 / STEP_S, Discretisation::Gl).in_series(&in_series(4)).expect("a law");
    let (mut exact, mut state) = (wide.state(), single.state());
    for k in 0..2_000_000 {
        let force = load(k % 1250);
        let x = wide.displacement(&mut exact, force);
        let seen = f64::from(single.displacement(&mut state, force as f32));
        assert!((seen - x).abs() < 2e-8, "step {k}: {seen} instead of {x}");
    }
}

#[test]
fn the_margin_and_the_bound_know_the_spring() {
    let law = law(0.0, Discretisation::Gl);
    let coarse = law.coarser::<4, 11, 7>();
    assert!(law.margin_of(&coarse, 5e-3, 100.0) > law.margin_of(&coarse, 5e-3, 0.0));
    let CompressionBound { displacement_per_increment, force_per_stroke, .. } =
        law.compression_bound(&film(0.0), 155.0);
    assert!(displacement_per_increment < 1e-3 && force_per_stroke.is_infinite());
}

#[test]
fn springs_that_do_not_rise_are_refused() {
    let knot = |(x, value, slope): (f64, f64, f64)| Knot { displacement: x, value, slope };
    let falls = Spring::new(&[(0.0, 0.0, 9e3), (1e-3, 6.0, -1e3), (2e-3, 9.0, 4e3)].map(knot)).expect("a spring");
    let memory: Law<f32> = law_by(&film(0.1), 1e3, Discretisation::Gl);
    for spring in [falls, Spring::linear(0.0).expect("a spring"), Spring::linear(-1e3).expect("a spring")] {
        let refused = memory.clone().in_series(&spring).err();
        assert!(matches!(refused, Some(LawError::SeriesSpring { slope, .. }) if slope <= 0.0), "{refused:?}");
    }
    let coefficients = memory.in_series(&in_series(5)).expect("a law").coefficients();
    assert!(coefficients.has_spring_in_series() && !coefficients.has_spring());
    let mut damaged = coefficients.clone();
    damaged.curve[3].value = 1e3;
    assert!(Law::from_coefficients(&damaged, 1e-3, 0.1).is_err());
    let mut alone = coefficients;
    alone.curve.truncate(1);
    assert!(Law::from_coefficients(&alone, 1e-3, 0.1).is_err());
}

proptest! {
    /// Along random paths that end where they began the film takes work.
    #[test]
    fn a_closed_path_takes_work(
        points in prop::collection::vec(-0.4e-3f64..3e-3, 2..8),
        slopes in prop::collection::vec(2e3f64..1e5, 3),
        order in 0.0f64..=1.0,
    ) {
        let model = Maxwell::new(springpot(5e3, order), &[[springpot(2e4, 0.0), springpot(4e3, 1.0)]], Topology::Parallel, 0.0).expect("valid");
        let mut force = 0.0;
        let mut knots = vec![Knot { displacement: -0.5e-3, value: -0.5e-3 * slopes[0], slope: slopes[0] }, Knot { displacement: 0.0, value: 0.0, slope: slopes[0] }];
        for (k, &slope) in slopes.iter().enumerate() {
            force += 0.8e-3 * 0.5 * (slope + knots[k + 1].slope);
            knots.push(Knot { displacement: 0.8e-3 * (k + 1) as f64, value: force, slope });
        }
        let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("a law");
        let law = law.in_series(&Spring::new(&knots).expect("a spring")).expect("a law");
        let mut state = law.state();
        let (mut work, mut size) = (0.0, 0.0);
        let mut from = 0.0;
        for to in points.into_iter().chain([0.0]) {
            let mut before = state.position();
            for k in 1..=300 {
                let x = from + (to - from) * f64::from(k) / 300.0;
                let force = law.force(&mut state, x);
                work += force * (x - before);
                size += (force * (x - before)).abs();
                before = x;
            }
            from = to;
        }
        prop_assert!(work >= -1e-6 * size, "{work} of {size}");
    }
}
