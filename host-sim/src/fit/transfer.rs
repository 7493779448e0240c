//! A model in the frequency domain, with its derivatives, and what couples it to its own displacement.

use num_complex::Complex;
use rayon::prelude::*;
use springpot::{Compressed, Law, Load, Maxwell, Options, Springpot, Topology};

use crate::replay::full_memory::FullMemory;

/// The memory of the recursion that solves for coupled motion, nearly.
pub(super) type Solver = Compressed<f64, 8, 16, 0>;

/// Values at the points of a circle.
pub(super) type Spectrum = Vec<Complex<f64>>;

/// The dynamic compliance of a model on a circle.
pub(super) struct Transfer {
    /// 1/(m s² + K).
    pub(super) compliance: Spectrum,
    /// m s² + K.
    pub(super) stiffness: Spectrum,
    /// ∂K/∂ ln c of every element.
    pub(super) sensitivities: Vec<Spectrum>,
    /// Solves what coupling makes implicit, nearly.
    pub(super) law: Option<Law<f64, Solver>>,
}

impl Transfer {
    pub(super) fn new(model: &Maxwell, circle: &FullMemory, step_s: f64, coupled: bool) -> Option<Self> {
        const CHUNK: usize = 1024;
        let law = if coupled {
            let horizon_s = (circle.samples() as f64 * step_s).max(100.0 * step_s);
            // However coarse: passes through the compliance remove what the tail misses.
            let options = Options::at_step(step_s).with_horizon(horizon_s).with_tolerance(f64::MAX);
            Some(Law::<f64, Solver>::compressed(model, options).ok()?)
        } else {
            None
        };
        let elements: Vec<Springpot> =
            std::iter::once(model.main()).chain(model.branches().as_flattened().iter().copied()).collect();
        let chain_length = match model.topology() {
            Topology::Eq11 => (elements.len() - 1).max(1),
            Topology::Parallel => 2,
        };
        let chain_scale = match model.topology() {
            Topology::Eq11 => model.branches().len() as f64,
            Topology::Parallel => 1.0,
        };
        let pieces: Vec<(Spectrum, Vec<Spectrum>)> = circle
            .ln_s()
            .par_chunks(CHUNK)
            .map(|ln_s| {
                let power = |element: &Springpot, sign: f64| -> Spectrum {
                    let (alpha, factor) = (sign * element.alpha, element.c.powf(sign));
                    ln_s.iter()
                        .map(|z| {
                            let size = factor * (alpha * z.re).exp();
                            let (sin, cos) = (alpha * z.im).sin_cos();
                            Complex::new(size * cos, size * sin)
                        })
                        .collect()
                };
                let main = power(&elements[0], 1.0);
                let mut stiffness: Spectrum =
                    ln_s.iter().zip(&main).map(|(z, k)| (2.0 * z).exp() * model.mass_kg() + k).collect();
                let mut sensitivities = vec![main];
                for chain in elements[1..].chunks(chain_length) {
                    let compliances: Vec<Spectrum> = chain.iter().map(|e| power(e, -1.0)).collect();
                    // scale / Σ J, and its derivative scale J_i / (Σ J)²
                    let factors: Spectrum = (0..ln_s.len())
                        .map(|j| {
                            let inverse = compliances.iter().map(|c| c[j]).sum::<Complex<f64>>().inv();
                            stiffness[j] += inverse * chain_scale;
                            inverse * inverse * chain_scale
                        })
                        .collect();
                    for mut compliance in compliances {
                        compliance.iter_mut().zip(&factors).for_each(|(c, f)| *c *= f);
                        sensitivities.push(compliance);
                    }
                }
                (stiffness, sensitivities)
            })
            .collect();
        let points = circle.ln_s().len();
        let mut stiffness = Vec::with_capacity(points);
        let mut sensitivities: Vec<Spectrum> = elements.iter().map(|_| Vec::with_capacity(points)).collect();
        for (piece, of_elements) in pieces {
            stiffness.extend(piece);
            for (all, some) in sensitivities.iter_mut().zip(of_elements) {
                all.extend(some);
            }
        }
        let compliance: Spectrum = stiffness.iter().map(Complex::inv).collect();
        compliance.iter().all(|h| h.re.is_finite() && h.im.is_finite()).then_some(Self {
            compliance,
            stiffness,
            sensitivities,
            law,
        })
    }
}

/// Displacement under `force + pull V² x`, by the compressed recursion.
pub(super) fn recursion(law: &Law<f64, Solver>, squared: &[f64], pull: f64, force: &[f64]) -> Vec<f64> {
    let mut state = law.state();
    force
        .iter()
        .zip(squared)
        .map(|(&force, v2)| law.displacement_under(&mut state, Load { force, slope: pull * v2 }))
        .collect()
}

/// The same with full memory: the recursion, then passes through the compliance until nothing changes.
pub(super) fn coupled(
    circle: &FullMemory,
    transfer: &Transfer,
    law: &Law<f64, Solver>,
    squared: &[f64],
    pull: f64,
    force: &[f64],
) -> Option<Vec<f64>> {
    // Past this slope of the load the film is pulled in.
    let steepest = squared.iter().copied().fold(0.0, f64::max) * pull;
    if steepest >= 0.99 * law.stiffness() {
        return None;
    }
    let mut x = recursion(law, squared, pull, force);
    for _ in 0..50 {
        let total: Vec<f64> = force.iter().zip(squared).zip(&x).map(|((f, v2), x)| f + pull * v2 * x).collect();
        let better = circle.displacement_from(&transfer.stiffness, &total);
        let (mut change, mut size) = (0.0, 0.0);
        for (old, new) in x.iter().zip(&better) {
            change += (old - new) * (old - new);
            size += new * new;
        }
        x = better;
        if change <= 1e-16 * size || change.is_nan() {
            return x.iter().all(|x| x.is_finite()).then_some(x);
        }
    }
    None
}
