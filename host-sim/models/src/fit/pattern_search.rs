//! The paper's procedure: generalised pattern search, from the paper's start.
//!
//! It follows the defaults of MATLAB's `patternsearch`: the positive basis of 2N directions is polled in order until a point
//! is better; the mesh doubles after a success and halves after a failure, and is scaled by the size of every variable at the
//! start. Variables are the paper's: c in N·s^α/mm and α, without coupling and offset.

use std::sync::atomic::{AtomicBool, Ordering};

use host_io::choice::Choice;
use springpot::{Actuator, Springpot, Topology};

use super::candidate::{Candidate, Variable};
use super::descent::{Context, Found};
use super::objective::Objective;
use super::settings::Settings;
use super::settings::Stages;
use crate::error::{Error, Result};
use crate::least_squares::{Minimum, half_square};

/// Coefficients in the paper's unit, N·s^α/mm.
const PER_MILLIMETRE: f64 = 1000.0;
/// Bounds of c in the paper's unit.
const COEFFICIENTS: (f64, f64) = (1e-3, 1e6);
/// Bounds of α.
const ORDERS: (f64, f64) = (0.0, 1.0);
/// Size of the mesh at which a search has converged.
const FINEST_MESH: f64 = 1e-6;
/// Most evaluations per variable.
const EVALUATIONS: usize = 2000;
/// Most polls per variable.
const POLLS: usize = 100;

/// Result of a pattern search.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The best candidate.
    pub candidate: Candidate,
    /// Half the sum of squared residuals.
    pub cost: f64,
    /// Whether the mesh became fine enough; false if evaluations or polls ran out.
    pub converged: bool,
}

/// The paper's start: c = 500 N·s^α/mm, α₁₁ = 0.2, all other orders 1.
pub fn paper_start(actuator: Actuator, topology: Topology, branches: usize) -> Candidate {
    let c = 500.0 * PER_MILLIMETRE;
    let mut elements = vec![Springpot::new(c, 0.2)];
    elements.resize(1 + 2 * branches, Springpot::new(c, 1.0));
    Candidate::linear(actuator, elements, topology)
}

/// Searches from `start`, calling `on_evaluation` before every evaluation; none where `start` has no response.
pub fn search(
    objective: &Objective,
    start: &Candidate,
    stop: &AtomicBool,
    on_evaluation: &dyn Fn(),
) -> Option<Outcome> {
    let values: Vec<f64> = start.elements.iter().flat_map(|e| [e.c / PER_MILLIMETRE, e.alpha]).collect();
    // Powers of two near the variables' size, as ScaleMesh does.
    let scale = values.iter().map(|x| x.abs().max(f64::MIN_POSITIVE).log2().round().exp2()).collect();
    let mut poll = Poll { objective, start, on_evaluation, values, scale, cost: f64::INFINITY, evaluations: 0 };
    poll.cost = poll.cost_here()?;
    let most_evaluations = EVALUATIONS * poll.values.len();
    let mut polls = POLLS * poll.values.len();
    let mut mesh = 1.0;
    let mut converged = false;
    while poll.evaluations < most_evaluations && polls > 0 && !stop.load(Ordering::Relaxed) {
        if mesh < FINEST_MESH {
            converged = true;
            break;
        }
        polls -= 1;
        mesh *= if poll.improves(mesh) { 2.0 } else { 0.5 };
    }
    Some(Outcome { candidate: poll.candidate(), cost: poll.cost, converged })
}

/// The best structure of the settings by the sum of squares, as the paper selects it.
pub fn best_structure(context: &Context<'_>, settings: &Settings, stages: &Stages<'_>) -> Result<Found> {
    let mut best: Option<Outcome> = None;
    for &topology in &settings.topologies {
        for &branches in &settings.branches {
            stages.begin(format!("pattern search, {} with n = {branches}", topology.name()), branches);
            let start = settings.start.clone().unwrap_or_else(|| paper_start(settings.actuator, topology, branches));
            let start = Candidate { delay_s: context.delay_s, ..start };
            let count = || {
                context.evaluations.fetch_add(1, Ordering::Relaxed);
            };
            let outcome = search(context.fine, &start, context.stop, &count);
            best = best.into_iter().chain(outcome).reduce(|a, b| if b.cost < a.cost { b } else { a });
        }
    }
    let Outcome { candidate, cost, converged } =
        best.ok_or_else(|| Error::Computation("pattern search has no response at its start".into()))?;
    let variables = Variable::of_model(candidate.branches());
    // Without derivatives there is no Jᵀ J.
    let values = variables.iter().map(|variable| variable.get(&candidate)).collect();
    let minimum = Minimum {
        values,
        cost,
        normal: nalgebra::DMatrix::zeros(0, 0),
        gradient: nalgebra::DVector::zeros(0),
        converged,
    };
    Ok(Found { candidate, variables, minimum })
}

struct Poll<'a> {
    objective: &'a Objective,
    start: &'a Candidate,
    on_evaluation: &'a dyn Fn(),
    values: Vec<f64>,
    scale: Vec<f64>,
    cost: f64,
    evaluations: usize,
}

impl Poll<'_> {
    fn candidate(&self) -> Candidate {
        let (pairs, _) = self.values.as_chunks::<2>();
        let elements = pairs.iter().map(|[c, alpha]| Springpot::new(c * PER_MILLIMETRE, *alpha)).collect();
        Candidate { elements, ..self.start.clone() }
    }

    fn cost_here(&mut self) -> Option<f64> {
        (self.on_evaluation)();
        self.evaluations += 1;
        let evaluation = self.objective.evaluate(&self.candidate())?;
        Some(half_square(&self.objective.residuals(&evaluation))).filter(|cost| cost.is_finite())
    }

    /// Moves to the first point of the mesh around this one that is better, if there is one.
    fn improves(&mut self, mesh: f64) -> bool {
        for sign in [1.0, -1.0] {
            for i in 0..self.values.len() {
                let (low, high) = if i.is_multiple_of(2) { COEFFICIENTS } else { ORDERS };
                let moved = (self.values[i] + sign * mesh * self.scale[i]).clamp(low, high);
                if moved == self.values[i] {
                    continue;
                }
                let before = std::mem::replace(&mut self.values[i], moved);
                match self.cost_here() {
                    Some(cost) if cost < self.cost => {
                        self.cost = cost;
                        return true;
                    }
                    _ => self.values[i] = before,
                }
            }
        }
        false
    }
}
