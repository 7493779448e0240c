//! Voltage and displacement samples in, an estimate of the film out.

use core::f64::consts::TAU;

use crate::actuator::Load;
use crate::actuator::{Actuator, VoltageDrive};
use crate::control::inverse::{Correction, share_per_step};
use crate::control::path::{clamp, is_finite};
use crate::control::statistics::Statistics;
use crate::error::ControlError;
use crate::law::{Law, Memory, State, state_traits};
use crate::scalar::{Real, Scalar};

/// How an [`Observer`] corrects. Times in s.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ObserverOptions {
    /// Up to here the estimate follows the sensor, beyond it the model, Hz.
    pub bandwidth_hz: f64,
    /// Time from one sensor sample to the next.
    pub sample_interval_s: f64,
    /// Time from a measurement until its sample arrives; may be 0.
    pub delay_s: f64,
    /// After so long without a sample the sensor counts as lost.
    pub lost_after_s: f64,
    /// Time over which a disturbance that swings with the load becomes a change of the force scale. Infinite: by all that was
    /// ever seen; 0: never.
    pub adaptation_s: f64,
}

impl ObserverOptions {
    /// A sensor of 100 Hz whose samples come 10 ms late, and counts as lost after 50 ms; adaptation over 30 s.
    #[must_use]
    pub const fn at_bandwidth(bandwidth_hz: f64) -> Self {
        Self { bandwidth_hz, sample_interval_s: 0.01, delay_s: 0.01, lost_after_s: 0.05, adaptation_s: 30.0 }
    }
}

/// A sample of the displacement sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<T> {
    /// Measured displacement, m. One that is not finite counts as no sample.
    pub displacement: T,
    /// How many ticks ago it was measured; nought is now. Samples older than the observer remembers count as none.
    pub age_ticks: usize,
}

/// Estimates the film from the voltage and, where there are any, samples of its displacement.
///
/// The law predicts under the applied voltage. The innovation e, a sample minus what was predicted for its time, feeds a
/// force d that the model does not know, and with it the prediction meets the film:
///
/// ```text
/// x̂ = G (F + d),    d = C e    ⟹    d = Q (x / G − F),    Q = C G / (1 + C G)
/// ```
///
/// # One bandwidth
///
/// C is proportional–integral. If the film had no other dynamics than k′ + i k″ = 1 / G(iω), the law's dynamic stiffness at
/// the bandwidth ω, then K_P = k″ and K_I = ω k′ would make C = −i / G at ω: a loop C G = ω / s and so a low-pass Q of
/// first order. A further integral lets d keep a slope, which halves what is left of slow disturbances (it costs 27° of the
/// loop's 90°), and a first-order lag at 4 ω keeps noise and resonances above the bandwidth small (14°):
///
/// ```text
/// C = (k″ + ω k′ / s + ω² k′ / 2 s²) / (1 + s / 4 ω)
/// ```
///
/// Samples slower than the tick weigh by their distance. Late ones are compared with what was predicted for their time,
/// which the state remembers for `PAST` ticks.
///
/// # Without samples
///
/// When the sensor is lost the observer predicts, and the disturbance goes over into its usual value within 1 / ω. When
/// samples come again they correct as before; the lag of C keeps both changes smooth.
///
/// # Drift
///
/// Stiffness that changes with temperature or age shows as a disturbance that swings with the load. Such a share is moved
/// into [`force_scale`](ObserverState::force_scale), by least squares over the adaptation time; at the moment when it is
/// moved it changes nothing, but it stays true when the load changes.
#[derive(Clone, Debug, PartialEq)]
pub struct Observer<T, M = crate::Compressed<T>, const PAST: usize = 64> {
    law: Law<T, M>,
    drive: VoltageDrive<T>,
    /// K_P, N/m.
    proportional: T,
    /// K_I times the step, N/m.
    integral: T,
    /// Gain of the slope times the step squared, N/m.
    slope: T,
    /// Ticks that a sample weighs for at the most, and after which the sensor is lost.
    lost_after: u32,
    /// Shares per tick: of the correction that acts, of the disturbance that goes over to its usual value, of the present
    /// in what is usual, and of what adaptation forgets.
    smoothing: T,
    recovery: T,
    averaging: T,
    forgetting: T,
    /// One where the force scale adapts, or nought.
    adapting: T,
    /// Σ swing² that adaptation wants to have seen before it moves freely, N².
    least_swing: T,
    /// Largest disturbance, N, slope of it, N per tick, and innovation, m.
    most_force: T,
    most_slope: T,
    most_innovation: T,
}

/// What changes with every tick of an [`Observer`].
pub struct ObserverState<T: Scalar, M: Memory<T> = crate::Compressed<T>, const PAST: usize = 64> {
    pub(crate) film: State<T, M>,
    /// Predictions of the last ticks, `newest` first and round.
    past: [T; PAST],
    newest: usize,
    /// What the integrals hold, N, and its slope, N per tick.
    held: T,
    slope: T,
    /// K_P e, N.
    swift: T,
    /// The disturbance that acts: both together, smoothed, N.
    disturbance: T,
    force_scale: T,
    /// Slow means of `held` and of the load, N.
    usual: T,
    usual_load: T,
    /// Σ (load − usual load)² over the ticks that adaptation remembers, N².
    swing: T,
    since_sample: u32,
    innovation: T,
    statistics: Statistics<T>,
}

state_traits!(ObserverState<T, M, PAST> {
    film, past, newest, held, slope, swift, disturbance, force_scale, usual, usual_load, swing, since_sample, innovation,
    statistics,
});

/// Share of a tick that times may be off because they are not whole in binary, or come in single precision.
const ROUNDING: f64 = 1e-4;
/// One over the time in which something becomes usual, 1/s.
const AVERAGING: f64 = 1.0 / 20.0;
/// Samples that statistics remember.
const REMEMBERED: f64 = 200.0;
/// Largest ω (interval + delay): the phase that samples may lose at the bandwidth, rad.
const MOST_PHASE: f64 = 0.35;
/// The force scale stays within these.
const SCALES: [f64; 2] = [0.25, 4.0];

impl<T: Real, M: Memory<T>, const PAST: usize> Observer<T, M, PAST> {
    /// An observer of `actuator` along `law`, up to `max_voltage_v` (V).
    ///
    /// # Errors
    ///
    /// [`ControlError`] for options that make no sense, a bandwidth that the sensor is too slow for or that lies above the
    /// model's resonance, and an actuator that is refused at the largest voltage.
    pub fn new(
        law: Law<T, M>,
        actuator: &Actuator,
        max_voltage_v: f64,
        options: ObserverOptions,
    ) -> Result<Self, ControlError> {
        let drive = VoltageDrive::new(actuator, max_voltage_v, law.stiffness())?;
        let ObserverOptions { bandwidth_hz, sample_interval_s, delay_s, lost_after_s, adaptation_s } = options;
        for (quantity, value, valid) in [
            ("bandwidth_hz", bandwidth_hz, bandwidth_hz.is_finite() && bandwidth_hz > 0.0),
            ("sample_interval_s", sample_interval_s, sample_interval_s.is_finite() && sample_interval_s > 0.0),
            ("delay_s", delay_s, delay_s.is_finite() && delay_s >= 0.0),
            ("lost_after_s", lost_after_s, lost_after_s.is_finite() && lost_after_s > 0.0),
            ("adaptation_s", adaptation_s, adaptation_s >= 0.0),
        ] {
            if !valid {
                return Err(ControlError::NotPositive { quantity, value });
            }
        }
        if lost_after_s < sample_interval_s {
            return Err(ControlError::LostBetweenSamples { lost_after_s, sample_interval_s });
        }
        let largest_hz = MOST_PHASE / (TAU * (sample_interval_s + delay_s));
        if bandwidth_hz > largest_hz {
            return Err(ControlError::SensorTooSlow { bandwidth_hz, largest_hz });
        }
        let step_s = law.step_s();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let late = libm::ceil(delay_s / step_s - ROUNDING) as usize;
        if late >= PAST {
            return Err(ControlError::SensorTooLate { ticks: late, most: PAST.saturating_sub(1) });
        }
        let stiffness = law.dynamic_stiffness(bandwidth_hz);
        if !(stiffness.re > 0.0 && stiffness.im.is_finite()) {
            return Err(ControlError::AboveResonance { bandwidth_hz });
        }
        let adapts = adaptation_s > 0.0;
        let omega = TAU * bandwidth_hz;
        let share = |rate: f64| T::from_f64(share_per_step(rate, step_s));
        let largest_force = actuator.force_per_square_volt() * max_voltage_v * max_voltage_v;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let lost_after = libm::ceil(lost_after_s / step_s - ROUNDING) as u32;
        Ok(Self {
            law,
            drive,
            proportional: T::from_f64(stiffness.im.max(0.0)),
            integral: T::from_f64(omega * stiffness.re * step_s),
            slope: T::from_f64(0.5 * omega * omega * stiffness.re * step_s * step_s),
            lost_after,
            smoothing: share(4.0 * omega),
            recovery: share(omega),
            averaging: share(AVERAGING),
            forgetting: share(if adapts { 1.0 / adaptation_s } else { 0.0 }),
            adapting: T::from_f64(if adapts { 1.0 } else { 0.0 }),
            // A tenth of the largest force for a tenth of a second.
            least_swing: T::from_f64(1e-3 * largest_force * largest_force / step_s),
            most_force: T::from_f64(largest_force),
            most_slope: T::from_f64(largest_force * omega * step_s),
            most_innovation: T::from_f64(largest_force / stiffness.re),
        })
    }

    /// A state whose film is `film`, with no disturbance.
    #[must_use]
    pub fn state(&self, film: State<T, M>) -> ObserverState<T, M, PAST> {
        let position = film.position();
        ObserverState {
            film,
            past: [position; PAST],
            newest: 0,
            held: T::ZERO,
            slope: T::ZERO,
            swift: T::ZERO,
            disturbance: T::ZERO,
            force_scale: T::from_f64(1.0),
            usual: T::ZERO,
            usual_load: T::ZERO,
            swing: T::ZERO,
            since_sample: 0,
            innovation: T::ZERO,
            statistics: Statistics::new(),
        }
    }

    /// Steps the film under the `voltage` (V) that was applied since the last tick, or that a monitor read, and corrects
    /// it with a `sample`, if one has arrived. Returns the estimated displacement (m).
    #[inline]
    pub fn observe(&self, state: &mut ObserverState<T, M, PAST>, voltage: T, sample: Option<Sample<T>>) -> T {
        let load = self.drive.load(voltage);
        let electrostatic = (load.force - self.drive.preload()) * state.force_scale;
        let forced = Load {
            force: electrostatic + self.drive.preload() + state.disturbance(),
            slope: load.slope * state.force_scale,
        };
        let position = self.law.displacement_under(&mut state.film, forced);
        state.remember(position);
        self.correct(state, sample);
        self.adapt(state, electrostatic + forced.slope * position);
        position
    }

    /// Takes in a sample, if there is one, and moves the disturbance on by a tick. The same work in every tick: a sample that
    /// is missing weighs nothing.
    #[inline]
    fn correct(&self, state: &mut ObserverState<T, M, PAST>, sample: Option<Sample<T>>) {
        let since = state.since_sample.saturating_add(1);
        let found = sample.and_then(|sample| state.innovation_of(sample)).filter(|e| is_finite(*e));
        let come = found.is_some();
        let innovation = clamp(found.unwrap_or(T::ZERO), -self.most_innovation, self.most_innovation);
        // A sample stands for the time since the last one, but not for a loss.
        let ticks = if come { T::from_f64(f64::from(since.min(self.lost_after))) } else { T::ZERO };
        state.statistics.take(innovation, if come { T::from_f64(1.0 / REMEMBERED) } else { T::ZERO });
        state.since_sample = if come { 0 } else { since };
        state.innovation = if come { innovation } else { state.innovation };
        let swift = if come { self.proportional * innovation } else { state.swift };
        let slope = clamp(state.slope + self.slope * ticks * innovation, -self.most_slope, self.most_slope);
        let held = state.held + self.integral * ticks * innovation;

        let lost = state.since_sample > self.lost_after;
        let corrected = clamp(held + slope, -self.most_force, self.most_force);
        let recovered = held + self.recovery * (state.usual - held);
        let usual = state.usual + self.averaging * (corrected - state.usual);
        state.slope = if lost { T::ZERO } else { slope };
        state.swift = if lost { T::ZERO } else { swift };
        state.held = if lost { recovered } else { corrected };
        state.usual = if lost { state.usual } else { usual };
        state.disturbance = state.disturbance + self.smoothing * (state.held + state.swift - state.disturbance);
    }

    /// Moves what swings with the `load` (N) from the disturbance to the force scale.
    ///
    /// Least squares, one tick at a time: a tick's say is its swing over the sum of all swings. At first every tick says
    /// much, so that the first rise already tells a film that is stiffer than the model.
    #[inline]
    fn adapt(&self, state: &mut ObserverState<T, M, PAST>, load: T) {
        state.usual_load = state.usual_load + self.averaging * (load - state.usual_load);
        let swing = load - state.usual_load;
        state.swing = state.swing + (swing * swing - self.forgetting * state.swing);
        let [low, high] = SCALES.map(T::from_f64);
        // While the sensor is lost nothing is learned.
        let adapting = if state.since_sample > self.lost_after { T::ZERO } else { self.adapting };
        let share = adapting * (state.held - state.usual) * swing / (state.swing + self.least_swing);
        let scale = clamp(state.force_scale + share * state.force_scale, low, high);
        let growth = (scale - state.force_scale) / state.force_scale;
        state.held = state.held - growth * load;
        state.disturbance = state.disturbance - growth * load;
        state.usual = state.usual - growth * state.usual_load;
        state.force_scale = scale;
    }

    /// The law.
    #[must_use]
    pub fn law(&self) -> &Law<T, M> {
        &self.law
    }

    /// The drive.
    #[must_use]
    pub fn drive(&self) -> &VoltageDrive<T> {
        &self.drive
    }

    /// K_P (N/m) and K_I (N/(m·s)), which a plain feedback of the same bandwidth has as well.
    #[must_use]
    pub fn gains(&self) -> [f64; 2] {
        [self.proportional.to_f64(), self.integral.to_f64() / self.law.step_s()]
    }
}

impl<T: Real, M: Memory<T>, const PAST: usize> ObserverState<T, M, PAST> {
    #[inline]
    fn remember(&mut self, position: T) {
        self.newest = if self.newest == 0 { PAST.saturating_sub(1) } else { self.newest - 1 };
        if let Some(slot) = self.past.get_mut(self.newest) {
            *slot = position;
        }
    }

    /// A sample minus what was predicted for its time; none for one that is too old.
    #[inline]
    fn innovation_of(&self, sample: Sample<T>) -> Option<T> {
        if sample.age_ticks >= PAST {
            return None;
        }
        let index = self.newest + sample.age_ticks;
        let index = if index >= PAST { index - PAST } else { index };
        self.past.get(index).map(|&predicted| sample.displacement - predicted)
    }

    /// Forgets what was learned about disturbance and force scale; film, innovation and statistics stay.
    pub(crate) fn forget(&mut self) {
        self.held = T::ZERO;
        self.slope = T::ZERO;
        self.swift = T::ZERO;
        self.disturbance = T::ZERO;
        self.force_scale = T::from_f64(1.0);
        self.usual = T::ZERO;
        self.usual_load = T::ZERO;
        self.swing = T::ZERO;
    }

    /// The estimated displacement, m.
    #[must_use]
    pub fn displacement(&self) -> T {
        self.film.position()
    }

    /// The force on the film that the model does not know, N, besides the force scale.
    #[must_use]
    #[inline]
    pub fn disturbance(&self) -> T {
        self.disturbance
    }

    /// Electrostatic force in units of what the model takes it for: below 1 for a film that has become stiffer.
    #[must_use]
    pub fn force_scale(&self) -> T {
        self.force_scale
    }

    /// The last innovation, m: a sample minus its prediction.
    #[must_use]
    pub fn innovation(&self) -> T {
        self.innovation
    }

    /// Statistics of the innovation (m, m²) over the last few hundred samples.
    #[must_use]
    pub fn statistics(&self) -> Statistics<T> {
        self.statistics
    }

    /// Ticks since the last sample arrived.
    #[must_use]
    pub fn ticks_since_sample(&self) -> u32 {
        self.since_sample
    }

    /// The film.
    #[must_use]
    pub fn film(&self) -> &State<T, M> {
        &self.film
    }

    pub(crate) fn correction(&self) -> Correction<T> {
        Correction { disturbance: self.disturbance(), force_scale: self.force_scale }
    }
}
