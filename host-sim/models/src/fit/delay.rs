//! A delay of the displacement sensor: whether recordings show one.
//!
//! A sensor that is late by τ reads x(t − τ). Over a band of frequencies that differs from creep, whose phase hardly changes with the
//! frequency, so both are found together. A film that resists its speed lags as well, and slow recordings show no difference: a delay is
//! fitted only where it explains what no film does, one with such a branch included.
//!
//! Where the drive steps, it did so at any time between two rows: a delay up to that time is not one of the sensor, and none is known better.

use num_complex::Complex;
use rayon::prelude::*;
use springpot::{Springpot, Topology};

use super::candidate::{Candidate, Variable};
use super::descent::{Context, Found};
use super::objective::Objective;
use super::resolution::Resolution;
use crate::least_squares::StoppingCriteria;

/// Share of a cost to which a delay must bring it: what a model does not follow of a film, a delay may make a quarter smaller.
const WORTH: f64 = 0.5;
/// Largest share of a delay by which it may differ from that of half a recording.
const DIFFERS: f64 = 0.25;
/// Smallest delay in intervals of the rows, and in steps of the thinned recordings, which make a springpot's answer early by up to a fifth
/// of a step.
const MIN_INTERVALS: f64 = 0.5;
const MIN_STEPS: f64 = 0.25;
/// Part of a radian of the drive in which creep is not seen: a film without it looks early by that time and the order of the springpot.
const UNSEEN: f64 = 0.02;
/// Branches of the small structures.
const SMALL: [usize; 2] = [1, 2];
/// Delays from which one is searched for, s.
const STARTS_S: [f64; 3] = [0.02, 0.08, 0.3];
const STOPPING: StoppingCriteria = StoppingCriteria { iterations: 60, decrease: 1e-6 };
/// Quantile of χ² with one degree of freedom at 99.9 %.
const SIGNIFICANT: f64 = 10.83;

/// The delay (s) that `found` leaves to be explained, or a small structure, which cannot imitate one; none where the film explains the
/// recordings as well.
pub(super) fn suspected(context: &Context<'_>, found: &Found) -> Option<f64> {
    let late = of_structure(context, found)
        .or_else(|| SMALL.into_iter().find_map(|branches| of_small_structure(context, branches)));
    late.map(|late| late.candidate.delay_s)
}

/// The delay (s) that the larger one of small structures leaves to be explained, and an interval that contains it: none where one of them does
/// without a delay.
pub(super) fn of_small_structures(context: &Context<'_>) -> Option<(f64, [f64; 2])> {
    let (mut delay_s, mut interval_s) = (0.0, [f64::INFINITY, f64::NEG_INFINITY]);
    for branches in SMALL {
        let late = of_small_structure(context, branches)?;
        delay_s = late.candidate.delay_s;
        let open_s = open_s(context, context.coarse, &late) + shortest_s(context);
        interval_s = [interval_s[0].min(delay_s - open_s), interval_s[1].max(delay_s + open_s)];
    }
    (interval_s[0] * interval_s[1] > 0.0).then_some((delay_s, interval_s))
}

/// Whether `late`, which has a delay, is so much better than `found`, or so much smaller a film, that the delay is kept.
pub(super) fn is_kept(context: &Context<'_>, late: &Found, found: &Found) -> bool {
    let explains = late.minimum.cost <= WORTH * found.minimum.cost;
    let is_smaller = late.minimum.cost <= found.minimum.cost && late.variables.len() < found.variables.len();
    (explains || is_smaller) && is_clear(context, context.fine, late, MIN_INTERVALS * context.scales.step_s)
}

/// The time (s) by which the delay of `found` may be off beside its noise: that between the rows of a drive that steps, that of creep which is too
/// fast to be seen, and the difference of delays in halves of the recordings of `objective`.
pub(super) fn open_s(context: &Context<'_>, objective: &Objective, found: &Found) -> f64 {
    let Resolution { between_rows_s, radian_s } = context.scales.resolution;
    let spread_s = spread_s(objective, found).unwrap_or(0.0);
    between_rows_s + found.candidate.elements[0].alpha * UNSEEN * radian_s + spread_s
}

/// The film with so many branches and a delay, if it leaves one to be explained.
fn of_small_structure(context: &Context<'_>, branches: usize) -> Option<Found> {
    if !context.excitation.identifies(Variable::Delay) {
        return None;
    }
    let starts = context.linear_starts(Topology::Parallel, branches);
    let prompt = context.best_over(context.coarse, &starts)?;
    let late = STARTS_S.iter().flat_map(|&delay_s| {
        let starts = [&prompt.candidate, starts.first().unwrap_or(&prompt.candidate)];
        starts.map(|start| Candidate { delay_s, ..start.clone() })
    });
    let starts: Vec<Candidate> = late.collect();
    let late = context.with_delay(0.0);
    let (variables, worthwhile) = (late.variables_of(&prompt.candidate), WORTH * prompt.minimum.cost);
    let descent = |start| late.descend_towards(worthwhile, late.coarse, start, variables.clone(), STOPPING);
    let descents = starts.par_iter().filter_map(descent);
    let late = descents.min_by(|a, b| a.minimum.cost.total_cmp(&b.minimum.cost))?;
    is_shown(context, &prompt, &late).then_some(late)
}

/// `found` with a delay on the thinned recordings, if it leaves one to be explained.
fn of_structure(context: &Context<'_>, found: &Found) -> Option<Found> {
    if !context.excitation.identifies(Variable::Delay) || found.variables.contains(&Variable::Delay) {
        return None;
    }
    let prompt = context.descend_over(context.coarse, &found.candidate, found.variables.clone(), STOPPING)?;
    let variables = [found.variables.as_slice(), &[Variable::Delay]].concat();
    let worthwhile = WORTH * prompt.minimum.cost;
    let late = context.descend_towards(worthwhile, context.coarse, &prompt.candidate, variables, STOPPING)?;
    is_shown(context, &prompt, &late).then_some(late)
}

/// Whether `late` brings the cost to a share of [`WORTH`]: of that of `prompt`, which has no delay, and of films that lag by as much.
fn is_shown(context: &Context<'_>, prompt: &Found, late: &Found) -> bool {
    if late.minimum.cost > WORTH * prompt.minimum.cost {
        return false;
    }
    let delay_s = late.candidate.delay_s;
    let lag =
        |film: &Candidate| Some(context.descend(context.coarse, &lagging(film, delay_s)?, STOPPING)?.minimum.cost);
    let film = Candidate { delay_s: prompt.candidate.delay_s, ..late.candidate.clone() };
    let lags = [&prompt.candidate, &film].into_iter().filter_map(lag);
    let least = lags.fold(prompt.minimum.cost, f64::min);
    let share = late.minimum.cost / least;
    let is_significant = |samples: f64| {
        share <= WORTH
            && (1.0 - share) * samples > SIGNIFICANT
            && is_clear(context, context.coarse, late, shortest_s(context))
    };
    context.coarse.whiteness(&late.candidate).is_some_and(|whiteness| is_significant(whiteness.effective_samples))
}

/// The film of `candidate` with one more branch, whose dashpot lags by `delay_s`; none where that is not positive.
fn lagging(candidate: &Candidate, delay_s: f64) -> Option<Candidate> {
    // At a phase of one radian.
    let ln_s = Complex::new(-delay_s.ln(), std::f64::consts::FRAC_PI_2);
    let stiffness = candidate.model().ok()?.modulus_of_ln(ln_s).norm();
    let mut lagging = candidate.clone();
    lagging.topology = Topology::Parallel;
    lagging.elements.extend([Springpot::new(10.0 * stiffness, 0.0), Springpot::new(delay_s * stiffness, 1.0)]);
    (delay_s > 0.0).then_some(lagging)
}

/// The shortest delay (s) that the thinned recordings show.
fn shortest_s(context: &Context<'_>) -> f64 {
    let steps_s = context.coarse.steps_s().fold(0.0, f64::max);
    (MIN_INTERVALS * context.scales.step_s).max(MIN_STEPS * steps_s)
}

/// Whether the delay of `late` is at least `shortest_s` and more than what is open of it, and the same in each half of each recording of
/// `objective`: what a film does that the model does not has other phases at other frequencies and times.
fn is_clear(context: &Context<'_>, objective: &Objective, late: &Found, shortest_s: f64) -> bool {
    let delay_s = late.candidate.delay_s.abs();
    let is_everywhere = |spread_s: f64| spread_s <= DIFFERS * delay_s;
    delay_s >= shortest_s.max(open_s(context, objective, late)) && spread_s(objective, late).is_some_and(is_everywhere)
}

/// Largest difference (s) of the delay of `found` in a half of a recording of `objective`; none without a response.
fn spread_s(objective: &Objective, found: &Found) -> Option<f64> {
    let evaluation = objective.evaluate(&found.candidate)?;
    let residuals = objective.residuals(&evaluation);
    let slope = objective.jacobian(&found.candidate, &evaluation, &[Variable::Delay]).pop()?;
    let mut from = 0;
    let halves = objective.values().flat_map(|values| [values / 2, values - values / 2]);
    let differences = halves.map(|count| {
        let half = from..from + count;
        from += count;
        let product: f64 = slope[half.clone()].iter().zip(&residuals[half.clone()]).map(|(d, r)| d * r).sum();
        (product / slope[half].iter().map(|d| d * d).sum::<f64>()).abs()
    });
    // Where nothing moves there is no difference: the larger of a number and NaN is the number.
    Some(differences.fold(0.0, f64::max))
}
