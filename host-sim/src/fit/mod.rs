//! Fits of the model to recordings: parameters, structure, and how far both can be trusted.

pub mod candidate;
pub mod levenberg_marquardt;
pub mod loss;
pub mod objective;
pub mod observation;
pub mod pattern_search;
pub mod search;
pub mod selection;
pub mod starts;
mod transfer;
pub mod uncertainty;
mod warnings;

use std::sync::atomic::{AtomicBool, Ordering};

use springpot::{Actuator, MAX_BRANCHES, Topology};

use crate::agreement::Agreement;
use crate::error::{Error, Result};
use crate::files::recording::Input;
use crate::reduce;
use candidate::{Candidate, Variable};
use loss::Loss;
use objective::Observation;
use search::{Context, Found, Workbench};
use selection::Row;
use uncertainty::Trust;

/// How parameters are searched for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// Levenberg–Marquardt with exact derivatives from many starts.
    Lm,
    /// Generalised pattern search from the paper's start: the paper's procedure.
    PatternSearch,
}

/// What is fitted, and how.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How parameters are searched for.
    pub method: Method,
    /// Number of branches to try; more than one is a choice.
    pub branches: Vec<usize>,
    /// Topologies to try; more than one is a choice.
    pub topologies: Vec<Topology>,
    /// Eq. 1 and the weight at the start.
    pub actuator: Actuator,
    /// What is fitted besides the elements.
    pub surroundings: Vec<Variable>,
    /// Elements' variables that keep their value from `start`.
    pub held: Vec<Variable>,
    /// A further start.
    pub start: Option<Candidate>,
    /// How residuals count.
    pub loss: Loss,
    /// Seed of the random starts.
    pub seed: u64,
    /// Random starts of every structure.
    pub starts: usize,
    /// Whether to judge the parameters.
    pub judge: bool,
}

impl Default for Settings {
    /// Every structure from random starts, coupling and offset freed, the paper's actuator.
    fn default() -> Self {
        Self {
            method: Method::Lm,
            branches: (0..=MAX_BRANCHES).collect(),
            topologies: vec![Topology::Parallel, Topology::Eq11],
            actuator: Actuator::KARNER_2022,
            surroundings: vec![Variable::StretchCoupling, Variable::Offset],
            held: Vec::new(),
            start: None,
            loss: Loss::Square,
            seed: 1,
            starts: 8,
            judge: true,
        }
    }
}

/// A fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The best candidate.
    pub candidate: Candidate,
    /// Modelled values at the measured times of every observation.
    pub modelled: Vec<Vec<f64>>,
    /// Agreement with every observation.
    pub agreements: Vec<Agreement>,
    /// Mean of the observations' R².
    pub r2_mean: f64,
    /// Structures that were tried.
    pub table: Vec<Row>,
    /// How far the parameters can be trusted.
    pub trust: Option<Trust>,
    /// What the user should know, plainly.
    pub warnings: Vec<String>,
    /// Residual evaluations.
    pub evaluations: usize,
    /// Whether the search was ended early.
    pub interrupted: bool,
}

/// Fits `observations`; `progress` hears what is being done, and `stop` ends the search with the best so far.
///
/// # Errors
///
/// [`Error`] for settings that make no fit, or recordings that allow none.
pub fn fit(
    observations: &[Observation],
    settings: &Settings,
    stop: &AtomicBool,
    progress: &dyn Fn(&str),
) -> Result<Fit> {
    settings.actuator.check()?;
    let scale_like = settings.surroundings.iter().filter(|v| v.force_exponent().is_some()).count();
    if scale_like > 1 {
        return Err(Error::option(
            "--free",
            "permittivity, length, width and thickness only scale the force; free one of them at the most",
        ));
    }
    let workbench = Workbench::new(observations, &settings.actuator)?;
    let mut warnings = Vec::new();
    let surroundings = effective(observations, settings, &mut warnings);
    let context = workbench.context(settings, surroundings, stop);
    if settings.branches.iter().all(|&branches| context.variables(branches).is_empty()) {
        return Err(Error::option("--hold", "nothing is left to fit"));
    }
    let fine = context.fine;

    let (found, table) = match settings.method {
        Method::Lm => {
            let one = settings.branches.len() * settings.topologies.len() == 1;
            match (&settings.start, one) {
                (Some(start), true) => (refine(&context, start, settings)?, Vec::new()),
                (None, true) => {
                    progress("fit");
                    let (topology, branches) = (settings.topologies[0], settings.branches[0]);
                    let found = context.best(topology, branches, &[]);
                    let found = found.ok_or_else(|| no_fit(observations))?;
                    (found, Vec::new())
                }
                (_, false) => {
                    selection::choose(&context, observations, &settings.topologies, &settings.branches, progress)?
                }
            }
        }
        Method::PatternSearch => pattern(&context, settings, progress)?,
    };

    let found = named_in_order(&context, found, settings);
    let interrupted = stop.load(Ordering::Relaxed);
    let trust = if settings.judge && settings.method == Method::Lm && !interrupted {
        progress("how far the parameters can be trusted");
        uncertainty::judge(&context, &found)
    } else {
        None
    };
    let no_response = || Error::Computation("the fit has no response; check the units of the recordings".into());
    let modelled = fine.evaluate(&found.candidate).ok_or_else(no_response)?.modelled;
    let agreements: Vec<Agreement> =
        fine.measured().zip(&modelled).map(|(measured, modelled)| Agreement::of(measured, modelled)).collect();
    let r2_mean = agreements.iter().map(|a| a.r2).sum::<f64>() / agreements.len() as f64;
    let residuals: Vec<f64> =
        fine.measured().zip(&modelled).flat_map(|(y, x)| y.iter().zip(x).map(|(y, x)| x - y)).collect();
    if let Some(trust) = &trust {
        warnings::of_trust(trust, &residuals, &mut warnings);
    }
    if !(found.minimum.converged || interrupted) {
        warnings.push("the search ran out of iterations; --start with this result goes on".into());
    }
    warnings::of_outliers(&residuals, settings.loss, &mut warnings);
    warnings::of_units(observations, &settings.actuator, r2_mean, settings.loss, &mut warnings);
    Ok(Fit {
        candidate: found.candidate,
        r2_mean,
        modelled,
        agreements,
        table,
        trust,
        warnings,
        evaluations: context.evaluations.load(Ordering::Relaxed),
        interrupted,
    })
}

/// The fit with its branches in the order in which they are written, unless a start gave them names.
fn named_in_order(context: &Context<'_>, found: Found, settings: &Settings) -> Found {
    let Some(ordered) = found.candidate.model().and_then(|model| reduce::ordered(&model)).ok() else { return found };
    let elements = std::iter::once(ordered.main()).chain(ordered.branches().as_flattened().iter().copied()).collect();
    let candidate = Candidate { elements, ..found.candidate.clone() };
    if settings.start.is_some() || candidate == found.candidate {
        return found;
    }
    if settings.method == Method::PatternSearch {
        return Found { candidate, ..found };
    }
    // One more step from there gives the derivatives in the new order.
    let limits = levenberg_marquardt::Limits { iterations: 2, decrease: 1e-9 };
    let again = context.descend(context.fine, &candidate, limits);
    again.map_or(found.clone(), |again| {
        let minimum = levenberg_marquardt::Minimum { converged: found.minimum.converged, ..again.minimum };
        Found { minimum, ..again }
    })
}

fn no_fit(observations: &[Observation]) -> Error {
    let names: Vec<&str> = observations.iter().map(|o| o.name.as_str()).collect();
    Error::Computation(format!(
        "{}: no start leads to a fit; check the units of voltage and displacement, and the actuator",
        names.join(", ")
    ))
}

/// The surroundings that the observations can tell anything of.
pub fn effective(observations: &[Observation], settings: &Settings, warnings: &mut Vec<String>) -> Vec<Variable> {
    let voltage_driven = observations.iter().any(|o| matches!(o.input, Input::Voltage(_)));
    let displacement_fitted = observations.iter().any(|o| !matches!(o.input, Input::Displacement(_)));
    let varies = observations.iter().any(|o| {
        let values = &o.input.samples().value;
        let (low, high) =
            values.iter().fold((f64::INFINITY, 0f64), |(low, high), v| (low.min(v.abs()), high.max(v.abs())));
        high - low > 0.01 * high
    });
    if !varies {
        warnings.push("what drives the film is constant: only creep under this one load is seen".into());
    }
    settings
        .surroundings
        .iter()
        .copied()
        .filter(|variable| match variable {
            Variable::StretchCoupling => voltage_driven && varies,
            Variable::Offset => displacement_fitted,
            Variable::Mass => true,
            _ => voltage_driven,
        })
        .collect()
}

fn refine(context: &Context<'_>, start: &Candidate, settings: &Settings) -> Result<Found> {
    let limits = levenberg_marquardt::Limits { iterations: 100, decrease: 1e-9 };
    let mut start = start.clone();
    start.topology = settings.topologies[0];
    context
        .descend(context.fine, &start, limits)
        .ok_or_else(|| Error::Computation("the given start has no response to these recordings".into()))
}

/// The paper's procedure for every structure; the best is chosen by the sum of squares, as the paper does.
fn pattern(context: &Context<'_>, settings: &Settings, progress: &dyn Fn(&str)) -> Result<(Found, Vec<Row>)> {
    let mut best: Option<(pattern_search::Outcome, Topology, usize)> = None;
    for &topology in &settings.topologies {
        for &branches in &settings.branches {
            progress(&format!("pattern search, {} with n = {branches}", selection::name_of(topology)));
            let start = settings
                .start
                .clone()
                .unwrap_or_else(|| pattern_search::paper_start(settings.actuator, topology, branches));
            let count = || {
                context.evaluations.fetch_add(1, Ordering::Relaxed);
            };
            let outcome =
                pattern_search::search(context.fine, &start, pattern_search::Limits::default(), context.stop, &count);
            if let Some(outcome) = outcome
                && best.as_ref().is_none_or(|(b, _, _)| outcome.cost < b.cost)
            {
                best = Some((outcome, topology, branches));
            }
        }
    }
    let (outcome, _, branches) =
        best.ok_or_else(|| Error::Computation("pattern search has no response at its start".into()))?;
    let variables = Variable::of_model(branches);
    let minimum = levenberg_marquardt::Minimum {
        place: variables.iter().map(|v| v.get(&outcome.candidate)).collect(),
        cost: outcome.cost,
        normal: nalgebra::DMatrix::zeros(0, 0),
        evaluations: outcome.evaluations,
        iterations: 0,
        converged: outcome.converged,
    };
    Ok((Found { candidate: outcome.candidate, variables, minimum }, Vec::new()))
}
