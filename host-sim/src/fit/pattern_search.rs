//! The paper's procedure: generalised pattern search, from the paper's start.
//!
//! As MATLAB's `patternsearch` does by default: the positive 2N basis, polled in order until a point is better; the mesh
//! doubles after a success and halves after a failure, and is scaled by the size of every variable at the start. Variables
//! are the paper's: c in N·s^α/mm and α, without coupling and offset.

use std::sync::atomic::{AtomicBool, Ordering};

use springpot::{Actuator, Springpot, Topology};

use super::candidate::Candidate;
use super::levenberg_marquardt::half_square;
use super::objective::Objective;

/// Coefficients in the paper's unit, N·s^α/mm.
const PER_MILLIMETRE: f64 = 1000.0;
/// Bounds of c in the paper's unit; orders are within 0…1.
const COEFFICIENTS: (f64, f64) = (1e-3, 1e6);

/// Where a pattern search ended.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The best candidate.
    pub candidate: Candidate,
    /// Half the sum of squared residuals.
    pub cost: f64,
    /// Residual evaluations.
    pub evaluations: usize,
    /// Whether the mesh became fine enough, as opposed to evaluations or polls running out.
    pub converged: bool,
}

/// When a pattern search ends.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Size of the mesh at which it ends.
    pub mesh: f64,
    /// Evaluations per variable at the most.
    pub evaluations_per_variable: usize,
    /// Polls per variable at the most.
    pub iterations_per_variable: usize,
}

impl Default for Limits {
    /// MATLAB's defaults.
    fn default() -> Self {
        Self { mesh: 1e-6, evaluations_per_variable: 2000, iterations_per_variable: 100 }
    }
}

/// The paper's start: c = 500 N·s^α/mm, α₁₁ = 0.2, all other orders 1.
pub fn paper_start(actuator: Actuator, topology: Topology, branches: usize) -> Candidate {
    let c = 500.0 * PER_MILLIMETRE;
    let mut elements = vec![Springpot::new(c, 0.2)];
    elements.resize(1 + 2 * branches, Springpot::new(c, 1.0));
    Candidate { actuator, elements, topology, offset_m: 0.0 }
}

/// Searches from `start`; `progress` hears of every evaluation.
pub fn search(
    objective: &Objective,
    start: &Candidate,
    limits: Limits,
    stop: &AtomicBool,
    progress: &dyn Fn(),
) -> Option<Outcome> {
    let mut place: Vec<f64> = start.elements.iter().flat_map(|e| [e.c / PER_MILLIMETRE, e.alpha]).collect();
    let candidate = |place: &[f64]| {
        let (pairs, _) = place.as_chunks::<2>();
        let elements = pairs.iter().map(|[c, alpha]| Springpot::new(c * PER_MILLIMETRE, *alpha)).collect();
        Candidate { elements, ..start.clone() }
    };
    let cost_of = |place: &[f64]| {
        progress();
        let evaluation = objective.evaluate(&candidate(place))?;
        Some(half_square(&objective.residuals(&evaluation))).filter(|cost| cost.is_finite())
    };
    // Powers of two near the variables' size, as ScaleMesh does.
    let scale: Vec<f64> = place.iter().map(|x| x.abs().max(f64::MIN_POSITIVE).log2().round().exp2()).collect();
    let bounds = |i: usize| if i.is_multiple_of(2) { COEFFICIENTS } else { (0.0, 1.0) };

    let mut cost = cost_of(&place)?;
    let (mut mesh, mut evaluations) = (1.0, 1);
    let most = limits.evaluations_per_variable * place.len();
    let mut iterations = limits.iterations_per_variable * place.len();
    let mut converged = false;
    while evaluations < most && iterations > 0 && !stop.load(Ordering::Relaxed) {
        if mesh < limits.mesh {
            converged = true;
            break;
        }
        iterations -= 1;
        let mut success = false;
        'poll: for sign in [1.0, -1.0] {
            for i in 0..place.len() {
                let (low, high) = bounds(i);
                let moved = (place[i] + sign * mesh * scale[i]).clamp(low, high);
                if moved == place[i] {
                    continue;
                }
                let before = std::mem::replace(&mut place[i], moved);
                evaluations += 1;
                match cost_of(&place) {
                    Some(better) if better < cost => {
                        cost = better;
                        success = true;
                        break 'poll;
                    }
                    _ => place[i] = before,
                }
            }
        }
        mesh *= if success { 2.0 } else { 0.5 };
    }
    Some(Outcome { candidate: candidate(&place), cost, evaluations, converged })
}
