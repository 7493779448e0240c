//! Logarithm and exponential of the adaptation, in operations that are the same everywhere.

use crate::scalar::Real;

/// Coefficients of the series of [`log_of_ratio`] and [`exp`].
pub(super) const LOGARITHM: [f64; 2] = [2.0 / 3.0, 0.4];
pub(super) const EXPONENTIAL: [f64; 2] = [1.0 / 16.0, 1.0 / 6.0];

/// ln (x / y) within 0.001 for ratios of 0.5 to 2, and within a tenth of it for ratios of 0.05 to 20.
pub(super) fn log_of_ratio<T: Real>(x: T, y: T) -> T {
    let part = (x - y) / (x + y);
    let square = part * part;
    let [third, fifth] = LOGARITHM.map(T::from_f64);
    part * (T::from_f64(2.0) + square * (third + fifth * square))
}

/// ln x of the series, so that [`exp`] gives x again: within 1e-4 for factors of 0.25 to 4.
pub(super) fn logarithm<T: Real>(x: T) -> T {
    let near = log_of_ratio(x, T::from_f64(1.0));
    near + log_of_ratio(x, exp(near))
}

/// e^x within 1e-4 for x of −2 to 2, in operations that are the same everywhere.
pub(super) fn exp<T: Real>(x: T) -> T {
    let [share, sixth] = EXPONENTIAL.map(T::from_f64);
    let part = share * x;
    let one = T::from_f64(1.0);
    let mut power = one + part * (one + part * (T::from_f64(0.5) + part * sixth));
    for _ in 0..4 {
        power = power * power;
    }
    power
}
