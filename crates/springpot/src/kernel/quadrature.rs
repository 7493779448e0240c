//! Gauss quadrature of a measure of many positive point masses, without storing them.
//!
//! Point masses are added one at a time; only the first rows of the measure's Jacobi matrix are kept (the rotations of
//! Gragg and Harrod, "RKPW": W. B. Gragg, W. J. Harrod, "The numerically stable reconstruction of Jacobi matrices
//! from spectral data", Numer. Math. 44 (1984) 317). Its eigenvalues are the nodes of the Gauss rule and the squared
//! first components of its eigenvectors the weights, which are therefore positive whatever the measure.

use heapless::Vec;

/// Nodes a rule can have.
pub(crate) const MAX_NODES: usize = 64;

/// The first rows of the Jacobi matrix of a measure.
pub(crate) struct JacobiMatrix {
    diagonal: [f64; MAX_NODES],
    /// Total mass, then the squared off-diagonal.
    squared: [f64; MAX_NODES],
    rows: usize,
    /// Rows in use: point masses so far, at most `rows`.
    filled: usize,
}

impl JacobiMatrix {
    /// The matrix of the zero measure, of which the first `rows` rows will be kept.
    pub(crate) fn new(rows: usize) -> Self {
        Self { diagonal: [0.0; MAX_NODES], squared: [0.0; MAX_NODES], rows: rows.min(MAX_NODES), filled: 0 }
    }

    /// Adds a point mass `mass` > 0 at `place`.
    pub(crate) fn add(&mut self, place: f64, mass: f64) {
        if !(mass > 0.0 && mass.is_finite()) {
            return;
        }
        if self.filled < self.rows {
            self.diagonal[self.filled] = place;
            self.filled += 1;
        }
        let (mut pushed, mut cosine, mut sine, mut shift) = (mass, 1.0, 0.0, 0.0);
        let rows = self.diagonal.iter_mut().zip(&mut self.squared).take(self.filled);
        for (diagonal, squared) in rows {
            let rho = *squared + pushed;
            let kept = cosine * rho;
            let sine_before = sine;
            if rho <= 0.0 {
                (cosine, sine) = (1.0, 0.0);
            } else {
                (cosine, sine) = (*squared / rho, pushed / rho);
            }
            let moved = sine * (*diagonal - place) - cosine * shift;
            *diagonal -= moved - shift;
            shift = moved;
            pushed = if sine <= 0.0 { sine_before * *squared } else { shift * shift / sine };
            *squared = kept;
        }
    }

    /// The nodes and weights of the Gauss rule.
    pub(crate) fn rule(&self) -> Vec<(f64, f64), MAX_NODES> {
        let n = self.filled;
        let mut diagonal = self.diagonal;
        let mut off = [0.0; MAX_NODES];
        for (off, squared) in off.iter_mut().zip(&self.squared[1..]).take(n.saturating_sub(1)) {
            *off = libm::sqrt(squared.max(0.0));
        }
        let mut first = [0.0; MAX_NODES];
        first[0] = 1.0;
        diagonalise(&mut diagonal, &mut off, &mut first, n);
        let weights = first.map(|component| component * component * self.squared[0]);
        diagonal.into_iter().zip(weights).take(n).collect()
    }
}

/// Implicit QL iteration on a symmetric tridiagonal matrix, carrying the first components of its eigenvectors
/// (G. H. Golub, J. H. Welsch, "Calculation of Gauss quadrature rules", Math. Comp. 23 (1969) 221).
fn diagonalise(diagonal: &mut [f64; MAX_NODES], off: &mut [f64; MAX_NODES], first: &mut [f64; MAX_NODES], n: usize) {
    const SWEEPS: usize = 60;
    for start in 0..n {
        for _ in 0..SWEEPS {
            let end = (start..n - 1)
                .find(|&i| off[i].abs() <= f64::EPSILON * (diagonal[i].abs() + diagonal[i + 1].abs()))
                .unwrap_or(n - 1);
            if end == start {
                break;
            }
            let half = (diagonal[start + 1] - diagonal[start]) / (2.0 * off[start]);
            let root = libm::hypot(half, 1.0);
            let mut shifted =
                diagonal[end] - diagonal[start] + off[start] / (half + if half < 0.0 { -root } else { root });
            let (mut sine, mut cosine, mut moved) = (1.0, 1.0, 0.0);
            let mut deflated = false;
            for i in (start..end).rev() {
                let (f, b) = (sine * off[i], cosine * off[i]);
                let length = libm::hypot(f, shifted);
                off[i + 1] = length;
                if length == 0.0 {
                    diagonal[i + 1] -= moved;
                    off[end] = 0.0;
                    deflated = true;
                    break;
                }
                (sine, cosine) = (f / length, shifted / length);
                let base = diagonal[i + 1] - moved;
                let turned = (diagonal[i] - base) * sine + 2.0 * cosine * b;
                moved = sine * turned;
                diagonal[i + 1] = base + moved;
                shifted = cosine * turned - b;
                (first[i], first[i + 1]) =
                    (cosine * first[i] - sine * first[i + 1], sine * first[i] + cosine * first[i + 1]);
            }
            if !deflated {
                diagonal[start] -= moved;
                off[start] = shifted;
                off[end] = 0.0;
            }
        }
    }
}
