//! The best candidate of one structure: descents from many starts on thinned recordings, then on all samples.
//!
//! Recordings are searched in up to three stages: the beginning of the thinned recordings where they are long, all of the thinned
//! recordings, on which structures are compared, and all samples for the structure that is chosen. The model steps along thinned recordings
//! with second-order differences, so that no branch explains the longer step.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;
use springpot::{Actuator, TemperatureDependence, Topology};

use super::candidate::{Candidate, Variable};
use super::objective::{Evaluation, Objective};
use super::observation::{self, Excitation, Observation};
use super::residuals::{Huber, Loss};
use super::settings::{Method, Settings};
use super::starts::{self, Scales};
use crate::error::{Error, Result};
use crate::least_squares::{self, Minimum, Problem, StoppingCriteria};
use crate::reduce;
use crate::statistics::{percentile_range, range};

/// Steps of thinned recordings up to which a search from many starts sees all of them.
const MAX_SCOUTED_STEPS: f64 = 8_192.0;

/// Measured values above which recordings are long: a descent on all of them costs seconds.
const MAX_SHORT_VALUES: usize = 1 << 16;

/// Starts that an interrupted search still continues from: one of them leads to a result.
const MIN_STARTS: usize = 8;

/// Iterations of a search from many starts, after which the best go on, and how many these are.
const FIRST_ITERATIONS: usize = 10;
const CONTINUED: usize = 3;

/// Share of the least cost so far that another of these must be able to reach to be better.
const BETTER: f64 = 0.998;

/// Observations with what every search needs of them.
pub struct PreparedObservations {
    scout: Option<Objective>,
    coarse: Objective,
    fine: Objective,
    scales: Scales,
    excitation: Excitation,
    temperature: Option<TemperatureDependence>,
    evaluations: AtomicUsize,
}

impl PreparedObservations {
    /// Prepares `observations`; `actuator` converts voltage to force.
    pub fn new(observations: &[Observation], actuator: &Actuator) -> Result<Self> {
        let thinned: Vec<Observation> = observations.iter().map(observation::thinned).collect();
        Self::with_thinned(observations, &thinned, Objective::new(observations, actuator.preload)?, actuator)
    }

    /// Prepares the beginnings of `observations`, thinned, as if they were all: a search in them is short.
    pub(super) fn beginnings(observations: &[Observation], actuator: &Actuator) -> Result<Self> {
        let thinned: Vec<Observation> = observations.iter().map(observation::thinned).collect();
        let thinned = scouted(&thinned).unwrap_or(thinned);
        Self::with_thinned(observations, &thinned, Objective::thinned(&thinned)?, actuator)
    }

    fn with_thinned(
        observations: &[Observation],
        thinned: &[Observation],
        fine: Objective,
        actuator: &Actuator,
    ) -> Result<Self> {
        Ok(Self {
            scout: scouted(thinned).map(|beginnings| Objective::thinned(&beginnings)).transpose()?,
            coarse: Objective::thinned(thinned)?,
            fine,
            scales: Scales::new(observations, actuator.force_per_square_volt()),
            excitation: Excitation::new(observations),
            temperature: observation::unknown_dependence(observations),
            evaluations: AtomicUsize::new(0),
        })
    }

    /// The context of searches with `settings`, without freed quantities that cannot be identified; they end early when
    /// `stop` is set.
    pub fn context<'a>(&'a self, settings: &'a Settings, stop: &'a AtomicBool) -> Context<'a> {
        let identified = |variable: &Variable| self.excitation.identifies(*variable);
        let is_searched = settings.method == Method::Lm;
        let of_temperature = [Variable::StiffnessSlope, Variable::Activation].into_iter();
        let of_temperature = of_temperature.filter(|variable| is_searched && !settings.held.contains(variable));
        Context {
            scout: self.scout.as_ref(),
            coarse: &self.coarse,
            fine: &self.fine,
            scales: self.scales,
            excitation: self.excitation,
            settings,
            delay_s: settings.sensor_delay_s.or(settings.start.as_ref().map(|start| start.delay_s)).unwrap_or(0.0),
            temperature: settings.start.as_ref().and_then(|start| start.temperature).or(self.temperature),
            freed: settings.freed.iter().copied().chain(of_temperature).filter(identified).collect(),
            stop,
            evaluations: &self.evaluations,
        }
    }
}

/// Whether a descent on all samples costs seconds.
pub(super) fn is_long(fine: &Objective) -> bool {
    fine.samples() > MAX_SHORT_VALUES
}

/// The beginnings of long `thinned` recordings; none where all of them are short.
fn scouted(thinned: &[Observation]) -> Option<Vec<Observation>> {
    let steps = |o: &Observation| o.input.samples().time_s.last().copied().unwrap_or(0.0) * o.rate_hz;
    let share = MAX_SCOUTED_STEPS / thinned.iter().map(steps).sum::<f64>();
    let beginning = |o: &Observation| observation::beginning(o, (share * steps(o)) as usize);
    let beginnings: Vec<Observation> = thinned.iter().map(beginning).collect();
    // A beginning in which nothing is measured, or nothing happens, is of no use.
    let useful = |o: &Observation| {
        let [measured, drive] = [&o.measured.value, &o.input.samples().value].map(range);
        o.measured.value.len() >= 100 && measured.0 < measured.1 && drive != (0.0, 0.0)
    };
    (share < 1.0 && beginnings.iter().all(useful)).then_some(beginnings)
}

/// The common parts of all descents of a fit.
#[derive(Clone)]
pub struct Context<'a> {
    /// The beginning of long thinned recordings, where searches from many starts begin.
    pub scout: Option<&'a Objective>,
    /// Thinned recordings, on which structures are compared.
    pub coarse: &'a Objective,
    /// All samples, where they end.
    pub fine: &'a Objective,
    /// Orders of magnitude of the parameters.
    pub scales: Scales,
    /// The excitation of the observations: which quantities can be identified.
    pub excitation: Excitation,
    /// The settings of the fit.
    pub settings: &'a Settings,
    /// The sensor's delay at the start, s.
    pub delay_s: f64,
    /// How the temperature changes the film at the start.
    pub temperature: Option<TemperatureDependence>,
    /// Quantities of the actuator and the sensor that are fitted besides the elements.
    pub freed: Vec<Variable>,
    /// Set to end searches early with the best so far.
    pub stop: &'a AtomicBool,
    /// Counts residual evaluations.
    pub evaluations: &'a AtomicUsize,
}

/// Result of a search.
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
    /// The variables of a structure with `branches` branches.
    pub fn variables(&self, branches: usize) -> Vec<Variable> {
        Variable::of_model(branches)
            .into_iter()
            .filter(|variable| !self.settings.held.contains(variable))
            .chain(self.freed.iter().copied())
            .collect()
    }

    /// The variables of a candidate: those of its structure, its elastic curve and its saturation.
    pub fn variables_of(&self, candidate: &Candidate) -> Vec<Variable> {
        let saturation = candidate.actuator.saturation_v.map(|_| Variable::Saturation);
        let bent = candidate.curve_variables().into_iter().chain(saturation);
        let bent =
            bent.filter(|variable| !self.settings.held.contains(variable) && self.excitation.identifies(*variable));
        // Eq. 1 leaves the scale of the force open, and with it the stiffness that belongs to a mass: beside a spring, where the memory is not to
        // explain inertia, it is fitted.
        let is_scale = |variable: &Variable| variable.force_exponent().is_some() || *variable == Variable::Mass;
        let is_beside = candidate.spring.is_some() && !candidate.is_in_series();
        let is_open = is_beside && self.excitation.voltage_driven && candidate.actuator.mass_kg > 0.0;
        let is_open = is_open && !self.freed.iter().chain(&self.settings.held).any(is_scale);
        let scale = is_open.then_some(Variable::Permittivity);
        let keeps_coupling = candidate.is_hencky() && !self.freed.contains(&Variable::Length);
        let is_kept = |variable: &Variable| keeps_coupling && *variable == Variable::StretchCoupling;
        let of_film = self.variables(candidate.branches()).into_iter().filter(|variable| !is_kept(variable));
        of_film.chain(bent).chain(scale).collect()
    }

    /// Half as many random starts of a structure as usual.
    pub fn linear_starts(&self, topology: Topology, branches: usize) -> Vec<Candidate> {
        let start =
            |index| starts::start(self.settings.actuator, topology, branches, self.scales, self.settings.seed, index);
        (0..self.settings.starts.div_ceil(2)).map(|index| self.on_the_bench(start(index), index)).collect()
    }

    /// The same with a delay of the sensor among what is fitted, from `delay_s` on.
    pub(super) fn with_delay(&self, delay_s: f64) -> Self {
        let freed = [self.freed.as_slice(), &[Variable::Delay]].concat();
        Self { delay_s, freed, ..self.clone() }
    }

    /// The `index`-th `start` with the sensor's delay, and the offset that fits it best, if that is fitted: the search is then the same wherever the sensor
    /// was zeroed. Where an activation energy is fitted it is one of those of films: recordings at one temperature each look like other branches.
    fn on_the_bench(&self, start: Candidate, index: usize) -> Candidate {
        const ACTIVATIONS: [f64; 4] = [0.0, 60.0, 30.0, 90.0];
        let mut start = Candidate { delay_s: self.delay_s, temperature: self.temperature, ..start };
        if self.freed.contains(&Variable::Activation) {
            Variable::Activation.set(&mut start, ACTIVATIONS[index % ACTIVATIONS.len()]);
        }
        if !self.freed.contains(&Variable::Offset) {
            return start;
        }
        let objective = self.scout.unwrap_or(self.coarse);
        Candidate { offset_m: objective.best_offset(&start), ..start }
    }

    /// The best candidate over `objective` from `starts`, which have the same variables.
    pub(super) fn best_over(&self, objective: &Objective, starts: &[Candidate]) -> Option<Found> {
        let stopping = StoppingCriteria { iterations: 60, decrease: 1e-7 };
        self.descents(objective, starts, &self.variables_of(starts.first()?), stopping, BETTER).into_iter().next()
    }

    /// `candidate` on the thinned recordings, where structures of other kinds are compared with it.
    pub fn coarsened(&self, candidate: &Candidate) -> Option<Found> {
        let decrease = if is_long(self.fine) { 1e-5 } else { 1e-7 };
        self.descend(self.coarse, candidate, StoppingCriteria { iterations: 60, decrease })
    }

    /// The best candidate of a structure on all samples, from random starts and from those of smaller structures, `grown`.
    pub fn best(&self, topology: Topology, branches: usize, grown: &[Candidate]) -> Option<Found> {
        self.explored(topology, branches, grown).map(|found| self.finished(found))
    }

    /// The same where structures are compared.
    pub fn explored(&self, topology: Topology, branches: usize, grown: &[Candidate]) -> Option<Found> {
        let random_starts =
            if grown.is_empty() { self.settings.starts } else { self.settings.starts.div_ceil(branches.max(1)) };
        let random = (0..random_starts).map(|index| {
            let mut start =
                starts::start(self.settings.actuator, topology, branches, self.scales, self.settings.seed, index);
            if self.freed.contains(&Variable::StretchCoupling) && start.actuator.stretch_coupling == 0.0 {
                start.actuator.stretch_coupling = self.scales.coupling;
            }
            self.on_the_bench(start, index)
        });
        let starts: Vec<Candidate> = grown.iter().cloned().chain(random).collect();
        self.explored_from(&starts, &self.variables(branches))
    }

    /// The best candidate from `starts` on all samples, over `variables`.
    pub fn best_from(&self, starts: &[Candidate], variables: &[Variable]) -> Option<Found> {
        self.explored_from(starts, variables).map(|found| self.finished(found))
    }

    /// The best candidate from `starts` where structures are compared, over `variables`.
    pub(super) fn explored_from(&self, starts: &[Candidate], variables: &[Variable]) -> Option<Found> {
        // Close enough to compare structures: the last search is on all samples.
        let stopping = StoppingCriteria { iterations: 60, decrease: 1e-5 };
        let found = match self.scout {
            None => self.descents(self.coarse, starts, variables, stopping, BETTER),
            Some(scout) => {
                let first = self.descents(scout, starts, variables, stopping, self.near());
                self.descents(self.coarse, &self.promising(first), variables, stopping, BETTER)
            }
        };
        found.into_iter().next()
    }

    /// The minima that are reached from `starts`, the least first. Those that will not come to this `share` of the least are not searched to their end.
    fn descents(
        &self,
        objective: &Objective,
        starts: &[Candidate],
        variables: &[Variable],
        stopping: StoppingCriteria,
        share: f64,
    ) -> Vec<Found> {
        // An interrupted search begins no further ones, once it has had a chance of a result.
        let is_begun = |index: usize| index < MIN_STARTS || !self.stop.load(Ordering::Relaxed);
        let descent = |start: &Candidate, stopping: StoppingCriteria, worthwhile: f64| {
            self.descend_towards(worthwhile, objective, start, variables.to_vec(), stopping)
        };
        let begun = starts.par_iter().enumerate().filter(|(index, _)| is_begun(*index));
        let few = StoppingCriteria { iterations: FIRST_ITERATIONS, ..stopping };
        let mut first = sorted(begun.filter_map(|(_, start)| descent(start, few, f64::INFINITY)).collect());
        first.truncate(CONTINUED);
        let on = |found: &Found, worthwhile: f64| {
            let ended = found.minimum.converged.then(|| found.clone());
            ended.or_else(|| descent(&found.candidate, stopping, worthwhile))
        };
        let Some((best, others)) = first.split_first() else { return first };
        let best = on(best, f64::INFINITY);
        let least = best.as_ref().map_or(f64::INFINITY, |best| best.minimum.cost);
        let others: Vec<Found> = others.par_iter().filter_map(|found| on(found, share * least)).collect();
        sorted(best.into_iter().chain(others).collect())
    }

    /// The two best minima that differ, because thinning could have changed their order.
    fn promising(&self, mut found: Vec<Found>) -> Vec<Candidate> {
        let best = found.first().map_or(0.0, |best| best.minimum.cost);
        found.dedup_by(|b, a| b.minimum.cost <= 1.001 * a.minimum.cost);
        found.truncate(if self.stop.load(Ordering::Relaxed) { 1 } else { 2 });
        found.into_iter().filter(|f| f.minimum.cost <= self.near() * best).map(|f| f.candidate).collect()
    }

    /// Cost of a minimum on the beginning, over the least, that may be the least on all of it. Of long recordings a second descent costs seconds: the
    /// beginning decides unless both are nearly the same.
    fn near(&self) -> f64 {
        if is_long(self.fine) { 1.05 } else { 1.2 }
    }

    /// `found` on all samples.
    pub fn finished(&self, found: Found) -> Found {
        // Between thinned recordings and all samples of long ones the minimum moves little.
        let stopping = StoppingCriteria { iterations: 60, decrease: if is_long(self.fine) { 1e-6 } else { 1e-8 } };
        self.descend_over(self.fine, &found.candidate, found.variables.clone(), stopping).unwrap_or(found)
    }

    /// The minimum that is reached from `start`; none if `start` has no response.
    pub fn descend(&self, objective: &Objective, start: &Candidate, stopping: StoppingCriteria) -> Option<Found> {
        self.descend_over(objective, start, self.variables_of(start), stopping)
    }

    /// The same over other variables.
    pub fn descend_over(
        &self,
        objective: &Objective,
        start: &Candidate,
        variables: Vec<Variable>,
        stopping: StoppingCriteria,
    ) -> Option<Found> {
        self.descend_towards(f64::INFINITY, objective, start, variables, stopping)
    }

    /// The same as long as the cost may become as small as is `worthwhile`.
    pub(super) fn descend_towards(
        &self,
        worthwhile: f64,
        objective: &Objective,
        start: &Candidate,
        variables: Vec<Variable>,
        stopping: StoppingCriteria,
    ) -> Option<Found> {
        let mut descent = Descent {
            worthwhile: if self.settings.loss == Loss::Square { worthwhile } else { f64::INFINITY },
            objective,
            base: start,
            bounds: variables.iter().map(|variable| variable.bounds_in(start)).collect(),
            variables,
            weights: Vec::new(),
            stop: self.stop,
            evaluations: self.evaluations,
        };
        let values: Vec<f64> = descent.variables.iter().map(|variable| variable.get(start)).collect();
        let minimum = least_squares::minimise(&descent, &values, stopping)?;
        let minimum = match self.settings.loss {
            Loss::Square => minimum,
            Loss::Huber => descent.reweighted(minimum, stopping)?,
        };
        Some(Found { candidate: descent.candidate(&minimum.values), variables: descent.variables, minimum })
    }

    /// The minimum on all samples from a `start` of the user.
    pub fn refined(&self, start: &Candidate, topology: Topology) -> Result<Found> {
        let start = Candidate { topology, delay_s: self.delay_s, temperature: self.temperature, ..start.clone() };
        self.descend(self.fine, &start, StoppingCriteria { iterations: 100, decrease: 1e-9 })
            .ok_or_else(|| Error::Computation("the given start has no response to these recordings".into()))
    }

    /// `found` with its branches in the order in which they are written.
    pub fn in_order(&self, found: Found, method: Method) -> Found {
        let Some(candidate) = found.in_order() else { return found };
        if method == Method::PatternSearch {
            return Found { candidate, ..found };
        }
        // One more step gives the derivatives.
        let stopping = StoppingCriteria { iterations: 2, decrease: 1e-9 };
        let again = self.descend_over(self.fine, &candidate, found.variables.clone(), stopping);
        let Some(Found { candidate, variables, minimum }) = again else { return found };
        Found { candidate, variables, minimum: Minimum { converged: found.minimum.converged, ..minimum } }
    }
}

impl Found {
    /// The candidate with its branches in the order in which they are written; none if they are.
    fn in_order(&self) -> Option<Candidate> {
        let ordered = reduce::ordered(&self.candidate.model().ok()?).ok()?;
        let candidate = Candidate { elements: Candidate::elements_of(&ordered), ..self.candidate.clone() };
        (candidate != self.candidate).then_some(candidate)
    }
}

/// The one of `found` with the least cost.
pub(super) fn least<'a>(found: impl Iterator<Item = &'a Found>) -> Option<&'a Found> {
    found.min_by(|a, b| a.minimum.cost.total_cmp(&b.minimum.cost))
}

/// `found`, the least cost first.
fn sorted(mut found: Vec<Found>) -> Vec<Found> {
    found.sort_by(|a, b| a.minimum.cost.total_cmp(&b.minimum.cost));
    found
}

struct Descent<'a> {
    objective: &'a Objective,
    base: &'a Candidate,
    variables: Vec<Variable>,
    bounds: Vec<(f64, f64)>,
    /// Factors of the residuals; empty where they are 1.
    weights: Vec<f64>,
    worthwhile: f64,
    stop: &'a AtomicBool,
    evaluations: &'a AtomicUsize,
}

impl Descent<'_> {
    fn candidate(&self, values: &[f64]) -> Candidate {
        let mut candidate = self.base.clone();
        for (variable, &value) in self.variables.iter().zip(values) {
            variable.set(&mut candidate, value);
        }
        candidate
    }

    fn weigh(&self, residuals: &mut [f64]) {
        residuals.iter_mut().zip(&self.weights).for_each(|(value, weight)| *value *= weight);
    }

    /// The minimum of Huber's loss by iteratively reweighted least squares, from the `minimum` of squares.
    fn reweighted(&mut self, mut minimum: Minimum, stopping: StoppingCriteria) -> Option<Minimum> {
        const PASSES: usize = 6;
        let huber = Huber::new(percentile_range(self.objective.measured().flatten().copied()));
        for pass in 0..PASSES {
            let before = minimum.values;
            let evaluation = self.objective.evaluate(&self.candidate(&before))?;
            self.weights = huber.weights(&self.objective.residuals(&evaluation));
            // After the first pass the start is close.
            let iterations = if pass == 0 { stopping.iterations } else { stopping.iterations.min(8) };
            minimum = least_squares::minimise(self, &before, StoppingCriteria { iterations, ..stopping })?;
            let moved = |(new, old): (&f64, &f64)| (new - old).abs() > 1e-4 * old.abs().max(1e-3);
            if !minimum.values.iter().zip(&before).any(moved) {
                break;
            }
        }
        let evaluation = self.objective.evaluate(&self.candidate(&minimum.values))?;
        minimum.cost = huber.cost(&self.objective.residuals(&evaluation));
        Some(minimum)
    }
}

impl Problem for Descent<'_> {
    type Evaluation = Evaluation;

    fn residuals(&self, values: &[f64]) -> Option<(Vec<f64>, Evaluation)> {
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        let evaluation = self.objective.evaluate(&self.candidate(values))?;
        let mut residuals = self.objective.residuals(&evaluation);
        self.weigh(&mut residuals);
        Some((residuals, evaluation))
    }

    fn jacobian(&self, values: &[f64], evaluation: &Evaluation) -> Vec<Vec<f64>> {
        let mut columns = self.objective.jacobian(&self.candidate(values), evaluation, &self.variables);
        columns.iter_mut().for_each(|column| self.weigh(column));
        columns
    }

    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    fn longest(&self, index: usize) -> f64 {
        match self.variables[index] {
            // In 1/m and m: limited by the bounds only.
            Variable::StretchCoupling | Variable::Offset | Variable::Saturation => f64::INFINITY,
            // In s: beyond a part of a period the error has other minima.
            Variable::Delay => 0.05,
            // In 1/K and kJ/mol.
            Variable::StiffnessSlope => 0.02,
            Variable::Activation => 50.0,
            // A curve changes its meaning beyond a factor of e in a step.
            Variable::Slope(_) | Variable::FreeLength | Variable::Limit => 1.0,
            _ => least_squares::MAX_STEP,
        }
    }

    fn negligible(&self) -> f64 {
        self.objective.negligible()
    }

    fn worthwhile(&self) -> f64 {
        self.worthwhile
    }

    fn interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
