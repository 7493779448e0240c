//! Films with a spring in series: their response, and how it changes.
//!
//! The displacement is y + e, the memory's and the spring's. A variable that changes y or e under the same force moves the film by u; with the rest
//! r of its change, the force f obeys
//!
//! ```text
//! r = y' + e' under f',      f' + m r̈ = F' + S (r + u) − m ü
//! ```
//!
//! with S the slope of the load and F' the change of the force: one [`Tangent`](super::tangent) for all variables.

use springpot::{Law, Load, Spring};

use super::super::candidate::{Candidate, Variable};
use super::super::transfer::{Nodes, Spectrum, Stepped, Transfer, pulls_in};
use super::product;
use crate::replay::full_memory::FullMemory;

/// Displacement and elongation (m) of a film under `loads`; none for pull-in.
pub(super) fn response(law: &Law<f64, Stepped>, loads: &[Load<f64>]) -> Option<[Vec<f64>; 2]> {
    if pulls_in(loads, law.min_stiffness()) {
        return None;
    }
    let mut state = law.state();
    let step = |&load: &Load<f64>| (law.displacement_under(&mut state, load), state.elongation());
    let (displacement, elongation) = loads.iter().map(step).unzip();
    Some([displacement, elongation])
}

/// A film with a spring in series near a candidate.
pub(super) struct Near<'a> {
    circle: &'a FullMemory,
    nodes: &'a Nodes,
    transfer: &'a Transfer,
    elongation: &'a [f64],
    /// S' at every step, N/m.
    pub(super) slopes: Vec<f64>,
    /// Spectrum of y.
    memory: Spectrum,
    /// The spring with less and with more of each variable.
    beside: [[Spring; 2]; 2],
}

/// Change of the spring's variables by which derivatives are taken.
const STEP: f64 = 1e-4;
const VARIABLES: [Variable; 2] = [Variable::SeriesStiffness, Variable::SeriesBend];

impl<'a> Near<'a> {
    pub(super) fn new(
        (circle, nodes): (&'a FullMemory, &'a Nodes),
        transfer: &'a Transfer,
        candidate: &Candidate,
        displacement: &[f64],
        elongation: &'a [f64],
    ) -> Option<Self> {
        let at = candidate.in_series().ok()??.evaluator();
        let beside = |variable: Variable, step: f64| {
            let mut beside = candidate.clone();
            variable.set(&mut beside, variable.get(candidate) + step);
            beside.in_series().ok()?
        };
        let pair = |variable| Some([beside(variable, -STEP)?, beside(variable, STEP)?]);
        let memory: Vec<f64> = displacement.iter().zip(elongation).map(|(x, e)| x - e).collect();
        Some(Self {
            circle,
            nodes,
            transfer,
            elongation,
            slopes: elongation.iter().map(|&e| at(e)[1]).collect(),
            memory: circle.spectrum(&memory),
            beside: [pair(VARIABLES[0])?, pair(VARIABLES[1])?],
        })
    }

    /// u (m) of `variable`; none for one that changes neither memory nor spring.
    pub(super) fn moved(&self, variable: Variable) -> Option<Vec<f64>> {
        if let Some(place) = VARIABLES.iter().position(|&of| of == variable) {
            let [less, more] = self.beside[place].each_ref().map(Spring::evaluator);
            let moved = |(&e, slope): (&f64, &f64)| (less(e)[0] - more(e)[0]) / (2.0 * STEP * slope);
            return Some(self.elongation.iter().zip(&self.slopes).map(moved).collect());
        }
        let (element, is_order) = match variable {
            Variable::Coefficient(element) => (element, false),
            Variable::Order(element) => (element, true),
            _ => return None,
        };
        let resisted = product(&self.memory, self.transfer.sensitivity(element, self.nodes));
        let mut moved: Spectrum = resisted.iter().zip(&self.transfer.kernel).map(|(force, k)| -force / k).collect();
        if is_order {
            moved = product(&moved, self.circle.ln_s());
        }
        Some(self.circle.series(moved, self.elongation.len()))
    }

    /// m ü (N) of `moved`.
    pub(super) fn inertia(&self, moved: &[f64]) -> Vec<f64> {
        self.circle.series(product(&self.circle.spectrum(moved), &self.transfer.inertia), moved.len())
    }
}
