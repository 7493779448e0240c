//! The bound of what compression costs, against the exact answer with full memory.

use std::ops::{Add, Div, Mul, Neg, Sub};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use springpot::{Compressed, CompressionBound, Curve, Discretisation, Law, LawOptions, Maxwell, Scalar};

use crate::support::full_memory::FullMemory;
use crate::support::models::{hard_models, presets, random_models};
use crate::support::sample;

/// Accuracy of the answer of full memory, relative to its largest value.
const KNOWN: f64 = 1e-11;

/// Coefficients as f32 has them, stepped in f64: what the bound of a law in f32 is about.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rounded(f64);

macro_rules! by_f64 {
    ($($Operation:ident :: $operation:ident),+) => {
        $(impl $Operation for Rounded {
            type Output = Self;
            fn $operation(self, other: Self) -> Self {
                Self(self.0.$operation(other.0))
            }
        })+
    };
}
by_f64!(Add::add, Sub::sub, Mul::mul, Div::div);

impl Neg for Rounded {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl From<f64> for Rounded {
    fn from(value: f64) -> Self {
        Self(value)
    }
}

impl Scalar for Rounded {
    const ZERO: Self = Self(0.0);
    fn from_f64(value: f64) -> Self {
        Self(f64::from(value as f32))
    }
    fn to_f64(self) -> f64 {
        self.0
    }
}

/// Errors of force and of displacement along one path, with what they are bounded by.
#[derive(Clone, Copy, Default)]
struct Errors {
    force: f64,
    displacement: f64,
    /// How far the exact answers are known.
    force_known: f64,
    displacement_known: f64,
    increment: f64,
    stroke: f64,
}

/// A film with full memory, and its inertia in plain arithmetic.
struct Exact<'a> {
    model: &'a Maxwell,
    massless: Maxwell,
    curve: Option<&'a Curve>,
    inertia: Vec<f64>,
    circle: FullMemory,
}

impl<'a> Exact<'a> {
    fn new(model: &'a Maxwell, curve: Option<&'a Curve>, options: LawOptions, steps: usize) -> Self {
        let massless = Maxwell::new(model.main(), model.branches(), model.topology(), 0.0).expect("valid");
        let mass_per_step2 = model.mass_kg() / options.step_s.powi(2);
        let (circle, shares) = match options.method {
            Discretisation::Gl => (FullMemory::new(steps, options.step_s), vec![1.0, -1.0]),
            _ => (FullMemory::of_second_order(steps, options.step_s), vec![2.25, -3.75, 1.75, -0.25]),
        };
        let inertia = shares.into_iter().map(|share| share * mass_per_step2).collect();
        Self { model, massless, curve, inertia, circle }
    }

    /// Errors at every step of `law` along `path` (m): of its force, and of its displacement under the force that leads it there.
    fn errors<T: Scalar + From<f64>, const H: usize, const F: usize, const S: usize>(
        &self,
        law: &Law<T, Compressed<T, H, F, S>>,
        path: &[f64],
    ) -> (Vec<f64>, Vec<f64>, Errors) {
        let mut film = law.state();
        let forces: Vec<f64> = path.iter().map(|&x| law.force(&mut film, T::from(x)).to_f64()).collect();
        let increments: Vec<f64> = path.iter().scan(0.0, |before, x| Some(x - std::mem::replace(before, *x))).collect();
        let inertia = |k: usize| -> f64 {
            self.inertia.iter().zip(increments[..=k].iter().rev()).map(|(share, dx)| share * dx).sum()
        };
        let bent: Vec<f64> = path.iter().map(|&x| self.curve.map_or(x, |curve| curve.value(x))).collect();
        let exact = self.circle.force(&self.massless, &bent);
        let force: Vec<f64> = (0..path.len()).map(|k| forces[k] - inertia(k) - exact[k]).collect();
        // Behind a curve the film has no mass, and what creeps is T(x).
        let followed = self.circle.displacement(self.model, &forces);
        let displacement =
            path.iter().zip(&followed).map(|(x, exact)| x - self.curve.map_or(*exact, |curve| curve.inverse(*exact)));
        let displacement: Vec<f64> = displacement.collect();
        let errors = Errors {
            force: largest(&force),
            displacement: largest(&displacement),
            // The inertia is subtracted from a force that holds it, and an increment from displacements that are rounded.
            force_known: KNOWN * largest(&exact)
                + f64::EPSILON * (4.0 * largest(&forces) + 128.0 * law.stiffness().to_f64() * largest(path)),
            displacement_known: KNOWN * largest(&followed),
            increment: largest(&increments),
            stroke: largest(path),
        };
        (force, displacement, errors)
    }
}

fn largest(series: &[f64]) -> f64 {
    series.iter().fold(0.0, |largest, value| largest.max(value.abs()))
}

/// The path whose increments are the signs of `response`, the newest first: what makes the sum of `response` over them largest.
fn against_sum(response: &[f64]) -> Vec<f64> {
    response
        .iter()
        .rev()
        .scan(0.0, |x, value| {
            *x += value.signum();
            Some(*x)
        })
        .collect()
}

/// The path between −1 and 1 that turns wherever `response` does, backwards in time.
fn against_variation(response: &[f64]) -> Vec<f64> {
    let slope = |j: usize| response[j] - if j == 0 { 0.0 } else { response[j - 1] };
    (0..response.len()).rev().map(|j| slope(j).signum()).collect()
}

/// Paths that are not the worst case of any law.
fn hostile_paths(steps: usize, random: &mut Pcg64) -> Vec<Vec<f64>> {
    let walk = |random: &mut Pcg64, last: usize| {
        let mut x = 0.0;
        (0..steps)
            .map(|k| {
                x += if k < last { random.random_range(-1.0..1.0) } else { 0.0 };
                x
            })
            .collect()
    };
    vec![
        (0..steps).map(|k| k as f64).collect(),
        (0..steps).map(|k| (k % 2) as f64).collect(),
        vec![1.0; steps],
        (0..steps).map(|k| 1.0 - (20.0 * k as f64 / steps as f64).cos()).collect(),
        walk(random, steps),
        // At rest after a tenth.
        walk(random, steps / 10),
    ]
}

/// Bound over largest error of the force by increments and by stroke, and of the displacement likewise.
type Ratios = [f64; 4];

/// Runs the worst paths and hostile ones. None exceeds the bound.
fn held_by_its_worst_paths<T: Scalar + From<f64>, const H: usize, const F: usize, const S: usize>(
    name: &str,
    law: &Law<T, Compressed<T, H, F, S>>,
    model: &Maxwell,
    options: LawOptions,
    steps: usize,
) -> Ratios {
    let exact = Exact::new(model, None, options, steps);
    let mut random = Pcg64::seed_from_u64(steps as u64);
    let (delta, q, _) = exact.errors(law, &vec![1.0; steps]);
    let mut paths = hostile_paths(steps, &mut random);
    paths.extend([against_sum(&delta), against_variation(&delta), against_sum(&q), against_variation(&q)]);
    let bound = law.compression_bound(model, options.horizon_s);
    assert!(
        (f64::from(bound.horizon_s) / options.horizon_s - 1.0).abs() < 1e-6
            && f64::from(bound.horizon_s) <= options.horizon_s
    );
    let mut smallest = [f64::INFINITY; 4];
    for path in paths {
        let (_, _, errors) = exact.errors(law, &path);
        let reached = held(name, &bound, &errors);
        smallest = std::array::from_fn(|k| smallest[k].min(reached[k]));
    }
    smallest
}

/// Bounds over errors, which they are no smaller than.
fn held(name: &str, bound: &CompressionBound, errors: &Errors) -> Ratios {
    let Errors { force, displacement, force_known, displacement_known, increment, stroke } = *errors;
    [
        ("force by increments", f64::from(bound.force_per_increment) * increment, force, force_known),
        ("force by stroke", f64::from(bound.force_per_stroke) * stroke, force, force_known),
        (
            "displacement by increments",
            f64::from(bound.displacement_per_increment) * increment,
            displacement,
            displacement_known,
        ),
        ("displacement by stroke", f64::from(bound.displacement_per_stroke) * stroke, displacement, displacement_known),
    ]
    .map(|(which, bound, error, known)| {
        assert!(error <= bound + known, "{name}, {which}: {error:.3e} exceeds {bound:.3e} (known to {known:.1e})");
        (bound + known) / error
    })
}

/// One of the kinds of law that are built: number type and memory.
fn of_kind(kind: usize, name: &str, model: &Maxwell, options: LawOptions, steps: usize) -> Ratios {
    fn ratios<T: Scalar + From<f64>, const H: usize, const F: usize, const S: usize>(
        (name, model, options, steps): (&str, &Maxwell, LawOptions, usize),
    ) -> Ratios {
        let law: Law<T, Compressed<T, H, F, S>> = Law::compressed(model, options).expect(name);
        held_by_its_worst_paths(name, &law, model, options, steps)
    }
    let lean = (name, model, options.with_tolerance(1e-2), steps);
    match kind {
        0 => ratios::<f64, 12, 12, 24>((name, model, options, steps)),
        1 => ratios::<Rounded, 12, 12, 24>((name, model, options, steps)),
        2 => ratios::<f64, 8, 14, 4>(lean),
        _ => ratios::<Rounded, 8, 14, 4>(lean),
    }
}

/// Random, published and hard models with and without mass, in both discretisations, from 100 steps to 30 000, in f64 and with
/// coefficients of f32. Every bound is held by its worst path, by those of the others and by hostile ones.
#[test]
fn no_run_exceeds_the_bound() {
    let all: Vec<_> = random_models(2022, 200).into_iter().chain(presets()).chain(hard_models()).enumerate().collect();
    let mut reached: Vec<Ratios> = sample(all, 40)
        .par_iter()
        .map(|(k, (name, model))| {
            let mut random = Pcg64::seed_from_u64(*k as u64);
            let steps = 10f64.powf(random.random_range(2.0..4.5)) as usize;
            let rate_hz = [100.0, 1000.0, 5000.0][random.random_range(0..3)];
            let method = [Discretisation::Gl, Discretisation::Bdf2][k % 2];
            let mass_kg = if random.random_bool(0.3) { 0.0 } else { model.mass_kg() };
            let model = Maxwell::new(model.main(), model.branches(), model.topology(), mass_kg).expect("valid");
            let options =
                LawOptions::at_step(1.0 / rate_hz).with_horizon((steps as f64 - 0.5) / rate_hz).with_method(method);
            let name = format!("{name}, {mass_kg} kg, {steps} steps at {rate_hz} Hz, {method:?}, kind {}", k / 2 % 4);
            of_kind(k / 2 % 4, &name, &model, options, steps)
        })
        .collect();
    println!("bound over largest error, {} laws: median, nine of ten below", reached.len());
    for (which, name) in
        ["force by increments", "force by stroke", "displacement by increments", "displacement by stroke"]
            .into_iter()
            .enumerate()
    {
        reached.sort_by(|a, b| a[which].total_cmp(&b[which]));
        let [median, most] = [reached.len() / 2, reached.len() * 9 / 10].map(|k| reached[k][which]);
        println!("{name:28}{median:8.2}{most:8.2}");
        // Reached by a run, but for what the sums between places are enlarged by and what an oscillation is counted with.
        assert!((1.0..1.3).contains(&median), "{name}: {median}");
    }
}

/// A law with fewer modes and a shorter head is further from full memory, within its larger bound.
#[test]
fn the_bound_of_a_coarser_law_holds() {
    const STEPS: usize = 3000;
    let models: Vec<_> = presets().into_iter().chain(random_models(11, 20)).enumerate().collect();
    sample(models, 12).par_iter().for_each(|(k, (name, model))| {
        let method = [Discretisation::Gl, Discretisation::Bdf2][k % 2];
        let options = LawOptions::at_step(1e-3).with_horizon(1e-3 * (STEPS as f64 - 0.5)).with_method(method);
        let law: Law<f64> = Law::compressed(model, options).expect("valid");
        let coarse: Law<f64, Compressed<f64, 4, 11, 7>> = law.coarser();
        let bound = |force: CompressionBound| force.force_per_stroke;
        let [finer, coarser] = [
            bound(law.compression_bound(model, options.horizon_s)),
            bound(coarse.compression_bound(model, options.horizon_s)),
        ];
        assert!(coarser > 10.0 * finer, "{name}: {coarser} beside {finer}");
        held_by_its_worst_paths(name, &coarse, model, options, STEPS);
    });
}

/// Over the default horizon of a day: what a run of a few minutes shows is far below.
#[test]
fn the_default_laws_are_within_a_millionth_of_the_stroke_for_a_day() {
    let (mut f64s, mut f32s) = (0f32, 0f32);
    for (name, model) in presets() {
        for method in [Discretisation::Gl, Discretisation::Bdf2] {
            let options = LawOptions::at_step(1e-3).with_method(method);
            let law: Law<f64> = Law::compressed(&model, options).expect("valid");
            let rounded: Law<f32> = Law::compressed(&model, options).expect("valid");
            let exact = Exact::new(&model, None, options, 10_000);
            let bound = law.compression_bound(&model, options.horizon_s);
            for path in hostile_paths(10_000, &mut Pcg64::seed_from_u64(1)) {
                held(&name, &bound, &exact.errors(&law, &path).2);
            }
            f64s = f64s.max(bound.displacement_per_stroke);
            f32s = f32s.max(rounded.compression_bound(&model, options.horizon_s).displacement_per_stroke);
        }
    }
    println!(
        "published models over 24 h at 1 kHz: displacement within {f64s:.1e} of the stroke, rounded to f32 {f32s:.1e}"
    );
    assert!(f64s < 1e-6 && f32s < 1e-5);
}

/// Behind an elastic curve: the force with and without mass, the displacement without.
#[test]
fn the_bound_holds_behind_a_curve() {
    const STEPS: usize = 4000;
    let curve = Curve::through(&[(-3e-3, -2.4e-3), (0.0, 0.0), (1e-3, 1.2e-3), (3e-3, 5e-3)]).expect("rises");
    let models = sample(random_models(7, 60), 8);
    for (k, (name, model)) in models.iter().enumerate() {
        let mass_kg = if k % 2 == 0 { model.mass_kg() } else { 0.0 };
        let model = Maxwell::new(model.main(), model.branches(), model.topology(), mass_kg).expect("valid");
        let method = [Discretisation::Gl, Discretisation::Bdf2][k / 2 % 2];
        let options = LawOptions::at_step(1e-3).with_horizon(1e-3 * (STEPS as f64 - 0.5)).with_method(method);
        let straight = Law::<f64, Compressed<f64, 8, 14, 4>>::compressed(&model, options.with_tolerance(1e-2));
        let straight = straight.expect("valid");
        let law = straight.clone().behind(&curve).expect("valid");
        let (mut bound, before) =
            (law.compression_bound(&model, options.horizon_s), straight.compression_bound(&model, options.horizon_s));
        assert!(bound.force_per_increment > before.force_per_increment, "{name}");
        if mass_kg > 0.0 {
            assert!(bound.displacement_per_increment.is_infinite() && bound.displacement_per_stroke.is_infinite());
        } else {
            assert!(bound.displacement_per_stroke > before.displacement_per_stroke, "{name}");
        }
        let exact = Exact::new(&model, Some(&curve), options, STEPS);
        let without = Exact::new(&model, None, options, STEPS);
        let (delta, q, _) = without.errors(&straight, &[1.0; STEPS]);
        let mut paths = hostile_paths(STEPS, &mut Pcg64::seed_from_u64(k as u64));
        paths.extend([against_sum(&delta), against_variation(&delta), against_sum(&q), against_variation(&q)]);
        for path in paths {
            // Within the curve.
            let scale = 3e-3 / largest(&path);
            let path: Vec<f64> = path.iter().map(|x| scale * x).collect();
            let (_, _, errors) = exact.errors(&law, &path);
            if mass_kg > 0.0 {
                // The displacement has no bound.
                bound.displacement_per_increment = f32::MAX;
                bound.displacement_per_stroke = f32::MAX;
            }
            held(name, &bound, &errors);
        }
    }
}

/// A law that was received as coefficients has the same bound. An infinite horizon has no bound.
#[test]
fn the_bound_is_that_of_the_coefficients() {
    for (name, model) in presets() {
        let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
        let received = Law::from_coefficients(&law.coefficients(), 1e-3, model.mass_kg()).expect("valid");
        let bound = |law: &Law<f32>, horizon_s| law.compression_bound(&model, horizon_s);
        assert_eq!(bound(&received, 3600.0), bound(&law, 3600.0), "{name}");
        assert!(bound(&law, f64::INFINITY).force_per_stroke.is_infinite());
    }
}
