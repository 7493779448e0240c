//! Where on a circle a model is evaluated: at all points of a small circle, at some of a large one.
//!
//! The dynamic stiffness is a smooth function of the logarithm of the frequency. On a circle of hundreds of thousands of points
//! most of them can be interpolated between nodes that are even in that logarithm.

use num_complex::Complex;

use crate::replay::full_memory::FullMemory;

/// Points from ζ = radius on that are evaluated themselves: there the circle's radius shows.
const DENSE: usize = 256;

/// Nodes per unit of the logarithm. The error of cubic interpolation, 3/128 of the fourth power of a node's distance times the
/// fourth derivative, stays below 1e-10 of the dynamic stiffness.
const PER_UNIT: f64 = 512.0;

/// The nodes of a circle.
pub(super) struct Nodes {
    ln_s: Vec<Complex<f64>>,
    /// For every point behind the dense ones: the node before it, and the share of the distance to the next.
    places: Vec<(u32, f64)>,
}

impl Nodes {
    /// The nodes of `circle`.
    pub(super) fn new(circle: &FullMemory) -> Self {
        let points = circle.ln_s().len();
        let reach = (points.max(DENSE) as f64 / DENSE as f64).ln() * PER_UNIT;
        if 2.0 * reach + DENSE as f64 > points as f64 {
            return Self { ln_s: circle.ln_s().to_vec(), places: Vec::new() };
        }
        // One node before the first interpolated point, and two behind the last.
        let node = |k: usize| circle.ln_s_between(DENSE as f64 * ((k as f64 - 1.0) / PER_UNIT).exp());
        let ln_s = circle.ln_s()[..DENSE].iter().copied().chain((0..reach as usize + 4).map(node)).collect();
        let place = |point: usize| {
            let distance = (point as f64 / DENSE as f64).ln() * PER_UNIT;
            (distance as u32, distance.fract())
        };
        Self { ln_s, places: (DENSE..points).map(place).collect() }
    }

    /// ln s at the nodes.
    pub(super) fn ln_s(&self) -> &[Complex<f64>] {
        &self.ln_s
    }

    /// The values at all points from those at the nodes.
    pub(super) fn spread(&self, values: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
        if self.places.is_empty() {
            return values;
        }
        let (dense, nodes) = values.split_at(DENSE);
        let mut all = Vec::with_capacity(DENSE + self.places.len());
        all.extend_from_slice(dense);
        all.extend(self.places.iter().map(|&(node, u)| {
            // Lagrange's cubic through the nodes at −1, 0, 1 and 2.
            let (below, above) = (u + 1.0, u - 1.0);
            let further = u - 2.0;
            let four = &nodes[node as usize..][..4];
            four[0] * (-u * above * further / 6.0)
                + four[1] * (below * above * further / 2.0)
                + four[2] * (-below * u * further / 2.0)
                + four[3] * (below * u * above / 6.0)
        }));
        all
    }
}
