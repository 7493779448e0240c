//! Selection of the structure: the number of branches, and how they are connected.

use std::sync::atomic::Ordering;

use rayon::prelude::*;
use serde::Serialize;
use springpot::{Springpot, Topology};

use super::candidate::Candidate;
use super::levenberg_marquardt::StoppingCriteria;
use super::objective::Objective;
use super::observation::{self, Observation};
use super::search::{Context, Found, is_long};
use super::settings::Stages;
use super::settings::{Settings, topology_name};
use super::statistics::Whiteness;
use super::statistics::{self, Loss};
use crate::agreement::Agreement;
use crate::error::{Error, Result};

/// A structure that was fitted, for tables.
#[derive(Clone, Debug, Serialize)]
pub struct StructureRow {
    /// How the branches are connected.
    #[serde(serialize_with = "serialize_topology")]
    pub topology: Topology,
    /// Number of branches.
    pub branches: usize,
    /// The elastic curve: `linear` for none.
    pub curve: String,
    /// Whether the drive saturates.
    pub saturates: bool,
    /// Number of fitted variables.
    pub variables: usize,
    /// Mean of the recordings' R².
    pub r2_mean: f64,
    /// Mean of the recordings' NRMSE, %.
    pub nrmse_pct: f64,
    /// Akaike's criterion minus the least of the table.
    pub delta_aic: f64,
    /// The Bayesian criterion minus the least of the table.
    pub delta_bic: f64,
    /// Mean NRMSE (%) of every recording under a fit to the others; null for a single recording.
    pub left_out_nrmse_pct: Option<f64>,
    /// Whether this structure was selected.
    pub chosen: bool,
}

impl StructureRow {
    /// Its structure in words, without the topology.
    pub fn nonlinearity(&self) -> String {
        match (self.curve.as_str(), self.saturates) {
            ("linear", false) => String::new(),
            ("linear", true) => "saturation".into(),
            (curve, false) => curve.to_owned(),
            (curve, true) => format!("{curve} + saturation"),
        }
    }
}

fn serialize_topology<S: serde::Serializer>(
    topology: &Topology,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.serialize_str(topology_name(*topology))
}

/// A left-out error up to this factor above the least is not worse.
const MARGIN: f64 = 1.05;
/// A structure whose Bayesian criterion is further than this above the least fits noise: odds of e⁵ to one.
const MARGIN_BIC: f64 = 10.0;
/// A gain of the mean R² up to this is not worth a branch: an error of 0.3 % of the stroke's standard deviation.
const MIN_GAIN: f64 = 1e-5;

/// Fits the structures of the settings and selects the smallest that is not worse than the best: by the error on left-out
/// recordings. If there is only one recording, the best is that with the least error among those whose Bayesian criterion says
/// that they do not fit noise, a structure is not worse whose error is up to 5 % or an R² of 1e-5 above it, and no larger
/// structures are tried once residuals are white, one more branch was not worth it, or the other topology was better with as many.
///
/// # Errors
///
/// [`Error::Computation`] where no structure has a fit.
pub fn select(
    context: &Context<'_>,
    observations: &[Observation],
    settings: &Settings,
    stages: &Stages<'_>,
) -> Result<(Found, Vec<StructureRow>)> {
    let mut fits = fit_structures(context, observations, settings, stages)?;
    let criteria = Criteria::new(context.compared, &fits);
    let selected = criteria.smallest_that_is_not_worse(&fits);
    let rows = fits.iter().enumerate().map(|(k, fit)| criteria.row(fit, k, k == selected)).collect();
    stages.tell("the chosen structure on all samples");
    Ok((context.finished(fits.swap_remove(selected).found), rows))
}

/// A fitted structure.
pub(super) struct StructureFit {
    topology: Topology,
    branches: usize,
    pub(super) found: Found,
    pub(super) left_out_nrmse_pct: Option<f64>,
    /// Mean of the recordings' R², and of their NRMSE (%).
    r2_mean: f64,
    nrmse_pct: f64,
    whiteness: Whiteness,
}

impl StructureFit {
    /// The fit of a structure that was `found`; none if it has no response.
    pub(super) fn new(objective: &Objective, topology: Topology, branches: usize, found: Found) -> Option<Self> {
        let evaluation = objective.evaluate(&found.candidate)?;
        let pairs = objective.measured().zip(&evaluation.modelled);
        let agreements: Vec<Agreement> = pairs.map(|(measured, modelled)| Agreement::new(measured, modelled)).collect();
        let mean = |of: fn(&Agreement) -> f64| agreements.iter().map(of).sum::<f64>() / agreements.len() as f64;
        Some(Self {
            topology,
            branches,
            r2_mean: mean(|a| a.r2),
            nrmse_pct: mean(|a| a.nrmse_pct),
            whiteness: Whiteness::new(objective.values(), &objective.residuals(&evaluation)),
            found,
            left_out_nrmse_pct: None,
        })
    }

    /// Whether its drive saturates.
    pub(super) fn saturates(&self) -> bool {
        self.found.candidate.actuator.saturation_v.is_some()
    }

    fn variables(&self) -> usize {
        self.found.variables.len()
    }

    fn cost(&self) -> f64 {
        self.found.minimum.cost
    }

    /// Whether the error is not worth more branches than this structure has to reach that of `best`.
    fn is_as_good_as(&self, best: &Self) -> bool {
        self.cost() <= MARGIN * MARGIN * best.cost() || best.r2_mean - self.r2_mean <= MIN_GAIN
    }
}

/// Fits of all structures, larger ones also from smaller ones; fewer if the search is interrupted.
fn fit_structures(
    context: &Context<'_>,
    observations: &[Observation],
    settings: &Settings,
    stages: &Stages<'_>,
) -> Result<Vec<StructureFit>> {
    let left_out = if is_long(context.fine) {
        LeftOut::new(&observations.iter().map(observation::thinned).collect::<Vec<_>>())?
    } else {
        LeftOut::new(observations)?
    };
    let mut fits: Vec<StructureFit> = Vec::new();
    'structures: for &topology in &settings.topologies {
        let mut smaller: Option<usize> = None;
        for &n in &settings.branches {
            // Below two branches the topologies are the same model.
            if n < 2 && topology != settings.topologies[0] {
                smaller = fits.iter().position(|fit| fit.branches == n);
                continue;
            }
            if context.stop.load(Ordering::Relaxed) && !fits.is_empty() {
                break 'structures;
            }
            stages.begin(format!("{} with n = {n}", topology_name(topology)), n);
            let before = smaller.map(|k| &fits[k]);
            let starts = before.map_or_else(Vec::new, |fit| grown(&fit.found.candidate, topology, context));
            let found = context.explored(topology, n, &starts);
            let Some(mut fit) = found.and_then(|found| StructureFit::new(context.compared, topology, n, found)) else {
                continue;
            };
            fit.left_out_nrmse_pct = left_out.as_ref().and_then(|left_out| left_out.error(context, &fit.found));
            let worth_it = before.is_none_or(|before| !before.is_as_good_as(&fit));
            // The other topology with as many branches.
            let other = fits.iter().find(|other| other.branches == n && other.topology != topology);
            let worth_it = worth_it && other.is_none_or(|other| fit.is_as_good_as(other));
            let white = fit.whiteness.white;
            smaller = Some(fits.len());
            fits.push(fit);
            match left_out {
                None if white => break 'structures,
                None if !worth_it => break,
                _ => {}
            }
        }
    }
    if fits.is_empty() {
        return Err(Error::Computation("no structure could be fitted to these recordings".into()));
    }
    Ok(fits)
}

/// Information criteria of all structures, in their order.
pub(super) struct Criteria {
    /// Akaike's and the Bayesian criterion.
    aic_bic: Vec<(f64, f64)>,
    least_aic: f64,
    least_bic: f64,
}

impl Criteria {
    /// The criteria of `fits`, with the number of independent samples from the residuals of the best of them.
    pub(super) fn new(objective: &Objective, fits: &[StructureFit]) -> Self {
        let best = fits.iter().min_by(|a, b| a.cost().total_cmp(&b.cost()));
        let samples = best.map_or(1.0, |best| best.whiteness.effective_samples);
        let aic_bic: Vec<(f64, f64)> = fits
            .iter()
            .map(|fit| {
                let variance = (2.0 * fit.cost() / objective.samples() as f64).max(f64::MIN_POSITIVE);
                let misfit = samples * variance.ln();
                let k = fit.variables() as f64;
                (misfit + 2.0 * k, misfit + k * samples.ln())
            })
            .collect();
        let least = |of: fn(&(f64, f64)) -> f64| aic_bic.iter().map(of).fold(f64::INFINITY, f64::min);
        let (least_aic, least_bic) = (least(|c| c.0), least(|c| c.1));
        Self { aic_bic, least_aic, least_bic }
    }

    /// The structure with the fewest variables of those that are not worse than the best.
    pub(super) fn smallest_that_is_not_worse(&self, fits: &[StructureFit]) -> usize {
        let cross_validated = fits.iter().any(|fit| fit.left_out_nrmse_pct.is_some());
        let least_left_out = fits.iter().filter_map(|fit| fit.left_out_nrmse_pct).fold(f64::INFINITY, f64::min);
        let fits_no_noise = |fit: &(usize, &StructureFit)| self.aic_bic[fit.0].1 <= self.least_bic + MARGIN_BIC;
        let best = fits.iter().enumerate().filter(fits_no_noise).min_by(|a, b| a.1.cost().total_cmp(&b.1.cost()));
        let not_worse = |k: usize| match fits[k].left_out_nrmse_pct {
            Some(error) => error <= MARGIN * least_left_out,
            None => !cross_validated && best.is_some_and(|(_, best)| fits[k].is_as_good_as(best)),
        };
        (0..fits.len())
            .filter(|&k| not_worse(k))
            .min_by(|&a, &b| {
                let by_size = fits[a].variables().cmp(&fits[b].variables());
                by_size.then(self.aic_bic[a].1.total_cmp(&self.aic_bic[b].1))
            })
            .unwrap_or(0)
    }

    /// The row of `fit`, which is number `k`.
    pub(super) fn row(&self, fit: &StructureFit, k: usize, chosen: bool) -> StructureRow {
        StructureRow {
            topology: fit.topology,
            branches: fit.branches,
            curve: fit.found.candidate.bend.name(),
            saturates: fit.saturates(),
            variables: fit.variables(),
            r2_mean: fit.r2_mean,
            nrmse_pct: fit.nrmse_pct,
            delta_aic: self.aic_bic[k].0 - self.least_aic,
            delta_bic: self.aic_bic[k].1 - self.least_bic,
            left_out_nrmse_pct: fit.left_out_nrmse_pct,
            chosen,
        }
    }
}

/// Agreement of a candidate with every recording; empty if it has no response.
pub fn agreements(objective: &Objective, candidate: &Candidate) -> Vec<Agreement> {
    let evaluation = objective.evaluate(candidate);
    let modelled = evaluation.map(|evaluation| evaluation.modelled).unwrap_or_default();
    objective.measured().zip(&modelled).map(|(measured, modelled)| Agreement::new(measured, modelled)).collect()
}

/// NRMSE (%) of a candidate; for Huber's loss from robust estimates, which drop-outs do not change.
fn nrmse_pct(objective: &Objective, candidate: &Candidate, loss: Loss) -> Option<f64> {
    let agreement = *agreements(objective, candidate).first()?;
    if loss == Loss::Square {
        return Some(agreement.nrmse_pct);
    }
    let residuals = objective.residuals(&objective.evaluate(candidate)?);
    let range = statistics::percentile_range(objective.measured().flatten().copied());
    Some(100.0 * statistics::robust_deviation(&residuals) / range.max(f64::MIN_POSITIVE))
}

/// The candidate with one more branch of little effect, at three relaxation times.
pub(super) fn grown(candidate: &Candidate, topology: Topology, context: &Context<'_>) -> Vec<Candidate> {
    let (short, long) = context.scales.times_s;
    [0.2, 0.5, 0.8]
        .into_iter()
        .map(|share| {
            let time = short * f64::powf(long / short, share);
            let stiffness = match topology {
                Topology::Parallel => 0.1 * context.scales.stiffness,
                // In series with all others: a stiff branch has little effect.
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
    /// The other recordings, and the one that is left out.
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

    /// Mean NRMSE (%) of the recordings that were left out; none if the search was interrupted.
    pub fn error(&self, context: &Context<'_>, found: &Found) -> Option<f64> {
        // The fit to all of them is a close start.
        let stopping = StoppingCriteria { iterations: 40, decrease: 1e-6 };
        let errors: Vec<f64> = self
            .folds
            .par_iter()
            .map(|(others, one)| {
                let fitted = context.descend_over(others, &found.candidate, found.variables.clone(), stopping)?;
                nrmse_pct(one, &fitted.candidate, context.loss)
            })
            .collect::<Option<_>>()?;
        (!context.stop.load(Ordering::Relaxed)).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
    }
}
