//! Eq. 1 both ways, with weight and coupling.

use springpot::{Actuator, ActuatorError, GRAVITY, Law, LawOptions, Preload, Preset, Real, VoltageDrive};

fn stiffness() -> f64 {
    let model = Preset::ALL[1].model().expect("valid");
    Law::<f64>::compressed(&model, LawOptions::at_step(1e-3)).expect("valid").stiffness()
}

fn drive(actuator: &Actuator) -> VoltageDrive<f64> {
    VoltageDrive::new(actuator, 8000.0, stiffness()).expect("valid")
}

#[test]
fn the_paper_s_actuator_pulls_140_n_at_6_kv() {
    let load = drive(&Actuator::KARNER_2022).load(6000.0);
    // ε0 εr V² l1 l2 / l3² by hand: 8.8541878128e-12 · 4.7 · 3.6e7 · 2.4e-3 / 2.56e-8
    assert!((load.force_n - 140.449_554_180_54).abs() < 1e-9, "{}", load.force_n);
    assert_eq!(load.slope_n_per_m, 0.0);
}

#[test]
fn force_and_voltage_are_inverse() {
    for preload in [Preload::Settled, Preload::FromStart] {
        for coupling in [0.0, 80.0] {
            let actuator = Actuator { preload, stretch_coupling: coupling, ..Actuator::KARNER_2022 };
            let drive = drive(&actuator);
            for volts in [0.0, 1.0, 500.0, 6000.0, 8000.0] {
                for x in [-1e-3, 0.0, 2e-3] {
                    let load = drive.load(volts);
                    let back = drive.voltage(load.force_n + load.slope_n_per_m * x, x);
                    assert!((back - volts).abs() < 1e-6, "{volts} V at {x} m: {back} V");
                }
            }
            assert_eq!(drive.load(-3000.0), drive.load(3000.0), "either sign squeezes");
        }
    }
}

#[test]
fn unreachable_forces_need_0_v() {
    let settled = drive(&Actuator::KARNER_2022);
    for force in [-1.0, -0.0, 0.0, f64::NEG_INFINITY, f64::NAN] {
        assert_eq!(settled.voltage(force, 1e-3), 0.0, "{force} N");
    }
    let from_start = drive(&Actuator { preload: Preload::FromStart, ..Actuator::KARNER_2022 });
    let weight = 0.316 * GRAVITY;
    assert_eq!(from_start.load(0.0).force_n, weight);
    assert_eq!(from_start.voltage(0.9 * weight, 0.0), 0.0, "the weight alone pulls more");
    assert!(from_start.voltage(1.1 * weight, 0.0) > 0.0);
    // A film pushed so far back that the coupling leaves nothing to pull with.
    let coupled = drive(&Actuator { stretch_coupling: 80.0, ..Actuator::KARNER_2022 });
    assert_eq!(coupled.voltage(1.0, -1.0 / 80.0), 0.0);
}

#[test]
fn voltages_beyond_the_largest_are_limited_so_that_a_step_always_has_an_answer() {
    let drive = drive(&Actuator { stretch_coupling: 80.0, ..Actuator::KARNER_2022 });
    assert_eq!(drive.load(1e9), drive.load(8000.0));
    assert_eq!(drive.load(-1e9), drive.load(8000.0));
}

#[test]
fn invalid_actuators_are_refused() {
    let good = Actuator::KARNER_2022;
    let new = |actuator: Actuator, volts: f64| VoltageDrive::<f64>::new(&actuator, volts, stiffness()).err();
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for (actuator, name) in [
            (Actuator { relative_permittivity: value, ..good }, "relative_permittivity"),
            (Actuator { length_m: value, ..good }, "length_m"),
            (Actuator { width_m: value, ..good }, "width_m"),
            (Actuator { thickness_m: value, ..good }, "thickness_m"),
        ] {
            let Some(ActuatorError::NotPositive { quantity, .. }) = new(actuator, 6000.0) else {
                panic!("{name} = {value} was accepted");
            };
            assert_eq!(quantity, name);
        }
        assert!(matches!(new(good, value), Some(ActuatorError::NotPositive { quantity: "max_voltage_v", .. })));
    }
    for mass in [-1.0, f64::NAN, f64::INFINITY] {
        let refused = new(Actuator { mass_kg: mass, ..good }, 6000.0);
        assert!(matches!(refused, Some(ActuatorError::Mass(_))));
    }
    for coupling in [f64::NEG_INFINITY, f64::NAN, f64::INFINITY] {
        let refused = new(Actuator { stretch_coupling: coupling, ..good }, 6000.0);
        assert!(matches!(refused, Some(ActuatorError::Coupling(_))));
    }
    assert_eq!(new(Actuator { stretch_coupling: -20.0, ..good }, 6000.0), None);
    for volts in [0.0, -9e3, f64::NAN, 1e-200] {
        let refused = new(Actuator { saturation_v: Some(volts), ..good }, 6000.0);
        assert!(matches!(refused, Some(ActuatorError::Saturation(_))), "{volts} V");
    }
    // 140 N · κ against about 5e5 N/m of one step.
    let refused = new(Actuator { stretch_coupling: 1e5, ..good }, 6000.0);
    assert!(matches!(refused, Some(ActuatorError::PullIn { pull, stiffness }) if pull > stiffness));
    // A force beyond what f32 can hold.
    let refused = VoltageDrive::<f32>::new(&good, 1e25, 1e5).err();
    assert!(matches!(refused, Some(ActuatorError::NotPositive { .. })));
}

/// The square root of a step: correctly rounded, or micromath's within what its documentation states.
#[test]
fn square_root_is_as_good_as_documented() {
    let allowed = if cfg!(feature = "micromath") { 2e-6 } else { 0.5 * f64::from(f32::EPSILON) };
    let mut worst = 0f64;
    for exponent in [-60, -1, 0, 1, 60] {
        // Every mantissa of two neighbouring exponents covers all cases of a square root.
        for bits in (0..1u32 << 23).step_by(if exponent == 0 || exponent == 1 { 1 } else { 997 }) {
            let x = f32::from_bits((((127 + exponent) as u32) << 23) | bits);
            let exact = f64::from(x).sqrt();
            worst = worst.max((f64::from(Real::sqrt(x)) / exact - 1.0).abs());
        }
    }
    println!("f32 square root: largest relative error {worst:.2e}");
    assert!(worst <= allowed, "{worst:.2e}");
    assert_eq!(Real::sqrt(0f32), 0.0);
    assert!(Real::sqrt(-1f32).is_nan() && Real::sqrt(f32::NAN).is_nan());
}

#[test]
fn a_saturating_actuator_gives_less_force_at_high_voltage_and_knows_where_it_ends() {
    let actuator = Actuator { saturation_v: Some(5000.0), stretch_coupling: -30.0, ..Actuator::KARNER_2022 };
    let plain = Actuator { saturation_v: None, ..actuator };
    let drive = drive(&actuator);
    for (volts, share) in [(0.0, 1.0), (500.0, 1.0 / 1.01), (5000.0, 0.5), (-5000.0, 0.5)] {
        for x in [-1e-3, 0.0, 2e-3] {
            let force = actuator.force(volts, x);
            assert!((force - share * plain.force(volts, x)).abs() < 1e-12, "{volts} V");
            let load = drive.load(volts);
            assert!((load.force_n + load.slope_n_per_m * x - force).abs() < 1e-12);
            assert!((actuator.load(volts).force_n - load.force_n).abs() < 1e-12);
            assert!((drive.voltage(force, x) - volts.abs()).abs() < 1e-6);
            assert!((actuator.voltage(force, x) - volts.abs()).abs() < 1e-6);
        }
    }
    // More than B V_s² no voltage gives.
    let most = actuator.force_per_square_volt() * 25e6;
    assert!(drive.voltage(0.999 * most, 0.0) > 100e3);
    assert_eq!(drive.voltage(1.001 * most, 0.0), f64::INFINITY);
    assert_eq!(actuator.squared_voltage(1.001 * most, 0.0), f64::INFINITY);
}
