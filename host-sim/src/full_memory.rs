//! The exact full-memory Grünwald–Letnikov answer, by FFT.
//!
//! A response with full memory is a product of power series in the delay ζ. Evaluated on a circle just inside |ζ| = 1 it
//! becomes a product of Fourier transforms: N samples cost N log N instead of the N² of the defining sum.

use std::sync::Arc;

use num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use springpot::Maxwell;

/// A circle of points |ζ| = radius on which responses of a given length are computed.
///
/// The circle depends only on the number of samples and the step, so one serves any number of models.
pub struct FullMemory {
    samples: usize,
    /// ln((1 − ζ)/h) at the points of the upper half circle.
    ln_s: Vec<Complex<f64>>,
    ln_radius: f64,
    forward: Arc<dyn RealToComplex<f64>>,
    backward: Arc<dyn ComplexToReal<f64>>,
}

impl FullMemory {
    /// A circle for `samples` samples at `step` seconds.
    ///
    /// What wraps around the end of the transform is damped by the radius, which in turn amplifies rounding; with four
    /// times as many points as samples both stay near 1e-12 of the largest response.
    pub fn new(samples: usize, step: f64) -> Self {
        Self::with_oversampling(samples, step, 4)
    }

    /// The same with `oversampling` times as many points as samples, 2 at the least.
    pub fn with_oversampling(samples: usize, step: f64, oversampling: usize) -> Self {
        let oversampling = oversampling.max(2);
        let points = smooth_length(samples.max(1) * oversampling);
        let ratio = points as f64 / samples.max(1) as f64;
        // Wrapped parts shrink by radius^points, rounding grows by radius^−samples: both equal.
        let ln_radius = f64::EPSILON.ln() * ratio / (ratio + 1.0) / points as f64;
        let ln_s = (0..=points / 2)
            .map(|k| {
                let angle = -std::f64::consts::TAU * k as f64 / points as f64;
                // 1 − ζ without cancellation near ζ = 1.
                let (sin, cos) = angle.sin_cos();
                let grown = ln_radius.exp_m1();
                let half = (0.5 * angle).sin();
                let difference = Complex::new(-(grown * cos - 2.0 * half * half), -(grown + 1.0) * sin);
                let (size, phase) = difference.to_polar();
                Complex::new((size / step).ln(), phase)
            })
            .collect();
        let mut planner = RealFftPlanner::new();
        Self {
            samples,
            ln_s,
            ln_radius,
            forward: planner.plan_fft_forward(points),
            backward: planner.plan_fft_inverse(points),
        }
    }

    /// Displacement (m) of `model` under `force` (N), one value per step from rest.
    pub fn displacement(&self, model: &Maxwell, force: &[f64]) -> Vec<f64> {
        self.displacement_from(&self.dynamic_stiffness(model), force)
    }

    /// The same from a [`dynamic_stiffness`](Self::dynamic_stiffness) that is already known.
    pub fn displacement_from(&self, stiffness: &[Complex<f64>], force: &[f64]) -> Vec<f64> {
        self.filter(force, |k, f| f / stiffness[k])
    }

    /// Force (N) of `model` along `displacement` (m), one value per step from rest.
    pub fn force(&self, model: &Maxwell, displacement: &[f64]) -> Vec<f64> {
        let stiffness = self.dynamic_stiffness(model);
        self.filter(displacement, |k, x| x * stiffness[k])
    }

    /// m s² + K(s) on the circle, N/m.
    pub fn dynamic_stiffness(&self, model: &Maxwell) -> Vec<Complex<f64>> {
        self.ln_s.iter().map(|&ln_s| (2.0 * ln_s).exp() * model.mass_kg() + model.modulus_of_ln(ln_s)).collect()
    }

    /// Multiplies the transform of `input` by a response on the circle.
    fn filter(&self, input: &[f64], response: impl Fn(usize, Complex<f64>) -> Complex<f64>) -> Vec<f64> {
        assert!(input.len() <= self.samples, "the circle is for {} samples", self.samples);
        let mut time = self.forward.make_input_vec();
        for (k, (slot, &value)) in time.iter_mut().zip(input).enumerate() {
            *slot = value * (self.ln_radius * k as f64).exp();
        }
        let mut spectrum = self.forward.make_output_vec();
        self.forward.process(&mut time, &mut spectrum).expect("lengths are the plan's own");
        for (k, value) in spectrum.iter_mut().enumerate() {
            *value = response(k, *value);
        }
        // The last point of an even transform is real, up to rounding.
        spectrum[0].im = 0.0;
        if let Some(last) = spectrum.last_mut() {
            last.im = 0.0;
        }
        self.backward.process(&mut spectrum, &mut time).expect("lengths are the plan's own");
        let scale = 1.0 / time.len() as f64;
        time.truncate(input.len());
        for (k, value) in time.iter_mut().enumerate() {
            *value *= scale * (-self.ln_radius * k as f64).exp();
        }
        time
    }
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
