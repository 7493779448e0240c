//! Laws with merged modes against those that they were merged from.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use springpot::{Compressed, Curve, Discretisation, Law, LawOptions, Load, Maxwell};

use crate::support::models::{hard_models, presets, random_models};
use crate::support::sample;

/// The sizes that the controller watches a film with.
type Coarse = Compressed<f32, 4, 11, 7>;

/// How far below and above, in shares of the largest displacement, the displacement of the coarse law comes in f32 under `force` (N).
fn deviation(law: &Law<f64>, coarse: &Law<f32, Coarse>, force: impl Iterator<Item = f64>) -> [f64; 2] {
    let (mut full, mut film) = (law.state(), coarse.state());
    let (mut largest, mut below, mut above) = (0f64, 0f64, 0f64);
    for f in force {
        let x = law.displacement(&mut full, f);
        let deviation = f64::from(coarse.displacement(&mut film, f as f32)) - x;
        largest = largest.max(x.abs());
        (below, above) = (below.min(deviation), above.max(deviation));
    }
    [below / largest, above / largest]
}

/// Forces (N) at `rate_hz` for `seconds`: held, squares of 20 s, a sine, a walk of steps every 3 s.
fn forces(rate_hz: f64, seconds: f64) -> Vec<(&'static str, Vec<f64>)> {
    let samples = (seconds * rate_hz) as usize;
    let of = |force: &dyn Fn(f64) -> f64| (0..samples).map(|k| force(k as f64 / rate_hz)).collect();
    let mut random = Pcg64::seed_from_u64(13);
    let walk: Vec<f64> = (0..=(seconds / 3.0) as usize).map(|_| random.random_range(0.0..10.0)).collect();
    vec![
        ("held", of(&|_| 10.0)),
        ("squares", of(&|t| if t % 40.0 < 20.0 { 10.0 } else { 0.0 })),
        ("sine", of(&|t| 5.0 - 5.0 * (t * std::f64::consts::TAU / 7.0).cos())),
        ("walk", of(&|t| walk[(t / 3.0) as usize])),
    ]
}

/// Below and above over all `models` and forces, printed by force.
fn extremes(
    what: &str,
    models: &[(String, Maxwell)],
    options: LawOptions,
    seconds: f64,
    curve: Option<&Curve>,
) -> [f64; 2] {
    let mut extremes = [0f64, 0f64];
    for (force_name, force) in forces(1.0 / options.step_s, seconds) {
        let deviations: Vec<[f64; 2]> = models
            .par_iter()
            .map(|(name, model)| {
                let law: Law<f64> = Law::compressed(model, options).unwrap_or_else(|e| panic!("{name}: {e}"));
                let single: Law<f32> = Law::compressed(model, options).unwrap_or_else(|e| panic!("{name}: {e}"));
                let behind =
                    |curve| (law.clone().behind(curve).expect("rises"), single.clone().behind(curve).expect("rises"));
                let (law, single) = curve.map_or_else(|| (law.clone(), single.clone()), behind);
                let coarse: Law<f32, Coarse> = single.coarser();
                let [below, above] = deviation(&law, &coarse, force.iter().copied());
                let margin = single.margin_of(&coarse, 1e-3, 0.0);
                assert!(-below <= margin, "{what}, {name}, {force_name}: behind by {} of {margin}", -below);
                [below, above]
            })
            .collect();
        let below = deviations.iter().map(|d| d[0]).fold(0.0, f64::min);
        let above = deviations.iter().map(|d| d[1]).fold(0.0, f64::max);
        println!("{what}, {seconds} s, {force_name}: {:+.3} % to {:+.3} %", 100.0 * below, 100.0 * above);
        extremes = [extremes[0].min(below), extremes[1].max(above)];
    }
    extremes
}

/// The supervisor's limit of the stroke relies on this.
fn stay_within_the_stated_band(what: &str, extremes: [f64; 2]) {
    assert!(extremes[0] >= -0.0075 && extremes[1] <= 0.012, "{what}: {extremes:?}");
}

#[test]
fn merged_modes_move_the_film_by_little() {
    let all = || presets().into_iter().chain(random_models(2022, 200)).chain(hard_models()).collect();
    for (rate_hz, seconds, count) in [(1000.0, 155.0, 20), (100.0, 3600.0, 10), (5000.0, 20.0, 20)] {
        let models: Vec<_> = sample(all(), count);
        let what = format!("{} models at {rate_hz} Hz", models.len());
        let extremes = extremes(&what, &models, LawOptions::at_step(1.0 / rate_hz), seconds, None);
        stay_within_the_stated_band(&what, extremes);
    }
}

/// Held under a load for a day, rates down to 1e-9 per step and all their rounding in f32 included.
#[test]
fn a_day_under_load_stays_within_the_band() {
    for (name, model) in sample(presets(), 2) {
        let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(5e-3)).expect("valid");
        let single: Law<f32> = Law::compressed(&model, LawOptions::at_step(5e-3)).expect("valid");
        let [below, above] = deviation(&law, &single.coarser(), std::iter::repeat_n(10.0, 24 * 3600 * 200));
        println!("{name}, 24 h at 200 Hz: {:+.3} % to {:+.3} %", 100.0 * below, 100.0 * above);
        stay_within_the_stated_band(&name, [below, above]);
    }
}

#[test]
fn curves_and_second_order_stay_within_the_band() {
    // Softer by a third, then twice as stiff.
    let curve =
        Curve::through(&[(-1e-3, -1e-3), (0.0, 0.0), (5e-4, 4e-4), (2e-3, 1.8e-3), (6e-3, 9e-3)]).expect("rises");
    let models: Vec<_> = sample(presets(), 4);
    let second = LawOptions::at_step(1e-3).with_method(Discretisation::Bdf2);
    for (what, options, curve) in [
        ("behind a curve", LawOptions::at_step(1e-3), Some(&curve)),
        ("second order", second, None),
        ("second order behind a curve", second, Some(&curve)),
    ] {
        stay_within_the_stated_band(what, extremes(what, &models, options, 60.0, curve));
    }
}

#[test]
fn merged_modes_keep_their_weight_and_others_stay() {
    let model = presets().remove(2).1;
    let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
    let sum = |modes: &mut dyn Iterator<Item = (f64, f64)>| modes.map(|(_, weight)| weight).sum::<f64>();
    let whole = sum(&mut law.memory().modes());
    let coarse: Law<f64, Compressed<f64, 12, 10, 8>> = law.coarser();
    assert_eq!(coarse.memory().modes().filter(|(_, weight)| *weight > 0.0).count(), 18);
    assert!((sum(&mut coarse.memory().modes()) / whole - 1.0).abs() < 1e-14);
    assert_eq!((coarse.stiffness(), coarse.step_s()), (law.stiffness(), law.step_s()));
    assert_eq!(coarse.memory().tail_error(), f64::INFINITY);
    // Sorted from fast to slow, all of them decaying.
    let losses: Vec<f64> = coarse.memory().modes().map(|(loss, _)| loss).collect();
    assert!(losses.windows(2).all(|pair| pair[0] > pair[1]) && losses[0] < 1.0 && losses[17] > 0.0, "{losses:?}");
    for loss in &losses {
        println!("{loss:.1e}");
    }

    // As many modes as before: the same ones.
    let same: Law<f64> = law.coarser();
    assert!(same.memory().modes().eq(law.memory().modes()));
    // A spring among them is not merged while anything else can be.
    let (_, springs) = hard_models().remove(9);
    let law: Law<f64> = Law::compressed(&springs, LawOptions::at_step(1e-3)).expect("valid");
    let spring = law.memory().modes().find(|(loss, weight)| *loss == 0.0 && *weight > 0.0).expect("a spring");
    let coarse: Law<f64, Compressed<f64, 12, 1, 1>> = law.coarser();
    assert!(coarse.memory().modes().any(|mode| mode == spring));
}

/// Films under voltages, on random models and curves, with couplings towards pull-in: wherever the film is further than it was before, the coarse
/// one is behind by no more than the margin for that stroke.
#[test]
fn the_margin_covers_what_a_coarser_law_misses() {
    let models: Vec<_> = sample(presets().into_iter().chain(random_models(30, 400)).collect(), 60);
    let results: Vec<[f64; 2]> = models
        .par_iter()
        .enumerate()
        .filter_map(|(index, (name, model))| {
            let random = &mut Pcg64::seed_from_u64(index as u64);
            let options = LawOptions::at_step(5e-3);
            let law: Law<f64> = Law::compressed(model, options).unwrap_or_else(|e| panic!("{name}: {e}"));
            let single: Law<f32> = Law::compressed(model, options).unwrap_or_else(|e| panic!("{name}: {e}"));
            let soft = random.random_range(0.1..0.8);
            let plateau = [(0.5e-3, 0.45e-3), (1.5e-3, (0.45 + soft) * 1e-3), (3e-3, (0.45 + 2.5 * soft) * 1e-3)];
            let last = (8e-3, (0.45 + 2.5 * soft) * 1e-3 + 4e-3);
            let points = [&[(-1e-3, -1e-3), (0.0, 0.0)], &plateau[..], &[last]].concat();
            let curve = Curve::through(&points).expect("rises");
            let is_curved = index % 2 == 0;
            let (law, single) =
                if is_curved { (law.behind(&curve).ok()?, single.behind(&curve).ok()?) } else { (law, single) };
            let coarse: Law<f32, Coarse> = single.coarser();
            let coupling = [0.0, 60.0, 200.0][index % 3];
            let (mut full, mut film) = (law.state(), coarse.state());
            // To 2 mm within a second if it did not creep.
            let most_n = 2e-3 * model.frequency_response(1.0).norm().recip();
            let (mut furthest_m, mut worst) = (0.3e-3, [0.0f64; 2]);
            for tick in 0..60_000u32 {
                let share = (f64::from(tick) / 20_000.0).min(1.0) * if tick % 4000 < 3000 { 1.0 } else { 0.3 };
                let load = |force: f64| Load { force_n: force, slope_n_per_m: force * coupling };
                let x = law.displacement_under(&mut full, load(share * most_n));
                let Load { force_n, slope_n_per_m } = load(share * most_n);
                let rounded = Load { force_n: force_n as f32, slope_n_per_m: slope_n_per_m as f32 };
                let y = f64::from(coarse.displacement_under(&mut film, rounded));
                if x > 8e-3 || !x.is_finite() {
                    break;
                }
                if x > furthest_m {
                    furthest_m = x;
                    let missed = 1.0 - y / x;
                    if missed > worst[0] {
                        worst = [missed, single.margin_of(&coarse, x, coupling)];
                    }
                }
            }
            println!(
                "{name}, curve {is_curved}, coupling {coupling}: {:.2} % of {:.2} %",
                100.0 * worst[0],
                100.0 * worst[1]
            );
            Some(worst)
        })
        .collect();
    assert!(results.len() > 20 && results.iter().any(|[missed, _]| *missed > 0.003));
    for [missed, margin] in results {
        assert!(missed <= margin, "{missed} of {margin}");
    }
}
