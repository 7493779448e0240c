//! A film gives back no more energy than it took.

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use springpot::Discretisation;

use crate::support::models::{presets, random_models};
use crate::support::{METHODS, all_models, law_by, sample};

/// Asserts Σ F_k (x_k − x_{k−1}) ≥ 0 along `steps` of force (N) and increment (m). Work that was taken and given back leaves rounding of what
/// passed, as a share of it.
fn takes_work(name: &str, rounding: f64, steps: impl Iterator<Item = (f64, f64)>) {
    let (mut work, mut gross) = (0.0, 0.0);
    for (force, increment) in steps {
        work += force * increment;
        gross += (force * increment).abs();
        assert!(work >= -rounding * gross, "{name}: {work} J of {gross} J");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// From rest, for any model, rate and force history.
    #[test]
    fn takes_work_from_any_force_history(
        seed in any::<u64>(),
        rate_hz in prop::sample::select(vec![100.0, 1000.0, 5000.0]),
        forces in prop::collection::vec(-100.0..100.0f64, 1..400),
        hold in 1usize..50,
    ) {
        let (name, model) = random_models(seed, 1).swap_remove(0);
        let law = law_by::<f64>(&model, rate_hz, Discretisation::Gl);
        let mut state = law.state();
        let forces = forces.into_iter().flat_map(|force| std::iter::repeat_n(force, hold));
        takes_work(&name, 1e-12, forces.map(|force| {
            law.displacement(&mut state, force);
            (force, state.increment())
        }));
    }

    /// The same along any path: displacement → force.
    #[test]
    fn takes_work_along_any_path(
        seed in any::<u64>(),
        increments in prop::collection::vec(-1e-4..1e-4f64, 1..400),
        hold in 1usize..50,
    ) {
        let (name, model) = random_models(seed, 1).swap_remove(0);
        let law = law_by::<f64>(&model, 1000.0, Discretisation::Gl);
        let (mut state, mut x) = (law.state(), 0.0);
        let increments = increments.into_iter().flat_map(|dx| std::iter::repeat_n(dx, hold));
        takes_work(&name, 1e-12, increments.map(|increment| {
            x += increment;
            (law.force(&mut state, x), state.increment())
        }));
    }
}

/// The same on the controller's arithmetic, down to its rounding.
#[test]
fn the_controller_s_arithmetic_takes_work() {
    for (seed, (name, model)) in random_models(11, 200).into_iter().enumerate() {
        let law = law_by::<f32>(&model, 1000.0, Discretisation::Gl);
        let mut state = law.state();
        let mut random = Pcg64::seed_from_u64(seed as u64);
        let steps = (0..20_000).map(|_| {
            let force = random.random_range(-100.0..100.0f32);
            law.displacement(&mut state, force);
            (f64::from(force), f64::from(state.increment()))
        });
        takes_work(&name, 1e-6, steps);
    }
}

/// Random forces on the controller's arithmetic: bounded throughout, and the response decays once the force is gone.
#[test]
fn presets_stay_bounded_and_come_to_rest() {
    const STEPS: usize = 10_000_000;
    sample(presets(), 3).into_par_iter().enumerate().for_each(|(k, (name, model))| {
        let law = law_by::<f32>(&model, 1000.0, METHODS[k % 2]);
        let mut state = law.state();
        let mut random = Pcg64::seed_from_u64(5);
        // A force of 140 N for 10⁷ steps reaches J(10⁴ s) · 140 N; random signs stay far below.
        let bound = (140.0 * model.creep_compliance(1e4)) as f32;
        let mut largest = 0f32;
        for _ in 0..STEPS {
            let force = random.random_range(-140.0..140.0f32);
            largest = largest.max(law.displacement(&mut state, force).abs());
        }
        assert!(largest < bound, "{name}: {largest} m");
        let left = state.position().abs();
        let mut at = |steps: usize| {
            for _ in 0..steps {
                law.displacement(&mut state, 0.0);
            }
            state.position().abs()
        };
        let (soon, later, late) = (at(100_000), at(900_000), at(9_000_000));
        println!(
            "{name}: largest {largest:.1e} m, left {left:.1e}, after 100 s {soon:.1e}, 1000 s {later:.1e}, 10000 s {late:.1e}"
        );
        assert!(late < 0.3 * largest && late <= 1.01 * later.max(1e-3 * largest), "{name} does not come to rest");
    });
}

/// The reason: every mode decays and pulls back, at every rate and by both methods.
#[test]
fn modes_are_positive_and_decay() {
    for (name, model) in all_models(200) {
        for (rate_hz, method) in [100.0, 1000.0, 5000.0].into_iter().flat_map(|rate_hz| METHODS.map(|m| (rate_hz, m))) {
            for (loss, weight) in law_by::<f32>(&model, rate_hz, method).memory().modes() {
                assert!((0.0..1.0).contains(&loss) && weight >= 0.0, "{name}: loss {loss}, weight {weight}");
            }
        }
    }
}
