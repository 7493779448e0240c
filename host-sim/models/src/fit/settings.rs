//! The settings of a fit, and its stages.

use std::cell::Cell;

use host_io::choice;
use springpot::{Actuator, MAX_BRANCHES, Topology};

use super::candidate::{Candidate, Variable};
use super::residuals::Loss;
use crate::error::{Error, Result};
use crate::files::parameters::MAX_SENSOR_DELAY_S;
use crate::files::recording::Direction;
use crate::progress::Stage;

choice! {
    /// How parameters are searched for.
    pub enum Method {
        /// Levenberg–Marquardt with exact derivatives from many starts.
        Lm = "lm",
        /// Generalised pattern search from the paper's start: the paper's procedure.
        PatternSearch = "pattern-search",
    }
}

choice! {
    /// Nonlinearities that may be fitted.
    #[derive(Default)]
    pub enum CurveChoice {
        /// Select: none, a drive that saturates, an elastic curve, both, two curves, or a spring in series.
        Auto = "auto",
        /// A linear film: Eq. 11.
        #[default]
        None = "none",
        /// A drive that saturates, `actuator.saturation_v`.
        Saturation = "saturation",
        /// The curve of rubber with one shape parameter.
        MooneyRivlin = "mooney-rivlin",
        /// The curve of rubber whose chains become taut.
        Gent = "gent",
        /// A curve of monotone pieces.
        Free = "free",
        /// A curve of monotone pieces, and a drive that saturates.
        Both = "both",
        /// Two curves: a spring beside the memory, which has a strain measure of its own.
        Two = "two",
        /// A spring in series with the memory, for voltages and forces that drive.
        Series = "series",
    }
}

/// The settings of a fit: what is fitted, and how.
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
    /// Time by which the displacement sensor is late, s; none to estimate it where the recordings show one.
    pub sensor_delay_s: Option<f64>,
    /// Variables that are not fitted.
    pub held: Vec<Variable>,
    /// A further start.
    pub start: Option<Candidate>,
    /// Nonlinearities that may be fitted.
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
            sensor_delay_s: None,
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

    /// Refuses an invalid actuator, and freed quantities that cannot be distinguished.
    pub fn check(&self) -> Result<()> {
        self.actuator.check()?;
        if self.sensor_delay_s.is_some_and(|delay_s| delay_s.is_nan() || delay_s.abs() > MAX_SENSOR_DELAY_S) {
            return Err(Error::field("sensor_delay_s", format!("must be at most {MAX_SENSOR_DELAY_S} s")));
        }
        if self.freed.iter().filter(|v| v.force_exponent().is_some()).count() > 1 {
            return Err(Error::field(
                "free",
                "permittivity, length, width and thickness only scale the force; free at most one of them",
            ));
        }
        Ok(())
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
/// [`Error::Field`] with the range.
pub fn checked_starts(starts: usize) -> Result<()> {
    if (1..=MAX_STARTS).contains(&starts) {
        Ok(())
    } else {
        Err(Error::field("starts", format!("{starts} must be from 1 to {MAX_STARTS}; the default is 8")))
    }
}

/// The stages of a fit: how many are expected, and which share of the work each is.
///
/// Nonlinear fits are planned when the linear film is known, and guessed before. A selection that ends early leaves
/// stages out.
pub struct Stages<'a> {
    report: &'a dyn Fn(&Stage),
    plan: Cell<Plan>,
}

#[derive(Clone, Copy, Default)]
struct Plan {
    /// Stages that have begun.
    number: usize,
    /// Stages at the most.
    most: usize,
    /// Work of the stages that have ended.
    done: u64,
    /// Work of the stage that has begun last.
    begun: u64,
    /// All work at the most.
    all: u64,
}

impl<'a> Stages<'a> {
    /// The stages of a fit with `settings` that tries so many `kinds` of nonlinearity, which are reported to `report`.
    pub fn new(settings: &Settings, kinds: usize, report: &'a dyn Fn(&Stage)) -> Self {
        let stages = Self { report, plan: Cell::default() };
        match settings.single_structure() {
            // One stage has no share worth reporting.
            Some(_) if kinds == 0 || settings.start.is_some() => {}
            Some((_, branches)) => stages.expect((0..=kinds).map(|_| work(branches))),
            None => {
                let bent = || settings.branches.iter().copied().filter(|&n| n <= USUAL_BRANCHES);
                let bent = (0..kinds).flat_map(|_| bent());
                stages.expect(structures(settings).chain(bent).map(work));
            }
        }
        stages
    }

    /// Plans the rest anew: a stage for each of these amounts of work.
    pub(super) fn expect(&self, rest: impl Iterator<Item = u64>) {
        let mut plan = self.plan.get();
        (plan.done, plan.begun) = (plan.done + plan.begun, 0);
        (plan.most, plan.all) = rest.fold((plan.number, plan.done), |(count, all), work| (count + 1, all + work));
        self.plan.set(plan);
    }

    /// Begins the stage `what` for a model of `branches` branches.
    pub(super) fn begin(&self, what: impl Into<String>, branches: usize) {
        let mut plan = self.plan.get();
        plan.number += 1;
        (plan.done, plan.begun) = (plan.done + plan.begun, work(branches));
        self.plan.set(plan);
        let known = plan.number <= plan.most;
        (self.report)(&Stage {
            what: what.into(),
            count: known.then_some((plan.number, plan.most)),
            work: if known { (plan.done, plan.all) } else { (0, 0) },
        });
    }

    /// Reports what is done now, which takes little beside the stages.
    pub(super) fn note(&self, what: &str) {
        (self.report)(&Stage::named(what));
    }
}

/// Branches of the linear film that kinds of nonlinearity are mostly tried with.
const USUAL_BRANCHES: usize = 2;

/// The structures of `settings` in the order in which they are fitted. Below two branches the topologies are the same model.
fn structures(settings: &Settings) -> impl Iterator<Item = usize> {
    let first = settings.topologies.first().copied();
    let fitted = move |topology: Topology, n: usize| n >= 2 || Some(topology) == first;
    settings
        .topologies
        .iter()
        .flat_map(move |&topology| settings.branches.iter().copied().filter(move |&n| fitted(topology, n)))
}

/// Work of a fit with `branches` branches, in units of that with none: more variables, more evaluations, each more expensive.
pub(super) fn work(branches: usize) -> u64 {
    let variables = 2 * branches as u64 + 3;
    variables * variables
}
