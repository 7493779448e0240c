//! Uncertainty of the fitted parameters: confidence intervals, and what the recordings do not determine.

use std::sync::atomic::Ordering;

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;

use super::candidate::{Candidate, Variable};
use super::delay;
use super::descent::{Context, Found};
use super::residuals::Whiteness;
use crate::least_squares::{StoppingCriteria, inverse, unit_diagonal};

/// Uncertainty of a fit.
#[derive(Clone, Debug, Serialize)]
pub struct Uncertainty {
    /// One estimate per fitted variable.
    pub estimates: Vec<Estimate>,
    /// Reason for missing intervals.
    pub no_intervals: Option<&'static str>,
    /// Rank of the Jacobian, columns scaled to unit length.
    pub rank: usize,
    /// Sets of variables that the data do not determine, by their names.
    pub undetermined: Vec<String>,
    /// Whether the residuals are white: no autocorrelation beyond chance at the first 20 lags.
    pub white: bool,
    /// Autocorrelation of the residuals at lag one.
    pub lag_one: f64,
    /// Number of independent samples among the residuals.
    pub effective_samples: f64,
}

/// A fitted value with its uncertainty.
#[derive(Clone, Debug, Serialize)]
pub struct Estimate {
    /// Name as in a parameter file.
    pub name: String,
    /// Value in SI units.
    pub value: f64,
    /// Lower end of the 95 % interval from the profile likelihood; null where the data set none.
    pub low: Option<f64>,
    /// Upper end, likewise.
    pub high: Option<f64>,
    /// Ends of the 95 % interval from the covariance, where there is one.
    pub linear: Option<(f64, f64)>,
    /// Whether the value is on a bound.
    pub at_bound: bool,
}

/// Singular values below this fraction of the largest count as zero: a change of the variables by one standard size then
/// changes the response by less than 1e-5 of what others do.
const RANK: f64 = 1e-5;
/// Quantiles of χ² with one degree of freedom and of the normal distribution at 95 %.
pub(crate) const CHI_SQUARE: f64 = 3.841;
pub(crate) const NORMAL: f64 = 1.96;

impl Uncertainty {
    /// The uncertainty of `found` on all samples, with profiles on the thinned recordings; none where `found` has no
    /// response.
    pub fn from_fit(context: &Context<'_>, found: &Found) -> Option<Self> {
        let objective = context.fine;
        let Whiteness { white, lag_one, effective_samples } = objective.whiteness(&found.candidate)?;

        let at_bound: Vec<bool> = found.variables.iter().map(|variable| is_at_bound(*variable, found)).collect();
        let inside: Vec<usize> = (0..at_bound.len()).filter(|&i| !at_bound[i]).collect();
        let (rank, undetermined) = undetermined(&found.minimum.normal, &inside);
        let followers = Followers::new(&found.minimum.normal, inside.clone());

        let freedom = (effective_samples - inside.len() as f64).max(1.0);
        // Only independent samples count.
        let variance = 2.0 * found.minimum.cost / objective.samples() as f64 * (objective.samples() as f64 / freedom);
        let is_open = |i: usize| undetermined.iter().any(|set| set.contains(&i));
        let errors: Vec<Option<f64>> = (0..at_bound.len())
            .map(|i| Some((variance * followers.variance(i).filter(|_| !is_open(i))?).sqrt()))
            .collect();
        // On a bound: the deviation of the variable if all others were fixed.
        let alone = |i: usize| (variance / found.minimum.normal[(i, i)].max(f64::MIN_POSITIVE)).sqrt();
        let deviation = |i: usize| if is_open(i) { None } else { Some(errors[i].unwrap_or_else(|| alone(i))) };
        let deviations: Vec<Option<f64>> = (0..errors.len()).map(deviation).collect();
        let no_intervals = (!found.minimum.converged).then_some("the search ran out of iterations");
        let ends = match no_intervals {
            None => profiles(context, found, &deviations, freedom),
            Some(_) => vec![(None, None); errors.len()],
        };
        let estimate = |(i, ends): (usize, Ends)| {
            let known = no_intervals.is_none();
            Estimate::new(found, found.variables[i], known.then_some(ends), errors[i].filter(|_| known), at_bound[i])
        };
        // A drive that was fitted as one without saturation has none to state.
        let estimates = ends.into_iter().enumerate().map(estimate).filter(|estimate| estimate.value.is_finite());
        let estimates = estimates.collect();
        let names = |set: &Vec<usize>| {
            set.iter().map(|&i| found.variables[i].to_string()).collect::<Vec<String>>().join(" with ")
        };
        let undetermined = undetermined.iter().map(names).collect();
        Some(Self { estimates, no_intervals, rank, undetermined, white, lag_one, effective_samples })
    }

    /// States the values of `found`, which the recordings do not distinguish from those of the minimum: intervals reach them.
    pub(super) fn state(&mut self, found: &Found) {
        for variable in &found.variables {
            let name = variable.to_string();
            let Some(estimate) = self.estimates.iter_mut().find(|estimate| estimate.name == name) else { continue };
            let value = variable.natural(&found.candidate);
            estimate.value = value;
            estimate.low = estimate.low.map(|low| low.min(value));
            estimate.high = estimate.high.map(|high| high.max(value));
            estimate.at_bound = is_at_bound(*variable, found);
        }
        // As above.
        self.estimates.retain(|estimate| estimate.value.is_finite());
    }
}

impl Estimate {
    /// The estimate of `variable` with the ends of its profile, if there is one, and its standard deviation, both as the fit varies it.
    fn new(found: &Found, variable: Variable, profile: Option<Ends>, deviation: Option<f64>, at_bound: bool) -> Self {
        let natural = |value: f64| {
            let mut candidate = found.candidate.clone();
            variable.set(&mut candidate, value);
            variable.natural(&candidate)
        };
        let value = variable.get(&found.candidate);
        // Orders are from 0 to 1 by definition.
        let bound = |end: f64| (profile.is_some() && matches!(variable, Variable::Order(_))).then_some(end);
        let (low, high) = profile.unwrap_or((None, None));
        Self {
            name: variable.to_string(),
            value: natural(value),
            low: low.map(natural).or(bound(0.0)),
            high: high.map(natural).or(bound(1.0)),
            linear: deviation.map(|e| (natural(value - NORMAL * e), natural(value + NORMAL * e))),
            at_bound,
        }
    }
}

/// `found` after further searches on all samples, until it is near its minimum or they lead nowhere.
pub(super) fn at_minimum(context: &Context<'_>, mut found: Found) -> Found {
    const SEARCHES: usize = 6;
    /// Squares of standard deviations that may be left at a minimum, and where a search that has converged can take no smaller step.
    const CLOSE: f64 = 0.05;
    const CONVERGED: f64 = 1.0;
    /// Share of what was left to which a search must come for another one.
    const LEADS: f64 = 0.5;
    let further = StoppingCriteria { iterations: 60, decrease: 1e-9 };
    let mut before = f64::INFINITY;
    for _ in 0..SEARCHES {
        let left = left(context, &found);
        found.minimum.converged = left <= if found.minimum.converged { CONVERGED } else { CLOSE };
        if found.minimum.converged || left > LEADS * before || context.stop.load(Ordering::Relaxed) {
            break;
        }
        before = left;
        match context.descend_over(context.fine, &found.candidate, found.variables.clone(), further) {
            Some(next) if next.minimum.cost < found.minimum.cost => found = next,
            _ => break,
        }
    }
    found
}

/// The step to its minimum that is left of the search that ended with `found`, in squares of standard deviations.
fn left(context: &Context<'_>, found: &Found) -> f64 {
    let Some(whiteness) = context.fine.whiteness(&found.candidate) else { return f64::INFINITY };
    let inside: Vec<usize> = (0..found.variables.len()).filter(|&i| !is_at_bound(found.variables[i], found)).collect();
    found.minimum.left(&inside, RANK) * whiteness.effective_samples
}

fn is_at_bound(variable: Variable, found: &Found) -> bool {
    let value = variable.get(&found.candidate);
    let (low, high) = variable.bounds();
    (value - low).abs() < 1e-9 || (high - value).abs() < 1e-9
}

/// `matrix` with 0 for what is not a number or overflows.
fn finite(matrix: DMatrix<f64>) -> DMatrix<f64> {
    matrix.map(|value| if value.is_finite() { value } else { 0.0 })
}

/// The rank of `normal` over the variables `inside`, and the variables of each direction that the data do not determine.
fn undetermined(normal: &DMatrix<f64>, inside: &[usize]) -> (usize, Vec<Vec<usize>>) {
    if inside.is_empty() {
        return (0, Vec::new());
    }
    let eigen = finite(unit_diagonal(normal, inside).0).symmetric_eigen();
    // Eigenvalues are squares of singular values.
    let largest = eigen.eigenvalues.max().max(f64::MIN_POSITIVE);
    let mut sets = Vec::new();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value <= RANK * RANK * largest {
            let strongest = vector.amax();
            sets.push((0..inside.len()).filter(|&i| vector[i].abs() > 0.2 * strongest).map(|i| inside[i]).collect());
        }
    }
    (inside.len() - sets.len(), sets)
}

/// Ends of an interval, where the data set them.
type Ends = (Option<f64>, Option<f64>);

/// Values at which the cost, minimised over all other variables, exceeds its minimum by the 95 % quantile; `deviations` are
/// first estimates of the variables' standard deviations, none for what the data do not determine. Where the data leave directions open, the others do
/// not follow to the minimum in a step: no interval is narrower than by its deviation.
fn profiles(context: &Context<'_>, found: &Found, deviations: &[Option<f64>], freedom: f64) -> Vec<Ends> {
    let none = || vec![(None, None); found.variables.len()];
    if context.stop.load(Ordering::Relaxed) {
        return none();
    }
    // The minimum on the thinned recordings is slightly different.
    let stopping = StoppingCriteria { iterations: 12, decrease: 1e-7 };
    let variables = found.variables.clone();
    let Some(base) = context.descend_over(context.coarse, &found.candidate, variables, stopping) else { return none() };
    let threshold = base.minimum.cost * (1.0 + CHI_SQUARE / freedom);
    let inside = (0..base.variables.len()).filter(|&i| !is_at_bound(base.variables[i], &base)).collect();
    let followers = Followers::new(&base.minimum.normal, inside);
    (0..found.variables.len())
        .into_par_iter()
        .map(|i| {
            // Distances carry over to the minimum on all samples.
            let variable = found.variables[i];
            let (low, high) = variable.bounds();
            let value = variable.get(&found.candidate);
            let profile = Profile { context, base: &base, followers: &followers, index: i, threshold };
            let open = if variable == Variable::Delay { delay::open_s(context, context.fine, found) } else { 0.0 };
            let end = |sign: f64| {
                let least = NORMAL * deviations[i]?;
                let distance = open + profile.end(sign, deviations[i]?)?.max(least);
                Some((value + sign * distance).clamp(low, high))
            };
            (end(-1.0), end(1.0))
        })
        .collect()
}

/// How all variables follow one of them along its profile, to first order.
struct Followers {
    /// Variables that are not on a bound.
    inside: Vec<usize>,
    /// Inverse of their Jᵀ J; none where numbers overflow.
    inverse: Option<DMatrix<f64>>,
}

impl Followers {
    /// From Jᵀ J over the variables `inside`. A ridge below the limit of the rank keeps directions that the data do not determine from
    /// moving the others.
    fn new(normal: &DMatrix<f64>, inside: Vec<usize>) -> Self {
        let (normal, lengths) = unit_diagonal(normal, &inside);
        let ridge = DMatrix::identity(inside.len(), inside.len()) * (RANK * RANK * inside.len() as f64);
        let inverse = inverse(finite(normal) + ridge, &lengths);
        Self { inside, inverse }
    }

    /// The variance of variable `index` per variance of the residuals; none on a bound.
    fn variance(&self, index: usize) -> Option<f64> {
        let place = self.inside.iter().position(|&i| i == index)?;
        Some(self.inverse.as_ref()?[(place, place)])
    }

    /// Moves variable `index` of `candidate` by `change`, and the others with it.
    fn moved(&self, base: &Found, index: usize, change: f64) -> Candidate {
        let mut candidate = base.candidate.clone();
        let place = self.inside.iter().position(|&i| i == index);
        if let (Some(place), Some(inverse)) = (place, &self.inverse) {
            for (row, &other) in self.inside.iter().enumerate() {
                let variable = base.variables[other];
                let (low, high) = variable.bounds();
                let follows = change * inverse[(row, place)] / inverse[(place, place)];
                variable.set(&mut candidate, (variable.get(&base.candidate) + follows).clamp(low, high));
            }
        }
        let variable = base.variables[index];
        variable.set(&mut candidate, variable.get(&base.candidate) + change);
        candidate
    }
}

/// The profile of one variable: the cost, minimised over all others.
struct Profile<'a> {
    context: &'a Context<'a>,
    base: &'a Found,
    followers: &'a Followers,
    index: usize,
    /// Cost at the ends of the interval.
    threshold: f64,
}

impl Profile<'_> {
    /// The distance from the minimum, in the direction of `sign`, at which the profile crosses the threshold, if it does before
    /// the bound. `deviation` is a first estimate of the standard deviation.
    fn end(&self, sign: f64, deviation: f64) -> Option<f64> {
        /// Share of the rise to the threshold within which an end is found: 3 % of the distance.
        const CLOSE: f64 = 0.06;
        let variable = self.base.variables[self.index];
        let (low, high) = variable.bounds();
        let value = variable.get(&self.base.candidate);
        let room = if sign > 0.0 { high - value } else { value - low };
        if room < 1e-9 {
            return None;
        }
        let others: Vec<Variable> = self.base.variables.iter().copied().filter(|&v| v != variable).collect();
        let mut nearest: Option<Candidate> = None;
        // The rise of the cost, in units of that to the threshold.
        let mut rise_at = |distance: f64| -> f64 {
            let from = |start: &Candidate| {
                // Where the others follow to first order, one step is enough.
                let iterations = if self.followers.inverse.is_some() { 1 } else { 6 };
                let stopping = StoppingCriteria { iterations, decrease: 1e-4 };
                self.context.descend_over(self.context.coarse, start, others.clone(), stopping)
            };
            // From where the others follow to first order; where they have no response there, from the nearest minimum.
            let start = self.followers.moved(self.base, self.index, sign * distance);
            let found = from(&start).or_else(|| {
                let mut start = nearest.clone().unwrap_or_else(|| self.base.candidate.clone());
                variable.set(&mut start, value + sign * distance);
                from(&start)
            });
            let Some(found) = found else { return f64::INFINITY };
            let rise = (found.minimum.cost - self.base.minimum.cost) / (self.threshold - self.base.minimum.cost);
            if rise < 1.0 {
                nearest = Some(found.candidate);
            }
            rise
        };
        // The root of the rise is near a straight line through the minimum: a secant between an inner and an outer end.
        let (mut inner, mut outer) = ((0.0, 0.0), None);
        let mut distance = (NORMAL * deviation).min(1.0).min(room);
        for _ in 0..10 {
            let rise = rise_at(distance);
            if (rise - 1.0).abs() <= CLOSE {
                return Some(distance);
            }
            let root = rise.max(0.0).sqrt();
            if rise > 1.0 {
                outer = Some((distance, root));
            } else if distance >= room {
                return None;
            } else {
                inner = (distance, root);
            }
            distance = secant(inner, outer, room);
        }
        outer.map(|_| distance)
    }
}

/// The next distance at which the root of the rise may be 1, within `room`: `inner` and `outer` are distances with the root there.
fn secant(inner: (f64, f64), outer: Option<(f64, f64)>, room: f64) -> f64 {
    match outer {
        // Away from both ends, so that the bracket shrinks in any case.
        Some((far, root)) if root.is_finite() => {
            let share = (1.0 - inner.1) / (root - inner.1);
            inner.0 + share.clamp(0.1, 0.9) * (far - inner.0)
        }
        Some((far, _)) => 0.5 * (inner.0 + far),
        None => (inner.0 * (1.0 / inner.1.max(1e-3)).clamp(1.2, 4.0)).min(room),
    }
}
