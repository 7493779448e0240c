//! Estimates how a film differs from the law that was fitted to it.

mod numbers;
mod power_series;
mod state;

use core::cmp::Ordering;

use power_series::{exp, log_of_ratio};

use crate::control::adapted::{Adapting, BOUNDS, ROUNDED};
use crate::control::inverse::share_per_step;
use crate::control::observer::{Observer, ObserverState};
use crate::control::observer_options::ObserverOptions;
use crate::control::path::{clamp, is_finite};
use crate::law::{Law, LawState, Memory};
use crate::scalar::{Real, Scalar};

/// Parameters that are estimated: [`SCALE`] to [`BIAS`].
pub(crate) const PARAMETERS: usize = 5;
/// Entries above the diagonal of their covariance.
const ABOVE: usize = PARAMETERS * (PARAMETERS - 1) / 2;
/// Logarithm of the force scale.
const SCALE: usize = 0;
/// Logarithm of the stiffness of what relaxes, where something does not.
const MEMORY: usize = 1;
/// Logarithm of all relaxation rates, and a factor of their logarithms about 1/s.
const RATE: usize = 2;
const STRETCH: usize = 3;
/// A constant force, N.
const BIAS: usize = 4;

/// Standard deviations of what is expected before a sensor has shown anything; of the bias in largest forces.
const EXPECTED: [f64; PARAMETERS] = [0.3, 0.3, 0.7, 0.15, 0.005];
/// Change of the force scale that is expected in an adaptation time, and rates with which what was learned of the others counts less, over
/// adaptation times.
const WANDERING: f64 = 0.005;
const WANDERED: f64 = (WANDERING / EXPECTED[SCALE]) * (WANDERING / EXPECTED[SCALE]);
const FORGETTING: [f64; PARAMETERS] = [0.0, 0.25, 0.25, 0.25, 0.5];
/// Growth of a variance, over it, for a change of rate or stretch that comes into use. Forces are no linear functions of them: what was learned with
/// other values counts less. It does not where an estimate is beyond this share of its bound: no values describe such a film.
const RELINEARISING: [f64; PARAMETERS] = [0.0, 2.5, 2.5, 2.5, 0.0];
const DESCRIBED: f64 = 0.9;
/// Force that the parameters leave unexplained in 0.1 s, rms, in largest forces.
const UNEXPLAINED: f64 = 0.015;
/// Squares of what is expected above which a difference counts less.
const PLAUSIBLE: f64 = 9.0;
/// Distance of the load from its slow mean from which it distinguishes the parameters, in largest forces.
const EXCITED: f64 = 0.01;
/// Time constant of the bias below that, and of the misfit, s.
const AVERAGING_S: f64 = 20.0;
/// Share of the stiffness that relaxes above which it cannot be distinguished from all of it.
const MAX_SHARE: f64 = 0.9;
/// Standard deviations by which an estimate differs from its law by chance.
const BY_CHANCE: f64 = 3.0;
/// Change of the stiffness alone that is reported.
const MIN_CHANGE: f64 = 0.0125;
/// Rate of the fastest mode that follows, 1/s.
const MAX_RATE: f64 = 2.0;
/// Time constant with which an estimate comes into use, s.
const BLEND_S: f64 = 1.0;
/// Share of what is expected of the parameters below which what is forgotten is out of use.
const FORGOTTEN: f64 = 1e-3;
/// Changes at which a film has aged by 1: a tenth in stiffness, a quarter in its memory, half in its rates, a twentieth in their logarithms.
const AGED: [f64; 4] = [0.095, 0.223, 0.405, 0.05];

/// Estimates how a film differs from its law, from the force that the observer finds.
///
/// See [`Adapting`] for the parameters. Work is spread over rounds of some thirty ticks: in each tick a
/// mode, in the last two what was estimated comes into use, and the next estimate is made.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Adaptation<T> {
    /// The first mode that follows, and how many do.
    first: u8,
    count: u8,
    /// The step, s: what a mode of 1/s loses within it.
    step: T,
    /// Stiffness of what does not relax of the memory, and within one step of what does, N/m.
    lasting: T,
    relaxing: T,
    /// Share of what relaxes in the stiffness at the observer's bandwidth; 0 where nothing lasts, and it is as good as all.
    share: T,
    /// Stiffness at the observer's bandwidth and at rest, N/m.
    stiffness: T,
    /// The largest force, N.
    largest: T,
    /// Ticks of a round.
    ticks: T,
    /// Share of an estimate that comes into use in a round.
    blend: T,
    /// A round over the adaptation time, with which variances grow.
    forgetting: T,
    /// 1 over the force that is left unexplained in a round, 1/N.
    precision: T,
}

/// State of an [`Adaptation`].
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AdaptationState<T, P> {
    /// The tick of the round.
    phase: usize,
    /// By which share what relaxes of the memory is stiffer than its law has it.
    stiffer: T,
    /// The loss of the mode before in a step, and the logarithm of its rate (1/s).
    before: (T, T),
    /// Derivatives of the modes' extensions by the logarithms of their rates, m.
    slopes: P,
    /// Sums of their forces in this round: as they are, and times the logarithms, N.
    sums: [T; 2],
    estimates: [T; PARAMETERS],
    /// The part of them that is in use.
    used: [T; PARAMETERS],
    /// Logarithms of force scale and rate at the temperature that was stated, and the part of them that is in use.
    stated: [T; 2],
    stated_used: [T; 2],
    /// The logarithm of the factor of all rates that is in use, learned and stated.
    rate: T,
    /// Changes of rate and stretch that came into use in the last round.
    steps: [T; 2],
    /// The forces by which the parameters act, N, and whether the load swings.
    forces: [T; PARAMETERS],
    is_excited: bool,
    /// The covariance of the estimates as U D Uᵀ, in squares of what is expected: D, and the columns of U above its diagonal, one
    /// after another.
    diagonal: [T; PARAMETERS],
    upper: [T; ABOVE],
    /// Mean square of the differences between what is found and estimated, over the variance that is expected of them.
    misfit: T,
    /// Variance of the force scale when it was last learned, in squares of what is expected.
    doubt: T,
    /// How far the film has moved from its law, then.
    ageing: T,
    /// Whether any of it is in use, and whether it stays so.
    is_in_use: bool,
    adapting: Adapting,
}

impl<T: Real> Adaptation<T> {
    /// Beside an observer along `law` that accepts these options, of a film with a force of up to `largest_n` (N).
    ///
    /// `stiffness` (N/m) is that of the film and of its memory, as far as that is not all of it, at the observer's bandwidth and at rest.
    #[inline(never)] // a small chip has no room for it beside what is built next
    pub(crate) fn new<M: Memory<T>>(
        law: &Law<T, M>,
        largest_n: f64,
        [stiffness, memory]: [f64; 2],
        options: &ObserverOptions,
    ) -> Self {
        // Where it is 0 nothing is learned, as if it were infinite.
        let adaptation_s = if options.adaptation_s > 0.0 { options.adaptation_s } else { f64::INFINITY };
        let step_s = law.step_s();
        let (mut first, mut end, mut index) = (0, 0, 0);
        let mut lasting = 0.0;
        while index < M::MODES {
            let [loss, weight] = law.memory().mode(index).map(Scalar::to_f64);
            index += 1;
            // Fastest first; unused modes have no weight, and springs no rate.
            if weight > 0.0 && loss > 0.0 {
                (first, end) = if loss > MAX_RATE * step_s { (index, index) } else { (first, index) };
            } else {
                lasting += weight;
            }
        }
        let count = end - first;
        #[allow(clippy::cast_precision_loss)] // some dozens
        let ticks = (count + 2) as f64;
        let round_s = ticks * step_s;
        let unexplained = UNEXPLAINED * libm::sqrt(0.1 / round_s) * largest_n;
        let share = (memory - lasting) / stiffness;
        #[allow(clippy::cast_possible_truncation)] // some dozens
        Self {
            first: first as u8,
            count: count as u8,
            step: T::from_f64(step_s),
            lasting: T::from_f64(lasting),
            relaxing: T::from_f64(law.instant() - lasting),
            share: T::from_f64(if share < MAX_SHARE { share } else { 0.0 }),
            stiffness: T::from_f64(stiffness),
            largest: T::from_f64(largest_n),
            ticks: T::from_f64(ticks),
            blend: T::from_f64(share_per_step(1.0 / BLEND_S, round_s)),
            forgetting: T::from_f64(round_s / adaptation_s),
            precision: T::from_f64(1.0 / unexplained),
        }
    }

    /// `values`, of the bias in largest forces.
    #[inline]
    fn sized(&self, values: [f64; PARAMETERS]) -> [T; PARAMETERS] {
        let [scale, memory, rate, stretch, bias] = values.map(T::from_f64);
        [scale, memory, rate, stretch, self.largest * bias]
    }

    /// A tick, after that of the `observer`; the last command met a limit or not.
    #[inline(never)] // as `Observer::step`
    pub(crate) fn advance<M: Memory<T>, const PAST: usize>(
        &self,
        state: &mut AdaptationState<T, M::PerMode>,
        observer: &Observer<T, M, PAST>,
        observed: &mut ObserverState<T, M, PAST>,
        is_limited: bool,
    ) {
        self.stiffen(state.stiffer, observer.law(), &mut observed.film);
        let (phase, count) = (state.phase, usize::from(self.count));
        state.phase = if phase > count { 0 } else { phase + 1 };
        match phase.cmp(&count) {
            Ordering::Less => self.flow(state, usize::from(self.first) + phase, observer.law(), &mut observed.film),
            Ordering::Equal => self.bring_into_use(state, observer, observed),
            Ordering::Greater => {
                if state.adapting == Adapting::Learn && !is_limited && observed.is_corrected(observer) {
                    self.learn(state, observed.unexplained(self.stiffness));
                }
            }
        }
    }

    /// Makes what relaxes of the memory of a `film` `stiffer` by this share, after a step, which leaves it as its law has it.
    #[inline]
    fn stiffen<M: Memory<T>>(&self, stiffer: T, law: &Law<T, M>, film: &mut LawState<T, M>) {
        let memory = law.remembered(film);
        let more = stiffer * (memory.force - self.lasting * memory.value);
        film.bend.memory = film.bend.memory + more;
        film.base = film.base + memory.weight * more;
        let stiffness = memory.stiffness + stiffer * (memory.weight * memory.slope * self.relaxing);
        // A film near pull-in may have no other stiffness.
        let least = T::from_f64(0.5) * memory.stiffness;
        film.bend.stiffness = if stiffness > least { stiffness } else { least };
        // The observer's gains follow.
        film.bend.slope = memory.steepness + stiffer * self.share * memory.steepness;
    }

    /// Lets the mode `index` flow faster or slower than its law has it, once in a round for all of the round.
    #[inline]
    fn flow<M: Memory<T>>(
        &self,
        state: &mut AdaptationState<T, M::PerMode>,
        index: usize,
        law: &Law<T, M>,
        film: &mut LawState<T, M>,
    ) {
        let Some(slope) = M::of_mode_mut(&mut state.slopes, index) else {
            return;
        };
        let [loss, weight] = law.memory().mode(index);
        // The logarithm grows from mode to mode, and from a rate of 1/s.
        let is_first = index == usize::from(self.first);
        let (before, log) = if is_first { (self.step, T::ZERO) } else { state.before };
        // Modes that are not used lose nothing.
        let (before, log) = if loss > T::ZERO { (loss, log + log_of_ratio(loss, before)) } else { (before, log) };
        state.before = (before, log);
        let extension = M::extension(&film.history, index);
        let one = T::from_f64(1.0);
        let lost = self.ticks * loss;
        let factor = exp(state.rate + state.used[STRETCH] * log);
        // What has just come into use counts from the beginning: the extension is as if it had always been so.
        let moved = *slope * (state.steps[0] + state.steps[1] * log);
        M::relax(&mut film.history, index, (factor - one) * lost * extension - moved);
        let flows = factor * lost;
        *slope = (*slope - flows * extension) / (one + flows);
        let force = weight * *slope;
        state.sums = [state.sums[0] + force, state.sums[1] + log * force];
    }

    /// Brings estimates into use, and finds the forces by which the parameters act now.
    #[inline]
    fn bring_into_use<M: Memory<T>, const PAST: usize>(
        &self,
        state: &mut AdaptationState<T, M::PerMode>,
        observer: &Observer<T, M, PAST>,
        observed: &mut ObserverState<T, M, PAST>,
    ) {
        let one = T::from_f64(1.0);
        let load = observed.scaled_load(observer.drive());
        // Of a film that has just been stiffened.
        let memory = observer.law().remembered(&observed.film);
        let weight = (one + state.stiffer) * memory.weight;
        let relaxing = memory.weight * (memory.force - self.lasting * memory.value);
        let relaxing = if self.share > T::ZERO { relaxing } else { T::ZERO };
        let [rate, stretch] = state.sums.map(|sum| -(weight * sum));
        state.sums = [T::ZERO; 2];
        let forces = [load, -relaxing, rate, stretch, one];
        let mut changes = [T::ZERO; PARAMETERS];
        for ((used, change), &estimate) in state.used.iter_mut().zip(&mut changes).zip(&state.estimates) {
            *change = self.blend * (estimate - *used);
            *used = *used + *change;
        }
        // The film itself changes with its temperature: there is no shift of the force, and what flowed before stays.
        let mut warmed = [T::ZERO; 2];
        for ((used, change), &stated) in state.stated_used.iter_mut().zip(&mut warmed).zip(&state.stated) {
            *change = self.blend * (stated - *used);
            *used = *used + *change;
        }
        if state.adapting == Adapting::Off && self.is_forgotten(state) {
            state.stated_used = [T::ZERO; 2];
            for (used, change) in state.used.iter_mut().zip(&mut changes) {
                *change = *change - *used;
                *used = T::ZERO;
            }
            // The next round leaves the stiffness of the film as its law has it.
            state.is_in_use = state.stiffer.abs() > T::ZERO;
        }
        // The total force stays the same at this moment. The bias is a part of the disturbance. The force scale may be another one where
        // this begins.
        let [scale, _, rate, ..] = BOUNDS.map(|bound| T::from_f64(bound * ROUNDED));
        let scale = exp(clamp(state.used[SCALE] + state.stated_used[0], -scale, scale));
        let grown = scale / observed.force_scale();
        changes[SCALE] = grown - one - warmed[0];
        changes[BIAS] = T::ZERO;
        let shift = changes.iter().zip(&forces).fold(T::ZERO, |sum, (&change, &force)| sum + change * force);
        state.steps = [changes[RATE], changes[STRETCH]];
        state.rate = clamp(state.used[RATE] + state.stated_used[1], -rate, rate);
        observed.adapt_to(scale, shift, state.used[BIAS]);
        state.stiffer = exp(state.used[MEMORY]) - one;
        // What is not seen changes as well.
        let scale = state.diagonal[SCALE] + T::from_f64(WANDERED) * self.forgetting;
        state.diagonal[SCALE] = if scale > one { one } else { scale };
        state.forces = forces;
        state.is_excited = observed.load_swing(load) > T::from_f64(EXCITED) * self.largest;
    }

    /// Returns `true` where so little is in use that it may go.
    fn is_forgotten<P>(&self, state: &AdaptationState<T, P>) -> bool {
        let few = T::from_f64(FORGOTTEN);
        let expected = self.sized(EXPECTED);
        let stated = state.stated_used.iter().zip([expected[SCALE], expected[RATE]]);
        state.used.iter().zip(expected).chain(stated).all(|(used, expected)| used.abs() <= few * expected)
    }

    /// Learns from an `unexplained` force (N): recursive least squares in Bierman's form, whose covariance stays positive in single precision.
    #[inline(never)]
    fn learn<P>(&self, state: &mut AdaptationState<T, P>, unexplained: T) {
        let AdaptationState { estimates, used, steps, forces, diagonal, upper, misfit, .. } = state;
        let averaging = T::from_f64(BLEND_S / AVERAGING_S) * self.blend;
        if !state.is_excited {
            // A load that stays distinguishes nothing.
            estimates[BIAS] = estimates[BIAS] + averaging * (unexplained - estimates[BIAS]);
            return;
        }
        // The disturbance has all of the bias.
        let used = [used[SCALE], used[MEMORY], used[RATE], used[STRETCH], T::ZERO];
        let one = T::from_f64(1.0);
        let mut regressors = [T::ZERO; PARAMETERS];
        let mut open = unexplained;
        let expected = self.sized(EXPECTED);
        let sized = forces.iter().zip(&expected);
        for ((regressor, (&force, &expected)), (&estimate, &used)) in
            regressors.iter_mut().zip(sized).zip(estimates.iter().zip(&used))
        {
            open = open - (estimate - used) * force;
            *regressor = force * self.precision * expected;
        }
        let innovation = open * self.precision;
        if !is_finite(innovation) {
            return;
        }
        let mut gains = [T::ZERO; PARAMETERS];
        let mut total = one;
        let mut columns = &mut upper[..];
        for (index, variance) in diagonal.iter_mut().enumerate() {
            let Some((column, others)) = columns.split_at_mut_checked(index) else {
                return;
            };
            columns = others;
            let above = column.iter().zip(&regressors);
            let own = regressors.get(index).copied().unwrap_or(T::ZERO);
            let along = above.fold(own, |sum, (&entry, &regressor)| sum + entry * regressor);
            let spread = *variance * along;
            let before = total;
            total = total + along * spread;
            *variance = *variance * (before / total);
            let back = -(along / before);
            for (entry, gain) in column.iter_mut().zip(&mut gains) {
                let was = *entry;
                *entry = was + *gain * back;
                *gain = *gain + was * spread;
            }
            if let Some(gain) = gains.get_mut(index) {
                *gain = spread;
            }
        }
        // What is less plausible counts less.
        let doubt = one + innovation * innovation / (T::from_f64(PLAUSIBLE) * total);
        let step = innovation / (total * doubt);
        *misfit = *misfit + averaging * (innovation * step - *misfit);
        let bounds = self.sized(BOUNDS);
        let moves: [T; PARAMETERS] = core::array::from_fn(|index| {
            let [gain, expected] = [&gains, &expected].map(|of| of.get(index).copied().unwrap_or(T::ZERO));
            gain * step * expected
        });
        // Only as far as all of them stay within their bounds: held there one by one, the others would run away.
        let (mut part, mut moved) = (one, steps[0].abs() + steps[1].abs());
        for ((&estimate, &by), &bound) in estimates.iter().zip(&moves).zip(&bounds) {
            let room = if by > T::ZERO { bound - estimate } else { bound + estimate };
            let most = if by.abs() > room { room / by.abs() } else { one };
            // One that was restored may be beyond its bound by its rounding.
            part = clamp(most, T::ZERO, part);
            moved = if estimate.abs() > T::from_f64(DESCRIBED) * bound { T::ZERO } else { moved };
        }
        for ((estimate, by), bound) in estimates.iter_mut().zip(moves).zip(bounds) {
            *estimate = clamp(*estimate + part * by, -bound, bound);
        }
        for ((variance, rate), relinearising) in diagonal.iter_mut().zip(FORGETTING).zip(RELINEARISING) {
            let growth = self.forgetting * T::from_f64(rate) + T::from_f64(relinearising) * moved;
            let grown = *variance + growth * *variance;
            *variance = if grown > one { one } else { grown };
        }
        state.judge();
    }
}
