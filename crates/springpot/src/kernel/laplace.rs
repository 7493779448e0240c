//! Values of a response at any time, from its Laplace transform.
//!
//! Every transform here has all its singularities on the negative real axis, so the inversion integral may be taken
//! along a contour that opens to the left, where `e^{st}` decays and a midpoint rule converges geometrically: the
//! cotangent contour of L. N. Trefethen, J. A. C. Weideman, T. Schmelzer, "Talbot quadratures and rational
//! approximations", BIT 46 (2006) 653. With 24 nodes (12 by symmetry) about 1e-13 of the response.

use core::f64::consts::PI;

use num_complex::Complex;

use crate::complex;
use crate::kernel::Discretisation;
use crate::kernel::power_series::{self, TERMS};
use crate::model::Maxwell;

const NODES: u32 = 24;

/// The function of time `t` > 0 whose transform is `transform`, both in any consistent units.
pub(crate) fn invert(t: f64, transform: impl Fn(Complex<f64>) -> Complex<f64>) -> f64 {
    let [value] = invert_all(t, |s| [transform(s)]);
    value
}

/// The same for several functions whose transforms have parts in common.
pub(crate) fn invert_all<const N: usize>(t: f64, transforms: impl Fn(Complex<f64>) -> [Complex<f64>; N]) -> [f64; N] {
    const SHIFT: f64 = -0.6122;
    const OPENING: f64 = 0.5017;
    const BEND: f64 = 0.6407;
    const RISE: f64 = 0.2645;
    let nodes = f64::from(NODES);
    let scale = nodes / t;
    let mut sums = [0.0; N];
    for k in 0..NODES / 2 {
        let theta = (2.0 * f64::from(k) + 1.0) * PI / nodes;
        let (sin, cos) = libm::sincos(BEND * theta);
        let (cot, cosec2) = (cos / sin, 1.0 / (sin * sin));
        let s = Complex::new(SHIFT + OPENING * theta * cot, RISE * theta) * scale;
        let slope = Complex::new(OPENING * (cot - BEND * theta * cosec2), RISE) * scale;
        let growth = complex::exp(s * t);
        for (sum, transform) in sums.iter_mut().zip(transforms(s)) {
            *sum += (growth * transform * slope).im;
        }
    }
    sums.map(|sum| 2.0 * sum / nodes)
}

/// Exact values of the discrete relaxation modulus g_j, in N/m.
pub(crate) struct Kernel<'a> {
    model: &'a Maxwell,
    step_s: f64,
    ln_step: f64,
    method: Discretisation,
    head: [f64; TERMS],
}

impl<'a> Kernel<'a> {
    /// The kernel of `model` at `step_s`.
    pub(crate) fn new(model: &'a Maxwell, step_s: f64, method: Discretisation) -> Self {
        let head = power_series::relaxation_modulus(model, step_s, method);
        Self { model, step_s, ln_step: libm::log(step_s), method, head }
    }

    /// The step in seconds.
    pub(crate) fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The model.
    pub(crate) fn model(&self) -> &'a Maxwell {
        self.model
    }

    /// How s is discretised.
    pub(crate) fn method(&self) -> Discretisation {
        self.method
    }

    /// g_0 … g_63.
    pub(crate) fn head(&self) -> &[f64; TERMS] {
        &self.head
    }

    /// g_j: by power series while that is short, by the Laplace integral beyond.
    ///
    /// With ζ = e^{−σ} the coefficient integral of g(ζ) is an inverse Laplace integral in σ at "time" j, cut along
    /// the negative real axis; the contour stays within |Im σ| < π for j > 6. What [`Discretisation::Bdf2`] adds lies beyond |ζ| = 2,
    /// outside the contour, and is below 2^−64.
    pub(crate) fn at(&self, j: usize) -> f64 {
        if let Some(&g) = self.head.get(j) {
            return g;
        }
        #[allow(clippy::cast_precision_loss)] // far below 2^53 steps
        let j = j as f64;
        invert(j, |sigma| {
            // 1 − e^{−σ}
            let difference = -complex::expm1(-sigma);
            self.model.modulus_of_ln(self.ln_s(difference)) / difference
        })
    }

    /// ln s where 1 − ζ is `difference`.
    pub(crate) fn ln_s(&self, difference: Complex<f64>) -> Complex<f64> {
        match self.method {
            Discretisation::Gl => complex::ln(difference) - self.ln_step,
            // δ = (1 − ζ)(1 + (1 − ζ)/2)
            Discretisation::Bdf2 => complex::ln(difference) + complex::ln(difference * 0.5 + 1.0) - self.ln_step,
        }
    }
}
