//! The paper's study on given recordings: joint fits for n = 1…5, each recording alone, both methods and topologies.
//!
//! As in the paper, forces come from Eq. 1 without coupling and displacements without offset.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::Serialize;
use springpot::{Actuator, Springpot, Topology};

use crate::agreement::Agreement;
use crate::error::Result;
use crate::fit::candidate::Candidate;
use crate::fit::objective::{Objective, Observation};
use crate::fit::search::Workbench;
use crate::fit::selection::name_of;
use crate::fit::{Method, Settings, pattern_search};

/// Branches of the joint fits.
pub const BRANCHES: [usize; 5] = [1, 2, 3, 4, 5];
/// Branches of the fits to one recording.
pub const BRANCHES_ALONE: usize = 2;
/// Both topologies.
pub const TOPOLOGIES: [Topology; 2] = [Topology::Eq11, Topology::Parallel];
/// Both methods.
pub const METHODS: [Method; 2] = [Method::PatternSearch, Method::Lm];

/// A fit of the study.
#[derive(Clone, Debug)]
pub struct Entry {
    /// How it was found.
    pub method: Method,
    /// Its topology.
    pub topology: Topology,
    /// Its number of branches.
    pub branches: usize,
    /// The recording it is of, or all of them.
    pub recording: Option<usize>,
    /// The fit.
    pub candidate: Candidate,
    /// Agreement with the recordings it is of.
    pub agreements: Vec<Agreement>,
    /// Modelled values at the measured times of those.
    pub modelled: Vec<Vec<f64>>,
    /// Residual evaluations.
    pub evaluations: usize,
}

/// How a study is made.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Eq. 1 and the weight; its coupling is left out.
    pub actuator: Actuator,
    /// Seed of the random starts.
    pub seed: u64,
    /// Whether pattern search sees thinned recordings, instead of all samples.
    pub thinned: bool,
}

/// All fits of the study; `progress` hears of each that is done, with the number of all.
///
/// # Errors
///
/// [`crate::Error`] for observations that allow no fit.
pub fn study(
    observations: &[Observation],
    options: &Options,
    stop: &AtomicBool,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Entry>> {
    let actuator = Actuator { stretch_coupling: 0.0, ..options.actuator };
    let together = Workbench::new(observations, &actuator)?;
    let alone =
        observations.iter().map(|o| Workbench::new(std::slice::from_ref(o), &actuator)).collect::<Result<Vec<_>>>()?;
    let mut jobs = Vec::new();
    for method in METHODS {
        for topology in TOPOLOGIES {
            // The longest first.
            jobs.extend(BRANCHES.iter().rev().map(|&branches| (method, topology, branches, None)));
            jobs.extend((0..observations.len()).map(|index| (method, topology, BRANCHES_ALONE, Some(index))));
        }
    }
    let all = jobs.len();
    let mut entries: Vec<Entry> = jobs
        .into_par_iter()
        .filter_map(|(method, topology, branches, recording)| {
            let workbench = recording.map_or(&together, |index| &alone[index]);
            let entry =
                entry(workbench, method, topology, branches, recording, &Options { actuator, ..*options }, stop);
            progress(all);
            entry
        })
        .collect();
    entries.sort_by_key(|e| (e.recording, e.branches));
    Ok(entries)
}

fn entry(
    workbench: &Workbench,
    method: Method,
    topology: Topology,
    branches: usize,
    recording: Option<usize>,
    options: &Options,
    stop: &AtomicBool,
) -> Option<Entry> {
    let settings = Settings {
        method,
        branches: vec![branches],
        topologies: vec![topology],
        actuator: options.actuator,
        surroundings: Vec::new(),
        seed: options.seed,
        judge: false,
        ..Settings::default()
    };
    let context = workbench.context(&settings, Vec::new(), stop);
    let counted = AtomicUsize::new(0);
    let context = crate::fit::search::Context { evaluations: &counted, ..context };
    let candidate = match method {
        Method::Lm => context.best(topology, branches, &[])?.candidate,
        Method::PatternSearch => {
            let start = pattern_search::paper_start(options.actuator, topology, branches);
            let objective: &Objective = if options.thinned { context.coarse } else { context.fine };
            let count = || {
                counted.fetch_add(1, Ordering::Relaxed);
            };
            pattern_search::search(objective, &start, pattern_search::Limits::default(), stop, &count)?.candidate
        }
    };
    let modelled = context.fine.evaluate(&candidate)?.modelled;
    let agreements = context.fine.measured().zip(&modelled).map(|(y, x)| Agreement::of(y, x)).collect();
    let evaluations = counted.load(Ordering::Relaxed);
    Some(Entry { method, topology, branches, recording, candidate, agreements, modelled, evaluations })
}

impl Entry {
    /// Mean of R² over its recordings.
    pub fn r2_mean(&self) -> f64 {
        self.agreements.iter().map(|a| a.r2).sum::<f64>() / self.agreements.len() as f64
    }

    /// Its elements as the paper prints them, c in N·s^α/mm: main (c, α), then the branches.
    pub fn elements(&self) -> (String, String) {
        let element = |e: &Springpot| format!("({}, {})", short(e.c / 1000.0), short(e.alpha));
        let (pairs, _) = self.candidate.elements[1..].as_chunks::<2>();
        let branches: Vec<String> = pairs.iter().map(|[a, b]| format!("{}–{}", element(a), element(b))).collect();
        (element(&self.candidate.elements[0]), branches.join(" · "))
    }
}

/// Four digits, without trailing noughts.
fn short(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e5).contains(&value.abs()) {
        return format!("{value:.2e}");
    }
    let decimals = (3 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 4) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// The name of a method as on the command line.
pub fn method_name(method: Method) -> &'static str {
    match method {
        Method::Lm => "lm",
        Method::PatternSearch => "pattern-search",
    }
}

/// Why Eq. 9 does not gain from a third branch, with this study's numbers.
pub fn why_eq9_stops(entries: &[Entry]) -> String {
    let best = |topology: Topology, branches: usize| {
        let of = entries.iter().filter(|e| e.recording.is_none() && e.topology == topology && e.branches == branches);
        of.map(Entry::r2_mean).fold(f64::NEG_INFINITY, f64::max)
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

/// An entry as a row for machines.
#[derive(Clone, Debug, Serialize)]
pub struct EntryRow {
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

impl EntryRow {
    /// The row of `entry`; `names` are the recordings'.
    pub fn new(entry: &Entry, names: &[String]) -> Self {
        Self {
            method: method_name(entry.method),
            topology: name_of(entry.topology),
            branches: entry.branches,
            recording: entry.recording.map(|index| names[index].clone()),
            r2: entry.agreements.iter().map(|a| a.r2).collect(),
            r2_mean: entry.r2_mean(),
            nrmse_pct: entry.agreements.iter().map(|a| a.nrmse_pct).collect(),
            elements: entry.candidate.elements.iter().map(|e| (e.c, e.alpha)).collect(),
            evaluations: entry.evaluations,
        }
    }
}
