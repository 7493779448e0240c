//! Which structure: the number of branches, and how they are connected.

use std::sync::atomic::Ordering;

use rayon::prelude::*;
use serde::Serialize;
use springpot::{Springpot, Topology};

use super::candidate::Candidate;
use super::levenberg_marquardt::Limits;
use super::loss::{self, Loss};
use super::objective::{Objective, Observation};
use super::search::{Context, Found};
use super::uncertainty;
use crate::agreement::Agreement;
use crate::error::{Error, Result};

/// A structure that was tried.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// How the branches are connected.
    #[serde(serialize_with = "topology_name")]
    pub topology: Topology,
    /// Branches.
    pub branches: usize,
    /// Variables that were fitted.
    pub variables: usize,
    /// Mean of the recordings' R².
    pub r2_mean: f64,
    /// Mean of the recordings' NRMSE, %.
    pub nrmse_pct: f64,
    /// Akaike's criterion less the best of the table.
    pub delta_aic: f64,
    /// The Bayesian criterion less the best of the table.
    pub delta_bic: f64,
    /// Mean NRMSE (%) of every recording under a fit to the others; null for a single recording.
    pub left_out_nrmse_pct: Option<f64>,
    /// Whether this structure was chosen.
    pub chosen: bool,
}

/// The lower-case name of a topology, as in parameter files.
pub fn name_of(topology: Topology) -> &'static str {
    match topology {
        Topology::Eq11 => "eq11",
        Topology::Parallel => "parallel",
    }
}

fn topology_name<S: serde::Serializer>(topology: &Topology, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    serializer.serialize_str(name_of(*topology))
}

/// A left-out error this much above the best is not worse.
const MARGIN: f64 = 1.05;
/// A Bayesian criterion this much above the best is not worse: odds of e⁵ to one at the most.
const MARGIN_BIC: f64 = 10.0;

/// Fits every structure of `topologies` and `branches`, and chooses the smallest that is not worse than the best: by the
/// error on left-out recordings, or by the Bayesian criterion where there is only one recording.
///
/// # Errors
///
/// [`Error::Computation`] where no structure has a fit.
pub fn choose(
    context: &Context<'_>,
    observations: &[Observation],
    topologies: &[Topology],
    branches: &[usize],
    progress: &dyn Fn(&str),
) -> Result<(Found, Vec<Row>)> {
    let left_out = LeftOut::new(observations)?;
    let mut tried: Vec<(Topology, usize, Found, Option<f64>)> = Vec::new();
    'structures: for &topology in topologies {
        let mut smaller: Option<Candidate> = None;
        for &n in branches {
            // Up to one branch the topologies are the same model.
            if n < 2 && topology != topologies[0] {
                smaller = tried.iter().find(|t| t.1 == n).map(|t| t.2.candidate.clone());
                continue;
            }
            if context.stop.load(Ordering::Relaxed) && !tried.is_empty() {
                break 'structures;
            }
            progress(&format!("{} with n = {n}", name_of(topology)));
            let warm: Vec<Candidate> = smaller.iter().flat_map(|c| grown(c, topology, context)).collect();
            if let Some(found) = context.best(topology, n, &warm) {
                let error = left_out.as_ref().and_then(|left_out| left_out.error(context, &found));
                smaller = Some(found.candidate.clone());
                tried.push((topology, n, found, error));
            }
        }
    }
    if tried.is_empty() {
        return Err(Error::Computation("no structure could be fitted to these recordings".into()));
    }

    // Criteria count samples that are independent, as the residuals of the best fit tell.
    let best =
        tried.iter().map(|t| &t.2).min_by(|a, b| a.minimum.cost.total_cmp(&b.minimum.cost)).unwrap_or(&tried[0].2);
    let evaluation = context
        .fine
        .evaluate(&best.candidate)
        .ok_or_else(|| Error::Computation("the best fit has no response".into()))?;
    let samples = uncertainty::whiteness(context.fine, &context.fine.residuals(&evaluation)).effective_samples;
    let criteria: Vec<(f64, f64)> = tried
        .iter()
        .map(|(_, _, found, _)| {
            let misfit =
                samples * (2.0 * found.minimum.cost / context.fine.samples() as f64).max(f64::MIN_POSITIVE).ln();
            let k = found.variables.len() as f64;
            (misfit + 2.0 * k, misfit + k * samples.ln())
        })
        .collect();
    let least = |of: &dyn Fn(&(f64, f64)) -> f64| criteria.iter().map(of).fold(f64::INFINITY, f64::min);
    let (aic, bic) = (least(&|c| c.0), least(&|c| c.1));
    let least_left_out = tried.iter().filter_map(|t| t.3).fold(f64::INFINITY, f64::min);
    let judged = tried.iter().any(|t| t.3.is_some());
    let not_worse = |index: usize| match tried[index].3 {
        Some(error) => error <= MARGIN * least_left_out,
        None => !judged && criteria[index].1 <= bic + MARGIN_BIC,
    };
    let chosen = (0..tried.len())
        .filter(|&index| not_worse(index))
        .min_by(|&a, &b| {
            let size = |i: usize| tried[i].2.variables.len();
            size(a).cmp(&size(b)).then(criteria[a].1.total_cmp(&criteria[b].1))
        })
        .unwrap_or(0);

    let rows = tried
        .iter()
        .zip(&criteria)
        .enumerate()
        .map(|(index, ((topology, branches, found, left_out), criterion))| {
            let agreements = agreements(context.fine, &found.candidate);
            let n = agreements.len() as f64;
            Row {
                topology: *topology,
                branches: *branches,
                variables: found.variables.len(),
                r2_mean: agreements.iter().map(|a| a.r2).sum::<f64>() / n,
                nrmse_pct: agreements.iter().map(|a| a.nrmse_pct).sum::<f64>() / n,
                delta_aic: criterion.0 - aic,
                delta_bic: criterion.1 - bic,
                left_out_nrmse_pct: *left_out,
                chosen: index == chosen,
            }
        })
        .collect();
    Ok((tried.swap_remove(chosen).2, rows))
}

/// Agreement of a candidate with every recording; empty where it has no response.
pub fn agreements(objective: &Objective, candidate: &Candidate) -> Vec<Agreement> {
    let evaluation = objective.evaluate(candidate);
    let modelled = evaluation.map(|evaluation| evaluation.modelled).unwrap_or_default();
    objective.measured().zip(&modelled).map(|(measured, modelled)| Agreement::of(measured, modelled)).collect()
}

/// NRMSE (%) of a candidate as the loss counts: with Huber's, from the spread of the residuals, whatever the drop-outs.
fn nrmse_pct(objective: &Objective, candidate: &Candidate, loss: Loss) -> Option<f64> {
    let agreement = *agreements(objective, candidate).first()?;
    if loss == Loss::Square {
        return Some(agreement.nrmse_pct);
    }
    let residuals = objective.residuals(&objective.evaluate(candidate)?);
    let range = loss::range(objective.measured().flatten().copied());
    Some(100.0 * loss::spread(&residuals) / range.max(f64::MIN_POSITIVE))
}

/// The candidate with one more branch, small, at three relaxation times.
fn grown(candidate: &Candidate, topology: Topology, context: &Context<'_>) -> Vec<Candidate> {
    let (short, long) = context.scales.times_s;
    [0.2, 0.5, 0.8]
        .into_iter()
        .map(|share| {
            let time = short * f64::powf(long / short, share);
            let stiffness = match topology {
                Topology::Parallel => 0.1 * context.scales.stiffness,
                // In series with all others: stiff is what does little.
                Topology::Eq11 => 10.0 * context.scales.stiffness,
            };
            let mut grown = candidate.clone();
            grown.topology = topology;
            grown.elements.push(Springpot::new(stiffness * f64::powf(time, 0.1), 0.1));
            grown.elements.push(Springpot::new(stiffness * f64::powf(time, 0.9), 0.9));
            grown
        })
        .collect()
}

/// Fits to all recordings but one, and their error on that one.
pub struct LeftOut {
    /// The others, and the one.
    folds: Vec<(Objective, Objective)>,
}

impl LeftOut {
    /// The folds of `observations`, if there is more than one.
    ///
    /// # Errors
    ///
    /// As [`Objective::new`].
    pub fn new(observations: &[Observation]) -> Result<Option<Self>> {
        if observations.len() < 2 {
            return Ok(None);
        }
        let folds = (0..observations.len())
            .map(|out| {
                let others: Vec<Observation> = observations
                    .iter()
                    .enumerate()
                    .filter(|(index, _)| *index != out)
                    .map(|(_, observation)| observation.clone())
                    .collect();
                Ok((Objective::new(&others)?, Objective::new(&observations[out..=out])?))
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Some(Self { folds }))
    }

    /// Mean NRMSE (%) of the recordings that were left out; nothing if the search was interrupted.
    pub fn error(&self, context: &Context<'_>, found: &Found) -> Option<f64> {
        // From the fit to all of them it is not far.
        let limits = Limits { iterations: 40, decrease: 1e-6 };
        let errors: Vec<f64> = self
            .folds
            .par_iter()
            .map(|(others, one)| {
                let fitted = context.descend_over(others, &found.candidate, found.variables.clone(), limits)?;
                nrmse_pct(one, &fitted.candidate, context.loss)
            })
            .collect::<Option<_>>()?;
        (!context.stop.load(Ordering::Relaxed)).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
    }
}
