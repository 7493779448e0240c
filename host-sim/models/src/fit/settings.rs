//! What is fitted, and how.

use springpot::{Actuator, MAX_BRANCHES, Topology};

use super::candidate::{Candidate, Variable};
use super::loss::Loss;
use super::nonlinearity::CurveChoice;
use crate::error::{Error, Result};
use crate::files::recording::Direction;

/// How parameters are searched for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// Levenberg–Marquardt with exact derivatives from many starts.
    Lm,
    /// Generalised pattern search from the paper's start: the paper's procedure.
    PatternSearch,
}

impl Method {
    /// The name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lm => "lm",
            Self::PatternSearch => "pattern-search",
        }
    }
}

/// What is fitted, and how.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How parameters are searched for.
    pub method: Method,
    /// Numbers of branches to try; with more than one the fit selects.
    pub branches: Vec<usize>,
    /// Topologies to try; with more than one the fit selects.
    pub topologies: Vec<Topology>,
    /// Eq. 1 and the weight at the start.
    pub actuator: Actuator,
    /// Whether the actuator's sizes are assumed, not the film's own.
    pub assumed_sizes: bool,
    /// Quantities of the actuator and the sensor that are fitted besides the elements.
    pub freed: Vec<Variable>,
    /// Variables of the elements that keep their value from `start`.
    pub held: Vec<Variable>,
    /// A further start.
    pub start: Option<Candidate>,
    /// What may be fitted beyond a linear film.
    pub curve: CurveChoice,
    /// Loss function of the residuals.
    pub loss: Loss,
    /// Seed of the random starts.
    pub seed: u64,
    /// Random starts per structure.
    pub starts: usize,
    /// Whether to compute the uncertainty of the parameters.
    pub uncertainty: bool,
}

impl Default for Settings {
    /// All structures from random starts, coupling and offset freed, the paper's actuator.
    fn default() -> Self {
        Self {
            method: Method::Lm,
            branches: (0..=MAX_BRANCHES).collect(),
            topologies: vec![Topology::Parallel, Topology::Eq11],
            actuator: Actuator::KARNER_2022,
            assumed_sizes: false,
            freed: vec![Variable::StretchCoupling, Variable::Offset],
            held: Vec::new(),
            start: None,
            curve: CurveChoice::None,
            loss: Loss::Square,
            seed: 1,
            starts: 8,
            uncertainty: true,
        }
    }
}

impl Settings {
    /// Topology and number of branches, if only one structure is to be tried.
    pub fn single_structure(&self) -> Option<(Topology, usize)> {
        match (self.topologies.as_slice(), self.branches.as_slice()) {
            (&[topology], &[branches]) => Some((topology, branches)),
            _ => None,
        }
    }

    /// Refuses an invalid actuator, and freed quantities that cannot be told apart.
    ///
    /// # Errors
    ///
    /// [`Error`] naming what is wrong.
    pub fn check(&self) -> Result<()> {
        self.actuator.check()?;
        if self.freed.iter().filter(|v| v.force_exponent().is_some()).count() > 1 {
            return Err(Error::option(
                "--free",
                "permittivity, length, width and thickness only scale the force; free at most one of them",
            ));
        }
        Ok(())
    }
}

/// Name of a topology on the command line and in files.
pub fn topology_name(topology: Topology) -> &'static str {
    match topology {
        Topology::Eq11 => "eq11",
        Topology::Parallel => "parallel",
    }
}

/// The actuator of recordings without one: the paper's, without mass if displacement drives, because a test machine carries the
/// weight.
pub fn assumed_actuator(drive: Direction) -> Actuator {
    match drive {
        Direction::Force => Actuator::KARNER_2022,
        Direction::Displacement => Actuator { mass_kg: 0.0, ..Actuator::KARNER_2022 },
    }
}

/// Most random starts of a structure: their memory alone would be gigabytes.
const MAX_STARTS: usize = 100_000;

/// Refuses a number of random starts of a structure with which no search could begin, or end.
///
/// # Errors
///
/// [`Error::Option`] with the range.
pub fn checked_starts(starts: usize) -> Result<()> {
    if (1..=MAX_STARTS).contains(&starts) {
        Ok(())
    } else {
        Err(Error::option("--starts", format!("{starts} must be from 1 to {MAX_STARTS}; the default is 8")))
    }
}
