//! Searches for the best candidate of one structure: from many starts on thinned recordings, then on all samples.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;
use springpot::{Actuator, Topology};

use super::Settings;
use super::candidate::{Candidate, Variable};
use super::levenberg_marquardt::{self, Limits, Minimum, Problem};
use super::loss::{self, Huber, Loss, Weights};
use super::objective::{Evaluation, Objective, Observation};
use super::observation;
use super::starts::{self, Scales};
use crate::error::Result;

/// Observations made ready for searches.
pub struct Workbench {
    coarse: Objective,
    fine: Objective,
    scales: Scales,
    evaluations: AtomicUsize,
}

impl Workbench {
    /// Makes `observations` ready; `actuator` turns voltage into force.
    ///
    /// # Errors
    ///
    /// As [`Objective::new`].
    pub fn new(observations: &[Observation], actuator: &Actuator) -> Result<Self> {
        let thinned: Vec<Observation> = observations.iter().map(observation::thinned).collect();
        Ok(Self {
            coarse: Objective::new(&thinned)?,
            fine: Objective::new(observations)?,
            scales: observation::scales(observations, actuator.force_per_square_volt()),
            evaluations: AtomicUsize::new(0),
        })
    }

    /// A context for searches with `settings`, `surroundings` fitted besides the elements.
    pub fn context<'a>(
        &'a self,
        settings: &Settings,
        surroundings: Vec<Variable>,
        stop: &'a AtomicBool,
    ) -> Context<'a> {
        Context {
            coarse: &self.coarse,
            fine: &self.fine,
            actuator: settings.actuator,
            surroundings,
            held: settings.held.clone(),
            loss: settings.loss,
            scales: self.scales,
            seed: settings.seed,
            starts: settings.starts,
            stop,
            evaluations: &self.evaluations,
        }
    }
}

/// What all searches of a fit share.
pub struct Context<'a> {
    /// Thinned recordings, where searches begin.
    pub coarse: &'a Objective,
    /// All samples, where they end.
    pub fine: &'a Objective,
    /// Eq. 1 and the weight at the start.
    pub actuator: Actuator,
    /// What is fitted besides the elements.
    pub surroundings: Vec<Variable>,
    /// Elements' variables that are not fitted.
    pub held: Vec<Variable>,
    /// How residuals count.
    pub loss: Loss,
    /// What the recordings tell beforehand.
    pub scales: Scales,
    /// Seed of the starts.
    pub seed: u64,
    /// Random starts of a structure; larger ones that go on from smaller ones take fewer.
    pub starts: usize,
    /// Set to end early and keep the best so far.
    pub stop: &'a AtomicBool,
    /// Counts residual evaluations.
    pub evaluations: &'a AtomicUsize,
}

/// A candidate that was found.
#[derive(Clone, Debug)]
pub struct Found {
    /// The candidate.
    pub candidate: Candidate,
    /// The variables that were fitted.
    pub variables: Vec<Variable>,
    /// The minimum on all samples.
    pub minimum: Minimum,
}

impl Context<'_> {
    /// The variables of a structure with so many branches.
    pub fn variables(&self, branches: usize) -> Vec<Variable> {
        Variable::of_model(branches)
            .into_iter()
            .filter(|variable| !self.held.contains(variable))
            .chain(self.surroundings.iter().copied())
            .collect()
    }

    /// The best candidate of a structure; `warm` are further starts.
    pub fn best(&self, topology: Topology, branches: usize, warm: &[Candidate]) -> Option<Found> {
        // Larger structures begin from smaller ones, too.
        let random_starts = if warm.is_empty() { self.starts } else { self.starts.div_ceil(branches.max(1)) };
        let random = (0..random_starts).map(|index| {
            let mut start = starts::start(self.actuator, topology, branches, self.scales, self.seed, index);
            if self.surroundings.contains(&Variable::StretchCoupling) && start.actuator.stretch_coupling == 0.0 {
                start.actuator.stretch_coupling = self.scales.coupling;
            }
            start
        });
        let starts: Vec<Candidate> = warm.iter().cloned().chain(random).collect();
        self.best_from(&starts, &self.variables(branches))
    }

    /// The best candidate that `starts` lead to over chosen `variables`.
    pub fn best_from(&self, starts: &[Candidate], variables: &[Variable]) -> Option<Found> {
        let coarse = Limits { iterations: 60, decrease: 1e-7 };
        let mut found: Vec<Found> = starts
            .par_iter()
            .filter_map(|start| self.descend_over(self.coarse, start, variables.to_vec(), coarse))
            .collect();
        found.sort_by(|a, b| a.minimum.cost.total_cmp(&b.minimum.cost));
        // The two best that differ go on, lest the thinning decide between them.
        let best = found.first()?.minimum.cost;
        found.dedup_by(|b, a| b.minimum.cost <= 1.001 * a.minimum.cost);
        found.truncate(if self.stop.load(Ordering::Relaxed) { 1 } else { 2 });
        found.retain(|f| f.minimum.cost <= 1.2 * best);
        let fine = Limits { iterations: 60, decrease: 1e-8 };
        found
            .iter()
            .filter_map(|start| self.descend_over(self.fine, &start.candidate, variables.to_vec(), fine))
            .min_by(|a, b| a.minimum.cost.total_cmp(&b.minimum.cost))
    }

    /// The minimum that `start` leads to.
    pub fn descend(&self, objective: &Objective, start: &Candidate, limits: Limits) -> Option<Found> {
        self.descend_over(objective, start, self.variables(start.branches()), limits)
    }

    /// The same over chosen variables.
    pub fn descend_over(
        &self,
        objective: &Objective,
        start: &Candidate,
        variables: Vec<Variable>,
        limits: Limits,
    ) -> Option<Found> {
        let mut descent = Descent {
            objective,
            base: start,
            bounds: variables.iter().map(|variable| variable.bounds()).collect(),
            variables,
            weights: None,
            stop: self.stop,
            evaluations: self.evaluations,
        };
        let mut place: Vec<f64> = descent.variables.iter().map(|variable| variable.get(start)).collect();
        let mut minimum = levenberg_marquardt::minimise(&descent, &place, limits)?;
        if self.loss == Loss::Huber {
            let huber = Huber::new(loss::range(objective.measured().flatten().copied()));
            // Iteratively reweighted least squares. After the first it is near.
            for pass in 0..6 {
                place.clone_from(&minimum.place);
                let evaluation = objective.evaluate(&descent.candidate(&place))?;
                descent.weights = Some(huber.weights(&objective.residuals(&evaluation)));
                let iterations = if pass == 0 { limits.iterations } else { limits.iterations.min(8) };
                let again = levenberg_marquardt::minimise(&descent, &place, Limits { iterations, ..limits })?;
                let moved =
                    again.place.iter().zip(&place).any(|(new, old)| (new - old).abs() > 1e-4 * old.abs().max(1e-3));
                minimum = again;
                if !moved {
                    break;
                }
            }
            let evaluation = objective.evaluate(&descent.candidate(&minimum.place))?;
            minimum.cost = huber.cost(&objective.residuals(&evaluation));
        }
        Some(Found { candidate: descent.candidate(&minimum.place), variables: descent.variables, minimum })
    }
}

/// One descent.
struct Descent<'a> {
    objective: &'a Objective,
    base: &'a Candidate,
    variables: Vec<Variable>,
    bounds: Vec<(f64, f64)>,
    weights: Option<Weights>,
    stop: &'a AtomicBool,
    evaluations: &'a AtomicUsize,
}

impl Descent<'_> {
    fn candidate(&self, place: &[f64]) -> Candidate {
        let mut candidate = self.base.clone();
        for (variable, &value) in self.variables.iter().zip(place) {
            variable.set(&mut candidate, value);
        }
        candidate
    }
}

impl Problem for Descent<'_> {
    type Evaluation = Evaluation;

    fn residuals(&self, place: &[f64]) -> Option<(Vec<f64>, Evaluation)> {
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        let evaluation = self.objective.evaluate(&self.candidate(place))?;
        let mut residuals = self.objective.residuals(&evaluation);
        if let Some(weights) = &self.weights {
            weights.apply(&mut residuals);
        }
        Some((residuals, evaluation))
    }

    fn jacobian(&self, place: &[f64], evaluation: &Evaluation) -> Vec<Vec<f64>> {
        let mut columns = self.objective.jacobian(&self.candidate(place), evaluation, &self.variables);
        if let Some(weights) = &self.weights {
            columns.iter_mut().for_each(|column| weights.apply(column));
        }
        columns
    }

    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    fn longest(&self, index: usize) -> f64 {
        match self.variables[index] {
            // In 1/m and m: as far as the bounds.
            Variable::StretchCoupling | Variable::Offset => f64::INFINITY,
            _ => levenberg_marquardt::LONGEST,
        }
    }

    fn interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
