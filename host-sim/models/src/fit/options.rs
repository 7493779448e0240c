//! Fit options: of a command line, or set one by one.

use std::path::Path;

use clap::{Args, FromArgMatches, ValueEnum};
use springpot::{Actuator, MAX_BRANCHES, Topology};

use super::candidate::{Bend, Candidate, Variable};
use super::observation::{self, Observation, Reading};
use super::preparation::{Gaps, Preparation, Window};
use super::settings::{CurveChoice, Method, Settings, assumed_actuator, checked_starts};
use super::statistics::Loss;
use super::warnings::Warning;
use crate::error::{Error, Result};
use crate::files::parameters::Parameters;
use crate::files::recording::{Direction, Recording};
use crate::quantity;

/// Options of a fit.
#[derive(Clone, Debug, Args)]
pub struct FitOptions {
    /// Branches of two springpots, 0 to 5, or auto.
    #[arg(long, value_name = "N|auto", default_value = "auto", value_parser = branches)]
    pub branches: Branches,
    /// How branches are connected.
    #[arg(long, value_enum, default_value_t = TopologyChoice::Auto)]
    pub topology: TopologyChoice,
    /// Extension of the linear film: an elastic curve, a drive that saturates, both, or what left-out recordings ask for.
    #[arg(long, value_enum, default_value_t = CurveChoice::Auto)]
    pub curve: CurveChoice,
    /// How parameters are searched for.
    #[arg(long, value_enum, default_value_t = Method::Lm)]
    pub method: Method,
    /// Input of the model.
    #[arg(long, value_enum, default_value_t = Direction::Force)]
    pub drive: Direction,
    /// Fit this too: stretch_coupling and offset_m (freed by default), mass_kg, or one of relative_permittivity,
    /// length_m, width_m and thickness_m.
    #[arg(long, value_name = "NAME")]
    pub free: Vec<String>,
    /// Do not fit this: stretch_coupling, offset_m, or with --start an element as warnings name it, such as main.alpha.
    #[arg(long, value_name = "NAME")]
    pub hold: Vec<String>,
    /// File with the actuator table: geometry, permittivity, mass, preload, coupling. Without it the paper's sizes are assumed
    /// (40 mm x 60 mm x 160 um), and no field limit is claimed; without mass if displacement drives.
    #[arg(long, value_name = "P")]
    pub actuator: Option<String>,
    /// Start parameters, instead of random starts; they also give branches and topology.
    #[arg(long, value_name = "P", conflicts_with_all = ["actuator", "branches"])]
    pub start: Option<String>,
    /// Loss function of the residuals.
    #[arg(long, value_enum, default_value_t = Loss::Square)]
    pub loss: Loss,
    /// Weight of each recording, in their order; or log-time: every decade of time since the recording's start counts the same.
    /// A column weight of a recording weighs its rows.
    #[arg(long, value_name = "W,W,…|log-time", value_delimiter = ',', value_parser = weight)]
    pub weights: Vec<Weight>,
    /// The sensor's offset: one for all recordings, or per-recording, where it was zeroed anew.
    #[arg(long, value_enum, default_value_t = Sharing::Joint)]
    pub offset: Sharing,
    /// The size of the readings: one for all recordings, or per-recording, for other specimens; relative to the first.
    #[arg(long, value_enum, default_value_t = Sharing::Joint)]
    pub gain: Sharing,
    /// Time without rows, s, beyond which --at-gap applies. By default the input is interpolated.
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    pub gap: Option<f64>,
    /// Action at a gap: end the recording there, or skip as much time after it as it lasted.
    #[arg(long, value_enum, default_value_t = AtGap::End, requires = "gap")]
    pub at_gap: AtGap,
    /// Turn the sign of what is measured.
    #[arg(long)]
    pub invert: bool,
    /// Fit what was measured from here on, s; the model still runs from the first row.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 0.0)]
    pub from: f64,
    /// Fit what was measured up to here, s. The default is the end.
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    pub to: Option<f64>,
    /// Seed of the random starts.
    #[arg(long, value_name = "N", default_value_t = Settings::default().seed)]
    pub seed: u64,
    /// Random starts per structure.
    #[arg(long, value_name = "N", default_value_t = Settings::default().starts)]
    pub starts: usize,
}

/// How many branches a model has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branches {
    /// As many as left-out recordings ask for.
    Auto,
    /// This many, at most [`MAX_BRANCHES`].
    Number(usize),
}

/// The branches that `text` names: a number or `auto`.
///
/// # Errors
///
/// The error, and what would be right.
pub fn branches(text: &str) -> std::result::Result<Branches, String> {
    if text == "auto" {
        return Ok(Branches::Auto);
    }
    text.parse()
        .ok()
        .filter(|n| *n <= MAX_BRANCHES)
        .map(Branches::Number)
        .ok_or_else(|| format!("use auto or a number from 0 to {MAX_BRANCHES}"))
}

/// A weight of residuals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Weight {
    /// Weight of a recording.
    Recording(f64),
    /// The same weight for every decade of time.
    LogTime,
}

fn weight(text: &str) -> std::result::Result<Weight, String> {
    if text == "log-time" {
        return Ok(Weight::LogTime);
    }
    quantity::number(text).map(Weight::Recording).map_err(|cause| format!("{cause}; or use log-time"))
}

/// Sharing of a quantity of the readings among the recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Sharing {
    /// One for all.
    Joint,
    /// Each has its own.
    PerRecording,
}

/// Treatment of missing rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum AtGap {
    /// The recording ends there.
    End,
    /// As much time after it is skipped as it lasted.
    Skip,
}

/// Which topologies are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TopologyChoice {
    /// As published.
    Eq11,
    /// The generalised Maxwell model.
    Parallel,
    /// Both.
    Auto,
}

impl Default for FitOptions {
    /// Those of a command line without options.
    fn default() -> Self {
        let nothing = Self::augment_args(clap::Command::new("fit")).try_get_matches_from(["fit"]);
        nothing.and_then(|matches| Self::from_arg_matches(&matches)).expect("every option has a default")
    }
}

impl FitOptions {
    /// The settings that the options give; the files that they name are read.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the option or the file that cannot be used.
    pub fn settings(&self) -> Result<Settings> {
        let start = self.start.as_deref().map(Parameters::load).transpose()?;
        let actuator = self.actuator.as_deref().map(Parameters::load_sized_actuator).transpose()?;
        self.settings_with(start, actuator)
    }

    /// The same from a `start` and an `actuator` that are at hand, the latter with whether its sizes are assumed; the files that the
    /// options name are not read.
    ///
    /// # Errors
    ///
    /// As [`settings`](Self::settings).
    pub fn settings_with(&self, start: Option<Parameters>, actuator: Option<(Actuator, bool)>) -> Result<Settings> {
        let (actuator, assumed_sizes) = match (actuator, &start) {
            (Some(given), _) => given,
            (None, Some(start)) => (start.actuator, start.assumed_sizes),
            (None, None) => (assumed_actuator(self.drive), true),
        };
        let start = start.map(|parameters| Candidate {
            actuator,
            elements: Candidate::elements_of(&parameters.model),
            topology: parameters.model.topology(),
            offset_m: parameters.sensor_offset_m,
            bend: parameters.curve.as_ref().map_or(Bend::Straight, Bend::from_curve),
        });
        // From a given start no random one is needed.
        checked_starts(self.starts.max(usize::from(start.is_some())))?;
        let (mut freed, held) = self.freed_and_held(&actuator, start.as_ref())?;
        if self.offset == Sharing::PerRecording {
            freed.retain(|variable| *variable != Variable::Offset);
        }
        if self.loss != Loss::Square && (self.offset, self.gain) != (Sharing::Joint, Sharing::Joint) {
            return Err(Error::field("loss", "offsets and gains per recording are solved by least squares"));
        }
        if self.method == Method::PatternSearch {
            self.check_pattern_search()?;
        }
        let branches = match (self.branches, &start) {
            (_, Some(start)) => vec![start.branches()],
            (Branches::Number(n), None) => vec![n],
            (Branches::Auto, None) => (0..=MAX_BRANCHES).collect(),
        };
        let topologies = match (self.topology, &start) {
            (TopologyChoice::Eq11, _) => vec![Topology::Eq11],
            (TopologyChoice::Parallel, _) => vec![Topology::Parallel],
            (TopologyChoice::Auto, Some(start)) => vec![start.topology],
            (TopologyChoice::Auto, None) => vec![Topology::Parallel, Topology::Eq11],
        };
        Ok(Settings {
            method: self.method,
            branches,
            topologies,
            actuator,
            assumed_sizes,
            freed,
            held,
            start,
            curve: self.curve,
            loss: self.loss,
            seed: self.seed,
            starts: self.starts,
            ..Settings::default()
        })
    }

    /// Quantities of the actuator and the sensor that are fitted, and variables of the elements that are not.
    fn freed_and_held(&self, actuator: &Actuator, start: Option<&Candidate>) -> Result<(Vec<Variable>, Vec<Variable>)> {
        let mut freed = Settings::default().freed;
        for name in &self.free {
            let variable = bench_quantity(name).ok_or_else(|| unknown("free", name))?;
            if variable == Variable::Mass && actuator.mass_kg == 0.0 {
                return Err(Error::field("free", "mass_kg needs a mass to begin from; give it with `actuator`"));
            }
            if !freed.contains(&variable) {
                freed.push(variable);
            }
        }
        if let Some(name) = self.free.iter().find(|name| self.hold.contains(name)) {
            return Err(Error::field("hold", format!("{name} is also to be freed")));
        }
        let mut held = Vec::new();
        for name in &self.hold {
            if let Some(variable) = bench_quantity(name) {
                freed.retain(|v| *v != variable);
                continue;
            }
            let all = Variable::of_model(start.map_or(0, Candidate::branches));
            let variable = all.into_iter().find(|v| v.to_string() == *name).ok_or_else(|| unknown("hold", name))?;
            if start.is_none() {
                return Err(Error::field("hold", format!("{name} needs `start`, which gives its value")));
            }
            held.push(variable);
        }
        if self.method == Method::PatternSearch {
            freed.clear();
        }
        Ok((freed, held))
    }

    /// Refuses what the paper's procedure does not have.
    fn check_pattern_search(&self) -> Result<()> {
        if let Some(name) = self.free.first().or(self.hold.first()) {
            let cause = format!(
                "pattern search is the paper's procedure, over all elements and nothing else; leave out {name}"
            );
            return Err(Error::field("method", cause));
        }
        if self.loss != Loss::Square {
            return Err(Error::field("loss", "pattern search is the paper's procedure, with squares"));
        }
        Ok(())
    }

    /// The observations, each with warnings about it.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the option or the recording that cannot be used.
    pub fn observations(&self, recordings: &[&Recording]) -> Result<Vec<(Observation, Vec<Warning>)>> {
        let log_time = self.weights.as_slice() == [Weight::LogTime];
        let weights: Vec<f64> = self
            .weights
            .iter()
            .filter_map(|weight| match weight {
                Weight::Recording(weight) => Some(*weight),
                Weight::LogTime => None,
            })
            .collect();
        if !(log_time || weights.len() == self.weights.len()) {
            return Err(Error::field("weights", "log-time excludes other weights; add your own with a column weight"));
        }
        if !(weights.is_empty() || weights.len() == recordings.len()) {
            let cause = format!("{} weights for {} recordings", weights.len(), recordings.len());
            return Err(Error::field("weights", cause));
        }
        if let Some(weight) = weights.iter().find(|w| !(1e-6..=1e6).contains(*w)) {
            return Err(Error::field("weights", format!("{weight:?} must be from 1e-6 to 1e6")));
        }
        if self.from < 0.0 {
            return Err(Error::field("from_s", format!("{:?} s must be at least 0", self.from)));
        }
        if let Some(to) = self.to.filter(|to| *to <= self.from) {
            return Err(Error::field("to_s", format!("{to:?} s must be after `from_s`, {:?} s", self.from)));
        }
        let gaps = match (self.gap, self.at_gap) {
            (None, _) => Gaps::Interpolate,
            (Some(gap), _) if !(gap.is_finite() && gap > 0.0) => {
                return Err(Error::field("gap_s", format!("{gap:?} s must be finite and greater than 0")));
            }
            (Some(gap), AtGap::End) => Gaps::End(gap),
            (Some(gap), AtGap::Skip) => Gaps::Skip(gap),
        };
        let window = Window { from_s: self.from, to_s: self.to.unwrap_or(f64::INFINITY) };
        let preparation = Preparation { window, gaps, inverted: self.invert, log_time };
        // The mean is 1, so that residuals keep their unit.
        let mean = weights.iter().sum::<f64>() / weights.len().max(1) as f64;
        let weight = |index: usize| weights.get(index).map_or(1.0, |weight| weight / mean);
        let own_offset = self.offset == Sharing::PerRecording;
        let own_gain = self.gain == Sharing::PerRecording;
        recordings
            .iter()
            .enumerate()
            .map(|(index, recording)| {
                // The weight is of squared residuals.
                let weight = weight(index).sqrt();
                let (mut observation, warnings) =
                    observation::observe_prepared(recording, self.drive, weight, preparation)?;
                // A gain of the first could not be distinguished from the film's stiffness.
                observation.reading = Reading { own_offset, own_gain: own_gain && index > 0 };
                Ok((observation, warnings))
            })
            .collect()
    }

    /// Input and output of the model.
    pub fn direction(&self) -> Direction {
        self.drive
    }

    /// Parameter files that are read.
    pub fn parameter_files(&self) -> impl Iterator<Item = &Path> {
        self.actuator.iter().chain(&self.start).map(Path::new)
    }
}

/// A quantity of the actuator or the sensor by its name.
fn bench_quantity(name: &str) -> Option<Variable> {
    [
        Variable::StretchCoupling,
        Variable::Offset,
        Variable::Permittivity,
        Variable::Length,
        Variable::Width,
        Variable::Thickness,
        Variable::Mass,
    ]
    .into_iter()
    .find(|variable| variable.to_string() == name)
}

fn unknown(option: &'static str, name: &str) -> Error {
    if option == "free" && (name.starts_with("main.") || name.starts_with("branches[")) {
        return Error::field(option, format!("{name} is free unless it is held"));
    }
    let names = "stretch_coupling, offset_m, mass_kg, relative_permittivity, length_m, width_m, thickness_m";
    let elements = if option == "hold" { " and, with `start`, elements such as main.alpha" } else { "" };
    Error::field(option, format!("no quantity {name:?}; there are {names}{elements}"))
}
