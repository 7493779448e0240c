//! Fourier transforms of real signals in f64.
//!
//! `realfft` is generic over its numbers: each package that makes a plan would compile all of its transforms again, which is more
//! than half of that package's build. Plans are made here, and elsewhere only called.
#![forbid(unsafe_code)]

use std::sync::Arc;

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

pub use realfft::{ComplexToReal, RealToComplex};

/// Makes plans, and keeps them for the next transform of the same length.
#[derive(Default)]
pub struct Planner(RealFftPlanner<f64>);

impl Planner {
    /// A planner without plans.
    pub fn new() -> Self {
        Self(RealFftPlanner::new())
    }

    /// From `length` samples to the `length/2 + 1` values of the upper half circle, not scaled.
    pub fn forward(&mut self, length: usize) -> Arc<dyn RealToComplex<f64>> {
        self.0.plan_fft_forward(length)
    }

    /// Back from `length/2 + 1` values to `length` samples: `length` times what [`forward`](Self::forward) was given.
    pub fn backward(&mut self, length: usize) -> Arc<dyn ComplexToReal<f64>> {
        self.0.plan_fft_inverse(length)
    }
}

/// The upper half circle of `values`, with zeros behind them up to the length of `plan`.
///
/// # Panics
///
/// Never: all lengths are the plan's own.
pub fn spectrum(plan: &dyn RealToComplex<f64>, values: impl IntoIterator<Item = f64>) -> Vec<Complex<f64>> {
    let mut time = plan.make_input_vec();
    time.iter_mut().zip(values).for_each(|(slot, value)| *slot = value);
    let mut spectrum = plan.make_output_vec();
    plan.process(&mut time, &mut spectrum).expect("lengths are the plan's own");
    spectrum
}

/// Back from the upper half circle `spectrum` of a `plan` of an even length: the samples times their number.
///
/// # Panics
///
/// For a spectrum of another length.
pub fn samples(plan: &dyn ComplexToReal<f64>, mut spectrum: Vec<Complex<f64>>) -> Vec<f64> {
    // The first and the last point are real, up to rounding.
    spectrum[0].im = 0.0;
    if let Some(last) = spectrum.last_mut() {
        last.im = 0.0;
    }
    let mut time = plan.make_output_vec();
    plan.process(&mut spectrum, &mut time).expect("a spectrum of the plan's length");
    time
}
