//! The search over structures: topology × branches × elastic curve × saturation.
//!
//! Every kind of film is fitted with more and more branches, as long as one more makes the error smaller: linear films first, then each kind
//! of nonlinearity from the linear film with as many branches and from its own with fewer. [`Selection`] selects one of them all.

use std::sync::atomic::Ordering;

use super::candidate::{Candidate, Variable};
use super::descent::{Context, Found, is_long, least};
use super::left_out::LeftOut;
use super::objective::Objective;
use super::observation::{self, Observation};
use super::pattern_search;
use super::residuals::{Loss, Whiteness};
use super::selection::{Selection, StructureFit, StructureRow, has_one_amplitude, is_near, is_worth_it};
use super::settings::{CurveChoice, Method, Settings, Stages, work};
use super::starts::{Kind, creeping, grown, reach, relaxing};
use crate::error::{Error, Result};
use crate::statistics::robust_deviation;
use host_io::choice::Choice;

/// Nonlinear structures of long recordings that are fitted beyond their beginning.
const FINALISTS: usize = 2;

/// Share of the cost of a simpler kind to which a nonlinearity must bring it with as many branches.
const ADDS: f64 = 0.995;

/// A selected structure.
#[derive(Clone)]
pub struct Selected {
    /// Its fit to all samples.
    pub found: Found,
    /// The rows of all structures that were compared; empty for a single one.
    pub rows: Vec<StructureRow>,
    /// Its fits to parts of the recordings.
    pub refits: Vec<Candidate>,
}

impl Selected {
    /// The only one that was tried.
    fn only(found: Found) -> Self {
        Self { found, rows: Vec::new(), refits: Vec::new() }
    }
}

/// A search over the structures of the settings.
pub struct Search<'a> {
    /// The common parts of all descents.
    pub context: &'a Context<'a>,
    /// The recordings that are fitted.
    pub observations: &'a [Observation],
    /// Which structures are tried.
    pub settings: &'a Settings,
    /// Where progress is reported.
    pub stages: &'a Stages<'a>,
}

impl Search<'_> {
    /// The best structure by the method of the settings, and the structures that were compared.
    pub fn best(&self) -> Result<Selected> {
        let Self { context, settings, stages, .. } = self;
        if settings.method == Method::PatternSearch {
            return Ok(Selected::only(pattern_search::best_structure(context, settings, stages)?));
        }
        let refined =
            settings.start.as_ref().map(|start| context.refined(start, settings.topologies[0])).transpose()?;
        let linear = match &refined {
            Some(refined) if !refined.candidate.is_straight() || settings.curve == CurveChoice::None => {
                return Ok(Selected::only(refined.clone()));
            }
            Some(refined) => context.coarsened(&refined.candidate).into_iter().collect(),
            None => self.linear(),
        };
        if linear.is_empty() {
            let names: Vec<&str> = self.observations.iter().map(|o| o.name.as_str()).collect();
            return Err(Error::Computation(format!(
                "{}: no start leads to a fit; check the units of voltage and displacement, and the actuator",
                names.join(", ")
            )));
        }
        let nonlinear = self.nonlinear(&linear);
        let Selected { found, rows, refits } = self.selected([linear, nonlinear].concat())?;
        stages.note("the chosen structure on all samples");
        let found = match refined {
            Some(refined) if found.candidate.is_straight() && found.variables == refined.variables => refined,
            _ => context.finished(found),
        };
        Ok(Selected { found, rows, refits })
    }

    /// Fits of linear films of both topologies, those with few branches first. Fewer if the search is interrupted.
    fn linear(&self) -> Vec<Found> {
        let Self { context, settings, .. } = self;
        let mut fits: Vec<Found> = Vec::new();
        for &topology in &settings.topologies {
            // Below two branches the topologies are the same model.
            let is_first = topology == settings.topologies[0];
            let shared = if is_first { None } else { fits.iter().rfind(|fit| fit.candidate.branches() < 2).cloned() };
            let other = fits.clone();
            let explored = |branches: usize, smaller: Option<&Found>| {
                let grown = smaller.map_or_else(Vec::new, |fit| grown(&fit.candidate, topology, context.scales));
                context.explored(topology, branches, &grown)
            };
            // One with many branches alone is found through those with fewer: random starts lead to poor minima.
            let fit = |branches: usize, smaller: Option<&Found>| {
                let from = smaller.map_or(1, |fit| fit.candidate.branches() + 1);
                let fewer = (from..branches).fold(smaller.cloned(), |last, n| explored(n, last.as_ref()).or(last));
                explored(branches, fewer.as_ref())
            };
            let rival = |fit: &Found| other.iter().find(|o| o.candidate.branches() == fit.candidate.branches());
            let goes_on = |fit: &Found| rival(fit).is_none_or(|other| fit.minimum.cost <= other.minimum.cost);
            let branches = settings.branches.iter().copied().filter(|&n| is_first || n >= 2);
            fits.extend(self.growing(topology.name(), branches, shared, fit, goes_on));
        }
        fits
    }

    /// Fits with so many `branches`, each by `fit`, which is given the one before, as long as one more branch makes the error smaller, the
    /// residuals are not white, and `goes_on`.
    fn growing(
        &self,
        name: &str,
        branches: impl Iterator<Item = usize>,
        shared: Option<Found>,
        fit: impl Fn(usize, Option<&Found>) -> Option<Found>,
        goes_on: impl Fn(&Found) -> bool,
    ) -> Vec<Found> {
        let mut fits: Vec<Found> = Vec::new();
        for branches in branches {
            if self.context.stop.load(Ordering::Relaxed) && !fits.is_empty() {
                break;
            }
            self.stages.begin(format!("{name} with n = {branches}"), branches);
            let before = fits.last().or(shared.as_ref()).filter(|before| before.candidate.branches() + 1 == branches);
            let Some(found) = fit(branches, before) else { continue };
            let is_better = before.is_none_or(|before| is_worth_it(found.minimum.cost, before.minimum.cost));
            let ends = !is_better || !goes_on(&found) || self.is_white(&found);
            fits.push(found);
            if ends {
                break;
            }
        }
        fits
    }

    /// Whether the residuals of `found` leave nothing to be explained.
    fn is_white(&self, found: &Found) -> bool {
        let objective = self.context.coarse;
        let residuals = objective.evaluate(&found.candidate).map(|evaluation| objective.residuals(&evaluation));
        residuals.is_none_or(|mut residuals| {
            if self.context.settings.loss == Loss::Huber {
                // Drop-outs are white, and hide what is not.
                let most = 3.0 * robust_deviation(&residuals);
                residuals.iter_mut().for_each(|residual| *residual = residual.clamp(-most, most));
            }
            Whiteness::new(objective.values(), &residuals).white
        })
    }

    /// Fits of every kind of nonlinearity that may be selected instead of `linear` ones.
    fn nonlinear(&self, linear: &[Found]) -> Vec<Found> {
        let Self { context, settings, stages, .. } = self;
        let is_auto = settings.curve == CurveChoice::Auto;
        // Hencky's strain is that of a film of constant volume, whose coupling follows from its length.
        let is_free = |variable: &Variable| context.freed.contains(variable);
        let may_be_hencky = is_free(&Variable::StretchCoupling) && !is_free(&Variable::Length);
        let mut kinds = Kind::for_choice(settings.curve, self.observations);
        kinds.retain(|kind| *kind != Kind::Hencky || may_be_hencky);
        let Some(best) = least(linear.iter()).filter(|best| kinds.len() > 1 && !(is_auto && self.is_white(best)))
        else {
            return Vec::new();
        };
        let reach = reach(self.observations, best.candidate.offset_m);
        let topology = best.candidate.topology;
        // The beginning of long recordings shows which structures come near the best.
        let beginning = context.scout.filter(|_| is_long(context.fine));
        let branches = || settings.branches.iter().copied();
        self.stages.expect(kinds[1..].iter().flat_map(|_| branches().take(3).map(work)));
        let mut fits: Vec<Found> = Vec::new();
        // The best of every kind. Costs on the beginning are not those of linear films on all of it.
        let mut least_of: Vec<(Kind, Found)> = match beginning {
            Some(_) => Vec::new(),
            None => vec![(Kind::Linear, best.clone())],
        };
        for &kind in &kinds[1..] {
            let least_cost = least(linear.iter().chain(&fits)).map_or(f64::INFINITY, |least| least.minimum.cost);
            let bent = |start: &Candidate| kind.starts(start, reach);
            let others = fits.clone();
            let fit = |branches: usize, smaller: Option<&Found>| {
                let simpler = linear.iter().chain(&others).filter(|fit| fit.candidate.branches() == branches);
                let simpler = least(simpler.filter(|fit| kind.extends(&fit.candidate)));
                if simpler.is_some_and(|fit| fit.minimum.cost > kind.reaches() * least_cost) {
                    return None;
                }
                let mut starts: Vec<Candidate> = simpler.iter().flat_map(|fit| bent(&fit.candidate)).collect();
                match (kind, simpler) {
                    (Kind::Beside { .. } | Kind::Hencky, Some(film)) => {
                        let pieces = kind.beside().unwrap_or(0);
                        let scale = context.variables_of(&starts[0]).contains(&Variable::Permittivity);
                        starts.extend(relaxing(&film.candidate, pieces, reach.range_m, context.scales, scale));
                    }
                    (Kind::Series { .. }, Some(_)) => {
                        let series = starts[0].clone();
                        starts.extend(creeping(&series, context.scales));
                    }
                    _ => {}
                }
                starts.extend(smaller.iter().flat_map(|fit| grown(&fit.candidate, topology, context.scales)));
                if starts.is_empty() || branches == 0 {
                    starts.extend(context.linear_starts(topology, branches).iter().flat_map(bent));
                }
                if kind == Kind::Hencky {
                    starts = starts.iter().map(Candidate::to_hencky).collect();
                }
                let variables = context.variables_of(starts.first()?);
                match beginning {
                    Some(beginning) => context.best_over(beginning, &starts),
                    None => context.explored_from(&starts, &variables),
                }
            };
            // With as many branches it comes near the best. A spring in series is worth one.
            let size = |fit: &Found| fit.candidate.branches() + usize::from(fit.candidate.is_in_series());
            let goes_on = |fit: &Found| {
                let mut rivals = others.iter().filter(|other| size(other) <= size(fit));
                rivals.all(|other| is_near(fit.minimum.cost, other.minimum.cost))
            };
            // Without a saturation it has shown how many branches it takes.
            let simpler = least(others.iter().filter(|other| kind.adds_saturation_to(&other.candidate)));
            let free = others.iter().filter(|other| kind == Kind::Hencky && kind.extends(&other.candidate));
            let fewest = simpler.or(least(free)).map_or(0, |simpler| simpler.candidate.branches());
            let branches = branches().filter(|&n| n >= fewest);
            let simpler = least_of.iter().filter(|(other, _)| is_auto && kind.adds_to(*other)).map(|(_, found)| found);
            let simpler = least(simpler);
            let with_as_many = simpler.and_then(|simpler| {
                let branches = simpler.candidate.branches();
                stages.begin(format!("{} with n = {branches}", kind.name()), branches);
                fit(branches, None)
            });
            let adds = |(more, simpler): (&Found, &Found)| more.minimum.cost <= ADDS * simpler.minimum.cost;
            if !with_as_many.as_ref().zip(simpler).is_none_or(adds) {
                continue;
            }
            let fit = |branches: usize, smaller: Option<&Found>| {
                let same =
                    with_as_many.iter().find(|found| smaller.is_none() && found.candidate.branches() == branches);
                same.cloned().or_else(|| fit(branches, smaller))
            };
            let found = self.growing(&kind.name(), branches, None, fit, goes_on);
            least_of.extend(least(found.iter()).map(|least| (kind, least.clone())));
            fits.extend(found);
        }
        if beginning.is_some() {
            fits = self.finalists(&fits);
        }
        // What is left out is hardly fitted better than what is not: only what is near the best is compared.
        let least = fits.iter().map(|fit| fit.minimum.cost).fold(f64::INFINITY, f64::min);
        let least = if is_auto { least.min(best.minimum.cost) } else { least };
        fits.retain(|fit| is_near(fit.minimum.cost, least));
        fits
    }

    /// The best of `fits` to the beginning on all of the thinned recordings, without larger ones that are worth nothing beside a smaller one.
    fn finalists(&self, fits: &[Found]) -> Vec<Found> {
        let is_larger = |fit: &Found, other: &Found| {
            other.variables.len() < fit.variables.len() && !is_worth_it(fit.minimum.cost, other.minimum.cost)
        };
        let mut best: Vec<&Found> = fits.iter().filter(|fit| !fits.iter().any(|other| is_larger(fit, other))).collect();
        best.sort_by(|a, b| a.minimum.cost.total_cmp(&b.minimum.cost));
        best.iter().take(FINALISTS).filter_map(|fit| self.context.coarsened(&fit.candidate)).collect()
    }

    /// The selected one of all that was `found`, with the rows of all if there are several.
    fn selected(&self, mut found: Vec<Found>) -> Result<Selected> {
        let Self { context, settings, observations, .. } = self;
        if found.len() == 1 {
            return Ok(Selected::only(found.swap_remove(0)));
        }
        let left_out = left_out(context, observations)?;
        self.stages.expect(found.iter().map(|found| work(found.candidate.branches())));
        let mut fits: Vec<StructureFit> = Vec::new();
        for found in found {
            let branches = found.candidate.branches();
            self.stages.begin(format!("{} with n = {branches}, left out", found.candidate.curve_name()), branches);
            fits.extend(StructureFit::new(context, &left_out, found));
        }
        let is_asked_for = settings.curve != CurveChoice::Auto && fits.iter().any(|fit| !fit.is_linear());
        let one_amplitude = has_one_amplitude(observations);
        let Selection { index, rivals, rows } =
            Selection::new(&fits, context.coarse.samples(), is_asked_for, one_amplitude);
        if fits.is_empty() {
            return Err(Error::Computation("no structure could be fitted to these recordings".into()));
        }
        let rivals: Vec<Candidate> = rivals.iter().map(|&k| fits[k].found.candidate.clone()).collect();
        let StructureFit { found, mut refits, .. } = fits.swap_remove(index);
        // The film may be one of them as well.
        refits.extend(rivals.into_iter().filter(|rival| rival.topology == found.candidate.topology));
        Ok(Selected { found, rows, refits })
    }
}

/// The parts of `observations` that are left out, thinned.
fn left_out<'a>(context: &Context<'a>, observations: &[Observation]) -> Result<LeftOut<'a>> {
    let thinned: Vec<Observation> = observations.iter().map(observation::thinned).collect();
    LeftOut::new(&thinned, context.coarse, Objective::thinned)
}

/// Fits of the structure that was `found` to parts of `observations`; empty where one is missing.
pub fn refits(context: &Context<'_>, observations: &[Observation], found: &Found) -> Result<Vec<Candidate>> {
    let fits = left_out(context, observations)?.refitted(context, found);
    Ok(fits.map_or_else(|_| Vec::new(), |(_, refits)| refits))
}
