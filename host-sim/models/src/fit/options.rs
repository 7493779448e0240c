//! Fit options.

use std::str::FromStr;

use host_io::choice;
use springpot::{Actuator, MAX_BRANCHES, Topology};

use super::bend::{Bend, Elastic};
use super::candidate::{Candidate, Variable};
use super::observation::{self, Observation};
use super::preparation::{Gaps, Preparation, Warning, Window};
use super::readings::Reading;
use super::residuals::Loss;
use super::settings::{CurveChoice, Method, Settings, assumed_actuator, checked_starts};
use crate::error::{Error, Result};
use crate::files::parameters::Parameters;
use crate::files::recording::{Direction, Recording};
use crate::quantity;
use crate::statistics::mean;

/// Options of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// Branches of two springpots.
    pub branches: Branches,
    /// How branches are connected.
    pub topology: TopologyChoice,
    /// Extension of the linear film.
    pub curve: CurveChoice,
    /// How parameters are searched for.
    pub method: Method,
    /// Input of the model.
    pub drive: Direction,
    /// Names of quantities that are fitted as well: stretch_coupling and offset_m (freed by default), mass_kg, or one of
    /// relative_permittivity, length_m, width_m and thickness_m.
    pub free: Vec<String>,
    /// Names of what is not fitted: stretch_coupling, offset_m, or of a start an element such as main.alpha.
    pub hold: Vec<String>,
    /// Loss function of the residuals.
    pub loss: Loss,
    /// Weight of each recording, in their order, or [`Weight::LogTime`] alone.
    pub weights: Vec<Weight>,
    /// The sensor's offset.
    pub offset: Sharing,
    /// Time by which the displacement sensor is late, s; estimated where the recordings show one if left out.
    pub sensor_delay_s: Option<f64>,
    /// The size of the readings, relative to the first recording.
    pub gain: Sharing,
    /// Time without rows, s, beyond which `at_gap` applies; the input is interpolated if left out.
    pub gap_s: Option<f64>,
    /// Action at a gap.
    pub at_gap: AtGap,
    /// Whether the sign of what is measured is turned.
    pub invert: bool,
    /// Time from which values are fitted, s; the model still runs from the first row.
    pub from_s: f64,
    /// Time up to which values are fitted, s; to the end if left out.
    pub to_s: Option<f64>,
    /// Seed of the random starts.
    pub seed: u64,
    /// Random starts per structure.
    pub starts: usize,
}

impl Default for FitOptions {
    /// Structure and curve selected by recordings that are left out.
    fn default() -> Self {
        let Settings { seed, starts, .. } = Settings::default();
        Self {
            branches: Branches::Auto,
            topology: TopologyChoice::Auto,
            curve: CurveChoice::Auto,
            method: Method::Lm,
            drive: Direction::Force,
            free: Vec::new(),
            hold: Vec::new(),
            loss: Loss::Square,
            weights: Vec::new(),
            offset: Sharing::Joint,
            sensor_delay_s: None,
            gain: Sharing::Joint,
            gap_s: None,
            at_gap: AtGap::End,
            invert: false,
            from_s: 0.0,
            to_s: None,
            seed,
            starts,
        }
    }
}

/// How many branches a model has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branches {
    /// As many as left-out recordings ask for.
    Auto,
    /// This many, at most [`MAX_BRANCHES`].
    Number(usize),
}

impl FromStr for Branches {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        text.parse()
            .ok()
            .filter(|n| *n <= MAX_BRANCHES)
            .map(Self::Number)
            .ok_or_else(|| format!("use auto or a number from 0 to {MAX_BRANCHES}"))
    }
}

/// A weight of residuals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Weight {
    /// Weight of a recording.
    Recording(f64),
    /// The same weight for every decade of time.
    LogTime,
}

impl FromStr for Weight {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if text == "log-time" {
            return Ok(Self::LogTime);
        }
        quantity::number(text).map(Self::Recording).map_err(|cause| format!("{cause}; or use log-time"))
    }
}

choice! {
    /// Sharing of a quantity of the readings among the recordings.
    pub enum Sharing {
        /// One for all.
        Joint = "joint",
        /// Each has its own.
        PerRecording = "per-recording",
    }
}

choice! {
    /// Treatment of missing rows.
    pub enum AtGap {
        /// The recording ends there.
        End = "end",
        /// As much time after it is skipped as it lasted.
        Skip = "skip",
    }
}

choice! {
    /// Which topologies are tried.
    pub enum TopologyChoice {
        /// As published.
        Eq11 = "eq11",
        /// The generalised Maxwell model.
        Parallel = "parallel",
        /// Both.
        Auto = "auto",
    }
}

impl FitOptions {
    /// The settings that the options give, with a `start`, and an `actuator` with whether its sizes are assumed.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the option that cannot be used.
    pub fn settings(&self, start: Option<Parameters>, actuator: Option<(Actuator, bool)>) -> Result<Settings> {
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
            delay_s: self.sensor_delay_s.unwrap_or(parameters.sensor_delay_s),
            bend: parameters.curve.as_ref().map_or(Bend::Straight, |curve| {
                Bend::from_curve(curve, actuator.stretch_coupling == 1.0 / actuator.length_m)
            }),
            spring: parameters.spring.as_ref().map(match parameters.curve {
                Some(_) => Elastic::from_spring,
                None => Elastic::from_series,
            }),
            temperature: parameters.temperature,
        });
        // From a given start no random one is needed.
        checked_starts(self.starts.max(usize::from(start.is_some())))?;
        let (mut freed, held) = self.freed_and_held(&actuator, start.as_ref())?;
        if self.offset == Sharing::PerRecording {
            freed.retain(|variable| *variable != Variable::Offset);
        }
        if self.sensor_delay_s.is_none() && start.as_ref().is_some_and(|start| start.delay_s != 0.0) {
            freed.push(Variable::Delay);
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
            sensor_delay_s: self.sensor_delay_s,
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
            if variable.is_of_temperature() {
                return Err(Error::field(
                    "free",
                    format!("{name} is free where recordings have a temperature_c unless it is held"),
                ));
            }
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
                held.push(variable);
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
        if self.from_s < 0.0 {
            return Err(Error::field("from_s", format!("{:?} s must be at least 0", self.from_s)));
        }
        if let Some(to) = self.to_s.filter(|to| *to <= self.from_s) {
            return Err(Error::field("to_s", format!("{to:?} s must be after `from_s`, {:?} s", self.from_s)));
        }
        let gaps = match (self.gap_s, self.at_gap) {
            (None, _) => Gaps::Interpolate,
            (Some(gap), _) if !(gap.is_finite() && gap > 0.0) => {
                return Err(Error::field("gap_s", format!("{gap:?} s must be finite and greater than 0")));
            }
            (Some(gap), AtGap::End) => Gaps::End(gap),
            (Some(gap), AtGap::Skip) => Gaps::Skip(gap),
        };
        let window = Window { from_s: self.from_s, to_s: self.to_s.unwrap_or(f64::INFINITY) };
        let preparation = Preparation { window, gaps, inverted: self.invert, log_time };
        // The mean is 1, so that residuals keep their unit.
        let mean = mean(&weights);
        let weight = |index: usize| weights.get(index).map_or(1.0, |weight| weight / mean);
        let own_offset = self.offset == Sharing::PerRecording;
        let own_gain = self.gain == Sharing::PerRecording;
        recordings
            .iter()
            .enumerate()
            .map(|(index, recording)| {
                // The weight is of squared residuals.
                let weight = weight(index).sqrt();
                let (mut observation, mut warnings) =
                    observation::observe_prepared(recording, self.drive, weight, preparation)?;
                warnings.splice(0..0, observation::remarks(recording));
                // A gain of the first could not be distinguished from the film's stiffness.
                observation.reading = Reading { own_offset, own_gain: own_gain && index > 0, ..Reading::default() };
                Ok((observation, warnings))
            })
            .collect()
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
        Variable::StiffnessSlope,
        Variable::Activation,
    ]
    .into_iter()
    .find(|variable| variable.to_string() == name)
}

fn unknown(option: &'static str, name: &str) -> Error {
    if option == "free" && (name.starts_with("main.") || name.starts_with("branches[")) {
        return Error::field(option, format!("{name} is free unless it is held"));
    }
    let names = "stretch_coupling, offset_m, mass_kg, relative_permittivity, length_m, width_m, thickness_m";
    let elements = if option == "hold" {
        ", stiffness_per_k, activation_kj_per_mol and, with `start`, elements such as main.alpha"
    } else {
        ""
    };
    Error::field(option, format!("no quantity {name:?}; there are {names}{elements}"))
}
