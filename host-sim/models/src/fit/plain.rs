//! Orders near 0 or 1 that the recordings do not distinguish from it: springs and dashpots.
//!
//! An order of 0.96 instead of 1 changes nothing in recordings of a few minutes, and the stroke after half an hour by a tenth: a film whose
//! memory ends is then predicted to creep on. Where data do not distinguish both, the model with fewer numbers is the better prediction.

use std::sync::atomic::Ordering;

use springpot::Springpot;

use super::candidate::Variable;
use super::descent::{Context, Found};
use super::objective::Objective;
use super::uncertainty::CHI_SQUARE;
use crate::least_squares::StoppingCriteria;

/// Largest distance of an order from the limit that is tried.
const NEAR: f64 = 0.15;

/// Largest rise of the cost, where residuals are so alike that chance would allow more.
const MAX_RISE: f64 = 0.01;

/// `found` with the orders of its branches at their limits, as many as the recordings do not distinguish from them: with all of these the cost is
/// within the 95 % interval of one.
pub(super) fn with_plain_orders(context: &Context<'_>, found: Found) -> Found {
    // The main springpot describes what goes on after all branches: its limit is a finding, not a default.
    let is_near = |&(element, springpot): &(usize, &Springpot)| {
        let variable = Variable::Order(element);
        (1e-9..NEAR).contains(&distance(springpot.alpha)) && found.variables.contains(&variable)
    };
    let branches = found.candidate.elements.iter().enumerate().skip(1);
    let mut near: Vec<(usize, f64)> = branches.filter(is_near).map(|(k, springpot)| (k, springpot.alpha)).collect();
    near.sort_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
    if near.is_empty() {
        return found;
    }
    // On the thinned recordings first: a search on all samples of long ones costs seconds.
    let coarse = StoppingCriteria { iterations: 12, decrease: 1e-7 };
    let thinned = context.descend_over(context.coarse, &found.candidate, found.variables.clone(), coarse);
    let Some(thinned) = thinned else { return found };
    while !near.is_empty() && !context.stop.load(Ordering::Relaxed) {
        let plain = plain(context, context.coarse, &thinned, &near, coarse);
        let start = plain.map(|plain| Found { candidate: plain.candidate, ..found.clone() });
        let fine = StoppingCriteria { iterations: 60, decrease: 1e-8 };
        let plain = start.and_then(|start| self::plain(context, context.fine, &start, &near, fine));
        if let Some(plain) = plain {
            return Found { candidate: plain.candidate, ..found };
        }
        near.pop();
    }
    found
}

/// The minimum of `objective` from `found` with the orders that are `near` at their limits, if its cost is not larger than that of `found` by more than chance.
fn plain(
    context: &Context<'_>,
    objective: &Objective,
    found: &Found,
    near: &[(usize, f64)],
    stopping: StoppingCriteria,
) -> Option<Found> {
    let mut start = found.candidate.clone();
    let mut variables = found.variables.clone();
    for &(element, alpha) in near {
        start.elements[element].alpha = alpha.round();
        variables.retain(|variable| *variable != Variable::Order(element));
    }
    let plain = context.descend_over(objective, &start, variables, stopping)?;
    let samples = objective.whiteness(&found.candidate)?.effective_samples;
    let freedom = (samples - found.variables.len() as f64).max(1.0);
    let rise = plain.minimum.cost / found.minimum.cost - 1.0;
    (rise <= (CHI_SQUARE / freedom).min(MAX_RISE)).then_some(plain)
}

/// Distance of an order from the nearer limit.
fn distance(alpha: f64) -> f64 {
    alpha.min(1.0 - alpha)
}
