//! The relation of capacitance and displacement, against its series and slopes in closed form.

use springpot::{CapacitanceRelation, SelfSensing, SelfSensingError, SelfSensingOptions};

const OPTIONS: SelfSensingOptions = SelfSensingOptions::BENCH;

fn relation() -> CapacitanceRelation {
    CapacitanceRelation::of_geometry(700e-12, 0.06, 2.0, 900e-12)
}

fn refused(relation: CapacitanceRelation) -> SelfSensingError {
    SelfSensing::<f64>::new(&relation, OPTIONS).expect_err("refused")
}

/// p, p (p − 1) / 2 and p (p − 1) (p − 2) / 6 of the lengths 1, 1/2 and 1/4 of the exponent.
#[test]
fn a_geometry_is_the_series_of_its_stretch() {
    for (exponent, series) in [(1.0, [1.0, 0.0, 0.0]), (2.0, [0.5, -0.125, 0.0625]), (4.0, [0.25, -0.09375, 0.0546875])]
    {
        let relation = CapacitanceRelation::of_geometry(700e-12, 0.06, exponent, 900e-12);
        for (found, expected) in relation.stroke_m.into_iter().zip(series) {
            assert!((found - 0.06 * expected).abs() < 1e-15, "exponent {exponent}: {found} m");
        }
        assert_eq!(relation.creep, 0.0);
        // A hundredth of the stroke at the largest capacitance.
        let q: f64 = 2.0 / 7.0;
        let stroke_m = 0.06 * (series[0] * q + series[1] * q * q + series[2] * q.powi(3));
        assert!((relation.uncertainty_m - 0.01 * stroke_m).abs() < 1e-15, "exponent {exponent}");
    }
}

/// Its slope a₁ + 2 a₂ q + 3 a₃ q² is a tenth of a₁, or minus a tenth, a quarter of the range beyond one end of the calibration.
#[test]
fn the_polynomial_must_rise_from_end_to_end() {
    let [low, high] = [-50.0 / 700.0, 250.0 / 700.0];
    for share in [0.1, -0.1] {
        let change = 0.06 * (share - 1.0);
        let strokes = [
            [0.06, change / (2.0 * low), 0.0],
            [0.06, change / (2.0 * high), 0.0],
            [0.06, 0.0, change / (3.0 * high * high)],
        ];
        for (index, stroke_m) in strokes.into_iter().enumerate() {
            let relation = CapacitanceRelation { stroke_m, ..relation() };
            if share > 0.0 {
                assert!(SelfSensing::<f64>::new(&relation, OPTIONS).is_ok(), "{index}");
                continue;
            }
            let SelfSensingError::NotMonotone { capacitance_f } = refused(relation) else {
                panic!("{index}: refused as another error");
            };
            // The lowest one, or within a twentieth of the range above that where the slope is 0.
            let zero = [low, high / 1.1, high / 1.1_f64.sqrt()][index];
            let above = capacitance_f / 700e-12 - 1.0 - zero;
            assert!((-1e-12..0.05 * high).contains(&above), "{index}: {capacitance_f:e} F");
        }
    }
}

/// By the constructor that takes the springpot in numbers as well.
#[test]
fn a_relation_needs_positive_capacitances() {
    let creep = SelfSensing::<f64>::new(&relation(), OPTIONS).expect("valid").creep();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let relations = [
            ("rest_f", CapacitanceRelation { rest_f: bad, ..relation() }),
            ("max_f", CapacitanceRelation { max_f: bad, ..relation() }),
            ("uncertainty_m", CapacitanceRelation { uncertainty_m: bad, ..relation() }),
        ];
        for (name, relation) in relations {
            for error in [Some(refused(relation)), SelfSensing::with_creep(&relation, OPTIONS, &creep).err()] {
                assert!(
                    matches!(error, Some(SelfSensingError::NotPositive { quantity, .. }) if quantity == name),
                    "{name} {bad}: {error:?}"
                );
            }
        }
    }
    let periods = SelfSensingOptions { periods: 65, ..OPTIONS };
    let found = SelfSensing::with_creep(&relation(), periods, &creep);
    assert_eq!(found.err(), Some(SelfSensingError::Periods(65)));
}
