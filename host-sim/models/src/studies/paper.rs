//! The paper's study on given recordings: joint fits for n = 1…5, each recording alone, both methods and topologies.
//!
//! As in the paper, forces come from Eq. 1 without coupling and displacements without offset.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::Serialize;
use springpot::{Actuator, Springpot, Topology};

use crate::agreement::{Agreement, mean_r2};
use crate::error::Result;
use crate::fit::candidate::Candidate;
use crate::fit::descent::{Context, PreparedObservations};
use crate::fit::observation::Observation;
use crate::fit::{Method, Settings, pattern_search, refuse_copies};
use host_io::choice::Choice;

/// Branches of the joint fits.
const BRANCHES: [usize; 5] = [1, 2, 3, 4, 5];
/// Branches of the fits to one recording.
pub const BRANCHES_ALONE: usize = 2;
const TOPOLOGIES: [Topology; 2] = [Topology::Eq11, Topology::Parallel];
const METHODS: [Method; 2] = [Method::PatternSearch, Method::Lm];

/// A fit of the study.
#[derive(Clone, Debug)]
pub struct StudyFit {
    /// Method of the search.
    pub method: Method,
    /// Topology.
    pub topology: Topology,
    /// Number of branches.
    pub branches: usize,
    /// The recording that is fitted; none for all of them.
    pub recording: Option<usize>,
    /// The best candidate.
    pub candidate: Candidate,
    /// Agreement with the fitted recordings.
    pub agreements: Vec<Agreement>,
    /// Modelled values at their measured times.
    pub modelled: Vec<Vec<f64>>,
    /// Number of residual evaluations.
    pub evaluations: usize,
}

/// Options of a study.
#[derive(Clone, Copy, Debug)]
pub struct StudyOptions {
    /// Eq. 1 and the weight; its coupling is set to 0.
    pub actuator: Actuator,
    /// Seed of the random starts.
    pub seed: u64,
    /// Whether pattern search sees thinned recordings, instead of all samples.
    pub thinned: bool,
}

/// All fits of the study; `progress` is called after each of them with the number of all.
///
/// # Errors
///
/// [`Error`](crate::error::Error) for observations that cannot be fitted.
pub fn study(
    observations: &[Observation],
    options: &StudyOptions,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Vec<StudyFit>> {
    refuse_copies(observations)?;
    let actuator = Actuator { stretch_coupling: 0.0, ..options.actuator };
    let together = PreparedObservations::new(observations, &actuator)?;
    let alone = observations
        .iter()
        .map(|o| PreparedObservations::new(std::slice::from_ref(o), &actuator))
        .collect::<Result<Vec<_>>>()?;
    // A part of a study is of no use: there is no early end.
    let never = AtomicBool::new(false);
    let mut jobs = Vec::new();
    for method in METHODS {
        for topology in TOPOLOGIES {
            let job = |branches, recording| Job { method, topology, branches, recording };
            // The longest first.
            jobs.extend(BRANCHES.iter().rev().map(|&branches| job(branches, None)));
            jobs.extend((0..observations.len()).map(|index| job(BRANCHES_ALONE, Some(index))));
        }
    }
    let all = jobs.len();
    let options = StudyOptions { actuator, ..*options };
    let mut fits: Vec<StudyFit> = jobs
        .into_par_iter()
        .filter_map(|job| {
            let prepared = job.recording.map_or(&together, |index| &alone[index]);
            let fit = job.fit(prepared, &options, &never);
            progress(all);
            fit
        })
        .collect();
    fits.sort_by_key(|fit| (fit.recording, fit.branches));
    Ok(fits)
}

/// A fit of the study before it is done.
struct Job {
    method: Method,
    topology: Topology,
    branches: usize,
    recording: Option<usize>,
}

impl Job {
    fn fit(self, prepared: &PreparedObservations, options: &StudyOptions, stop: &AtomicBool) -> Option<StudyFit> {
        let Self { method, topology, branches, recording } = self;
        let settings =
            Settings { actuator: options.actuator, freed: Vec::new(), seed: options.seed, ..Settings::default() };
        let counted = AtomicUsize::new(0);
        let context = Context { evaluations: &counted, ..prepared.context(&settings, stop) };
        let candidate = match method {
            Method::Lm => context.best(topology, branches, &[])?.candidate,
            Method::PatternSearch => {
                let start = pattern_search::paper_start(options.actuator, topology, branches);
                let objective = if options.thinned { context.coarse } else { context.fine };
                let count = || {
                    counted.fetch_add(1, Ordering::Relaxed);
                };
                pattern_search::search(objective, &start, stop, &count)?.candidate
            }
        };
        let modelled = context.fine.evaluate(&candidate)?.modelled;
        let agreements = context.fine.measured().zip(&modelled).map(|(y, x)| Agreement::new(y, x)).collect();
        let evaluations = counted.load(Ordering::Relaxed);
        Some(StudyFit { method, topology, branches, recording, candidate, agreements, modelled, evaluations })
    }
}

impl StudyFit {
    /// Mean of R² over the fitted recordings.
    pub fn r2_mean(&self) -> f64 {
        mean_r2(&self.agreements)
    }

    /// The elements as the paper prints them, c in N·s^α/mm: main (c, α), then the branches.
    pub fn elements(&self) -> (String, String) {
        let element = |e: &Springpot| format!("({}, {})", short(e.c / 1000.0), short(e.alpha));
        let (pairs, _) = self.candidate.elements[1..].as_chunks::<2>();
        let branches: Vec<String> = pairs.iter().map(|[a, b]| format!("{}–{}", element(a), element(b))).collect();
        (element(&self.candidate.elements[0]), branches.join(" · "))
    }
}

/// Four digits, without trailing zeros.
fn short(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e5).contains(&value.abs()) {
        return format!("{value:.2e}");
    }
    let decimals = (3 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 4) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Why Eq. 9 does not gain from a third branch, with this study's numbers.
pub fn why_eq9_stops(fits: &[StudyFit]) -> String {
    let best = |topology: Topology, branches: usize| {
        let of = fits.iter().filter(|e| e.recording.is_none() && e.topology == topology && e.branches == branches);
        of.map(StudyFit::r2_mean).fold(f64::NEG_INFINITY, f64::max)
    };
    format!(
        "Eq. 9 puts all 2n springpots of the branches in series and scales by n: their harmonic mean is one chain, in which \
         springpots of one order are one springpot, so more of them only name the same few coefficients again. Here R² goes \
         from {:.6} (n = 2) to {:.6} (n = 5) with eq11, and from {:.6} to {:.6} with branches in parallel.",
        best(Topology::Eq11, 2),
        best(Topology::Eq11, 5),
        best(Topology::Parallel, 2),
        best(Topology::Parallel, 5)
    )
}

/// A fit of the study, as `study --json` prints it.
#[derive(Clone, Debug, Serialize)]
pub struct StudyFitRow {
    method: &'static str,
    topology: &'static str,
    branches: usize,
    recording: Option<String>,
    r2: Vec<f64>,
    r2_mean: f64,
    nrmse_pct: Vec<f64>,
    /// c in N·s^α/m and α of the main springpot and both of every branch.
    elements: Vec<(f64, f64)>,
    evaluations: usize,
}

impl StudyFitRow {
    /// The row of `fit`; `names` are the recordings'.
    pub fn new(fit: &StudyFit, names: &[String]) -> Self {
        Self {
            method: fit.method.name(),
            topology: fit.topology.name(),
            branches: fit.branches,
            recording: fit.recording.map(|index| names[index].clone()),
            r2: fit.agreements.iter().map(|a| a.r2).collect(),
            r2_mean: fit.r2_mean(),
            nrmse_pct: fit.agreements.iter().map(|a| a.nrmse_pct).collect(),
            elements: fit.candidate.elements.iter().map(|e| (e.c, e.alpha)).collect(),
            evaluations: fit.evaluations,
        }
    }
}
