//! The recursion is open to other scalars: dual numbers carry derivatives through it.

use std::ops::{Add, Div, Mul, Neg, Sub};

use springpot::{Load, Preset, Scalar};

use crate::laws::law;
use crate::support::models::paper_force;

/// A value with its derivative.
#[derive(Clone, Copy, Debug)]
struct Dual {
    value: f64,
    slope: f64,
}

macro_rules! operations {
    ($($operation:ident $function:ident |$a:ident, $b:ident| $slope:expr;)*) => {$(
        impl $operation for Dual {
            type Output = Self;
            fn $function(self, other: Self) -> Self {
                let ($a, $b) = (self, other);
                Self { value: $a.value.$function($b.value), slope: $slope }
            }
        }
    )*};
}

operations! {
    Add add |a, b| a.slope + b.slope;
    Sub sub |a, b| a.slope - b.slope;
    Mul mul |a, b| a.value * b.slope + a.slope * b.value;
    Div div |a, b| (a.slope - a.value / b.value * b.slope) / b.value;
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}
impl Scalar for Dual {
    const ZERO: Self = Self { value: 0.0, slope: 0.0 };
    fn from_f64(value: f64) -> Self {
        Self { value, slope: 0.0 }
    }
    fn to_f64(self) -> f64 {
        self.value
    }
}

#[test]
fn dual_numbers_carry_derivatives_through_the_recursion() {
    let model = Preset::ALL[6].model().expect("valid");
    let (dual, plain) = (law::<Dual>(&model), law::<f64>(&model));
    let (mut state, mut plain_state) = (dual.state(), plain.state());
    // Derivative with respect to the coupling: the load is f (1 + κ x).
    let kappa = Dual { value: 30.0, slope: 1.0 };
    let displaced = |kappa: f64| {
        let mut state = plain.state();
        let mut x = 0.0;
        for f in paper_force(0.2, 5.0, 1000.0) {
            x = plain.displacement_under(&mut state, Load { force_n: f, slope_n_per_m: kappa * f });
        }
        x
    };
    let mut x = Dual::ZERO;
    for f in paper_force(0.2, 5.0, 1000.0) {
        let force = Dual::from_f64(f);
        x = dual.displacement_under(&mut state, Load { force_n: force, slope_n_per_m: kappa * force });
        let same = plain.displacement_under(&mut plain_state, Load { force_n: f, slope_n_per_m: 30.0 * f });
        assert_eq!(x.value, same);
    }
    let numeric = (displaced(30.0 + 1e-3) - displaced(30.0 - 1e-3)) / 2e-3;
    assert!((x.slope / numeric - 1.0).abs() < 1e-6, "{} for {numeric}", x.slope);
}
