//! Fourier transforms of real signals in f64.
//!
//! `realfft` is generic over its numbers: each package that makes a plan would compile all of its transforms again, which is more
//! than half of that package's build. Plans are made here, and elsewhere only called.
#![forbid(unsafe_code)]

use std::sync::Arc;

use realfft::RealFftPlanner;

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
