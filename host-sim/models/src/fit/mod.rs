//! Fits of the model to recordings: parameters, structure, and their uncertainty.
//!
//! [`fit`] takes observations of recordings ([`observation`]) and [`Settings`], and returns a [`Fit`]. It minimises the
//! [`objective`], model minus measurement, over the variables of a [`candidate`] model: from many starts for one structure
//! (`descent`), for all structures of the settings (`search`), of which `selection` selects one, or by the paper's procedure
//! (`pattern_search`).
//! The `uncertainty` of the parameters comes last. [`amplifier`] is separate: the amplifier in front of the film.

pub mod amplifier;
pub mod candidate;
pub mod checks;
pub(crate) mod descent;
pub(crate) mod levenberg_marquardt;
pub mod objective;
pub mod observation;
pub mod options;
mod outcome;
pub(crate) mod pattern_search;
pub mod preparation;
pub mod report;
mod search;
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
use descent::{Context, Found, PreparedObservations};
use observation::Observation;
pub use observation::ReadingFit;
pub use options::FitOptions;
pub use outcome::Fit;
pub use report::FitReport;
use search::Search;
pub use selection::StructureRow;
use settings::Stages;
pub use settings::{Method, Settings};
use starts::Kind;
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
    let stages = Stages::new(settings, Kind::for_choice(settings.curve, observations).len(), progress);
    let prepared = PreparedObservations::new(observations, &settings.actuator)?;
    let context = prepared.context(settings, stop);
    if settings.branches.iter().all(|&branches| context.variables(branches).is_empty()) {
        return Err(Error::field("hold", "nothing is left to fit"));
    }
    let (found, structures) = Search { context: &context, observations, settings, stages: &stages }.best()?;
    let found = in_order(&context, found, settings);
    let interrupted = stop.load(Ordering::Relaxed);
    let mut uncertainty = None;
    if settings.uncertainty && settings.method == Method::Lm && !interrupted {
        stages.note("uncertainty of the parameters");
        uncertainty = Uncertainty::from_fit(&context, &found);
    }
    Fit::new(&context, observations, settings, found, structures, uncertainty, interrupted)
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
