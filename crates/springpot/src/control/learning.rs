//! Learning of periodic references: what is left of the error in every cycle is added to the reference.

use core::f64::consts::TAU;

use crate::actuator::Actuator;
use crate::control::cycle::{Cycle, CycleFinder};
use crate::control::observer::SensorSample;
use crate::control::path::is_finite;
use crate::error::ControlError;
use crate::law::{Law, Memory};
use crate::scalar::Real;

/// Harmonics that are learned, beside the mean.
pub const HARMONICS: usize = 6;

/// How a [`Learning`] learns.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct LearningOptions {
    /// Period of the reference, s. `None`: taken from the reference, which takes three of its cycles.
    pub period_s: Option<f64>,
    /// Largest rate at which a harmonic approaches its value, 1/s. It is bounded to a tenth of the model's resonance as well.
    pub rate_per_s: f64,
    /// Time from one sample of the sensor to the next, s.
    pub sample_interval_s: f64,
}

impl LearningOptions {
    /// A period that is taken from the reference, 1/s, and a sensor of 100 Hz.
    pub const BENCH: Self = Self { period_s: None, rate_per_s: 1.0, sample_interval_s: 0.01 };

    fn check(&self) -> Result<(), ControlError> {
        let values = [
            ("period_s", self.period_s.unwrap_or(1.0)),
            ("rate_per_s", self.rate_per_s),
            ("sample_interval_s", self.sample_interval_s),
        ];
        let wrong = crate::error::first_not_positive(&values);
        wrong.map_or(Ok(()), |(quantity, value)| Err(ControlError::NotPositive { quantity, value }))
    }
}

/// Learns the harmonics of a periodic reference that the film does not follow, and adds them to the reference.
///
/// With θ the phase of the reference's cycle, e a sample minus the reference of its time t, and T the time since the sample
/// before (adaptive feedforward cancellation: M. Bodson, A. Sacks, P. Khosla, "Harmonic generation in adaptive feedforward
/// cancellation schemes", IEEE Trans. Automatic Control 39 (1994) 1939):
///
/// ```text
/// r + a₀ + Σ a_h cos hθ + b_h sin hθ,      a_h ← a_h − μ_h T e cos hθ(t),   b_h ← b_h − μ_h T e sin hθ(t)
/// ```
///
/// The inverse of the law stands behind it, so what it acts on is nearly 1, and a sample that comes late costs nothing: e belongs to
/// its own time.
///
/// # What is learned
///
/// Near its resonance a film behind its model's inverse is far from 1 and its phase turns. μ_h therefore falls with the square of the
/// frequency, to 0 at three quarters of the model's resonance: 0.7 of it is a film 30 % softer. It is 0 beyond 0.15 of the sensor's rate as
/// well, where a delay that is wrong by a sample turns the phase by 54°. A harmonic whose μ is 0 keeps its value.
///
/// The errors of the cycles are watched: where they have grown four times in a row, to more than they were before anything was
/// learned, what was learned is faded out, and learning begins again at a quarter of its rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learning<T, const PAST: usize = 64> {
    finder: CycleFinder<T>,
    /// The period that was given, ticks; 0 where it is taken from the reference.
    period: T,
    /// Largest share of an error that is learned in a tick.
    rate: T,
    /// The largest angle in a tick that is learned, to the power −2.
    bound: T,
}

/// What changes with every tick of a [`Learning`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningState<T, const PAST: usize = 64> {
    cycle: Cycle<T>,
    /// cos θ and sin θ at the end of this tick, and of the angle of a tick.
    phase: [T; 2],
    turn: [T; 2],
    /// Angle of a tick, rad; 0 without a period.
    angle: T,
    /// Share of what was learned that is added: fades out where the period is lost.
    share: T,
    mean: T,
    harmonics: [[T; 2]; HARMONICS],
    /// References of the last ticks with the phase of each: a ring that begins at `newest`.
    past: [[T; 3]; PAST],
    newest: usize,
    /// The sample that is being learned from, harmonic by harmonic: `slot` is the next.
    slot: usize,
    /// Error times its weight, m.
    error: T,
    /// Phase of the sample, and its multiple for the next harmonic.
    then: [T; 2],
    multiple: [T; 2],
    since_sample: T,
    /// Ticks since a limit was met.
    free: usize,
    watch: Watch<T>,
}

/// Mean squares of the errors of the cycles.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Watch<T> {
    /// Of this cycle.
    sum: T,
    samples: T,
    /// Of the cycle before, and of the first; 0 before there was one.
    before: T,
    first: T,
    /// Cycles in a row that were worse than the one before.
    grown: u8,
    /// Share of the rate that is left.
    trust: T,
    /// Whether what was learned is faded out.
    failed: bool,
}

/// Share of the model's resonance below which harmonics are learned.
const BELOW_RESONANCE: f64 = 0.75;
/// Share of the sensor's rate below which they are.
const BELOW_SAMPLES: f64 = 0.15;
/// Largest rate in resonances.
const RATE_OF_RESONANCE: f64 = 0.1;
/// Share of the static stroke at the largest voltage that counts as a swing.
const LEAST_SWING: f64 = 1e-3;
/// Largest angle of a tick, rad: the series for its cosine and sine hold it to single precision.
const LARGEST_ANGLE: f64 = 0.35;
/// Ticks without a limit before learning goes on.
const FREE_TICKS: usize = 64;
const GROWN_CYCLES: u8 = 4;

impl<T: Real, const PAST: usize> Learning<T, PAST> {
    /// Learning in front of the inverse of `law` for `actuator`, up to `max_voltage_v` (V).
    ///
    /// # Errors
    ///
    /// [`ControlError::NotPositive`] for options that are not finite and positive.
    pub fn new<M: Memory<T>>(
        law: &Law<T, M>,
        actuator: &Actuator,
        max_voltage_v: f64,
        options: LearningOptions,
    ) -> Result<Self, ControlError> {
        options.check()?;
        let LearningOptions { period_s, rate_per_s, sample_interval_s } = options;
        let step_s = law.step_s();
        let fastest_hz = (BELOW_SAMPLES / sample_interval_s).min(LARGEST_ANGLE / (TAU * step_s));
        let resonance_hz = resonance_hz(law, fastest_hz / BELOW_RESONANCE);
        let bound = TAU * step_s * fastest_hz.min(BELOW_RESONANCE * resonance_hz);
        let rate = rate_per_s.min(RATE_OF_RESONANCE * resonance_hz) * step_s;
        let stroke = actuator.electrostatic_force(max_voltage_v) / law.dynamic_stiffness(1.0, 1.0).re.abs();
        Ok(Self {
            finder: CycleFinder::new(LEAST_SWING * stroke, step_s),
            period: T::from_f64(period_s.map_or(0.0, |period_s| period_s / step_s)),
            rate: T::from_f64(rate),
            bound: T::from_f64(1.0 / (bound * bound)),
        })
    }

    /// Nothing learned yet, of a reference that begins at `position` (m).
    #[must_use]
    pub fn state(&self, position: T) -> LearningState<T, PAST> {
        let (zero, one) = (T::ZERO, T::from_f64(1.0));
        let given = self.period > zero;
        let mut state = LearningState {
            cycle: Cycle::at(position),
            phase: [one, zero],
            turn: [one, zero],
            angle: zero,
            share: if given { one } else { zero },
            mean: zero,
            harmonics: [[zero; 2]; HARMONICS],
            past: [[position, one, zero]; PAST],
            newest: 0,
            slot: HARMONICS + 1,
            error: zero,
            then: [one, zero],
            multiple: [one, zero],
            since_sample: zero,
            free: 0,
            watch: Watch::new(),
        };
        if given {
            state.turn_by(T::from_f64(TAU) / self.period);
        }
        state
    }

    /// The reference to follow at the end of this tick (m) instead of `reference` (m), from a `sample` if one has arrived.
    /// `is_free`: no limit was met in the tick before; nothing is learned at limits.
    #[inline(never)]
    pub fn advance(
        &self,
        state: &mut LearningState<T, PAST>,
        reference: T,
        sample: Option<SensorSample<T>>,
        is_free: bool,
    ) -> T {
        state.free = if is_free { state.free.saturating_add(1) } else { 0 };
        let below = state.phase[1] < T::ZERO;
        state.rotate();
        self.follow_period(state, reference);
        if below && state.phase[1] >= T::ZERO && state.phase[0] > T::ZERO {
            state.watch.end_cycle();
        }
        state.remember(reference);
        self.listen(state, sample);
        self.learn(state);
        state.fade();
        reference + state.share * state.sum()
    }

    /// Takes the period from the reference, where it was not given.
    #[inline]
    fn follow_period(&self, state: &mut LearningState<T, PAST>, reference: T) {
        let crossed = self.finder.advance(&mut state.cycle, reference);
        if self.period > T::ZERO {
            return;
        }
        let Some(period) = state.cycle.period() else {
            state.angle = T::ZERO;
            return;
        };
        let Some(late) = crossed else { return };
        let turn = T::from_f64(TAU) / period;
        let [cos, sin] = state.phase;
        // The crossing is where the phase is 0: `late` ticks ago.
        let behind = sin - turn * late * cos;
        let near = cos > T::ZERO && behind < T::from_f64(0.3) && -behind < T::from_f64(0.3);
        if near && state.angle > T::ZERO {
            // The next cycle makes up for what is left.
            state.turn_by(turn - turn * behind / T::from_f64(TAU));
        } else if state.share > T::from_f64(0.01) {
            // Another period: what was learned is faded out first.
            state.angle = T::ZERO;
        } else {
            state.phase = [T::from_f64(1.0), turn * late];
            state.turn_by(turn);
            state.watch.restart();
        }
    }

    /// Takes a sample, unless the one before is still being learned from.
    #[inline]
    fn listen(&self, state: &mut LearningState<T, PAST>, sample: Option<SensorSample<T>>) {
        state.since_sample = state.since_sample + T::from_f64(1.0);
        if state.slot <= HARMONICS || state.angle <= T::ZERO {
            return;
        }
        let Some(sample) = sample.filter(|sample| is_finite(sample.displacement)) else { return };
        let Some([reference, cos, sin]) = state.of_time(sample.age_ticks + 1) else { return };
        let error = sample.displacement - reference;
        state.watch.add(error);
        // After a loss a sample weighs no more than one of 20 Hz at 1 kHz.
        let longest = T::from_f64(50.0);
        let ticks = if state.since_sample < longest { state.since_sample } else { longest };
        state.since_sample = T::ZERO;
        let weight = if state.free > FREE_TICKS && !state.watch.failed { self.rate * ticks * state.watch.trust } else { T::ZERO };
        state.error = weight * error;
        state.then = [cos, sin];
        state.multiple = [T::from_f64(1.0), T::ZERO];
        state.slot = 0;
    }

    /// Learns one harmonic of the sample.
    #[inline]
    fn learn(&self, state: &mut LearningState<T, PAST>) {
        let slot = state.slot;
        if slot > HARMONICS {
            return;
        }
        let [cos, sin] = state.multiple;
        if let Some([a, b]) = slot.checked_sub(1).and_then(|slot| state.harmonics.get_mut(slot)) {
            #[allow(clippy::cast_precision_loss)] // at most 6
            let angle = state.angle * T::from_f64(slot as f64);
            let share = T::from_f64(1.0) - angle * angle * self.bound;
            let error = if share > T::ZERO { share * state.error } else { T::ZERO };
            let error = error + error;
            *a = *a - error * cos;
            *b = *b - error * sin;
        } else {
            state.mean = state.mean - T::from_f64(0.5) * state.error;
        }
        let [c, s] = state.then;
        state.multiple = [cos * c - sin * s, cos * s + sin * c];
        state.slot = slot + 1;
    }
}

impl<T: Real, const PAST: usize> LearningState<T, PAST> {
    /// What is added to the reference now, m.
    #[must_use]
    pub fn learned(&self) -> T {
        self.share * self.sum()
    }

    /// The period that is learned, ticks; `None` where there is none.
    #[must_use]
    pub fn period_ticks(&self) -> Option<T> {
        (self.angle > T::ZERO).then(|| T::from_f64(TAU) / self.angle)
    }

    /// Forgets what was learned.
    pub fn forget(&mut self) {
        self.mean = T::ZERO;
        self.harmonics = [[T::ZERO; 2]; HARMONICS];
        self.watch = Watch::new();
    }

    /// Turns by `angle` (rad) in every tick from now on.
    fn turn_by(&mut self, angle: T) {
        let largest = T::from_f64(LARGEST_ANGLE);
        let angle = if angle < largest { angle } else { largest };
        let square = angle * angle;
        let series = |second: f64, fourth: f64, sixth: f64| {
            T::from_f64(1.0) + square * (T::from_f64(second) + square * (T::from_f64(fourth) + square * T::from_f64(sixth)))
        };
        self.angle = angle;
        self.turn = [
            series(-1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0),
            angle * series(-1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0),
        ];
    }

    #[inline]
    fn rotate(&mut self) {
        let ([cos, sin], [c, s]) = (self.phase, self.turn);
        let (cos, sin) = (cos * c - sin * s, cos * s + sin * c);
        // Keeps the length at 1: a step of Newton's method for the root.
        let keep = T::from_f64(1.5) - T::from_f64(0.5) * (cos * cos + sin * sin);
        self.phase = [cos * keep, sin * keep];
    }

    #[inline]
    fn remember(&mut self, reference: T) {
        self.newest = if self.newest == 0 { PAST.saturating_sub(1) } else { self.newest - 1 };
        if let Some(slot) = self.past.get_mut(self.newest) {
            *slot = [reference, self.phase[0], self.phase[1]];
        }
    }

    /// Reference, cosine and sine at the end of the tick `ago` ticks before this one.
    #[inline]
    fn of_time(&self, ago: usize) -> Option<[T; 3]> {
        if ago >= PAST {
            return None;
        }
        let index = self.newest + ago;
        self.past.get(if index >= PAST { index - PAST } else { index }).copied()
    }

    /// Fades out without a period and after a failure, and in again.
    #[inline]
    fn fade(&mut self) {
        let is_on = self.angle > T::ZERO && !self.watch.failed;
        // A time constant of 64 ticks out, 256 in.
        let change = if is_on { T::from_f64(1.0 / 256.0) * (T::from_f64(1.0) - self.share) } else { T::from_f64(-1.0 / 64.0) * self.share };
        self.share = self.share + change;
        if self.watch.failed && self.share < T::from_f64(1e-3) {
            let trust = T::from_f64(0.25) * self.watch.trust;
            self.forget();
            self.watch.trust = trust;
        }
    }

    /// The mean and the harmonics at the present phase, m: Clenshaw's recurrence.
    #[inline]
    fn sum(&self) -> T {
        let [cos, sin] = self.phase;
        let twice = cos + cos;
        let zero = [T::ZERO; 2];
        let [[a1, b1], [a2, _]] = self.harmonics.iter().rev().fold([zero, zero], |[[a1, b1], [a2, b2]], &[a, b]| {
            [[a + twice * a1 - a2, b + twice * b1 - b2], [a1, b1]]
        });
        self.mean + (a1 * cos - a2) + b1 * sin
    }
}

impl<T: Real> Watch<T> {
    fn new() -> Self {
        let zero = T::ZERO;
        Self { sum: zero, samples: zero, before: zero, first: zero, grown: 0, trust: T::from_f64(1.0), failed: false }
    }

    /// Begins again, as with another period.
    fn restart(&mut self) {
        *self = Self { trust: self.trust, ..Self::new() };
    }

    #[inline]
    fn add(&mut self, error: T) {
        self.sum = self.sum + error * error;
        self.samples = self.samples + T::from_f64(1.0);
    }

    /// Compares the cycle that ends with those before.
    fn end_cycle(&mut self) {
        if self.samples <= T::ZERO {
            return;
        }
        let square = self.sum / self.samples;
        self.sum = T::ZERO;
        self.samples = T::ZERO;
        let first = self.first <= T::ZERO;
        if first {
            self.first = square;
        }
        self.grown = if !first && square > self.before { self.grown.saturating_add(1) } else { 0 };
        self.before = square;
        if self.grown >= GROWN_CYCLES && square > self.first + self.first {
            self.failed = true;
        }
    }
}

/// The lowest frequency at which the inertia outweighs the stiffness of `law` where its film is softest, Hz; `most_hz` if it is higher.
fn resonance_hz<T: Real, M: Memory<T>>(law: &Law<T, M>, most_hz: f64) -> f64 {
    let softest = law.least_slope();
    let is_below = |frequency_hz: f64| law.dynamic_stiffness(frequency_hz, softest).re > 0.0;
    let (mut low, mut high) = (0.0, most_hz.min(0.25));
    while high < most_hz && is_below(high) {
        low = high;
        high = (2.0 * high).min(most_hz);
    }
    if is_below(high) {
        return high;
    }
    for _ in 0..6 {
        let middle = 0.5 * (low + high);
        if is_below(middle) { low = middle } else { high = middle }
    }
    low
}
