//! Learning of periodic references: the negative of the error that remains in every cycle is added to the reference.

mod numbers;
mod options;

pub use options::LearningOptions;

use core::f64::consts::TAU;

use crate::actuator::Actuator;
use crate::control::block::{Block, Progress};
use crate::control::cycle::{Cycle, CycleFinder};
use crate::control::harmonic::{HARMONICS, Harmonic, Kind, Pair};
use crate::control::limits::Limited;
use crate::control::observer::SensorSample;
use crate::control::path::is_finite;
use crate::error::ControlError;
use crate::law::{Law, Memory};
use crate::scalar::Real;

/// Learns the error that a film leaves of a periodic reference, and adds its negative to the reference.
///
/// A [`Follower`](crate::Follower) puts it in front of feedforward or tracking. In front of another controller:
/// [`observe`](LearningState::observe) each sample that arrives, then, in every tick, [`advance`](Self::advance) with the reference; it
/// returns the one to follow instead.
///
/// The error e, a sample minus the reference of its own time, has in every cycle of the reference the harmonics E_h. They respond to
/// the correction A_h with the factor P_h, which the inverse of the law makes nearly 1 where the law is right. So, block by block,
///
/// ```text
/// E_h = D_h + P_h A_h,      A_h ← A_h − γ E_h / P_h,      P_h ← ΔE_h / ΔA_h
/// ```
///
/// (higher harmonic control: W. Johnson, "Self-tuning regulators for multicyclic control of helicopter vibration", NASA TP-1996, 1982;
/// here with P_h from the last two blocks). A sample that comes late costs nothing. Near a resonance that the law does not know, P_h is
/// far from 1 and its phase turns: small steps measure it, and the next ones use it. Where the film responds with less than a fifth,
/// nothing is added. Where the error grows, the correction returns to that of the best block.
///
/// A block is some time for the film to settle and then whole cycles. γ is 0.6 at first, above 2 Hz 0.1 and doubled from block to block, 0.8
/// once P_h is measured, and less where E_h is no larger than its noise and after an error that has grown. Blocks without samples or with a limit are not used; where limits leave no block at all, the correction is
/// halved.
///
/// Harmonics up to 0.3 of the sensor's rate are learned. The correction has two lags of 5 ticks, so that it has no steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learning<T, const PAST: usize = 64> {
    finder: CycleFinder<T>,
    /// The period that was given, ticks; 0 where it is taken from the reference.
    period: T,
    /// The harmonics that are learned, beside the mean.
    harmonics: usize,
    /// The largest angle in a tick that is learned, rad.
    largest_angle: T,
    /// Ticks in a second.
    rate: T,
    /// Share of the distance to its target by which a harmonic approaches it in a visit.
    approach: T,
}

/// State of a [`Learning`]: changes with every tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningState<T, const PAST: usize = 64> {
    cycle: Cycle<T>,
    /// exp(iθ) at the end of this tick, and exp(i) of the angle of a tick.
    phase: Pair<T>,
    rotation: Pair<T>,
    /// Angle of a tick, rad; 0 without a period.
    angle: T,
    /// Share of the learned correction that is added: fades out where the period is lost.
    fade: T,
    /// The correction after one and two lags, m.
    lagged: [T; 2],
    /// The mean and the harmonics.
    harmonics: [Harmonic<T>; HARMONICS + 1],
    /// References of the last ticks with the phase of each: a ring that begins at `newest`.
    past: [[T; 3]; PAST],
    newest: usize,
    /// The last sample, and its place in the ring.
    arrived: Option<(T, usize)>,
    /// The harmonic that is updated in this tick.
    index: usize,
    /// Error (m) of the sample of this round of visits, 0 without one, exp(iθ) of it, and its power for the next harmonic.
    error: T,
    unit: Pair<T>,
    power: Pair<T>,
    block: Block<T>,
    /// Progress over the blocks of this period.
    progress: Progress<T>,
}

/// Share of the sensor's rate below which harmonics are learned.
const MAX_SHARE_OF_RATE: f64 = 0.3;
/// Share of the static stroke at the largest voltage that counts as a swing of the reference.
const MIN_SWING: f64 = 1e-3;
/// Below this frequency a film is taken to respond as its law predicts until its response is measured.
const SLOW_HZ: f64 = 2.0;
/// Largest angle of a tick, rad: the series for its cosine and sine hold it to single precision.
const MAX_ANGLE: f64 = 0.35;
/// Time for the film to settle, s: with cycles that are longer than a second, and with shorter ones, which stir its resonance.
const SETTLING_S: [f64; 2] = [0.2, 0.5];
/// Least time of the cycles of a block, s: while there is much to learn, and later.
const MIN_BLOCK_S: [f64; 2] = [0.5, 2.5];
/// Fewest samples of a block: there are 13 numbers to learn.
const MIN_SAMPLES: f64 = 16.0;
/// Time constant with which a new value is approached, s.
const APPROACH_S: f64 = 0.1;
/// Weight of the newest value in the two lags.
const SMOOTHING: f64 = 0.2;
/// Share of the distance by which the correction fades in a round of visits.
const FADE_WEIGHT: f64 = 0.1;
/// Share of the learned correction below which it counts as faded out.
const FADED_OUT: f64 = 0.01;
/// Blocks of the longest kind without an end, in their least time, after which the correction is halved.
const MAX_BLOCKS: f64 = 4.0;
/// Taylor's series of cosine and of sine over the angle, in its square.
const COSINE: [f64; 4] = [1.0, -1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0];
const SINE: [f64; 4] = [1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0];
/// sin of the angle by which a crossing may miss its phase and still belong to the same period.
const SAME_PERIOD: f64 = 0.3;

impl<T: Real> Learning<T> {
    /// Learning in front of the inverse of `law` for `actuator`, up to `max_voltage_v` (V), that remembers 64 ticks.
    ///
    /// # Errors
    ///
    /// [`ControlError::NotPositive`] for times that are not finite and positive, [`ControlError::Harmonics`].
    pub fn new<M: Memory<T>>(
        law: &Law<T, M>,
        actuator: &Actuator,
        max_voltage_v: f64,
        options: LearningOptions,
    ) -> Result<Self, ControlError> {
        Self::with_past(law, actuator, max_voltage_v, options)
    }
}

impl<T: Real, const PAST: usize> Learning<T, PAST> {
    /// As [`new`](Self::new), remembering `PAST` ticks: samples may be up to `PAST` − 9 ticks old.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn with_past<M: Memory<T>>(
        law: &Law<T, M>,
        actuator: &Actuator,
        max_voltage_v: f64,
        options: LearningOptions,
    ) -> Result<Self, ControlError> {
        options.check()?;
        let LearningOptions { harmonics, period_s, sample_interval_s } = options;
        let step_s = law.step_s();
        let largest_angle = (MAX_SHARE_OF_RATE * TAU * step_s / sample_interval_s).min(MAX_ANGLE);
        let stroke = actuator.electrostatic_force(max_voltage_v) / law.stiffness_at_rest();
        #[allow(clippy::cast_precision_loss)] // 7
        let visit_s = (HARMONICS + 1) as f64 * step_s;
        Ok(Self {
            finder: CycleFinder::new(MIN_SWING * stroke, step_s),
            period: T::from_f64(period_s.map_or(0.0, |period_s| period_s / step_s)),
            harmonics,
            largest_angle: T::from_f64(largest_angle),
            rate: T::from_f64(1.0 / step_s),
            approach: T::from_f64((visit_s / APPROACH_S).min(1.0)),
        })
    }

    /// A state that has learned nothing, for a reference that begins at `position` (m).
    #[must_use]
    pub fn state(&self, position: T) -> LearningState<T, PAST> {
        let (zero, one) = (T::ZERO, T::from_f64(1.0));
        let is_given = self.period > zero;
        // In one piece: a small chip has no room for two.
        let (angle, rotation) =
            if is_given { rotation_by(T::from_f64(TAU) / self.period) } else { (zero, [one, zero]) };
        LearningState {
            cycle: Cycle::at(position),
            phase: [one, zero],
            rotation,
            angle,
            fade: if is_given { one } else { zero },
            lagged: [zero; 2],
            harmonics: [Harmonic::new(); HARMONICS + 1],
            past: [[position, one, zero]; PAST],
            newest: 0,
            arrived: None,
            index: 0,
            error: zero,
            unit: [one, zero],
            power: [one, zero],
            block: Block::first(),
            progress: Progress::none(),
        }
    }

    /// Begins another run, whose reference begins at `position` (m), with the learned correction of `state` if it `keeps` it. The sample that has
    /// arrived last stays.
    pub fn restart(&self, state: &mut LearningState<T, PAST>, position: T, keeps: bool) {
        let LearningState { harmonics, arrived, newest, progress, .. } = state;
        let harmonics = if keeps { harmonics.map(Harmonic::carried_over) } else { [Harmonic::new(); HARMONICS + 1] };
        // The ring begins at 0 again.
        let arrived = arrived.map(|(displacement, place)| {
            (displacement, if place < *newest { place + PAST - *newest } else { place - *newest })
        });
        let progress = if keeps { progress.carried_over() } else { Progress::none() };
        *state = LearningState { harmonics, arrived, progress, ..self.state(position) };
    }

    /// The reference to follow at the end of this tick (m) instead of `reference` (m). `limited`: the limits that the command before met;
    /// nothing is learned from blocks with limits.
    ///
    /// A non-finite reference is passed on, and nothing is learned from it.
    // Not inlined, as `Observer::step`.
    #[inline(never)]
    pub fn advance(&self, state: &mut LearningState<T, PAST>, reference: T, limited: Limited) -> T {
        state.advance_phase();
        if self.period <= T::ZERO {
            self.track_period(state, reference);
        }
        state.remember(reference);
        if !limited.is_none() {
            self.discard_block(state);
        }
        self.visit(state);
        reference + state.smooth()
    }

    /// Takes the period from the reference.
    #[inline]
    fn track_period(&self, state: &mut LearningState<T, PAST>, reference: T) {
        let crossed = self.finder.advance(&mut state.cycle, reference);
        let Some(period) = state.cycle.period() else {
            state.angle = T::ZERO;
            state.progress = state.progress.renewed();
            return;
        };
        let Some(ticks_ago) = crossed else { return };
        let angle = T::from_f64(TAU) / period;
        let [cos, sin] = state.phase;
        // The crossing is where the phase is 0: `ticks_ago` ticks ago.
        let phase_error = sin - angle * ticks_ago * cos;
        let same = T::from_f64(SAME_PERIOD);
        if state.angle > T::ZERO && cos > T::ZERO && phase_error < same && -phase_error < same {
            // The next cycle makes up for what is left.
            state.set_angle(angle - angle * phase_error / T::from_f64(TAU));
        } else if state.fade > T::from_f64(FADED_OUT) {
            // Another period: the correction fades out first.
            state.angle = T::ZERO;
            state.progress = state.progress.renewed();
        } else {
            state.phase = [T::from_f64(1.0), angle * ticks_ago];
            state.set_angle(angle);
            state.begin_block();
        }
    }

    /// A limit was met: the block is not used. Where limits leave no block, the correction may be the cause.
    fn discard_block(&self, state: &mut LearningState<T, PAST>) {
        if !state.block.has_ended {
            state.begin_block();
        }
        let longest = T::from_f64(MAX_BLOCKS * MIN_BLOCK_S[1]) * self.rate;
        if state.block.ticks_since_end > longest {
            state.block.ticks_since_end = T::ZERO;
            state.harmonics.iter_mut().for_each(Harmonic::halve);
        }
    }

    /// Updates one harmonic.
    #[inline]
    fn visit(&self, state: &mut LearningState<T, PAST>) {
        let index = state.index;
        if index == 0 {
            self.begin_round(state);
        }
        state.index = if index == HARMONICS { 0 } else { index + 1 };
        let [cos, sin] = state.power;
        let [c, s] = state.unit;
        state.power = [cos * c - sin * s, cos * s + sin * c];
        let Some(harmonic) = state.harmonics.get_mut(index) else { return };
        harmonic.approach(self.approach);
        if !state.block.has_ended {
            harmonic.accumulate(state.error, [cos, sin]);
            return;
        }
        #[allow(clippy::cast_precision_loss)] // at most 6
        let angle = T::from_f64(index as f64) * state.angle;
        if index <= self.harmonics && angle <= self.largest_angle {
            let kind = match index {
                0 => Kind::Mean,
                _ if angle * self.rate < T::from_f64(SLOW_HZ * TAU) => Kind::Slow,
                _ => Kind::Fast,
            };
            state.block.is_short |= harmonic.update(kind, &state.block, &state.progress);
        }
        state.progress.is_bare = (index == 0 || state.progress.is_bare) && !harmonic.adds();
        if index == HARMONICS {
            state.begin_block();
        }
    }

    /// Takes the sample that has arrived since the round before, or ends the block.
    #[inline]
    fn begin_round(&self, state: &mut LearningState<T, PAST>) {
        state.power = [T::from_f64(1.0), T::ZERO];
        state.error = T::ZERO;
        state.renormalise();
        state.update_fade();
        let measured = state.take_error();
        #[allow(clippy::cast_precision_loss)] // 7
        let visits = T::from_f64((HARMONICS + 1) as f64);
        state.block.ticks = state.block.ticks + visits;
        state.block.ticks_since_end = state.block.ticks_since_end + visits;
        let second = self.rate * state.angle;
        let is_slow = second < T::from_f64(TAU);
        let settling = T::from_f64(SETTLING_S[usize::from(!is_slow)]) * self.rate;
        let block = &mut state.block;
        if block.ticks < settling || state.angle <= T::ZERO {
            return;
        }
        block.angle = block.angle + visits * state.angle;
        if block.angle >= block.next_end {
            block.next_end = block.next_end + T::from_f64(TAU);
            let least = T::from_f64(MIN_BLOCK_S[usize::from(!block.is_short)]) * self.rate;
            if block.ticks >= settling + least && block.samples >= T::from_f64(MIN_SAMPLES) {
                let [mean, harmonics @ ..] = &state.harmonics;
                let half = T::from_f64(0.5) * mean.power();
                let mean_squares = block.complete(harmonics.iter().fold(half, |sum, harmonic| sum + harmonic.power()));
                state.progress.judge(mean_squares, state.block.variance);
                return;
            }
        }
        if let Some((error, unit)) = measured {
            block.samples = block.samples + T::from_f64(1.0);
            block.sum_of_squares = block.sum_of_squares + error * error;
            state.error = error;
            state.unit = unit;
        }
        if state.progress.is_excessive(&state.block) {
            state.progress.judge([state.block.sum_of_squares / state.block.samples, state.progress.noise], T::ZERO);
            let verdict = state.progress.verdict;
            state.harmonics.iter_mut().for_each(|harmonic| harmonic.retreat(verdict));
            state.begin_block();
        }
    }
}

impl<T: Real, const PAST: usize> LearningState<T, PAST> {
    /// Takes a `sample` that has arrived, before [`advance`](Learning::advance) of the same tick. One that is too old is ignored.
    #[inline]
    pub fn observe(&mut self, sample: SensorSample<T>) {
        let SensorSample { displacement_m, age_ticks } = sample;
        // What is remembered will be overwritten before the next round is over: a sample must be younger by that.
        if age_ticks < PAST.saturating_sub(HARMONICS + 2) {
            let place = self.newest + age_ticks;
            self.arrived = Some((displacement_m, if place >= PAST { place - PAST } else { place }));
        }
    }

    /// Ignores the sample that has arrived last.
    pub(crate) fn drop_sample(&mut self) {
        self.arrived = None;
    }

    /// The correction that is added to the reference now, m.
    #[must_use]
    pub fn added(&self) -> T {
        self.lagged[1]
    }

    /// The period that is learned, ticks; `None` without one.
    #[must_use]
    pub fn period_ticks(&self) -> Option<T> {
        (self.angle > T::ZERO).then(|| T::from_f64(TAU) / self.angle)
    }

    /// The share of the sensor's correction that learning has taken over from an observer, 0 to 1: it grows with every block that ends.
    #[must_use]
    pub fn taken_over(&self) -> T {
        self.progress.taken_over
    }

    /// Resets the learned correction, which fades out with the two lags.
    pub fn forget(&mut self) {
        self.harmonics = [Harmonic::new(); HARMONICS + 1];
        self.block = Block::first();
        self.progress = Progress::none();
        self.index = 0;
    }

    /// Turns by `angle` (rad) in every tick from now on.
    fn set_angle(&mut self, angle: T) {
        (self.angle, self.rotation) = rotation_by(angle);
    }

    #[inline]
    fn advance_phase(&mut self) {
        let ([cos, sin], [c, s]) = (self.phase, self.rotation);
        self.phase = [cos * c - sin * s, cos * s + sin * c];
    }

    /// Keeps the phase on the circle: a step of Newton's method.
    fn renormalise(&mut self) {
        let [cos, sin] = self.phase;
        let keep = T::from_f64(1.5) - T::from_f64(0.5) * (cos * cos + sin * sin);
        self.phase = [cos * keep, sin * keep];
    }

    /// Fades out without a period, and in again.
    fn update_fade(&mut self) {
        let on = if self.angle > T::ZERO { T::from_f64(1.0) } else { T::ZERO };
        self.fade = self.fade + T::from_f64(FADE_WEIGHT) * (on - self.fade);
    }

    /// Remembers reference and phase of the end of this tick.
    #[inline]
    fn remember(&mut self, reference: T) {
        self.newest = if self.newest == 0 { PAST.saturating_sub(1) } else { self.newest - 1 };
        if let Some(slot) = self.past.get_mut(self.newest) {
            *slot = [reference, self.phase[0], self.phase[1]];
        }
    }

    /// Error (m) and phase of the sample that has arrived since this was called before; none if it is not finite.
    #[inline]
    fn take_error(&mut self) -> Option<(T, Pair<T>)> {
        let (displacement, place) = self.arrived.take()?;
        let &[reference, cos, sin] = self.past.get(place)?;
        let error = displacement - reference;
        is_finite(error).then_some((error, [cos, sin]))
    }

    fn begin_block(&mut self) {
        self.block =
            Block { ticks_since_end: self.block.ticks_since_end, is_short: self.block.is_short, ..Block::first() };
        self.harmonics.iter_mut().for_each(Harmonic::begin);
    }

    /// The correction (m), faded and smoothed.
    #[inline]
    fn smooth(&mut self) -> T {
        let smoothing = T::from_f64(SMOOTHING);
        let [first, second] = self.lagged;
        let first = first + smoothing * (self.fade * self.sum() - first);
        let second = second + smoothing * (first - second);
        self.lagged = [first, second];
        second
    }

    /// The mean and the harmonics at the present phase, m: Clenshaw's recurrence.
    #[inline]
    fn sum(&self) -> T {
        let [cos, sin] = self.phase;
        let twice = cos + cos;
        let [mean, harmonics @ ..] = &self.harmonics;
        let (mut one, mut two) = ([T::ZERO; 2], [T::ZERO; 2]);
        for harmonic in harmonics.iter().rev() {
            let [re, im] = harmonic.added;
            (one, two) = ([re + twice * one[0] - two[0], im + twice * one[1] - two[1]], one);
        }
        mean.added[0] + (one[0] * cos - two[0]) - one[1] * sin
    }
}

/// `angle` (rad) within its bound, and exp(i) of it.
fn rotation_by<T: Real>(angle: T) -> (T, Pair<T>) {
    let largest = T::from_f64(MAX_ANGLE);
    let angle = if angle < largest { angle } else { largest };
    let square = angle * angle;
    let [one, a2, a4, a6] = COSINE.map(T::from_f64);
    let [_, b2, b4, b6] = SINE.map(T::from_f64);
    let cos = one + square * (a2 + square * (a4 + square * a6));
    let sin = angle * (one + square * (b2 + square * (b4 + square * b6)));
    (angle, [cos, sin])
}
