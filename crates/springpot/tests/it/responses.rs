//! Responses in time and frequency against closed forms and against runs.

use num_complex::Complex;
use springpot::{Law, Maxwell, Springpot, Topology, Window};

use crate::laws::{STEP, law, single};
use crate::support::models::{presets, random_models};

/// The continuous springpot relaxes as c t^−α/Γ(1 − α) and creeps as t^α/(c Γ(1 + α)).
#[test]
fn responses_in_time_have_their_closed_forms() {
    let c = 6e4;
    // Γ(1 − α) and Γ(1 + α)
    for (alpha, below, above) in [
        (0.2, 1.164_229_713_725_303_4, 0.918_168_742_399_760_6),
        (0.5, 1.772_453_850_905_516, 0.886_226_925_452_758),
        (0.9, 9.513_507_698_668_732, 0.961_765_831_907_388_3),
    ] {
        let model = single(c, alpha, 0.316);
        for time in [1e-4, 1.0, 155.0, 86_400.0] {
            let relaxed = c * f64::powf(time, -alpha) / below;
            let crept = f64::powf(time, alpha) / (c * above);
            assert!((model.relaxation_modulus(time) / relaxed - 1.0).abs() < 1e-10);
            assert!((model.creep_compliance(time) / crept - 1.0).abs() < 1e-10);
        }
    }
    // A standard linear solid: both are exponentials.
    let (spring, branch, dashpot) = (5e3, 2e4, 7e3);
    let model = Maxwell::new(
        Springpot::new(spring, 0.0),
        &[[Springpot::new(branch, 0.0), Springpot::new(dashpot, 1.0)]],
        Topology::Eq11,
        0.0,
    )
    .expect("valid");
    for time in [1e-3, 0.3, 2.0, 100.0] {
        let relaxed = spring + branch * (-time * branch / dashpot).exp();
        let rate = branch / dashpot * spring / (spring + branch);
        let crept = 1.0 / spring - branch / (spring * (spring + branch)) * (-time * rate).exp();
        assert!((model.relaxation_modulus(time) / relaxed - 1.0).abs() < 1e-10);
        assert!((model.creep_compliance(time) / crept - 1.0).abs() < 1e-10);
    }
    assert!(model.creep_compliance(0.0).is_nan() && model.relaxation_modulus(-1.0).is_nan());
}

/// The law's frequency response is what it does to a sine, and the model's is where it tends to.
#[test]
fn frequency_responses_agree_with_runs_and_with_each_other() {
    for (name, model) in presets().into_iter().take(6).chain(random_models(9, 20)) {
        let law = law::<f64>(&model);
        for (frequency, near) in [(0.01, 1e-3), (0.1, 1e-3), (1.0, 2e-2)] {
            let (discrete, continuous) = (law.frequency_response(frequency), model.frequency_response(frequency));
            let difference = (discrete - continuous).norm() / continuous.norm();
            assert!(difference < near, "{name} at {frequency} Hz: {difference:.1e}");
        }
        // Along a sine of displacement the force settles to 1/response within periods.
        let frequency = 2.0;
        let turn = |k: usize| Complex::from_polar(1.0, std::f64::consts::TAU * frequency * k as f64 * STEP);
        let mut state = law.state();
        let mut sum = Complex::<f64>::ZERO;
        for k in 0..60_000 {
            let force = law.force(&mut state, turn(k).im);
            // The last ten seconds against the sine.
            if k >= 50_000 {
                sum += turn(k).conj() * force * 2.0 / 10_000.0;
            }
        }
        let measured = sum * Complex::<f64>::i();
        let stated = law.frequency_response(frequency).inv();
        let difference = (measured - stated).norm() / stated.norm();
        assert!(difference < 3e-3, "{name}: {measured} for {stated}");
    }
}

/// Windows state their own response.
#[test]
fn a_window_answers_at_frequencies_as_it_steps() {
    let model = single(6e4, 0.4, 0.1);
    let law: Law<f64, Window<f64, [f64; 200]>> = Law::window(&model, STEP, [0.0; 200]).expect("valid");
    let mut state = law.state([0.0; 200]).expect("same length");
    let frequency = 5.0;
    let turn = |k: usize| Complex::from_polar(1.0, std::f64::consts::TAU * frequency * k as f64 * STEP);
    let mut sum = Complex::<f64>::ZERO;
    for k in 0..2000 {
        let force = law.force(&mut state, turn(k).im);
        if k >= 1000 {
            sum += turn(k).conj() * force * 2.0 / 1000.0;
        }
    }
    let stated = law.frequency_response(frequency).inv();
    assert!((sum * Complex::<f64>::i() - stated).norm() < 1e-9 * stated.norm());
}
