//! Laws behind an elastic curve, with two curves, F = m ẍ + E(x) + T'(x) M[T(x)], and with a spring in series, S(e) = K[x − e], against nonlinear sums,
//! closed forms and the plain law.

use std::f64::consts::TAU;

use springpot::{
    Actuator, Curve, Discretisation, Law, LawOptions, Load, Maxwell, Measure, Real, Spring, Springpot, Topology,
};

use crate::support::bent_films::{
    Bent, STEP_S, bent, cubic, elastic, film, hencky, in_series, left_in_series, load, run, spring, strain,
};
use crate::support::{METHODS, law_by, relative_rms};

const GAMMA_0_8: f64 = 1.164_229_713_725_303;

/// Behind the cubic, in Hencky's strain beside the spring, or in series with the one that stiffens.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Film {
    Behind,
    Beside,
    Series,
}

const FILMS: [Film; 3] = [Film::Behind, Film::Beside, Film::Series];

impl Film {
    /// The law of `model` with these curves, each in so many `pieces`.
    fn law<T: Real>(self, model: &Maxwell, step_s: f64, method: Discretisation, pieces: usize) -> Law<T> {
        let law = Law::compressed(model, LawOptions::at_step(step_s).with_method(method)).expect("a law");
        let law = match self {
            Self::Behind => law.behind(&cubic(-0.5e-3, 5e-3, pieces)),
            Self::Beside => law.beside(&spring(pieces), &hencky()),
            Self::Series => law.in_series(&in_series(pieces)),
        };
        law.expect("a law")
    }

    fn wide(self, model: &Maxwell, pieces: usize) -> Law<f64> {
        self.law(model, STEP_S, Discretisation::Gl, pieces)
    }

    /// Gives the film of `model` to `work`, as a nonlinear sum.
    fn summed<R>(self, model: &Maxwell, work: impl FnOnce(Bent<'_>) -> R) -> R {
        // As its pieces are: 4e-6 from the formula in the slope.
        let measure = hencky();
        match self {
            Self::Behind => work(Bent { model, strain: &|x, _| bent(x), resists: &|_, memory| memory }),
            Self::Series => work(Bent { model, strain: &left_in_series, resists: &|_, memory| memory }),
            Self::Beside => {
                let resists = |x: f64, memory: f64| elastic(x)[0] + measure.slope(x) * memory;
                work(Bent { model, strain: &|x, _| measure.value(x), resists: &resists })
            }
        }
    }
}

#[test]
fn creep_is_that_of_the_nonlinear_sum() {
    const SAMPLES: usize = 4000;
    let cases = [(0.3, 0.0), (0.0, 0.0), (0.1, 60.0)];
    for (kind, (mass_kg, coupling)) in FILMS.into_iter().flat_map(|kind| cases.map(|case| (kind, case))) {
        let model = film(mass_kg);
        let exact = kind.summed(&model, |film| film.by_the_sum(|k, x| load(k) * (1.0 + coupling * x), SAMPLES));
        let largest = exact.iter().copied().fold(0.0, f64::max);
        let (most_m, matters) = match kind {
            Film::Behind => (6e-3, bent(largest) > 1.4 * largest),
            Film::Beside => (6e-3, strain(largest)[1] < 0.93),
            Film::Series => (6.5e-3, in_series(1).displacement(44.0) < 0.5 * 44.0 / in_series(1).slope(0.0)),
        };
        assert!((1.7e-3..most_m).contains(&largest) && matters, "the curves matter: {largest}");
        let load = |k| Load { force_n: load(k), slope_n_per_m: load(k) * coupling };
        let most = if kind == Film::Behind { 16 } else { 8 };
        for pieces in [1, 7, most] {
            let error = relative_rms(&run(&kind.wide(&model, pieces), load, SAMPLES), &exact);
            assert!(error < 3e-6, "{kind:?}, {mass_kg} kg, {pieces} pieces: {error:e}");
            let single: Law<f32> = kind.law(&model, STEP_S, Discretisation::Gl, pieces);
            let error = relative_rms(&run(&single, load, SAMPLES), &exact);
            assert!(error < 4e-6, "{kind:?}, {mass_kg} kg, {pieces} pieces in f32: {error:e}");
        }
    }
}

#[test]
fn relaxation_has_the_closed_form() {
    // A springpot of order 0.2 held at x: E(x) + T'(x) c T(x) t^−0.2 / Γ(0.8).
    let model = Maxwell::new(Springpot::new(5e3, 0.2), &[], Topology::Eq11, 0.0).expect("valid");
    let x = 3.1e-3;
    let [value, slope] = strain(x);
    for (kind, spring_n, memory_m) in [(Film::Behind, 0.0, bent(x)), (Film::Beside, elastic(x)[0], slope * value)] {
        let law = kind.wide(&model, 5);
        let mut state = law.state();
        for k in 1..=20_000 {
            let force = law.force(&mut state, x);
            let t = (f64::from(k) - 0.5) * STEP_S;
            let exact = spring_n + 5e3 * memory_m * t.powf(-0.2) / GAMMA_0_8;
            assert!(k < 2000 || (force / exact - 1.0).abs() < 1e-4, "{kind:?}, step {k}: {force} instead of {exact}");
        }
    }
}

#[test]
fn both_directions_return_each_other() {
    for (kind, method) in FILMS.into_iter().flat_map(|kind| METHODS.map(|method| (kind, method))) {
        let law: Law<f64> = kind.law(&film(0.3), STEP_S, method, 7);
        let (mut forwards, mut backwards, mut state) = (law.state(), law.state(), law.state());
        for k in 0..5000 {
            let x = law.displacement(&mut forwards, load(k));
            let ahead = law.force_to(&backwards, x);
            let force = law.force(&mut backwards, x);
            assert_eq!(ahead, force);
            // The curves are exact backwards and linearised forwards.
            assert!((force - load(k)).abs() < 2e-3, "{kind:?}, step {k}: {force} instead of {}", load(k));

            // By the change of the increment the inverse is exact to rounding.
            let mut next = state.clone();
            law.displacement(&mut next, load(k));
            let change = next.increment() - state.increment();
            assert!((law.force_for(&state, change) - load(k)).abs() < 1e-8);
            state = next;
        }
    }
}

#[test]
fn straight_curves_and_no_spring_are_the_law_by_itself() {
    let straight = Curve::through(&[(-1e-3, -1e-3), (1e-3, 1e-3), (4e-3, 4e-3)]).expect("rises");
    assert!((straight.slope(2e-3) - 1.0).abs() < 1e-15);
    let measure = Measure { exponent: 1.0, length_m: 1.0 }.curve(-1e-3, 6e-3).expect("rises");
    let none = Spring::linear(0.0).expect("valid");
    let load = |k| Load { force_n: load(k), slope_n_per_m: 0.1 * load(k) };
    for (mass_kg, method) in [0.0, 0.3].into_iter().flat_map(|mass_kg| METHODS.map(|method| (mass_kg, method))) {
        let plain: Law<f64> =
            Law::compressed(&film(mass_kg), LawOptions::at_step(STEP_S).with_method(method)).expect("a law");
        let expected = run(&plain, load, 4000);
        for law in [plain.clone().behind(&straight), plain.beside(&none, &measure)] {
            assert!(relative_rms(&run(&law.expect("a law"), load, 4000), &expected) < 1e-9);
        }
    }
}

#[test]
fn curves_serve_the_discretisation_of_second_order_as_well() {
    // Small changes of the step: the error against a fine solution falls with its square.
    let model = film(0.3);
    for (kind, peak_n) in [(Film::Behind, 40.0), (Film::Beside, 60.0)] {
        let at = |step_s: f64, method| -> f64 {
            let law: Law<f64> = kind.law(&model, step_s, method, 4);
            let mut state = law.state();
            let steps = (2.0 / step_s).round() as usize;
            for k in 1..=steps {
                let share = k as f64 * step_s / 2.0;
                law.displacement(&mut state, peak_n * share.powi(3) * (10.0 - 15.0 * share + 6.0 * share.powi(2)));
            }
            state.position()
        };
        let exact = at(1.25e-4, Discretisation::Bdf2);
        let errors = [8e-3, 4e-3, 2e-3].map(|step_s| (at(step_s, Discretisation::Bdf2) / exact - 1.0).abs());
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((1.7..2.4).contains(&order), "{kind:?}: {errors:?}");
        }
        assert!((at(2e-3, Discretisation::Gl) / exact - 1.0).abs() > 10.0 * errors[2]);
    }
}

#[test]
fn coefficients_carry_the_curves_and_give_the_same_bits() {
    let model = film(0.3);
    for (kind, pieces, knots) in [(Film::Behind, 11, 12), (Film::Beside, 5, 9 + 6)] {
        for method in METHODS {
            let law: Law<f32> = kind.law(&model, STEP_S, method, pieces);
            let coefficients = law.coefficients();
            assert_eq!((coefficients.curve.len(), coefficients.has_spring()), (knots, kind == Film::Beside));
            let received = Law::from_coefficients(&coefficients, STEP_S, model.mass_kg()).expect("a law");
            assert_eq!(received, law);
            let load = |k| Load { force_n: load(k), slope_n_per_m: 0.0 };
            assert_eq!(run(&received, load, 1000), run(&law, load, 1000));
        }
    }
}

#[test]
fn a_film_that_hung_under_a_load_is_where_stepping_brings_it() {
    for law in FILMS.map(|kind| kind.wide(&film(0.0), 6)) {
        let mut stepped = law.state();
        law.warm_up(&mut stepped, (0..20_000).map(|_| 25.0));
        let mut settled = law.settled(25.0, 20.0);
        assert!((settled.position() / stepped.position() - 1.0).abs() < 1e-5);
        assert!((settled.slope() / stepped.slope() - 1.0).abs() < 1e-5);
        for _ in 0..1000 {
            let x = law.displacement(&mut stepped, 15.0);
            assert!((law.displacement(&mut settled, 15.0) - x).abs() < 1e-5 * x);
        }
        // A sensor that is zeroed there: the film stays where it is on its curves.
        let origin = settled.position();
        let mut zeroed = settled.clone();
        zeroed.move_origin(origin);
        for _ in 0..100 {
            let x = law.displacement(&mut settled, 20.0);
            assert!((law.displacement(&mut zeroed, 20.0) + origin - x).abs() < 1e-12);
        }
    }
}

#[test]
fn feedforward_follows_a_bent_film_through_a_saturating_drive() {
    let model = film(Actuator::KARNER_2022.mass_kg);
    for (kind, stretch_coupling, centre_m, starting) in
        [(Film::Behind, -20.0, 0.6e-3, 20), (Film::Beside, 30.0, 1.2e-3, 40)]
    {
        let actuator = Actuator { stretch_coupling, saturation_v: Some(9000.0), ..Actuator::KARNER_2022 };
        let law: Law<f32> = kind.law(&model, STEP_S, Discretisation::Gl, 8);
        let error = kind.summed(&model, |film| film.feedforward_error(law, &actuator, centre_m, starting));
        assert!(error < 1e-4, "{kind:?}: {error:e}");
    }
}

/// A spring beside the memory is a branch of two equal ones in series; one in series with it is in its branch, beside next to nothing.
#[test]
fn a_linear_spring_is_one_of_the_model() {
    let sp = Springpot::new;
    let straight = Measure { exponent: 1.0, length_m: 1.0 }.curve(-1e-3, 6e-3).expect("rises");
    let linear = |n_per_m| Spring::linear(n_per_m).expect("valid");
    let (memory, elements) = (sp(9e3, 0.3), film(0.0));
    for (mass_kg, method) in [0.0, 0.3].into_iter().flat_map(|mass_kg| METHODS.map(|method| (mass_kg, method))) {
        let law = |main, branches: &[_]| -> Law<f64> {
            let model = Maxwell::new(main, branches, Topology::Parallel, mass_kg).expect("valid");
            law_by(&model, 1.0 / STEP_S, method)
        };
        let branch = elements.branches()[0];
        let beside = law(elements.main(), &[branch]).beside(&linear(7e3), &straight).expect("a law");
        let series = law(memory, &[]).in_series(&linear(2e4)).expect("a law");
        let whole_series = law(sp(1e-6, 0.0), &[[memory, sp(2e4, 0.0)]]);
        let ratio = series.stiffness() / whole_series.stiffness();
        assert!(series.min_stiffness() <= series.max_stiffness() && ratio >= 1.0, "{ratio}");
        assert!((series.min_stiffness() / whole_series.stiffness() - 1.0).abs() < 1e-6);
        let whole_beside = law(elements.main(), &[branch, [sp(14e3, 0.0); 2]]);
        let load = |k| Load { force_n: load(k), slope_n_per_m: 0.1 * load(k) };
        for (law, whole) in [(beside, whole_beside), (series, whole_series)] {
            let error = relative_rms(&run(&law, load, 4000), &run(&whole, load, 4000));
            assert!(error < 1e-6, "{mass_kg} kg, {method:?}: {error:e}");
            for hz in [0.01, 1.0, 30.0] {
                let ratio = law.frequency_response(hz) / whole.frequency_response(hz);
                assert!((ratio - 1.0).norm() < 1e-6, "{hz} Hz: {ratio}");
            }
        }
    }
}

/// The slope scales the observer's gains: about a film that has been held, changes at 1 Hz meet so much more stiffness than at rest.
#[test]
fn the_slope_is_that_of_slow_changes() {
    for (kind, tolerance) in [(Film::Beside, 0.03), (Film::Series, 0.05)] {
        let law = kind.wide(&film(0.0), 4);
        let amplitude = |centre: f64| {
            let (mut state, mut still) = (law.state(), law.state());
            let (mut swung, size) = (0f64, 1e-6);
            for k in 0..8000 {
                let phase = TAU * f64::from(k) * STEP_S;
                let force = law.force(&mut state, centre + size * phase.sin()) - law.force(&mut still, centre);
                swung = if k >= 4000 { swung.max(force.abs()) } else { 0.0 };
            }
            (swung / size, still.slope())
        };
        let (at_rest, one) = amplitude(0.0);
        assert!((one - 1.0).abs() < 1e-6, "{one}");
        for centre in [1.5e-3, 4e-3] {
            let (stiffness, slope) = amplitude(centre);
            let error = (stiffness / at_rest / slope - 1.0).abs();
            let text = format!("{kind:?}, {centre}: {stiffness} of {at_rest}, {slope}");
            assert!((slope - 1.0).abs() > 0.1 && error < tolerance, "{text}");
        }
    }
}

/// A law of fewer modes follows one with curves, and is behind it by no more than its margin.
#[test]
fn a_coarser_law_knows_the_curves() {
    for (kind, pieces) in [(Film::Beside, 8), (Film::Series, 4)] {
        let law = kind.wide(&film(0.0), pieces);
        let coarse = law.coarser::<4, 11, 7>();
        let margin = law.margin_of(&coarse, 5e-3, 0.0);
        assert!((0.0..0.02).contains(&margin), "{margin}");
        let (mut film, mut watched) = (law.state(), coarse.state());
        for k in 0..60_000 {
            let force = if k % 20_000 < 12_000 { 35.0 } else { 12.0 };
            let x = law.displacement(&mut film, force);
            let seen = coarse.displacement(&mut watched, force);
            assert!(k < 100 || (seen - x).abs() < 0.015 * x.abs(), "{kind:?}, step {k}: {seen} instead of {x}");
            let behind = x * (1.0 - margin) - 1e-6;
            assert!(k < 1000 || seen > behind, "{kind:?}, step {k}: {seen} of {x}, margin {margin}");
        }
    }
}
