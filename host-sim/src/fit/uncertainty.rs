//! How far the parameters of a fit can be trusted.

use std::sync::atomic::Ordering;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

use super::candidate::Variable;
use super::levenberg_marquardt::Limits;
use super::objective::Objective;
use super::search::{Context, Found};

/// What the data say about a fit.
#[derive(Clone, Debug, Serialize)]
pub struct Trust {
    /// One estimate per fitted variable.
    pub estimates: Vec<Estimate>,
    /// Rank of the Jacobian, columns scaled to unit length: how many directions the data tell apart.
    pub rank: usize,
    /// Sets of variables that the data leave free together.
    pub undetermined: Vec<String>,
    /// Whether the residuals are white: no autocorrelation beyond chance at the first 20 lags.
    pub white: bool,
    /// Autocorrelation of the residuals at lag one.
    pub lag_one: f64,
    /// Independent samples among the residuals.
    pub effective_samples: f64,
}

/// A fitted value with its uncertainty.
#[derive(Clone, Debug, Serialize)]
pub struct Estimate {
    /// Name as in a parameter file.
    pub name: String,
    /// Value in SI units.
    pub value: f64,
    /// Ends of the 95 % interval from the profile likelihood; null where the data set no end.
    pub low: Option<f64>,
    /// See `low`.
    pub high: Option<f64>,
    /// Ends of the 95 % interval from the covariance, where there is one.
    pub linear: Option<(f64, f64)>,
    /// Whether the value stands on a bound.
    pub at_bound: bool,
}

/// Singular values below this share of the largest count as nought: a change of the variables by one standard size then
/// moves the response by less than 1e-5 of what others do.
const RANK: f64 = 1e-5;
/// Quantiles of χ² with one degree of freedom and of the normal distribution at 95 %.
const CHI_SQUARE: f64 = 3.841;
const NORMAL: f64 = 1.96;

/// What the residuals of one fit look like.
pub struct Whiteness {
    /// See [`Trust::white`].
    pub white: bool,
    /// See [`Trust::lag_one`].
    pub lag_one: f64,
    /// See [`Trust::effective_samples`].
    pub effective_samples: f64,
}

/// Autocorrelation of residuals, recording by recording.
pub fn whiteness(objective: &Objective, residuals: &[f64]) -> Whiteness {
    let mut rest = residuals;
    let (mut effective, mut lag_one, mut samples) = (0.0, 0.0, 0.0);
    let mut white = true;
    for measured in objective.measured() {
        let (this, others) = rest.split_at(measured.len());
        rest = others;
        let n = this.len() as f64;
        let mean = this.iter().sum::<f64>() / n;
        let variance: f64 = this.iter().map(|r| (r - mean).powi(2)).sum();
        let correlation = |lag: usize| -> f64 {
            if variance == 0.0 || lag >= this.len() {
                return 0.0;
            }
            this.iter().zip(&this[lag..]).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>() / variance
        };
        // Four standard deviations at 20 lags: one fit in 800 is called coloured by chance.
        white &= (1..=20).all(|lag| correlation(lag).abs() <= 4.0 / n.sqrt());
        // Up to where the correlation first vanishes.
        let sum: f64 = (1..this.len() / 4).map(correlation).take_while(|&c| c > 0.0).sum();
        effective += (n / (1.0 + 2.0 * sum)).max(1.0);
        lag_one += n * correlation(1);
        samples += n;
    }
    Whiteness { white, lag_one: lag_one / samples, effective_samples: effective }
}

/// Judges a fit on all samples; profiles are taken on the thinned recordings.
pub fn judge(context: &Context<'_>, found: &Found) -> Option<Trust> {
    let objective = context.fine;
    let evaluation = objective.evaluate(&found.candidate)?;
    let residuals = objective.residuals(&evaluation);
    let Whiteness { white, lag_one, effective_samples } = whiteness(objective, &residuals);

    let variables = &found.variables;
    let values: Vec<f64> = variables.iter().map(|v| v.get(&found.candidate)).collect();
    let at_bound: Vec<bool> = variables
        .iter()
        .zip(&values)
        .map(|(v, value)| {
            let (low, high) = v.bounds();
            (value - low).abs() < 1e-9 || (high - value).abs() < 1e-9
        })
        .collect();
    let inside: Vec<usize> = (0..variables.len()).filter(|&i| !at_bound[i]).collect();
    let normal = scaled(&found.minimum.normal, &inside);
    let (rank, undetermined) = undetermined(&normal.0, &inside, variables);

    let freedom = (effective_samples - inside.len() as f64).max(1.0);
    // As many samples as are independent.
    let variance = 2.0 * found.minimum.cost / objective.samples() as f64 * (objective.samples() as f64 / freedom);
    let inverse = (rank == inside.len()).then(|| normal.0.clone().cholesky()).flatten().map(|c| c.inverse());
    let errors: Vec<Option<f64>> = (0..variables.len())
        .map(|i| {
            let place = inside.iter().position(|&j| j == i)?;
            let inverse = inverse.as_ref()?;
            Some((variance * inverse[(place, place)]).sqrt() / normal.1[place])
        })
        .collect();

    // Where the covariance tells nothing, how far the variable could move if all others stayed.
    let sizes: Vec<f64> = (0..variables.len())
        .map(|i| errors[i].unwrap_or_else(|| (variance / found.minimum.normal[(i, i)].max(f64::MIN_POSITIVE)).sqrt()))
        .collect();
    let profiles = profiles(context, found, &sizes, freedom);
    let estimates = variables
        .iter()
        .enumerate()
        .map(|(i, &variable)| {
            let natural = |value: f64| {
                let mut candidate = found.candidate.clone();
                variable.set(&mut candidate, value);
                variable.natural(&candidate)
            };
            // An order has its ends by nature.
            let within_bounds = |end: f64| matches!(variable, Variable::Order(_)).then_some(end);
            Estimate {
                name: variable.to_string(),
                value: natural(values[i]),
                low: profiles[i].0.map(natural).or(within_bounds(0.0)),
                high: profiles[i].1.map(natural).or(within_bounds(1.0)),
                linear: errors[i].map(|e| (natural(values[i] - NORMAL * e), natural(values[i] + NORMAL * e))),
                at_bound: at_bound[i],
            }
        })
        .collect();
    Some(Trust { estimates, rank, undetermined, white, lag_one, effective_samples })
}

/// The rows and columns `inside` of Jᵀ J with unit diagonal, and the lengths that were divided out.
fn scaled(normal: &DMatrix<f64>, inside: &[usize]) -> (DMatrix<f64>, Vec<f64>) {
    let lengths: Vec<f64> = inside.iter().map(|&i| normal[(i, i)].sqrt().max(f64::MIN_POSITIVE)).collect();
    let matrix = DMatrix::from_fn(inside.len(), inside.len(), |i, j| {
        let value = normal[(inside[i], inside[j])] / (lengths[i] * lengths[j]);
        if value.is_finite() { value } else { 0.0 }
    });
    (matrix, lengths)
}

/// The rank, and which variables take part in what the data leave free.
fn undetermined(matrix: &DMatrix<f64>, inside: &[usize], variables: &[Variable]) -> (usize, Vec<String>) {
    let eigen = matrix.clone().symmetric_eigen();
    // Eigenvalues are squares of singular values.
    let largest = eigen.eigenvalues.max().max(f64::MIN_POSITIVE);
    let mut sets = Vec::new();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value <= RANK * RANK * largest {
            let vector: DVector<f64> = vector.into_owned();
            let strongest = vector.amax();
            let names: Vec<String> = (0..inside.len())
                .filter(|&i| vector[i].abs() > 0.2 * strongest)
                .map(|i| variables[inside[i]].to_string())
                .collect();
            sets.push(names.join(" with "));
        }
    }
    (inside.len() - sets.len(), sets)
}

type Ends = (Option<f64>, Option<f64>);

/// Where the cost, minimised over all other variables, exceeds its minimum by what chance allows in 95 of 100 cases.
fn profiles(context: &Context<'_>, found: &Found, sizes: &[f64], freedom: f64) -> Vec<Ends> {
    let none = || vec![(None, None); found.variables.len()];
    if context.stop.load(Ordering::Relaxed) {
        return none();
    }
    // The minimum on the thinned recordings lies a little elsewhere.
    let limits = Limits { iterations: 12, decrease: 1e-7 };
    let Some(base) = context.descend(context.coarse, &found.candidate, limits) else { return none() };
    let threshold = base.minimum.cost * (1.0 + CHI_SQUARE / freedom);
    (0..found.variables.len())
        .into_par_iter()
        .map(|i| {
            // Distances carry over to the minimum on all samples.
            let variable = found.variables[i];
            let (low, high) = variable.bounds();
            let value = variable.get(&found.candidate);
            let end = |sign: f64| {
                let distance = profile_end(context, &base, i, sizes[i], sign, threshold)?;
                Some((value + sign * distance).clamp(low, high))
            };
            (end(-1.0), end(1.0))
        })
        .collect()
}

/// The distance from the minimum at which the profile crosses the threshold, if it does before the bound.
fn profile_end(context: &Context<'_>, base: &Found, index: usize, size: f64, sign: f64, threshold: f64) -> Option<f64> {
    let variable = base.variables[index];
    let value = variable.get(&base.candidate);
    let (low, high) = variable.bounds();
    let bound = if sign > 0.0 { high } else { low };
    let room = (bound - value).abs();
    if room < 1e-9 {
        return None;
    }
    let others: Vec<Variable> = base.variables.iter().copied().filter(|&v| v != variable).collect();
    let limits = Limits { iterations: 6, decrease: 1e-4 };
    let mut nearest = base.candidate.clone();
    let mut cost_at = |distance: f64| -> f64 {
        let mut start = nearest.clone();
        variable.set(&mut start, value + sign * distance);
        match context.descend_over(context.coarse, &start, others.clone(), limits) {
            Some(found) => {
                if found.minimum.cost < threshold {
                    nearest = found.candidate;
                }
                found.minimum.cost
            }
            None => f64::INFINITY,
        }
    };
    // Outwards until the cost is exceeded, then between.
    let mut inner = 0.0;
    let mut outer = (NORMAL * size).min(1.0).min(room);
    let mut steps = 0;
    while cost_at(outer) < threshold {
        if outer >= room || steps == 8 {
            return None;
        }
        inner = outer;
        outer = (2.5 * outer).min(room);
        steps += 1;
    }
    for _ in 0..4 {
        let middle = 0.5 * (inner + outer);
        if cost_at(middle) < threshold {
            inner = middle;
        } else {
            outer = middle;
        }
    }
    Some(0.5 * (inner + outer))
}
