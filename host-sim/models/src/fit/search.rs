//! The search over structures: topology × branches × elastic curve × saturation.
//!
//! Linear structures come first, from few branches to many. Every kind of nonlinearity is then fitted from the linear film that is
//! selected, with as many branches and with fewer, because a curve often explains what branches were needed for, and with more.
//! [`Selection`] selects one of each round by the same rule: among the linear structures, and among that linear film and all that
//! lies beyond it. There are two rounds because the product of all would take hours.

use std::sync::atomic::Ordering;

use rayon::prelude::*;
use springpot::Topology;

use super::candidate::{Bend, Candidate};
use super::descent::{Context, Found, is_long};
use super::observation::{self, Observation};
use super::pattern_search;
use super::selection::{LeftOut, Selection, StructureFit, StructureRow, is_near, is_worth_it};
use super::settings::{CurveChoice, Method, Settings, Stages, topology_name, work};
use super::starts::{Kind, grown, reach};
use super::statistics::Whiteness;
use crate::error::{Error, Result};
use crate::least_squares::StoppingCriteria;

/// Kinds of one long recording that are fitted beyond its beginning.
const FINALISTS: usize = 2;

/// A selected structure on all samples, and the rows of all that were compared.
pub type Selected = (Found, Vec<StructureRow>);

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
    ///
    /// # Errors
    ///
    /// [`Error::Computation`] where no structure has a fit.
    pub fn best(&self) -> Result<Selected> {
        let Self { context, settings, stages, .. } = self;
        if settings.method == Method::PatternSearch {
            return Ok((pattern_search::best_structure(context, settings, stages)?, Vec::new()));
        }
        let linear = match settings.single_structure() {
            None => self.linear()?,
            Some((topology, branches)) => (self.single(topology, branches)?, Vec::new()),
        };
        match &settings.start {
            Some(start) if start.bend != Bend::Straight => Ok(linear),
            _ => self.beyond(linear),
        }
    }

    /// The only structure that is asked for, from the start of the user or from random ones.
    fn single(&self, topology: Topology, branches: usize) -> Result<Found> {
        if let Some(start) = &self.settings.start {
            return self.context.refined(start, topology);
        }
        self.stages.begin("fit", branches);
        self.context.best(topology, branches, &[]).ok_or_else(|| {
            let names: Vec<&str> = self.observations.iter().map(|o| o.name.as_str()).collect();
            Error::Computation(format!(
                "{}: no start leads to a fit; check the units of voltage and displacement, and the actuator",
                names.join(", ")
            ))
        })
    }

    /// The linear structure that is selected.
    fn linear(&self) -> Result<Selected> {
        let mut fits = self.linear_fits()?;
        let Selection { index, rows } = Selection::new(self.context.compared, &fits);
        self.stages.note("the chosen structure on all samples");
        Ok((self.context.finished(fits.swap_remove(index).found), rows))
    }

    /// Fits of all linear structures, larger ones also from smaller ones. With a single recording no larger structures are tried
    /// once residuals are white, one more branch was not worth it, or the other topology was better with as many. Fewer if the
    /// search is interrupted.
    fn linear_fits(&self) -> Result<Vec<StructureFit>> {
        let Self { context, settings, .. } = self;
        let left_out = self.left_out(is_long(context.fine))?;
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
                self.stages.begin(format!("{} with n = {n}", topology_name(topology)), n);
                let before = smaller.map(|k| &fits[k]);
                let starts = before.map_or_else(Vec::new, |fit| grown(&fit.found.candidate, topology, context.scales));
                let found = context.explored(topology, n, &starts);
                let fit =
                    found.and_then(|found| StructureFit::new(context, context.compared, left_out.as_ref(), found));
                let Some(fit) = fit else { continue };
                let is_better = before.is_none_or(|before| !before.is_as_good_as(&fit));
                // The other topology with as many branches.
                let other = fits.iter().find(|other| other.branches == n && other.topology != topology);
                let goes_on = is_better && other.is_none_or(|other| fit.is_as_good_as(other));
                let is_white = fit.whiteness.white;
                smaller = Some(fits.len());
                fits.push(fit);
                match left_out {
                    None if is_white => break 'structures,
                    None if !goes_on => break,
                    _ => {}
                }
            }
        }
        if fits.is_empty() {
            return Err(Error::Computation("no structure could be fitted to these recordings".into()));
        }
        Ok(fits)
    }

    /// Fits with each recording left out in turn, on the thinned recordings if `is_thinned`.
    fn left_out(&self, is_thinned: bool) -> Result<Option<LeftOut>> {
        if is_thinned {
            LeftOut::new(&self.observations.iter().map(observation::thinned).collect::<Vec<_>>())
        } else {
            LeftOut::new(self.observations)
        }
    }

    /// The structure that is selected among the `linear` one, whose rows are `rows`, and those with a curve or a saturation.
    fn beyond(&self, (linear, rows): Selected) -> Result<Selected> {
        let Self { context, settings, .. } = self;
        let kinds = Kind::for_choice(settings.curve, self.observations);
        let residuals = |found: &Found| context.fine.evaluate(&found.candidate).map(|e| context.fine.residuals(&e));
        // White residuals leave nothing to be explained.
        let is_explained =
            residuals(&linear).is_none_or(|residuals| Whiteness::new(context.fine.values(), &residuals).white);
        if kinds.is_empty() || (is_explained && settings.curve == CurveChoice::Auto) {
            return Ok((linear, rows));
        }
        let Some(base) = context.coarsened(&linear.candidate) else { return Ok((linear, rows)) };
        let left_out = self.left_out(true)?;
        let found = self.beyond_candidates(&base, &kinds, left_out.is_some());
        let mut fits = self.beyond_fits(base, found, left_out.as_ref());
        if settings.curve != CurveChoice::Auto && fits.len() > 1 {
            // What was asked for, not the linear film.
            fits.remove(0);
        }
        if fits.is_empty() {
            return Ok((linear, rows));
        }
        let selection = Selection::new(context.coarse, &fits);
        let stays = fits[selection.index].is_linear();
        let linear_rows = rows.into_iter().map(|row| StructureRow { chosen: row.chosen && stays, ..row });
        let others = fits.iter().zip(selection.rows).filter(|(fit, _)| !fit.is_linear()).map(|(_, row)| row);
        let rows = linear_rows.chain(others).collect();
        if stays {
            return Ok((linear, rows));
        }
        self.stages.note("all samples");
        // Between thinned recordings and all samples of long ones the minimum moves little.
        let fine = StoppingCriteria { iterations: 60, decrease: if is_long(context.fine) { 1e-6 } else { 1e-8 } };
        let selected = &fits[selection.index].found.candidate;
        Ok((context.descend(context.fine, selected, fine).unwrap_or(linear), rows))
    }

    /// Candidates of `kinds` on the thinned recordings that may be selected instead of the linear film `base`.
    fn beyond_candidates(&self, base: &Found, kinds: &[Kind], is_validated: bool) -> Vec<(Kind, Found)> {
        let Self { context, settings, .. } = self;
        let smaller = || settings.branches.iter().filter(|&&n| n <= base.candidate.branches());
        self.stages.expect(kinds.iter().flat_map(|_| smaller().map(|&branches| work(branches))));
        let mut found: Vec<(Kind, Found)> = kinds.iter().flat_map(|&kind| self.with_fewer(base, kind)).collect();
        // What a linear film cannot show, because its error hides it, may need more branches. One recording alone cannot
        // distinguish them from a curve of another shape.
        let best = found.iter().min_by(|a, b| cost(a).total_cmp(&cost(b))).cloned();
        if let (Some((kind, best)), true) = (best, self.observations.len() > 1) {
            found.extend(self.with_more(kind, best));
        }
        let is_auto = settings.curve == CurveChoice::Auto;
        let mut least = found.iter().map(cost).fold(f64::INFINITY, f64::min);
        if !std::ptr::eq(context.scouted(), context.coarse) {
            // The beginning of a long recording shows which kinds are worth it and come near the best. The others are left out.
            let stopping = StoppingCriteria { iterations: 60, decrease: 1e-7 };
            let linear = context.descend(context.scouted(), &base.candidate, stopping);
            let linear = linear.map_or(f64::INFINITY, |linear| linear.minimum.cost);
            found.retain(|fit| is_near(cost(fit), least) && (!is_auto || is_worth_it(cost(fit), linear)));
            found.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
            if self.observations.len() == 1 {
                found.truncate(FINALISTS);
            }
            let again = |(kind, found): (Kind, Found)| Some((kind, context.coarsened(&found.candidate)?));
            found = found.into_par_iter().filter_map(again).collect();
            least = found.iter().map(cost).fold(f64::INFINITY, f64::min);
        }
        // What is asked for is fitted even where it is worth nothing.
        if is_auto && !is_worth_it(least, base.minimum.cost) {
            found.clear();
        }
        if is_validated {
            // What is left out is hardly fitted better than what is not: only what is near the best is tried.
            found.retain(|fit| is_near(cost(fit), least));
        }
        found
    }

    /// The linear film `base` and what was `found` beyond it, with their errors on left-out recordings.
    fn beyond_fits(&self, base: Found, found: Vec<(Kind, Found)>, left_out: Option<&LeftOut>) -> Vec<StructureFit> {
        let fit = |found: Found| StructureFit::new(self.context, self.context.coarse, left_out, found);
        self.stages.expect(found.iter().map(|(_, found)| work(found.candidate.branches())));
        let mut fits: Vec<StructureFit> = fit(base).into_iter().collect();
        for (kind, found) in found {
            if self.context.stop.load(Ordering::Relaxed) {
                break;
            }
            let branches = found.candidate.branches();
            self.stages.begin(format!("{} with n = {branches}, left out", kind.name()), branches);
            fits.extend(fit(found));
        }
        fits
    }

    /// Fits of `kind` with as many branches as the linear film `base`, and with fewer.
    fn with_fewer(&self, base: &Found, kind: Kind) -> Vec<(Kind, Found)> {
        let Self { context, .. } = self;
        let (range_m, largest_v) = reach(self.observations, base.candidate.offset_m);
        let bent = |start: &Candidate| kind.starts(start, range_m, largest_v);
        let mut fits = Vec::new();
        let mut least = f64::INFINITY;
        for &branches in self.settings.branches.iter().rev().filter(|&&n| n <= base.candidate.branches()) {
            if context.stop.load(Ordering::Relaxed) {
                break;
            }
            self.stages.begin(format!("{} with n = {branches}", kind.name()), branches);
            let starts = if branches == base.candidate.branches() {
                bent(&base.candidate)
            } else {
                context.linear_starts(base.candidate.topology, branches).iter().flat_map(bent).collect()
            };
            let Some(found) = context.best_over(context.scouted(), &starts) else { continue };
            let cost = found.minimum.cost;
            fits.push((kind, found));
            // Fewer branches that are clearly too few end the descent.
            if !is_near(cost, least) {
                break;
            }
            least = least.min(cost);
        }
        fits
    }

    /// Fits of `kind` with more branches than `best`, as long as each makes the error smaller.
    fn with_more(&self, kind: Kind, best: Found) -> Vec<(Kind, Found)> {
        let Self { context, .. } = self;
        let mut fits = Vec::new();
        let mut last = best;
        while self.settings.branches.contains(&(last.candidate.branches() + 1)) && !context.stop.load(Ordering::Relaxed)
        {
            let branches = last.candidate.branches() + 1;
            self.stages.begin(format!("{} with n = {branches}", kind.name()), branches);
            let starts = grown(&last.candidate, Topology::Parallel, context.scales);
            let Some(found) = context.best_over(context.scouted(), &starts) else { break };
            if !is_worth_it(found.minimum.cost, last.minimum.cost) {
                break;
            }
            last = found.clone();
            fits.push((kind, found));
        }
        fits
    }
}

fn cost((_, found): &(Kind, Found)) -> f64 {
    found.minimum.cost
}
