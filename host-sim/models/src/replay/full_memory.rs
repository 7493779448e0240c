//! The exact full-memory Grünwald–Letnikov answer, by FFT.
//!
//! A response with full memory is a product of power series in the delay ζ. Evaluated on a circle just inside |ζ| = 1 it
//! becomes a product of Fourier transforms: N samples cost N log N instead of the N² of the defining sum.

use std::sync::Arc;

use host_fft::{ComplexToReal, Planner, RealToComplex};
use num_complex::Complex;
use springpot::{Discretisation, Maxwell};

/// A circle of points |ζ| = radius on which responses of a given length are computed.
///
/// The circle depends only on the number of samples and the step, so one serves any number of models.
pub struct FullMemory {
    samples: usize,
    /// Seconds per sample.
    step: f64,
    method: Discretisation,
    ln_radius: f64,
    /// Points of the whole circle.
    points: usize,
    /// ln s at the points of the upper half circle: ln((1 − ζ)/h), or with δ(ζ) of another method instead of 1 − ζ.
    ln_s: Vec<Complex<f64>>,
    /// Largest error that wrapping and rounding leave, relative to the largest response.
    rounding: f64,
    /// radius^k for every sample k.
    damping: Vec<f64>,
    forward: Arc<dyn RealToComplex<f64>>,
    backward: Arc<dyn ComplexToReal<f64>>,
}

impl FullMemory {
    /// A circle for `samples` samples at `step` seconds.
    ///
    /// The part that wraps around the end of the transform is damped by the radius, which in turn amplifies rounding; with four
    /// times as many points as samples both stay near 1e-12 of the largest response.
    pub fn new(samples: usize, step: f64) -> Self {
        Self::with_method(samples, step, Discretisation::Gl)
    }

    /// The same for another discretisation of s.
    pub fn with_method(samples: usize, step: f64, method: Discretisation) -> Self {
        Self::with_oversampling(samples, step, 4, method)
    }

    /// The same with `oversampling` times as many points as samples, at least 2.
    pub fn with_oversampling(samples: usize, step: f64, oversampling: usize, method: Discretisation) -> Self {
        let oversampling = oversampling.max(2);
        let points = smooth_length(samples.max(1) * oversampling);
        let ratio = points as f64 / samples.max(1) as f64;
        // Wrapped parts shrink by radius^points, rounding grows by radius^−samples: both equal.
        let ln_radius = f64::EPSILON.ln() * ratio / (ratio + 1.0) / points as f64;
        let ln_s = (0..=points / 2).map(|k| ln_s_at(k as f64 / points as f64, ln_radius, step, method)).collect();
        let mut planner = Planner::new();
        Self {
            samples,
            step,
            method,
            ln_radius,
            points,
            ln_s,
            rounding: (ln_radius * points as f64).exp(),
            damping: (0..samples).map(|k| (ln_radius * k as f64).exp()).collect(),
            forward: planner.forward(points),
            backward: planner.backward(points),
        }
    }

    /// Displacement (m) of `model` under `force` (N), one value per step from rest.
    pub fn displacement(&self, model: &Maxwell, force: &[f64]) -> Vec<f64> {
        self.displacement_from(&self.dynamic_stiffness(model), force)
    }

    /// The same from a [`dynamic_stiffness`](Self::dynamic_stiffness) that is already known.
    pub fn displacement_from(&self, stiffness: &[Complex<f64>], force: &[f64]) -> Vec<f64> {
        let mut spectrum = self.spectrum(force);
        spectrum.iter_mut().zip(stiffness).for_each(|(f, k)| *f /= k);
        self.series(spectrum, force.len())
    }

    /// Force (N) of `model` along `displacement` (m), one value per step from rest.
    pub fn force(&self, model: &Maxwell, displacement: &[f64]) -> Vec<f64> {
        let mut spectrum = self.spectrum(displacement);
        spectrum.iter_mut().zip(self.dynamic_stiffness(model)).for_each(|(x, k)| *x *= k);
        self.series(spectrum, displacement.len())
    }

    /// m s² + K(s) on the circle, N/m.
    pub fn dynamic_stiffness(&self, model: &Maxwell) -> Vec<Complex<f64>> {
        self.ln_s.iter().map(|&ln_s| (2.0 * ln_s).exp() * model.mass_kg() + model.modulus_of_ln(ln_s)).collect()
    }

    /// ln s at the points of the upper half circle, s = (1 − ζ)/h in 1/s.
    pub fn ln_s(&self) -> &[Complex<f64>] {
        &self.ln_s
    }

    /// The same between the points, at `place` counted in points from ζ = radius.
    pub fn ln_s_between(&self, place: f64) -> Complex<f64> {
        ln_s_at(place / self.points as f64, self.ln_radius, self.step, self.method)
    }

    /// Largest error that wrapping and rounding leave, relative to the largest response.
    pub fn rounding(&self) -> f64 {
        self.rounding
    }

    /// How s is discretised.
    pub fn method(&self) -> Discretisation {
        self.method
    }

    /// Samples the circle is for.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// The power series of `series` in ζ, at the points of the upper half circle.
    ///
    /// # Panics
    ///
    /// For more samples than the circle is for.
    pub fn spectrum(&self, series: &[f64]) -> Vec<Complex<f64>> {
        assert!(series.len() <= self.samples, "the circle is for {} samples", self.samples);
        host_fft::spectrum(&*self.forward, series.iter().zip(&self.damping).map(|(value, damping)| value * damping))
    }

    /// The first `samples` coefficients of a power series whose values on the circle are `spectrum`.
    ///
    /// # Panics
    ///
    /// For a spectrum of another circle.
    pub fn series(&self, spectrum: Vec<Complex<f64>>, samples: usize) -> Vec<f64> {
        let mut time = host_fft::samples(&*self.backward, spectrum);
        let scale = 1.0 / time.len() as f64;
        time.truncate(samples);
        for (value, damping) in time.iter_mut().zip(&self.damping) {
            *value *= scale / damping;
        }
        time
    }
}

/// ln s at `share` of the circle, without cancellation near ζ = 1.
fn ln_s_at(share: f64, ln_radius: f64, step: f64, method: Discretisation) -> Complex<f64> {
    let angle = -std::f64::consts::TAU * share;
    let (sin, cos) = angle.sin_cos();
    let grown = ln_radius.exp_m1();
    let half = (0.5 * angle).sin();
    let difference = Complex::new(-(grown * cos - 2.0 * half * half), -(grown + 1.0) * sin);
    // δ(ζ): with second-order backward differences (1 − ζ)(3 − ζ)/2.
    let delta = if method == Discretisation::Gl { difference } else { difference * (difference * 0.5 + 1.0) };
    let (size, phase) = delta.to_polar();
    Complex::new((size / step).ln(), phase)
}

/// The smallest even number ≥ `least` whose prime factors are 2, 3 and 5.
fn smooth_length(least: usize) -> usize {
    (least.max(2)..)
        .find(|&n| {
            let mut rest = n;
            for prime in [2, 3, 5] {
                while rest % prime == 0 {
                    rest /= prime;
                }
            }
            rest == 1 && n % 2 == 0
        })
        .expect("there is always a power of two above")
}
