//! The stages of a fit, told as they begin with the share of the work before them.

use std::cell::Cell;

use springpot::Topology;

use super::settings::Settings;
use crate::progress::Stage;

/// The stages of a fit: how many are expected, and which share of the work each is.
///
/// What is fitted beyond a linear film is planned when the linear film is known, and guessed before. A selection that ends early leaves
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
    /// The stages of a fit with `settings` that tries so many `kinds` of nonlinearity, of which `report` is told.
    pub fn new(settings: &Settings, kinds: usize, report: &'a dyn Fn(&Stage)) -> Self {
        let stages = Self { report, plan: Cell::default() };
        match settings.single_structure() {
            // One stage has no share worth telling.
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

    /// Tells what is done now, which takes little beside the stages.
    pub(super) fn tell(&self, what: &str) {
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
