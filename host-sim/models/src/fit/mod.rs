//! Fits of the model to recordings: parameters, structure, and their uncertainty.
//!
//! [`fit`] takes observations of recordings ([`observation`]) and [`Settings`], and returns a [`Fit`]. It minimises the
//! [`objective`], model minus measurement, over the variables of a [`candidate`] model: from many starts for one structure
//! (`search`), for several structures of which it selects one (`selection`), or by the paper's procedure (`pattern_search`).
//! The `uncertainty` of the parameters comes last. [`amplifier`] stands beside it: the amplifier in front of the film.

pub mod amplifier;
pub mod candidate;
pub mod checks;
pub(crate) mod levenberg_marquardt;
pub mod nonlinearity;
pub mod objective;
pub mod observation;
pub mod options;
mod outcome;
pub(crate) mod pattern_search;
pub mod preparation;
pub(crate) mod search;
pub mod selection;
pub mod settings;
mod starts;
pub mod statistics;
mod transfer;
pub mod uncertainty;
pub mod warnings;

use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};
use crate::progress::Stage;
use observation::Observation;
pub use observation::ReadingFit;
pub use options::FitOptions;
pub use outcome::Fit;
use search::{Context, Found, PreparedObservations};
pub use selection::StructureRow;
use settings::Stages;
pub use settings::{Method, Settings};
pub use statistics::Loss;
pub use uncertainty::{Estimate, Uncertainty};
pub use warnings::{Severity, Warning};

/// Fits `observations`. `progress` is called with each stage as it begins; `stop` ends the search early with the best so far.
///
/// # Errors
///
/// [`Error`] for invalid settings, or recordings that cannot be fitted.
pub fn fit(
    observations: &[Observation],
    settings: &Settings,
    stop: &AtomicBool,
    progress: &dyn Fn(&Stage),
) -> Result<Fit> {
    settings.check()?;
    let stages = &Stages::new(settings, nonlinearity::kinds(settings.curve, observations), progress);
    let prepared = PreparedObservations::new(observations, &settings.actuator)?;
    let context = prepared.context(settings, stop);
    if settings.branches.iter().all(|&branches| context.variables(branches).is_empty()) {
        return Err(Error::field("hold", "nothing is left to fit"));
    }
    let linear = find(&context, observations, settings, stages)?;
    let given = settings.start.as_ref().is_some_and(|start| start.bend != candidate::Bend::Straight);
    let (found, structures) = if settings.method == Method::Lm && !given {
        nonlinearity::select(&context, observations, settings, stages, linear)?
    } else {
        linear
    };
    let found = in_order(&context, found, settings);
    let interrupted = stop.load(Ordering::Relaxed);
    let mut uncertainty = None;
    if settings.uncertainty && settings.method == Method::Lm && !interrupted {
        stages.tell("uncertainty of the parameters");
        uncertainty = Uncertainty::from_fit(&context, &found);
    }
    Fit::new(&context, observations, settings, found, structures, uncertainty, interrupted)
}

/// The best candidate by the method of the settings, and the structures that were compared.
fn find(
    context: &Context<'_>,
    observations: &[Observation],
    settings: &Settings,
    stages: &Stages<'_>,
) -> Result<(Found, Vec<StructureRow>)> {
    if settings.method == Method::PatternSearch {
        return Ok((pattern_search::best_structure(context, settings, stages)?, Vec::new()));
    }
    let Some((topology, branches)) = settings.single_structure() else {
        return selection::select(context, observations, settings, stages);
    };
    if let Some(start) = &settings.start {
        return Ok((context.refined(start, topology)?, Vec::new()));
    }
    stages.begin("fit", branches);
    let no_fit = || {
        let names: Vec<&str> = observations.iter().map(|o| o.name.as_str()).collect();
        Error::Computation(format!(
            "{}: no start leads to a fit; check the units of voltage and displacement, and the actuator",
            names.join(", ")
        ))
    };
    Ok((context.best(topology, branches, &[]).ok_or_else(no_fit)?, Vec::new()))
}

/// `found` with its branches in the order in which they are written, unless a start gave their order.
fn in_order(context: &Context<'_>, found: Found, settings: &Settings) -> Found {
    match (&settings.start, settings.method) {
        (Some(_), _) => found,
        (None, Method::Lm) => context.in_order(found),
        (None, Method::PatternSearch) => match found.in_order() {
            Some(candidate) => Found { candidate, ..found },
            None => found,
        },
    }
}
