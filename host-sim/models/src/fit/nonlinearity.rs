//! Selection of what lies beyond a linear film: an elastic curve, a drive that saturates, or both.
//!
//! The linear structure is found first. Every kind of nonlinearity is then fitted from there, with as many branches and with fewer,
//! because a curve often explains what branches were needed for. The smallest of all that is not worse than the best is selected, by
//! the rules by which branches are.

use std::sync::atomic::Ordering;

use rayon::prelude::*;
use springpot::Topology;

use super::candidate::{Bend, Candidate};
use super::levenberg_marquardt::StoppingCriteria;
use super::objective::Objective;
use super::observation::{self, Observation};
use super::search::{Context, Found, is_long};
use super::selection::{self, Criteria, LeftOut, StructureFit, StructureRow};
use super::settings::{self as stages, Stages};
use super::settings::{CurveChoice, Settings};
use super::statistics::{Whiteness, range};
use crate::error::Result;
use crate::files::recording::Input;

/// One kind of nonlinearity.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Saturation,
    MooneyRivlin,
    Gent,
    Free { pieces: usize, saturates: bool },
}

impl Kind {
    /// The kinds that `choice` names for these observations.
    fn for_choice(choice: CurveChoice, observations: &[Observation]) -> Vec<Self> {
        let volts = observations.iter().any(|o| matches!(o.input, Input::Voltage(_)));
        let free = |saturates| [2, 4].map(|pieces| Self::Free { pieces, saturates }).to_vec();
        match choice {
            CurveChoice::None => Vec::new(),
            CurveChoice::Saturation => vec![Self::Saturation],
            CurveChoice::MooneyRivlin => vec![Self::MooneyRivlin],
            CurveChoice::Gent => vec![Self::Gent],
            CurveChoice::Free => free(false),
            CurveChoice::Both => free(true),
            CurveChoice::Auto if volts => [vec![Self::Saturation], free(false), free(true)].concat(),
            CurveChoice::Auto => [vec![Self::MooneyRivlin, Self::Gent], free(false)].concat(),
        }
    }

    /// Its name while it is fitted.
    fn name(self) -> String {
        match self {
            Self::Saturation => "saturation".into(),
            Self::MooneyRivlin => "mooney-rivlin".into(),
            Self::Gent => "gent".into(),
            Self::Free { pieces, saturates: false } => format!("free curve of {pieces} pieces"),
            Self::Free { pieces, saturates: true } => format!("free curve of {pieces} pieces and saturation"),
        }
    }

    /// `candidate` with a little of this nonlinearity: starts of a search. `range_m` is the stroke, `largest_v` the largest voltage.
    fn starts(self, candidate: &Candidate, range_m: (f64, f64), largest_v: f64) -> Vec<Candidate> {
        let mut start = candidate.clone();
        // A twentieth of the force at the largest voltage.
        let saturation_v = Some(20f64.sqrt() * largest_v.max(1.0));
        match self {
            Self::Saturation => {
                start.actuator.saturation_v = saturation_v;
                vec![start]
            }
            Self::Free { pieces, saturates } => {
                start.bend = Bend::free(pieces, range_m);
                start.actuator.saturation_v = saturation_v.filter(|_| saturates);
                vec![start]
            }
            Self::MooneyRivlin | Self::Gent => {
                let stroke = range_m.1.abs().max(range_m.0.abs());
                // Stretched to 1.3, 2 and 5 times its length.
                [3.3f64, 1.0, 0.25]
                    .into_iter()
                    .map(|length| {
                        let farthest = 1.0 + 1.0 / length;
                        let invariant = farthest * farthest + 2.0 / farthest - 3.0;
                        let ln_limit = (self == Self::Gent).then(|| (5.0 * invariant).ln());
                        let ln_length = (length * stroke).ln();
                        let bend = Bend::Rubber { share: 0.5, ln_limit, ln_length, rest_stretch: 1.0, range_m };
                        Candidate { bend, ..start.clone() }
                    })
                    .collect()
            }
        }
    }
}

/// Number of the kinds that `choice` names for these observations.
pub(super) fn kinds(choice: CurveChoice, observations: &[Observation]) -> usize {
    Kind::for_choice(choice, observations).len()
}

/// The stroke of all `observations` with a margin, and the largest voltage (V).
fn reach(observations: &[Observation], offset_m: f64) -> ((f64, f64), f64) {
    let (mut low, mut high, mut largest_v) = (0f64, 0f64, 0f64);
    for observation in observations {
        let values = &observation.input.samples().value;
        let (least, most) = match observation.input {
            Input::Displacement(_) => range(values),
            _ => {
                let (least, most) = range(&observation.measured.value);
                (least - offset_m, most - offset_m)
            }
        };
        (low, high) = (low.min(least), high.max(most));
        if let Input::Voltage(_) = observation.input {
            largest_v = values.iter().fold(largest_v, |largest, v| largest.max(v.abs()));
        }
    }
    let margin = 0.05 * (high - low);
    // Noise about 0 is no stroke.
    let low = if low < -0.05 * (high - low) { low - margin } else { low };
    ((low, high + margin), largest_v)
}

/// Beyond the linear `fit`, whose rows are `rows`: the selected structure, and the rows of all.
///
/// # Errors
///
/// [`Error`](crate::error::Error) for recordings that cannot be fitted.
pub fn select(
    context: &Context<'_>,
    observations: &[Observation],
    settings: &Settings,
    stages: &Stages<'_>,
    (linear, rows): (Found, Vec<StructureRow>),
) -> Result<(Found, Vec<StructureRow>)> {
    let choice = settings.curve;
    let kinds = Kind::for_choice(choice, observations);
    let residuals = |found: &Found| context.fine.evaluate(&found.candidate).map(|e| context.fine.residuals(&e));
    // White residuals leave nothing to be explained.
    let explained = residuals(&linear).is_none_or(|residuals| Whiteness::new(context.fine.values(), &residuals).white);
    if kinds.is_empty() || (explained && choice == CurveChoice::Auto) {
        return Ok((linear, rows));
    }
    let Some(base) = context.coarsened(&linear.candidate) else { return Ok((linear, rows)) };
    let bent = Bent { context, scouted: context.scouted(), observations, stages, base, settings };
    let mut fits = bent.fits(&kinds)?;
    if choice != CurveChoice::Auto && fits.len() > 1 {
        // What was asked for, not the linear film.
        fits.remove(0);
    }
    if fits.is_empty() {
        return Ok((linear, rows));
    }
    let criteria = Criteria::new(context.coarse, &fits);
    let selected = criteria.smallest_that_is_not_worse(&fits);
    let is_linear = |fit: &StructureFit| fit.found.candidate.bend == Bend::Straight && !fit.saturates();
    let stays = is_linear(&fits[selected]);
    let linear_rows = rows.into_iter().map(|row| StructureRow { chosen: row.chosen && stays, ..row });
    let bent = fits.iter().enumerate().filter(|(_, fit)| !is_linear(fit));
    let bent = bent.map(|(k, fit)| criteria.row(fit, k, k == selected));
    let rows = linear_rows.chain(bent).collect();
    if stays {
        return Ok((linear, rows));
    }
    stages.tell("all samples");
    // Between thinned recordings and all samples of long ones the minimum moves little.
    let fine = StoppingCriteria { iterations: 60, decrease: if is_long(context.fine) { 1e-6 } else { 1e-8 } };
    Ok((context.descend(context.fine, &fits[selected].found.candidate, fine).unwrap_or(linear), rows))
}

/// Fits of nonlinear films to thinned recordings.
struct Bent<'a> {
    context: &'a Context<'a>,
    /// Where kinds and numbers of branches are tried.
    scouted: &'a Objective,
    observations: &'a [Observation],
    stages: &'a Stages<'a>,
    /// The linear film.
    base: Found,
    settings: &'a Settings,
}

impl Bent<'_> {
    /// The linear film, and the films of `kinds` that come near the best of them.
    fn fits(self, kinds: &[Kind]) -> Result<Vec<StructureFit>> {
        let smaller = || self.settings.branches.iter().filter(|&&n| n <= self.base.candidate.branches());
        self.stages.expect(kinds.iter().flat_map(|_| smaller().map(|&branches| stages::work(branches))));
        let mut found: Vec<(Kind, Found)> = kinds.iter().flat_map(|&kind| self.smaller(kind)).collect();
        let cost = |(_, found): &(Kind, Found)| found.minimum.cost;
        // What a linear film cannot show, because its error hides it, may need more branches. One recording alone cannot tell them
        // from a curve of another shape.
        let best = found.iter().min_by(|a, b| cost(a).total_cmp(&cost(b))).cloned();
        if let (Some((kind, best)), true) = (best, self.observations.len() > 1) {
            found.extend(self.larger(kind, best));
        }
        let mut least = found.iter().map(cost).fold(f64::INFINITY, f64::min);
        if !std::ptr::eq(self.scouted, self.context.coarse) {
            // The beginning of a long recording shows which kinds are worth it and come near the best. The others are left out.
            let stopping = StoppingCriteria { iterations: 60, decrease: 1e-7 };
            let linear = self.context.descend(self.scouted, &self.base.candidate, stopping);
            let linear = linear.map_or(f64::INFINITY, |linear| linear.minimum.cost);
            let enough = if self.settings.curve == CurveChoice::Auto { WORTH * linear } else { f64::INFINITY };
            found.retain(|fit| cost(fit) <= (FAR * least).min(enough));
            found.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
            if self.observations.len() == 1 {
                found.truncate(FINALISTS);
            }
            let again = |(kind, found): (Kind, Found)| Some((kind, self.context.coarsened(&found.candidate)?));
            found = found.into_par_iter().filter_map(again).collect();
            least = found.iter().map(cost).fold(f64::INFINITY, f64::min);
        }
        // What is asked for is fitted even where it is worth nothing.
        if self.settings.curve == CurveChoice::Auto && least > WORTH * self.base.minimum.cost {
            found.clear();
        }
        let thinned: Vec<Observation> = self.observations.iter().map(observation::thinned).collect();
        let left_out = LeftOut::new(&thinned)?;
        if left_out.is_some() {
            // What is left out is hardly fitted better than what is not: only what is near the best is tried.
            found.retain(|fit| cost(fit) <= FAR * least);
        }
        let fit = |found: Found| -> Option<StructureFit> {
            let (topology, branches) = (found.candidate.topology, found.candidate.branches());
            let mut fit = StructureFit::new(self.context.coarse, topology, branches, found)?;
            fit.left_out_nrmse_pct = left_out.as_ref().and_then(|left_out| left_out.error(self.context, &fit.found));
            Some(fit)
        };
        self.stages.expect(found.iter().map(|(_, found)| stages::work(found.candidate.branches())));
        let mut fits: Vec<StructureFit> = fit(self.base).into_iter().collect();
        for (kind, found) in found {
            if self.context.stop.load(Ordering::Relaxed) {
                break;
            }
            let branches = found.candidate.branches();
            self.stages.begin(format!("{} with n = {branches}, left out", kind.name()), branches);
            fits.extend(fit(found));
        }
        Ok(fits)
    }

    /// Fits of `kind` with as many branches as the linear film, and with fewer.
    fn smaller(&self, kind: Kind) -> Vec<(Kind, Found)> {
        let Self { context, base, .. } = self;
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
            let Some(found) = context.best_over(self.scouted, &starts) else { continue };
            let cost = found.minimum.cost;
            fits.push((kind, found));
            // Fewer branches that are clearly too few end the descent.
            if cost > FAR * least {
                break;
            }
            least = least.min(cost);
        }
        fits
    }

    /// Fits of `kind` with more branches than `best`, as long as each makes the error smaller.
    fn larger(&self, kind: Kind, best: Found) -> Vec<(Kind, Found)> {
        let mut fits = Vec::new();
        let mut last = best;
        while self.settings.branches.contains(&(last.candidate.branches() + 1))
            && !self.context.stop.load(Ordering::Relaxed)
        {
            let topology = Topology::Parallel;
            let branches = last.candidate.branches() + 1;
            self.stages.begin(format!("{} with n = {branches}", kind.name()), branches);
            let starts = selection::grown(&last.candidate, topology, self.context);
            let Some(found) = self.context.best_over(self.scouted, &starts) else { break };
            if found.minimum.cost > WORTH * last.minimum.cost {
                break;
            }
            last = found.clone();
            fits.push((kind, found));
        }
        fits
    }
}

/// Kinds of one long recording that are fitted beyond its beginning.
const FINALISTS: usize = 2;
/// Share of a cost to which a nonlinearity, or one more branch, must bring it: errors a twentieth smaller.
const WORTH: f64 = 0.9;
/// A cost so many times the least is far from it: errors 1.3 times as large.
const FAR: f64 = 1.7;
