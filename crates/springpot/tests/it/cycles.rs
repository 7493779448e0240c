//! The period of a reference that learning finds by itself, of references in closed form.

use std::f64::consts::{FRAC_PI_2, TAU};

use springpot::{Actuator, Law, LawOptions, Learning, LearningOptions, Limited, Maxwell, Springpot, Topology};

const STEP_S: f64 = 1e-3;
const STIFFNESS: f64 = 5000.0;
const ALPHA: f64 = 0.1;

/// The period (ticks) after `seconds` of a reference (m, of a time in s) that begins at `position` (m).
fn period(position: f64, seconds: u32, reference: impl Fn(f64) -> f64) -> Option<f64> {
    let model = Maxwell::new(Springpot::new(STIFFNESS, ALPHA), &[], Topology::Parallel, 0.0).expect("valid");
    let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(STEP_S)).expect("valid");
    let learning = Learning::new(&law, &Actuator::KARNER_2022, 6000.0, LearningOptions::BENCH).expect("valid");
    let mut state: springpot::LearningState<f64> = learning.state(position);
    for tick in 1..=1000 * seconds {
        learning.advance(&mut state, reference(f64::from(tick) * STEP_S), Limited::NONE);
    }
    state.period_ticks()
}

fn assert_is_1_s(found: Option<f64>, case: &str) {
    assert!(found.is_some_and(|ticks| (ticks - 1000.0).abs() < 0.1), "{case}: {found:?}");
}

/// A sine of 1 Hz between `low` and `high`, which begins at the lower one.
fn sine(low: f64, high: f64) -> impl Fn(f64) -> f64 {
    move |t| 0.5 * (low + high) - 0.5 * (high - low) * (TAU * t).cos()
}

#[test]
fn a_reference_may_be_anywhere() {
    for position in [0.0, 2.0e-3, 5.0e-3] {
        assert_is_1_s(period(position, 5, sine(2.0e-3, 2.4e-3)), &format!("from {position} m"));
    }
}

/// Seventeen times as fast, with 4 % of the swing on either side: less than the tenth by which a reference turns back, and as steep as to cross the middle
/// three times. It begins after two cycles without.
#[test]
fn a_ripple_has_no_cycles_of_its_own() {
    let slow = sine(0.5e-3, 1.5e-3);
    let ripple = |t: f64| if t < 2.0 { 0.0 } else { 0.04e-3 * (17.0 * TAU * (t - 0.25)).sin() };
    assert_is_1_s(period(0.5e-3, 8, |t| slow(t) - ripple(t)), "with a ripple");
}

/// A thousandth of the stroke at the largest voltage, which is that of 1 Hz.
#[test]
fn a_swing_has_a_smallest_size() {
    let stiffness = STIFFNESS * TAU.powf(ALPHA) * (ALPHA * FRAC_PI_2).cos();
    let least = 1e-3 * Actuator::KARNER_2022.electrostatic_force(6000.0) / stiffness;
    assert_eq!(period(1e-3, 6, sine(1e-3, 1e-3 + 0.9 * least)), None);
    assert_is_1_s(period(1e-3, 6, sine(1e-3, 1e-3 + 1.1 * least)), "a little above the smallest");
}

/// A swing of a twentieth of the one before: each of its two turning points is found once a tenth of the distance to the last one has decayed to it, by a
/// factor of e in 20 s.
#[test]
fn a_smaller_swing_is_found_after_a_while() {
    let (large, small) = (sine(0.5e-3, 1.5e-3), sine(0.5e-3, 0.55e-3));
    let smaller = |t| if t < 5.0 { large(t) } else { small(t) };
    let found_s = 5.0 + 2.0 * 20.0 * 2.0_f64.ln();
    assert_eq!(period(0.5e-3, found_s as u32 - 2, smaller), None);
    assert_is_1_s(period(0.5e-3, found_s as u32 + 6, smaller), "a smaller swing");
}
