//! Functions of complex numbers and half turns, on `libm` alone so that host and target agree to the bit.

use core::f64::consts::PI;

use num_complex::Complex;

/// sin πα for α in 0…1, exact at both ends and accurate in relative terms near them.
pub(crate) fn sin_pi(alpha: f64) -> f64 {
    libm::sin(PI * if alpha > 0.5 { 1.0 - alpha } else { alpha })
}

/// cos πα for α in 0…1, exact at 0, ½ and 1.
pub(crate) fn cos_pi(alpha: f64) -> f64 {
    libm::sin(PI * (0.5 - alpha))
}

/// Natural logarithm, cut along the negative real axis.
pub(crate) fn ln(z: Complex<f64>) -> Complex<f64> {
    Complex::new(libm::log(libm::hypot(z.re, z.im)), libm::atan2(z.im, z.re))
}

/// ln (1 + z), accurate for small z.
pub(crate) fn ln_1p(z: Complex<f64>) -> Complex<f64> {
    Complex::new(0.5 * libm::log1p(2.0 * z.re + z.norm_sqr()), libm::atan2(z.im, 1.0 + z.re))
}

/// Exponential.
pub(crate) fn exp(z: Complex<f64>) -> Complex<f64> {
    let size = libm::exp(z.re);
    let (sin, cos) = libm::sincos(z.im);
    Complex::new(size * cos, size * sin)
}

/// e^z − 1, accurate for small z.
pub(crate) fn expm1(z: Complex<f64>) -> Complex<f64> {
    let grown = libm::expm1(z.re);
    let (sin, cos) = libm::sincos(z.im);
    let half = libm::sin(0.5 * z.im);
    // e^x cos y − 1 = (e^x − 1) cos y + (cos y − 1)
    Complex::new(grown * cos - 2.0 * half * half, (grown + 1.0) * sin)
}
