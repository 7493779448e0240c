//! Estimates how a film differs from the law that was fitted to it.

use core::cmp::Ordering;
use core::f64::consts::TAU;

use crate::control::inverse::share_per_step;
use crate::control::observer::{Observer, ObserverState};
use crate::control::observer_options::ObserverOptions;
use crate::control::path::{clamp, is_finite};
use crate::law::{Law, LawState, Memory};
use crate::scalar::{Real, Scalar};

/// Parameters that are estimated: [`SCALE`] to [`BIAS`].
pub(crate) const PARAMETERS: usize = 5;
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
/// Bounds: a force scale of 0.25 to 4, half to twice the memory, a third to three times its rates, orders of 0.8 to 1.3 times; of the bias
/// in largest forces.
const BOUNDS: [f64; PARAMETERS] = [1.386, 0.7, 1.1, 0.25, 1.0];
/// Change of the force scale that is expected in an adaptation time, and times over which what was learned of the others counts less, in
/// adaptation times.
const WANDERING: f64 = 0.005;
const FORGETTING: [f64; PARAMETERS] = [f64::INFINITY, 4.0, 4.0, 4.0, 2.0];
/// Force that the parameters leave unexplained in 0.1 s, rms, in largest forces.
const UNEXPLAINED: f64 = 0.01;
/// Squares of what is expected above which a difference counts less.
const PLAUSIBLE: f64 = 9.0;
/// Distance of the load from its slow mean from which it distinguishes the parameters, in largest forces.
const EXCITED: f64 = 0.01;
/// Time constant of the bias below that, s.
const AVERAGING_S: f64 = 20.0;
/// Share of the stiffness that relaxes above which it cannot be distinguished from all of it.
const MAX_SHARE: f64 = 0.9;
/// Rate of the fastest mode that follows, 1/s.
const MAX_RATE: f64 = 2.0;
/// Time constant with which an estimate comes into use, s.
const BLEND_S: f64 = 1.0;
/// Changes at which a film has aged by 1: a tenth in stiffness, a quarter in its memory, half in its rates, a twentieth in their logarithms.
const AGED: [f64; 4] = [0.095, 0.223, 0.405, 0.05];

/// Estimates how a film differs from its law, from the force that the observer finds.
///
/// See [`AdaptiveTracking`](crate::AdaptiveTracking) for the parameters. Work is spread over rounds of some thirty ticks: in each tick a
/// mode, in the last two what was estimated comes into use, and the next estimate is made.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Adaptation<T, P> {
    /// The first mode that follows, and how many do.
    first: usize,
    count: usize,
    /// Logarithms of the rates of all modes (1/s).
    logs: P,
    /// Stiffness of what does not relax of the memory, and within one step of what does, N/m.
    lasting: T,
    relaxing: T,
    /// Share of what relaxes in the stiffness at the observer's bandwidth; 0 where nothing lasts, and it is as good as all.
    share: T,
    /// Stiffness at the observer's bandwidth and at rest, N/m.
    stiffness: T,
    /// Ticks of a round.
    ticks: T,
    /// Share of an estimate that comes into use in a round.
    blend: T,
    /// Growth of the variances in a round: by a sum of that of the force scale, by factors of the others.
    wandering: T,
    growth: [T; PARAMETERS],
    /// Expected size of the parameters, and their bounds.
    expected: [T; PARAMETERS],
    bounds: [T; PARAMETERS],
    /// 1 over the force that is left unexplained in a round, 1/N.
    precision: T,
    /// Distance of the load from its mean from which it distinguishes the parameters, N.
    excited: T,
    /// Weight of a round in the bias below that.
    averaging: T,
}

/// State of an [`Adaptation`].
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AdaptationState<T, P> {
    /// The tick of the round.
    phase: usize,
    /// By which share what relaxes of the memory is stiffer than its law has it.
    stiffer: T,
    /// Derivatives of the modes' extensions by the logarithms of their rates, m.
    slopes: P,
    /// Sums of their forces in this round: as they are, and times the logarithms, N.
    sums: [T; 2],
    estimates: [T; PARAMETERS],
    /// The part of them that is in use.
    used: [T; PARAMETERS],
    /// Changes of rate and stretch that came into use in the last round.
    steps: [T; 2],
    /// The forces by which the parameters act, N, and whether the load swings.
    forces: [T; PARAMETERS],
    is_excited: bool,
    /// The covariance of the estimates as U D Uᵀ, in squares of what is expected: D, and the columns of U above its diagonal.
    diagonal: [T; PARAMETERS],
    upper: [[T; PARAMETERS]; PARAMETERS],
    is_on: bool,
    /// Whether the last command met a limit.
    pub(crate) is_limited: bool,
}

impl<T: Real, P: Clone> Adaptation<T, P> {
    /// Beside an `observer` with these options, of a film with a force of up to `largest_n` (N).
    pub(crate) fn new<M: Memory<T, PerMode = P>, const PAST: usize>(
        observer: &Observer<T, M, PAST>,
        largest_n: f64,
        options: &ObserverOptions,
    ) -> Self {
        let (law, adaptation_s) = (observer.law(), options.adaptation_s);
        let [_, integral] = observer.gains();
        let step_s = law.step_s();
        let mut logs = M::per_mode();
        let (mut first, mut end, mut index) = (0, 0, 0);
        let mut lasting = 0.0;
        while let Some(log) = M::of_mode_mut(&mut logs, index) {
            let [loss, weight] = law.memory().mode(index).map(Scalar::to_f64);
            index += 1;
            // Fastest first; unused modes have no weight, and springs no rate.
            if weight > 0.0 && loss > 0.0 {
                let rate = loss / step_s;
                *log = T::from_f64(libm::log(rate));
                (first, end) = if rate > MAX_RATE { (index, index) } else { (first, index) };
            } else {
                lasting += weight;
            }
        }
        let count = end - first;
        #[allow(clippy::cast_precision_loss)] // some dozens
        let ticks = (count + 2) as f64;
        let round_s = ticks * step_s;
        let unexplained = UNEXPLAINED * libm::sqrt(0.1 / round_s) * largest_n;
        let sized = |values: [f64; PARAMETERS]| {
            let [scale, memory, rate, stretch, bias] = values;
            [scale, memory, rate, stretch, bias * largest_n].map(T::from_f64)
        };
        let stiffness = integral / (TAU * options.bandwidth_hz);
        // Without a curve the memory is all of it.
        let memory = if law.is_curved() { law.memory_stiffness(options.bandwidth_hz) } else { stiffness };
        let share = (memory - lasting) / stiffness;
        let wandered = WANDERING / EXPECTED[SCALE];
        Self {
            first,
            count,
            logs,
            lasting: T::from_f64(lasting),
            relaxing: T::from_f64(law.instant() - lasting),
            share: T::from_f64(if share < MAX_SHARE { share } else { 0.0 }),
            stiffness: T::from_f64(stiffness),
            ticks: T::from_f64(ticks),
            blend: T::from_f64(share_per_step(1.0 / BLEND_S, round_s)),
            wandering: T::from_f64(wandered * wandered * round_s / adaptation_s),
            growth: FORGETTING.map(|times| T::from_f64(1.0 + round_s / (times * adaptation_s))),
            expected: sized(EXPECTED),
            bounds: sized(BOUNDS),
            precision: T::from_f64(1.0 / unexplained),
            excited: T::from_f64(EXCITED * largest_n),
            averaging: T::from_f64(share_per_step(1.0 / AVERAGING_S, round_s)),
        }
    }

    /// A tick, after that of the `observer`.
    #[inline(never)] // as `Observer::step`
    pub(crate) fn advance<M: Memory<T, PerMode = P>, const PAST: usize>(
        &self,
        state: &mut AdaptationState<T, P>,
        observer: &Observer<T, M, PAST>,
        observed: &mut ObserverState<T, M, PAST>,
    ) {
        self.stiffen(state.stiffer, observer.law(), &mut observed.film);
        let phase = state.phase;
        state.phase = if phase > self.count { 0 } else { phase + 1 };
        match phase.cmp(&self.count) {
            Ordering::Less => self.flow(state, self.first + phase, observer.law(), &mut observed.film),
            Ordering::Equal => self.bring_into_use(state, observer, observed),
            Ordering::Greater => {
                if state.is_on && !state.is_limited && observed.is_corrected(observer) {
                    self.learn(state, observed.unexplained(self.stiffness));
                }
            }
        }
    }

    /// Makes what relaxes of the memory of a `film` `stiffer` by this share, after a step, which leaves it as its law has it.
    #[inline]
    fn stiffen<M: Memory<T, PerMode = P>>(&self, stiffer: T, law: &Law<T, M>, film: &mut LawState<T, M>) {
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
    fn flow<M: Memory<T, PerMode = P>>(
        &self,
        state: &mut AdaptationState<T, P>,
        index: usize,
        law: &Law<T, M>,
        film: &mut LawState<T, M>,
    ) {
        let (Some(&log), Some(slope)) = (M::of_mode(&self.logs, index), M::of_mode_mut(&mut state.slopes, index))
        else {
            return;
        };
        let [loss, weight] = law.memory().mode(index);
        let extension = M::extension(&film.history, index);
        let one = T::from_f64(1.0);
        let lost = self.ticks * loss;
        let factor = exp(state.used[RATE] + state.used[STRETCH] * log);
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
    fn bring_into_use<M: Memory<T, PerMode = P>, const PAST: usize>(
        &self,
        state: &mut AdaptationState<T, P>,
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
        // The total force stays the same at this moment. The bias is a part of the disturbance.
        changes[BIAS] = T::ZERO;
        let shift = changes.iter().zip(&forces).fold(T::ZERO, |sum, (&change, &force)| sum + change * force);
        state.steps = [changes[RATE], changes[STRETCH]];
        observed.adapt_to(exp(changes[SCALE]), shift, state.used[BIAS]);
        state.stiffer = exp(state.used[MEMORY]) - one;
        // What is not seen changes as well.
        let scale = state.diagonal[SCALE] + self.wandering;
        state.diagonal[SCALE] = if scale > one { one } else { scale };
        state.forces = forces;
        state.is_excited = observed.load_swing(load) > self.excited;
    }

    /// Learns from an `unexplained` force (N): recursive least squares in Bierman's form, whose covariance stays positive in single precision.
    #[inline(never)]
    fn learn(&self, state: &mut AdaptationState<T, P>, unexplained: T) {
        let AdaptationState { estimates, used, forces, diagonal, upper, .. } = state;
        if !state.is_excited {
            // A load that stays distinguishes nothing.
            estimates[BIAS] = estimates[BIAS] + self.averaging * (unexplained - estimates[BIAS]);
            return;
        }
        // The disturbance has all of the bias.
        let used = [used[SCALE], used[MEMORY], used[RATE], used[STRETCH], T::ZERO];
        let one = T::from_f64(1.0);
        let mut regressors = [T::ZERO; PARAMETERS];
        let mut open = unexplained;
        let sized = forces.iter().zip(&self.expected);
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
        for (index, (column, variance)) in upper.iter_mut().zip(&mut *diagonal).enumerate() {
            let above = column.iter().zip(&regressors).take(index);
            let own = regressors.get(index).copied().unwrap_or(T::ZERO);
            let along = above.fold(own, |sum, (&entry, &regressor)| sum + entry * regressor);
            let spread = *variance * along;
            let before = total;
            total = total + along * spread;
            *variance = *variance * (before / total);
            let back = -(along / before);
            for (entry, gain) in column.iter_mut().zip(&mut gains).take(index) {
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
        let allowed = self.expected.iter().zip(&self.bounds);
        for ((estimate, gain), (&expected, &bound)) in estimates.iter_mut().zip(gains).zip(allowed) {
            *estimate = clamp(*estimate + gain * step * expected, -bound, bound);
        }
        for (variance, &growth) in diagonal.iter_mut().zip(&self.growth) {
            let grown = growth * *variance;
            *variance = if grown > one { one } else { grown };
        }
    }
}

impl<T: Real, P> AdaptationState<T, P> {
    /// The film as its law has it.
    pub(crate) fn as_fitted<M: Memory<T, PerMode = P>>() -> Self {
        Self {
            phase: 0,
            stiffer: T::ZERO,
            slopes: M::per_mode(),
            sums: [T::ZERO; 2],
            estimates: [T::ZERO; PARAMETERS],
            used: [T::ZERO; PARAMETERS],
            steps: [T::ZERO; 2],
            forces: [T::ZERO; PARAMETERS],
            is_excited: false,
            diagonal: [T::from_f64(1.0); PARAMETERS],
            upper: [[T::ZERO; PARAMETERS]; PARAMETERS],
            is_on: true,
            is_limited: false,
        }
    }

    /// The parameters that are in use.
    pub(crate) fn used(&self) -> [T; PARAMETERS] {
        self.used
    }

    /// Standard deviation of the force scale, over it.
    pub(crate) fn uncertainty(&self) -> T {
        let others = self.upper.iter().zip(&self.diagonal);
        let variance = others
            .fold(self.diagonal[SCALE], |sum, (column, &variance)| sum + column[SCALE] * column[SCALE] * variance);
        T::from_f64(EXPECTED[SCALE]) * variance.sqrt()
    }

    /// How far the film has moved from its law: the largest change over the one that is 1.
    pub(crate) fn ageing(&self) -> T {
        let changes = self.used.iter().zip(AGED).map(|(used, aged)| used.abs() / T::from_f64(aged));
        changes.fold(T::ZERO, |largest, change| if change > largest { change } else { largest })
    }

    /// Learns from now on, or not.
    pub(crate) fn set_learning(&mut self, is_on: bool) {
        self.is_on = is_on;
    }

    /// The law comes back into use, and nothing is known of the film.
    pub(crate) fn forget(&mut self) {
        self.estimates = [T::ZERO; PARAMETERS];
        self.diagonal = [T::from_f64(1.0); PARAMETERS];
        self.upper = [[T::ZERO; PARAMETERS]; PARAMETERS];
    }
}

/// e^x within 1e-4 for x of −2 to 2, in operations that are the same everywhere.
fn exp<T: Real>(x: T) -> T {
    let part = T::from_f64(1.0 / 16.0) * x;
    let one = T::from_f64(1.0);
    let mut power = one + part * (one + part * (T::from_f64(0.5) + part * T::from_f64(1.0 / 6.0)));
    for _ in 0..4 {
        power = power * power;
    }
    power
}
