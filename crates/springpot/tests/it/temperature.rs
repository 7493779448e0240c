//! A film at another temperature: K_T(s) = k K(a s), with k and a computed here.

use num_complex::Complex;
use springpot::{ModelError, TemperatureDependence};

use crate::support::models::random_models;

#[test]
fn a_model_at_a_temperature_is_itself_in_another_time() {
    let dependence = TemperatureDependence { reference_c: 23.0, stiffness_per_k: 0.004, activation_kj_per_mol: 80.0 };
    for temperature_c in [-10.0_f64, 23.0, 41.5] {
        let stiffness = 1.0 + 0.004 * (temperature_c - 23.0);
        let time = (80e3 / 8.314_462_618 * (1.0 / (temperature_c + 273.15) - 1.0 / 296.15)).exp();
        for (name, model) in random_models(7, 20) {
            let other = model.at_temperature(&dependence, temperature_c).expect("within reach");
            assert_eq!(other.mass_kg(), model.mass_kg());
            for omega in [1e-4, 0.3, 40.0] {
                let s = Complex::new(0.0, omega);
                let (found, wanted) = (other.modulus(s), model.modulus(s * time) * stiffness);
                assert!((found - wanted).norm() < 1e-12 * wanted.norm(), "{name} at {temperature_c} °C, {omega} rad/s");
            }
        }
    }
}

#[test]
fn dependences_of_no_film_are_refused() {
    let sound = TemperatureDependence { reference_c: 20.0, stiffness_per_k: -0.02, activation_kj_per_mol: 200.0 };
    assert!(sound.check_at(35.0).is_ok());
    // Less than a tenth of the stiffness, and more than e¹² in time.
    assert!(matches!(sound.check_at(66.0), Err(ModelError::BeyondTemperature { .. })));
    assert!(matches!(sound.check_at(-40.0), Err(ModelError::BeyondTemperature { .. })));
    assert_eq!(sound.check_at(300.0), Err(ModelError::Temperature(300.0)));
    let steep = TemperatureDependence { stiffness_per_k: f64::INFINITY, ..sound };
    assert!(matches!(steep.check(), Err(ModelError::TemperatureDependence { quantity: "stiffness_per_k", .. })));
    assert!(sound.with_reference(f64::NAN).is_err());
}
