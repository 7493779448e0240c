//! Selection of the structure: the one rule by which topology, branches, elastic curve and saturation are chosen.

use std::sync::atomic::Ordering;

use rayon::prelude::*;
use serde::Serialize;
use springpot::Topology;

use super::candidate::{Bend, Candidate};
use super::descent::{Context, Found};
use super::objective::Objective;
use super::observation::Observation;
use super::settings::topology_name;
use super::statistics::Whiteness;
use super::statistics::{self, Loss};
use crate::agreement::Agreement;
use crate::error::Result;
use crate::least_squares::StoppingCriteria;

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
    /// Reason why that is missing although there are several recordings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out_missing: Option<String>,
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
/// Share of a cost to which a nonlinearity, or one more branch behind it, must bring it: errors a twentieth smaller.
const WORTH: f64 = 0.9;
/// A cost so many times the least is far from it: errors 1.3 times as large.
const FAR: f64 = 1.7;

/// Whether `cost` is so much less than `simpler`, that of a simpler structure, that a nonlinearity is worth it.
pub(super) fn is_worth_it(cost: f64, simpler: f64) -> bool {
    cost <= WORTH * simpler
}

/// Whether `cost` is near the `least`, so that the structure may still be selected.
pub(super) fn is_near(cost: f64, least: f64) -> bool {
    cost <= FAR * least
}

/// A fitted structure.
pub(super) struct StructureFit {
    pub(super) topology: Topology,
    pub(super) branches: usize,
    pub(super) found: Found,
    left_out_nrmse_pct: Option<f64>,
    left_out_missing: Option<String>,
    /// Mean of the recordings' R², and of their NRMSE (%).
    r2_mean: f64,
    nrmse_pct: f64,
    pub(super) whiteness: Whiteness,
}

impl StructureFit {
    /// The structure that was `found`, with its error where it is compared (`objective`) and on the recordings that are
    /// `left_out`; none if it has no response.
    pub(super) fn new(
        context: &Context<'_>,
        objective: &Objective,
        left_out: Option<&LeftOut>,
        found: Found,
    ) -> Option<Self> {
        let evaluation = objective.evaluate(&found.candidate)?;
        let pairs = objective.measured().zip(&evaluation.modelled);
        let agreements: Vec<Agreement> = pairs.map(|(measured, modelled)| Agreement::new(measured, modelled)).collect();
        let mean = |of: fn(&Agreement) -> f64| agreements.iter().map(of).sum::<f64>() / agreements.len() as f64;
        let error = left_out.map(|left_out| left_out.error(context, &found)).transpose();
        let (left_out_nrmse_pct, left_out_missing) = match error {
            Ok(error_pct) => (error_pct, None),
            Err(reason) => (None, Some(reason)),
        };
        Some(Self {
            topology: found.candidate.topology,
            branches: found.candidate.branches(),
            r2_mean: mean(|a| a.r2),
            nrmse_pct: mean(|a| a.nrmse_pct),
            whiteness: Whiteness::new(objective.values(), &objective.residuals(&evaluation)),
            left_out_nrmse_pct,
            left_out_missing,
            found,
        })
    }

    /// Whether it has neither a curve nor a drive that saturates.
    pub(super) fn is_linear(&self) -> bool {
        self.found.candidate.bend == Bend::Straight && !self.saturates()
    }

    /// Whether its drive saturates.
    fn saturates(&self) -> bool {
        self.found.candidate.actuator.saturation_v.is_some()
    }

    fn variables(&self) -> usize {
        self.found.variables.len()
    }

    fn cost(&self) -> f64 {
        self.found.minimum.cost
    }

    /// Whether the error is not worth more branches than this structure has to reach that of `best`.
    pub(super) fn is_as_good_as(&self, best: &Self) -> bool {
        self.cost() <= MARGIN * MARGIN * best.cost() || best.r2_mean - self.r2_mean <= MIN_GAIN
    }

    /// The criterion for it, where fits are or are not validated on left-out recordings.
    fn judgement(&self, is_validated: bool) -> Judgement {
        match self.left_out_nrmse_pct {
            Some(error_pct) => Judgement::LeftOut(error_pct),
            None if is_validated => Judgement::Missing,
            None => Judgement::Fitted,
        }
    }
}

/// The criterion for a structure.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Judgement {
    /// The error on recordings that were left out, %.
    LeftOut(f64),
    /// Others have an error on left-out recordings, this one has none: it is never selected. Its row has no such error.
    Missing,
    /// No structure has an error on left-out recordings: the error on the recordings themselves.
    Fitted,
}

/// The structure that is selected among fits to the same recordings, with a row for each.
///
/// It is the smallest that is not worse than the best: by the error on left-out recordings. If there is only one recording, the
/// best is that with the least error among those whose Bayesian criterion says that they do not fit noise, and a structure is not
/// worse whose error is up to 5 % or an R² of 1e-5 above it.
pub(super) struct Selection {
    /// Its place among the fits.
    pub(super) index: usize,
    /// One row per fit.
    pub(super) rows: Vec<StructureRow>,
}

impl Selection {
    /// Selects among `fits` to the recordings of `objective`; the first where none is left.
    pub(super) fn new(objective: &Objective, fits: &[StructureFit]) -> Self {
        let criteria = criteria(objective, fits);
        let least = |of: fn(&(f64, f64)) -> f64| criteria.iter().map(of).fold(f64::INFINITY, f64::min);
        let (least_aic, least_bic) = (least(|c| c.0), least(|c| c.1));
        let least_left_out = fits.iter().filter_map(|fit| fit.left_out_nrmse_pct).fold(f64::INFINITY, f64::min);
        let is_validated = fits.iter().any(|fit| fit.left_out_nrmse_pct.is_some());
        let fits_no_noise = |fit: &(usize, &StructureFit)| criteria[fit.0].1 <= least_bic + MARGIN_BIC;
        let best = fits.iter().enumerate().filter(fits_no_noise).min_by(|a, b| a.1.cost().total_cmp(&b.1.cost()));
        let is_not_worse = |k: usize| match fits[k].judgement(is_validated) {
            Judgement::LeftOut(error_pct) => error_pct <= MARGIN * least_left_out,
            Judgement::Missing => false,
            Judgement::Fitted => best.is_some_and(|(_, best)| fits[k].is_as_good_as(best)),
        };
        let smallest = |&a: &usize, &b: &usize| {
            let by_size = fits[a].variables().cmp(&fits[b].variables());
            by_size.then(criteria[a].1.total_cmp(&criteria[b].1))
        };
        let index = (0..fits.len()).filter(|&k| is_not_worse(k)).min_by(smallest).unwrap_or(0);
        let row = |(k, fit): (usize, &StructureFit)| StructureRow {
            topology: fit.topology,
            branches: fit.branches,
            curve: fit.found.candidate.bend.name(),
            saturates: fit.saturates(),
            variables: fit.variables(),
            r2_mean: fit.r2_mean,
            nrmse_pct: fit.nrmse_pct,
            delta_aic: criteria[k].0 - least_aic,
            delta_bic: criteria[k].1 - least_bic,
            left_out_nrmse_pct: fit.left_out_nrmse_pct,
            left_out_missing: fit.left_out_missing.clone(),
            chosen: k == index,
        };
        Self { index, rows: fits.iter().enumerate().map(row).collect() }
    }
}

/// Akaike's and the Bayesian criterion of `fits`, with the number of independent samples from the residuals of the best of them.
fn criteria(objective: &Objective, fits: &[StructureFit]) -> Vec<(f64, f64)> {
    let best = fits.iter().min_by(|a, b| a.cost().total_cmp(&b.cost()));
    let samples = best.map_or(1.0, |best| best.whiteness.effective_samples);
    let of = |fit: &StructureFit| {
        let variance = (2.0 * fit.cost() / objective.samples() as f64).max(f64::MIN_POSITIVE);
        let misfit = samples * variance.ln();
        let k = fit.variables() as f64;
        (misfit + 2.0 * k, misfit + k * samples.ln())
    };
    fits.iter().map(of).collect()
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

/// Shares of the way from the fit to all recordings to the fit without one, on which a film with a response to that one is looked for.
const WAY_BACK: [f64; 5] = [1.0, 0.5, 0.25, 0.1, 0.0];

/// Fits to all recordings but one, and their error on that one.
pub struct LeftOut {
    folds: Vec<Fold>,
}

/// A recording that is left out.
struct Fold {
    name: String,
    others: Objective,
    one: Objective,
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
        let fold = |out: usize| {
            let mut others = observations.to_vec();
            let one = others.remove(out);
            Ok(Fold {
                others: Objective::new(&others)?,
                one: Objective::new(std::slice::from_ref(&one))?,
                name: one.name,
            })
        };
        Ok(Some(Self { folds: (0..observations.len()).map(fold).collect::<Result<_>>()? }))
    }

    /// Mean NRMSE (%) of the recordings that were left out.
    ///
    /// # Errors
    ///
    /// The reason why it is missing.
    pub fn error(&self, context: &Context<'_>, found: &Found) -> std::result::Result<f64, String> {
        let errors: Vec<f64> =
            self.folds.par_iter().map(|fold| fold.error(context, found)).collect::<std::result::Result<_, _>>()?;
        if context.stop.load(Ordering::Relaxed) {
            return Err("the search was interrupted".into());
        }
        Ok(errors.iter().sum::<f64>() / errors.len() as f64)
    }
}

impl Fold {
    /// NRMSE (%) on this recording of the structure that was `found`, fitted to the others. Their strokes leave the end of a curve open: where
    /// the film pulls in on this one, it is brought back towards the fit to all of them.
    fn error(&self, context: &Context<'_>, found: &Found) -> std::result::Result<f64, String> {
        // The fit to all of them is a close start.
        let stopping = StoppingCriteria { iterations: 40, decrease: 1e-6 };
        let fitted = context.descend_over(&self.others, &found.candidate, found.variables.clone(), stopping);
        let fitted = fitted.ok_or_else(|| format!("there is no fit without {}", self.name))?;
        let error = |share: f64| {
            let mut candidate = found.candidate.clone();
            for variable in &found.variables {
                let (from, to) = (variable.get(&found.candidate), variable.get(&fitted.candidate));
                variable.set(&mut candidate, if share == 1.0 { to } else { from + share * (to - from) });
            }
            nrmse_pct(&self.one, &candidate, context.loss).filter(|error_pct| error_pct.is_finite())
        };
        let error = WAY_BACK.into_iter().find_map(error);
        error.ok_or_else(|| format!("the fit without {} has no response to it", self.name))
    }
}
