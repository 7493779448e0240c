//! Displacement under a force that depends on the displacement, with full memory.
//!
//! With coupling the force of Eq. 1 grows with the displacement, so that `x = H (F + S x)` is implicit: H is the compliance
//! of Eq. 11, F the force at x = 0 and S its slope. A fixed-point iteration solves it.

use num_complex::Complex;
use springpot::Load;

use super::full_memory::FullMemory;

/// Passes after which a solution is given up; a stable film gains about a digit per pass.
const MAX_PASSES: usize = 200;

/// There is no equilibrium: the force grows faster with displacement than the film resists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PullIn;

/// The displacement (m) under `loads`, one per step, by passes through the full-memory response of `stiffness` (m s² + K(s)
/// on the circle, N/m), from the estimate `start` (m).
///
/// It has converged when a pass changes it by at most `tolerance` (RMS, relative), which cannot be below
/// [`FullMemory::rounding`].
///
/// # Errors
///
/// [`PullIn`] where the passes do not converge.
pub fn coupled_displacement(
    circle: &FullMemory,
    stiffness: &[Complex<f64>],
    loads: &[Load<f64>],
    start: Vec<f64>,
    tolerance: f64,
) -> Result<Vec<f64>, PullIn> {
    let implicit = loads.iter().any(|load| load.slope_n_per_m != 0.0);
    let mut displacement = start;
    for _ in 0..MAX_PASSES {
        let force: Vec<f64> =
            loads.iter().zip(&displacement).map(|(load, x)| load.force_n + load.slope_n_per_m * x).collect();
        let next = circle.displacement_from(stiffness, &force);
        let [change, size] = squares(&displacement, &next);
        displacement = next;
        if !implicit {
            return Ok(displacement);
        }
        if !size.is_finite() {
            return Err(PullIn);
        }
        if change <= tolerance * tolerance * size {
            return Ok(displacement);
        }
    }
    Err(PullIn)
}

/// Sums of the squares of the change from `before` to `after`, and of `after`.
pub(super) fn squares(before: &[f64], after: &[f64]) -> [f64; 2] {
    let add = |[change, size]: [f64; 2], (before, after): (&f64, &f64)| {
        [change + (before - after) * (before - after), size + after * after]
    };
    before.iter().zip(after).fold([0.0; 2], add)
}
