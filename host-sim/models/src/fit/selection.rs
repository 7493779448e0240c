//! Selection of the structure: the one rule by which topology, branches, elastic curve and saturation are chosen.
//!
//! Every structure is fitted again without each recording, and without every second block of time of all recordings. Its errors on what was
//! left out are compared with those of the best structure, block by block. The smallest structure wins that this comparison does not
//! distinguish from the best one.

use host_io::choice::by_name;
use serde::Serialize;
use springpot::Topology;

use super::candidate::Candidate;
use super::descent::{Context, Found};
use super::left_out::LeftOut;
use super::objective::{Evaluation, Objective};
use super::observation::Observation;
use super::residuals::Whiteness;
use crate::agreement::Agreement;
use crate::statistics::{self, peaks, sorted};

/// A structure that was fitted, for tables.
#[derive(Clone, Debug, Serialize)]
pub struct StructureRow {
    /// How the branches are connected.
    #[serde(serialize_with = "by_name")]
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
    /// NRMSE (%) in blocks of time under fits without every second block.
    pub left_out_blocks_nrmse_pct: Option<f64>,
    /// Reason why the errors on what was left out are missing.
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

/// Standard errors of the mean difference of two structures from which one is better: 1 chance in 40 if they are equal.
const STANDARD_ERRORS: f64 = 2.0;
/// Smallest mean difference that matters, as a logarithm of mean squares: errors 1 % smaller.
const MIN_DIFFERENCE: f64 = 0.02;
/// The same for Hencky's strain in a film of constant volume, whose two numbers are physics, not fitted: errors 2 % larger, on what
/// was left out and in the fit itself. What it leaves unexplained beside noise then moves the longest relaxation time less than two fitted numbers do.
const MIN_DIFFERENCE_HENCKY: f64 = 0.04;
/// Error that no application resolves, as a share of a recording's range: what is below does not matter.
const FLOOR: f64 = 2e-4;
/// The same difference for a curve or a saturation if the recordings have one amplitude, where creep and stiffening look alike: errors beyond the
/// noise a quarter larger without it.
const MIN_DIFFERENCE_ONE_AMPLITUDE: f64 = 0.446;
/// A cost so many times the least is far from it: errors 1.3 times as large, in a selection those beyond the noise.
const FAR: f64 = 1.7;
/// Share of the mean squares on what was left out that rules out a structure whose fit is far from another one: what only one part of the recordings
/// shows, no structure predicts well.
const MIN_LEFT_OUT: f64 = 0.45;
/// Share of the noise's mean square that remains in comparisons without it, and the error that matters beside it, as a share of the range.
const NOISE_LEFT: f64 = 0.05;
const MATTERS: f64 = 1e-3;
/// Share of a cost to which one more branch must bring it for another to be tried: one that explains a part of the creep of two brings it less far than the
/// second one then does.
const WORTH: f64 = 0.985;

/// Whether `cost` is so much less than that of one branch fewer that one more is tried.
pub(super) fn is_worth_it(cost: f64, smaller: f64) -> bool {
    cost <= WORTH * smaller
}

/// Whether `cost` is near the `least`, so that the structure may still be selected.
pub(super) fn is_near(cost: f64, least: f64) -> bool {
    cost <= FAR * least
}

pub(super) struct StructureFit {
    pub(super) found: Found,
    /// Mean NRMSE (%) of the recordings that were left out, if there are several.
    left_out_nrmse_pct: Option<f64>,
    /// NRMSE (%) of the blocks of time that were left out.
    left_out_blocks_nrmse_pct: Option<f64>,
    /// Relative mean squares in the blocks that were left out, or the reason why they are missing.
    left_out: std::result::Result<Vec<f64>, String>,
    /// The fits to the parts.
    pub(super) refits: Vec<Candidate>,
    /// Relative mean squares of the fit itself in the blocks.
    fitted: Vec<f64>,
    /// Relative mean squares of the noise from row to row in its residuals, which no structure explains: in the blocks, and in those left out.
    noise: [Vec<f64>; 2],
    /// Mean of the recordings' R², and of their NRMSE (%).
    r2_mean: f64,
    nrmse_pct: f64,
    effective_samples: f64,
}

impl StructureFit {
    /// The structure that was `found`, with its errors on what is `left_out`; none if it has no response.
    pub(super) fn new(context: &Context<'_>, left_out: &LeftOut<'_>, found: Found) -> Option<Self> {
        let objective = context.coarse;
        let evaluation = objective.evaluate(&found.candidate)?;
        let agreements = agreements_of(objective, &evaluation);
        // A thinned recording may have no change left.
        let mean = |of: fn(&Agreement) -> f64| {
            let stated: Vec<f64> = agreements.iter().map(of).filter(|value| value.is_finite()).collect();
            statistics::mean(&stated)
        };
        let whiteness = Whiteness::new(objective.values(), &objective.residuals(&evaluation));
        let (errors, refits) = match left_out.refitted(context, &found) {
            Ok((errors, refits)) => (Ok(errors), refits),
            Err(missing) => (Err(missing), Vec::new()),
        };
        Some(Self {
            r2_mean: mean(|a| a.r2),
            nrmse_pct: mean(|a| a.nrmse_pct),
            effective_samples: whiteness.effective_samples,
            left_out_nrmse_pct: errors.as_ref().ok().and_then(|errors| left_out.nrmse_pct(errors)),
            left_out_blocks_nrmse_pct: errors.as_ref().ok().and_then(|errors| left_out.blocks_nrmse_pct(errors)),
            left_out: errors,
            refits,
            fitted: left_out.mean_squares(context.settings.loss, &evaluation),
            noise: left_out.noise(&evaluation),
            found,
        })
    }

    /// Whether it has neither a curve nor a drive that saturates.
    pub(super) fn is_linear(&self) -> bool {
        self.found.candidate.is_straight() && !self.saturates()
    }

    fn saturates(&self) -> bool {
        self.found.candidate.actuator.saturation_v.is_some()
    }

    fn variables(&self) -> usize {
        self.found.variables.len()
    }

    fn cost(&self) -> f64 {
        self.found.minimum.cost
    }
}

/// The paired comparison of two structures by their mean squares in the same blocks: the mean of the logarithms' differences, positive if
/// `one` is worse than the `other`, and its standard error.
fn difference(one: &[f64], other: &[f64]) -> (f64, f64) {
    let floored = |square: f64| (square + FLOOR * FLOOR).ln();
    let differences: Vec<f64> = one.iter().zip(other).map(|(a, b)| floored(*a) - floored(*b)).collect();
    let n = differences.len() as f64;
    let mean = statistics::mean(&differences);
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, (variance / n).sqrt())
}

/// The mean of mean squares in blocks.
fn mean(squares: &[f64]) -> f64 {
    squares.iter().map(|square| square + FLOOR * FLOOR).sum::<f64>() / squares.len() as f64
}

/// Mean squares in blocks beyond those of the `noise`, of which a share stays, as much as chance leaves of it in a block; with an error that
/// matters to no application.
fn beyond(squares: &[f64], noise: &[f64]) -> Vec<f64> {
    let left = |(square, noise): (&f64, &f64)| (square - noise).max(0.0) + NOISE_LEFT * noise + MATTERS * MATTERS;
    squares.iter().zip(noise).map(left).collect()
}

/// The structure that is selected among fits to the same recordings, with a row for each.
///
/// The best has the least errors on what was left out; if no structure has such errors, because the search was interrupted, those of the
/// fit itself count. Selected is the smallest that a paired comparison does not distinguish from it, and whose fit is not far from another one that
/// predicts what was left out about as well. A nonlinearity that only one amplitude supports
/// must do clearly better than every linear film.
pub(super) struct Selection {
    /// Its place among the fits.
    pub(super) index: usize,
    /// The places of those that do no worse in the comparison.
    pub(super) rivals: Vec<usize>,
    /// One row per fit.
    pub(super) rows: Vec<StructureRow>,
}

impl Selection {
    /// Selects among `fits`, of which only nonlinear ones are `wanted` if there are some, to recordings with `one_amplitude` or more.
    pub(super) fn new(fits: &[StructureFit], samples: usize, wanted_nonlinear: bool, one_amplitude: bool) -> Self {
        let criteria = criteria(fits, samples);
        let least = |of: fn(&(f64, f64)) -> f64| criteria.iter().map(of).fold(f64::INFINITY, f64::min);
        let (least_aic, least_bic) = (least(|c| c.0), least(|c| c.1));
        let is_validated = fits.iter().any(|fit| fit.left_out.is_ok());
        let errors = |k: usize| if is_validated { fits[k].left_out.as_deref().ok() } else { Some(&*fits[k].fitted) };
        // Mean logarithm of the mean squares.
        let size_of = |squares: &[f64]| difference(squares, &vec![0.0; squares.len()]).0;
        let size = |k: usize| errors(k).map(size_of);
        let by_size =
            |a: &usize, b: &usize| size(*a).unwrap_or(f64::INFINITY).total_cmp(&size(*b).unwrap_or(f64::INFINITY));
        let size_beyond = |k: usize| {
            let noise = &fits[k].noise[usize::from(is_validated)];
            errors(k).map(|errors| size_of(&beyond(errors, noise)))
        };
        // How much less than that of the best linear film a size is.
        let gains = |size: &dyn Fn(usize) -> Option<f64>, k: usize| {
            let linear =
                (0..fits.len()).filter(|&k| fits[k].is_linear()).filter_map(size).fold(f64::INFINITY, f64::min);
            size(k).is_some_and(|size| linear - size >= MIN_DIFFERENCE_ONE_AMPLITUDE)
        };
        let is_supported =
            |k: usize| !one_amplitude || fits[k].is_linear() || gains(&size, k) || gains(&size_beyond, k);
        let supported: Vec<usize> = (0..fits.len())
            .filter(|&k| if wanted_nonlinear { !fits[k].is_linear() } else { is_supported(k) })
            .filter(|&k| errors(k).is_some())
            .collect();
        // A single block, such as the ramp of a relaxation, changes the mean logarithm by no more than chance does.
        let is_far_from = |k: usize, other: usize| {
            let left_out = |fit: &StructureFit| Some(mean(fit.left_out.as_deref().ok()?));
            let fitted = |fit: &StructureFit| Some(mean(&fit.fitted));
            let beyond_noise = |fit: &StructureFit| Some(mean(&beyond(&fit.fitted, &fit.noise[0])));
            let farther = |of: &dyn Fn(&StructureFit) -> Option<f64>, factor: f64| {
                of(&fits[k]).zip(of(&fits[other])).is_some_and(|(this, best)| this > factor * best)
            };
            (farther(&fitted, FAR) || farther(&beyond_noise, FAR)) && farther(&left_out, MIN_LEFT_OUT)
        };
        let is_ruled_out = |k: &usize| supported.iter().any(|&other| is_far_from(*k, other));
        let admitted: Vec<usize> = supported.iter().copied().filter(|k| !is_ruled_out(k)).collect();
        let best = admitted.iter().copied().min_by(by_size);
        let least_nrmse_pct = admitted.iter().map(|&k| fits[k].nrmse_pct).fold(f64::INFINITY, f64::min);
        let is_not_worse = |k: &usize| {
            let is_hencky = fits[*k].found.candidate.is_hencky();
            if is_hencky && fits[*k].nrmse_pct > least_nrmse_pct * (0.5 * MIN_DIFFERENCE_HENCKY).exp() {
                return false;
            }
            let pair = best.and_then(errors).zip(errors(*k));
            pair.is_none_or(|(best, this)| {
                let (mean, error) = difference(this, best);
                let least = if is_hencky { MIN_DIFFERENCE_HENCKY } else { MIN_DIFFERENCE };
                mean <= least.max(STANDARD_ERRORS * error)
            })
        };
        let smallest = |&a: &usize, &b: &usize| {
            let by_variables = fits[a].variables().cmp(&fits[b].variables());
            by_variables.then(criteria[a].1.total_cmp(&criteria[b].1))
        };
        let index = admitted.iter().copied().filter(is_not_worse).min_by(smallest).unwrap_or(0);
        let rivals = (0..fits.len()).filter(|k| *k != index && errors(*k).is_some() && !is_ruled_out(k));
        let rivals = rivals.filter(is_not_worse).collect();
        let row = |(k, fit): (usize, &StructureFit)| StructureRow {
            topology: fit.found.candidate.topology,
            branches: fit.found.candidate.branches(),
            curve: fit.found.candidate.curve_name(),
            saturates: fit.saturates(),
            variables: fit.variables(),
            r2_mean: fit.r2_mean,
            nrmse_pct: fit.nrmse_pct,
            delta_aic: criteria[k].0 - least_aic,
            delta_bic: criteria[k].1 - least_bic,
            left_out_nrmse_pct: fit.left_out_nrmse_pct,
            left_out_blocks_nrmse_pct: fit.left_out_blocks_nrmse_pct,
            left_out_missing: fit.left_out.as_ref().err().cloned(),
            chosen: k == index,
        };
        Self { index, rivals, rows: fits.iter().enumerate().map(row).collect() }
    }
}

/// Akaike's and the Bayesian criterion of `fits` to so many `samples`, with the number of independent ones from the residuals of the best.
fn criteria(fits: &[StructureFit], samples: usize) -> Vec<(f64, f64)> {
    let best = fits.iter().min_by(|a, b| a.cost().total_cmp(&b.cost()));
    let effective = best.map_or(1.0, |best| best.effective_samples);
    let of = |fit: &StructureFit| {
        let variance = (2.0 * fit.cost() / samples as f64).max(f64::MIN_POSITIVE);
        let misfit = effective * variance.ln();
        let k = fit.variables() as f64;
        (misfit + 2.0 * k, misfit + k * effective.ln())
    };
    fits.iter().map(of).collect()
}

/// Agreement of a candidate with every recording; empty if it has no response.
pub fn agreements(objective: &Objective, candidate: &Candidate) -> Vec<Agreement> {
    objective.evaluate(candidate).map(|evaluation| agreements_of(objective, &evaluation)).unwrap_or_default()
}

fn agreements_of(objective: &Objective, evaluation: &Evaluation) -> Vec<Agreement> {
    let pairs = objective.measured().zip(&evaluation.modelled);
    pairs.map(|(measured, modelled)| Agreement::new(measured, modelled)).collect()
}

/// Whether the turning points of `observations` all have the same size.
pub(super) fn has_one_amplitude(observations: &[Observation]) -> bool {
    let peaks = sorted(observations.iter().flat_map(|o| peaks(&o.input.samples().value)));
    // Several cycles, all as large.
    let several = peaks.len() > observations.len();
    several && peaks.first().zip(peaks.last()).is_some_and(|(least, most)| *least > 0.8 * most)
}
