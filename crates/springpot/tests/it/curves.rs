//! Elastic curves, and laws behind one, against closed forms and the plain law.

use std::f64::consts::TAU;

use springpot::{
    Actuator, ActuatorError, Applied, CommandLimits, Curve, CurveError, Discretisation, Feedforward, Knot, Law,
    LawError, LawOptions, LawState, Limited, Load, Maxwell, Measure, Observer, ObserverOptions, Real, Rubber,
    SensorSample, VoltageDrive,
};

use crate::support::bent_films::{STEP_S, bent_slope, cubic, film};

fn law<T: Real>(model: &Maxwell) -> Law<T> {
    Law::compressed(model, LawOptions::at_step(STEP_S)).expect("a law")
}

#[test]
fn a_jump_of_the_force_leaves_no_error_behind() {
    // Without mass T(x) under a force is the displacement of the plain law. In the steps of the jump x is one linearisation off.
    let model = film(0.0);
    let curve = cubic(-0.5e-3, 5e-3, 1);
    let plain: Law<f64> = law(&model);
    let behind = plain.clone().behind(&curve).expect("a law");
    let (mut bent_film, mut straight) = (behind.state(), plain.state());
    let mut largest = 0f64;
    for k in 0..2000 {
        let force = if k % 500 < 250 { 25.0 } else { 5.0 };
        let x = behind.displacement(&mut bent_film, force);
        let exact = curve.inverse(plain.displacement(&mut straight, force));
        let error = (x - exact).abs() / 2e-3;
        largest = largest.max(error);
        assert!(k % 250 < 40 || error < 1e-8, "step {k}: {error:e}");
    }
    assert!(largest > 1e-3, "the jumps are large: {largest:e}");
}

#[test]
fn small_oscillations_have_the_response_of_the_working_point() {
    let model = film(0.0);
    let curve = cubic(-0.5e-3, 5e-3, 3);
    for method in [Discretisation::Gl, Discretisation::Bdf2] {
        let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(STEP_S).with_method(method))
            .expect("a law")
            .behind(&curve)
            .expect("a law");
        // Along a small sine about 2 mm the force is the kernel's times the slope there.
        let (hz, size, centre) = (2.0, 1e-6, 2e-3);
        // Beside a film at rest there.
        let (mut state, mut still): (LawState<f64>, LawState<f64>) = (law.state(), law.state());
        let (mut re, mut im, mut count) = (0.0, 0.0, 0.0);
        for k in 0..40_000 {
            let phase = TAU * hz * k as f64 * STEP_S;
            let force = law.force(&mut state, centre + size * phase.sin()) - law.force(&mut still, centre);
            if k >= 20_000 {
                re += force * phase.sin();
                im += force * phase.cos();
                count += 0.5;
            }
        }
        let found = springpot::Complex::new(re / count, im / count) / size;
        let stated = law.frequency_response_about(hz, centre).inv();
        assert!((found / stated - 1.0).norm() < 0.01, "{method:?}: {found} instead of {stated}");
        let at_rest = law.frequency_response(hz).inv();
        assert!((stated.re / at_rest.re - bent_slope(centre)).abs() < 1e-6);
    }
}

#[test]
fn a_command_beyond_the_curve_is_flagged() {
    let law: Law<f32> = law(&film(0.3)).behind(&cubic(-0.1e-3, 0.3e-3, 2)).expect("a law");
    let feedforward = Feedforward::new(law, &Actuator::KARNER_2022, CommandLimits::BENCH).expect("valid");
    let mut state = feedforward.state(feedforward.law().state());
    let mut flags = Vec::new();
    for k in 0..3000 {
        let command = feedforward.command(&mut state, 0.6e-3 * (k as f32 / 3000.0));
        feedforward.apply(&mut state, Applied::as_commanded(command.voltage_v));
        assert_eq!(state.film().beyond_curve(), state.displacement() + state.film().increment() > 0.3e-3);
        flags.push(command.limited.contains(Limited::BEYOND_CURVE));
    }
    assert!(!flags[1000] && flags[2000]);
    assert_eq!(Limited::BEYOND_CURVE.bits(), 64);
}

#[test]
fn the_observers_gain_grows_with_the_slope() {
    // A constant unknown force at rest and high on the curve: the estimate must follow as fast in both places.
    let model = film(0.1);
    let plain: Law<f64> = law(&model);
    let curve = cubic(-0.5e-3, 5e-3, 4);
    let options = ObserverOptions { adaptation_s: 0.0, ..ObserverOptions::at_bandwidth(0.5) };
    let after_one_second = |law: Law<f64>, force: f64| -> f64 {
        let observer: Observer<f64> =
            Observer::new(law.clone(), &Actuator::KARNER_2022, 6000.0, options).expect("valid");
        let volts = (force / Actuator::KARNER_2022.force_per_square_volt()).sqrt();
        let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6000.0, law.min_stiffness()).expect("valid");
        let rest = law.settled(force, 600.0);
        let (mut film, mut state) = (rest.clone(), observer.state(rest));
        for k in 0..1000 {
            let load = drive.load(volts);
            let x = law.displacement_under(&mut film, Load { force_n: load.force_n + 0.5, ..load });
            let sample = (k % 10 == 0).then_some(SensorSample { displacement_m: x, age_ticks: 0 });
            observer.observe(&mut state, Applied::as_commanded(volts), sample);
        }
        state.disturbance()
    };
    let straight = after_one_second(plain.clone(), 10.0);
    let high = after_one_second(plain.behind(&curve).expect("a law"), 22.0);
    assert!((0.5..0.9).contains(&straight) && (high / straight - 1.0).abs() < 0.05, "{straight} and {high}");
}

#[test]
fn rubber_has_the_stress_of_its_formula() {
    for (share, limit, rest_stretch) in
        [(0.5, 137.0, 1.0), (0.5, 137.0, 2.1), (1.0, f64::INFINITY, 1.0), (0.2, 60.0, 1.5)]
    {
        let rubber = Rubber { share, limit, rest_stretch, free_length_m: 0.02 };
        let curve = rubber.curve(-4e-3, 40e-3).expect("rises");
        let nominal = |stretch: f64| {
            let first = stretch - stretch.powi(-2);
            let gent = 1.0 - (stretch.powi(2) + 2.0 / stretch - 3.0) / limit;
            share * first / gent + (1.0 - share) * (1.0 - stretch.powi(-3))
        };
        let scale = (nominal(rest_stretch + 1e-5) - nominal(rest_stretch - 1e-5)) / 2e-5;
        let largest = curve.value(40e-3);
        for k in 0..=200 {
            let x = -4e-3 + 44e-3 * f64::from(k) / 200.0;
            let exact = (nominal(rest_stretch + x / 0.02) - nominal(rest_stretch)) / scale * 0.02;
            let error = (curve.value(x) - exact).abs() / largest;
            assert!(error < 2e-4, "share {share}, limit {limit}, rest {rest_stretch}, x = {x}: {error:e}");
        }
        assert_eq!(curve.knots().len(), 17);
    }
}

/// Many values at once are the values one by one, to the bit, beyond the ends and on the knots as well.
#[test]
fn an_evaluator_has_the_bits_of_the_curve() {
    let hencky = Measure { exponent: 0.0, length_m: 0.06 }.curve(-1e-3, 10e-3).expect("a measure");
    for curve in [cubic(-1e-3, 3e-3, 7), hencky] {
        let (low, high) = curve.range();
        let at = curve.evaluator();
        let spread = (-50..150).map(|k| low + 0.01 * f64::from(k) * (high - low));
        for x in curve.knots().iter().map(|knot| knot.displacement).chain(spread) {
            let expected = [curve.value(x), curve.slope(x), curve.curvature(x)];
            assert_eq!(at(x).map(f64::to_bits), expected.map(f64::to_bits), "{x}");
        }
    }
}

#[test]
fn a_monotone_curve_through_points_has_the_published_slopes() {
    // By hand from Fritsch and Butland 1984, and the parabola through three points at the ends.
    let curve = Curve::through(&[(0.0, 0.0), (1.0, 2.0), (2.0, 3.0), (4.0, 4.0)]).expect("rises");
    let slopes: Vec<f64> = curve.knots().iter().map(|knot| knot.slope * 2.5).collect();
    let by_hand = [2.5, 4.0 / 3.0, 9.0 / (5.0 / 1.0 + 4.0 / 0.5), 1.0 / 6.0];
    for (slope, exact) in slopes.iter().zip(by_hand) {
        assert!((slope - exact).abs() < 1e-12, "{slopes:?}");
    }
    assert!((curve.value(4.0) - 4.0 / 2.5).abs() < 1e-15);
    for s in [-0.3, 0.0, 0.2, 0.77, 1.3, 1.6, 2.5] {
        assert!((curve.value(curve.inverse(s)) - s).abs() < 1e-14);
    }
    // Beyond its ends it goes on with the slope there.
    assert!((curve.value(6.0) - (4.0 + 1.0 / 3.0) / 2.5).abs() < 1e-12);
}

#[test]
fn invalid_curves_are_refused_with_their_place() {
    let through = |points: &[(f64, f64)]| Curve::through(points).err();
    assert_eq!(through(&[]), Some(CurveError::Knots(0)));
    assert_eq!(through(&[(0.0, 0.0)]), Some(CurveError::Knots(1)));
    assert_eq!(through(&[(0.0, 0.0); 18]), Some(CurveError::Knots(18)));
    assert_eq!(through(&[(0.0, 0.0), (0.0, 1.0)]), Some(CurveError::Knot { index: 0 }), "its slope is infinite");
    assert_eq!(through(&[(0.0, 0.0), (1.0, f64::NAN), (2.0, 2.0)]), Some(CurveError::Knot { index: 0 }));
    assert_eq!(through(&[(1.0, 1.0), (2.0, 2.0)]), Some(CurveError::Range { low_m: 1.0, high_m: 2.0 }));
    let falls = through(&[(0.0, 0.0), (1.0, 1.0), (2.0, 0.5), (3.0, 2.0)]);
    assert!(
        matches!(falls, Some(CurveError::NotMonotone { displacement_m, .. }) if (1.0..=2.0).contains(&displacement_m))
    );
    // A cubic between knots that rise may fall in between.
    let knot = |x: f64, value, slope| Knot { displacement: x, value, slope };
    let wavy = Curve::new(&[knot(0.0, 0.0, 1.0), knot(1.0, 0.1, 1.0)]).err();
    assert!(matches!(wavy, Some(CurveError::NotMonotone { slope, .. }) if slope < 0.0));
    let steep = Curve::new(&[knot(0.0, 0.0, 2.0), knot(1.0, 2.0, 2.0)]).err();
    assert_eq!(steep, Some(CurveError::AtRest { value_m: 0.0, slope: 2.0 }));

    let rubber = Rubber { share: 0.5, limit: 10.0, rest_stretch: 1.0, free_length_m: 0.01 };
    assert!(
        matches!(rubber.curve(0.0, 0.05), Err(CurveError::Taut { displacement_m: 0.05, stretch }) if stretch > 5.9)
    );
    assert!(matches!(rubber.curve(-0.02, 0.01), Err(CurveError::Taut { displacement_m: -0.02, .. })));
    assert_eq!(Rubber { limit: f64::NAN, ..rubber }.curve(0.0, 0.01), Err(CurveError::Rubber));
    assert_eq!(Rubber { free_length_m: 0.0, ..rubber }.curve(0.0, 0.01), Err(CurveError::Rubber));
    assert!(matches!(Rubber { share: -3.0, ..rubber }.curve(0.0, 0.01), Err(CurveError::NotMonotone { .. })));

    // Knots that are one in single precision.
    let narrow = Curve::through(&[(0.0, 0.0), (1e-3, 1e-3), (1e-3 + 1e-13, 1e-3 + 2e-13)]).expect("rises in f64");
    let refused = law::<f32>(&film(0.3)).behind(&narrow).err();
    assert_eq!(refused, Some(LawError::Curve(CurveError::Knot { index: 2 })));

    // Pull-in counts where the film is softest.
    let soft = Curve::through(&[(0.0, 0.0), (1e-3, 0.2e-3), (2e-3, 0.3e-3)]).expect("rises");
    let law: Law<f64> = law(&film(0.0)).behind(&soft).expect("a law");
    let actuator = Actuator { stretch_coupling: 200.0, ..Actuator::KARNER_2022 };
    assert!(VoltageDrive::new(&actuator, 6000.0, law.stiffness()).is_ok());
    let refused = VoltageDrive::new(&actuator, 6000.0, law.min_stiffness()).err();
    assert!(matches!(refused, Some(ActuatorError::PullIn { .. })), "{refused:?}, {:?}", law.min_stiffness());
}

/// A film that was held, in closed form, and stepped: whatever the force and the creep after it is released.
#[test]
fn a_held_film_relaxes_as_one_that_was_stepped() {
    let curve = Curve::through(&[(-1e-3, -1e-3), (0.0, 0.0), (1e-3, 0.8e-3), (3e-3, 3.6e-3)]).expect("rises");
    let model = springpot::Preset::TABLE3_N2.model().expect("valid");
    let straight: Law<f64> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
    for law in [straight.clone().behind(&curve).expect("soft enough"), straight] {
        let (mut held, mut stepped) = (law.held(2e-3, 60.0), law.state());
        law.warm_up_along(&mut stepped, std::iter::repeat_n(2e-3, 60_000));
        for _ in 0..100 {
            let (force, expected) = (law.force(&mut held, 2e-3), law.force(&mut stepped, 2e-3));
            assert!((force / expected - 1.0).abs() < 1e-4, "{force} N instead of {expected}");
        }
        for _ in 0..20_000 {
            law.displacement(&mut held, 0.0);
            law.displacement(&mut stepped, 0.0);
        }
        let (left, expected) = (held.position(), stepped.position());
        assert!(expected > 1e-4 && (left / expected - 1.0).abs() < 1e-3, "{left} m instead of {expected}");
    }
}
