//! The observer: an estimate of the film from voltage and displacement samples.

mod numbers;
mod resonance;
mod state;

use core::f64::consts::TAU;

use crate::actuator::Load;
use crate::actuator::{Actuator, VoltageDrive};
use crate::control::inverse::{Applied, share_per_step};
use crate::control::observer_options::ObserverOptions;
use crate::control::path::{clamp, is_finite};
use crate::control::statistics::Statistics;
use crate::error::ControlError;
use crate::law::{Law, LawState, Memory, state_traits};
use crate::scalar::{Real, Scalar};

/// A sample of the displacement sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorSample<T> {
    /// Measured displacement, m. A non-finite one is ignored.
    pub displacement_m: T,
    /// How many ticks ago it was measured; 0 is now. Samples older than the observer remembers are ignored.
    pub age_ticks: usize,
}

/// Estimates the film from the voltage and samples of its displacement.
///
/// The law predicts the displacement under the applied voltage. The innovation e, a sample minus the prediction for its time, drives a
/// disturbance d, a force that the model does not explain. With it the prediction agrees with the film:
///
/// ```text
/// x̂ = G (F + d),    d = C e    ⟹    d = Q (x / G − F),    Q = C G / (1 + C G)
/// ```
///
/// # One bandwidth
///
/// C has proportional and integral action. Let k′ + i k″ = 1 / G(iω) be the law's dynamic stiffness at the bandwidth ω. With
/// K_P = k″ and K_I = ω k′, C = −i / G at ω: the loop is C G = ω / s there and Q a first-order low-pass. A double integral
/// gives d a slope, which halves the error under slow disturbances and costs 27° of the loop's 90° of phase margin. A
/// first-order lag at 4 ω attenuates noise and resonances above the bandwidth and costs 14°:
///
/// ```text
/// C = (k″ + ω k′ / s + ω² k′ / 2 s²) / (1 + s / 4 ω)
/// ```
///
/// Behind an elastic curve k′ + i k″ is the stiffness at rest, and the innovation weighs as much more as the curve is steeper where
/// the film is.
///
/// A sample that is slower than the tick weighs as many ticks as have passed since the last one. A late sample is compared
/// with the prediction for its time; the state remembers the predictions of the last `PAST` ticks.
///
/// # Without samples
///
/// When the sensor is lost the observer predicts, and the disturbance returns to its mean with the time constant 1 / ω. New
/// samples correct as before. The lag of C keeps both changes smooth.
///
/// # Drift
///
/// A stiffness that changes with temperature or age appears as a disturbance that varies with the load. Recursive least squares over the
/// adaptation time move that part into [`force_scale`](ObserverState::force_scale). The total force stays the same at that moment and
/// remains right when the load changes. Nothing is learned from a load that stays within 2 % of the largest force around its mean: it only
/// responds to the disturbance and to sensor noise.
///
/// The [crate page](crate#observer) has a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Observer<T, M = crate::Compressed<T>, const PAST: usize = 64> {
    law: Law<T, M>,
    drive: VoltageDrive<T>,
    /// The gains of the whole correction.
    gains: Gains<T>,
    /// Ticks without a sample after which the sensor is lost; also the largest weight of a sample.
    lost_after: u32,
    /// Coefficients of first-order lags, per tick: of the disturbance (corner at 4 ω), of its return to the mean without a
    /// sensor (ω), of the means, and of the forgetting in the least squares.
    smoothing: T,
    recovery: T,
    averaging: T,
    forgetting: T,
    /// Share of the slope that is forgotten with a sample, where none of it is in use.
    forgetting_slope: T,
    /// 1 where the force scale adapts, otherwise 0.
    adapting: T,
    /// Added to the excitation in the least squares, N²: bounds the first steps of the force scale.
    regularisation: T,
    /// Largest disturbance, N, slope of it, N per tick, and innovation, m.
    max_disturbance: T,
    max_slope: T,
    max_innovation: T,
}

/// State of an [`Observer`]: changes with every tick.
pub struct ObserverState<T: Scalar, M: Memory<T> = crate::Compressed<T>, const PAST: usize = 64> {
    pub(crate) film: LawState<T, M>,
    /// Predictions of the last ticks: a ring that begins at `newest`.
    past: [T; PAST],
    newest: usize,
    /// Integral action, N, and its slope from the double integral, N per tick.
    integral: T,
    slope: T,
    /// Proportional action K_P e, N.
    proportional: T,
    /// The disturbance that acts: the sum of both after the lag, N.
    disturbance: T,
    force_scale: T,
    /// Slow means of the integral action and of the load, N.
    integral_mean: T,
    load_mean: T,
    /// Σ (load − its mean)² with exponential forgetting, N².
    excitation: T,
    since_sample: u32,
    innovation: T,
    statistics: Statistics<T>,
    load: Load<T>,
    /// Share of the correction that is in use.
    share: T,
    gains: Gains<T>,
    /// 1 where the force scale adapts, otherwise 0.
    adapting: T,
}

/// Gains of the share that is in use.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Gains<T> {
    /// Gain of the proportional action, of the integral times the step, and of the double integral times its square, N/m.
    proportional: T,
    integral: T,
    slope: T,
}

state_traits!(ObserverState<T, M, PAST> {
    film, past, newest, integral, slope, proportional, disturbance, force_scale, integral_mean, load_mean, excitation,
    since_sample, innovation, statistics, load, share, gains, adapting,
});

/// Tolerance of times in ticks: they may have been rounded to single precision.
const TIME_ROUNDING: f64 = 1e-4;
/// Possible forces at the largest voltage, N: squares and sums of them stay within single precision.
const FORCES_N: core::ops::RangeInclusive<f64> = 1e-12..=1e12;
/// Rate of the slow means, 1/s.
const AVERAGING_RATE: f64 = 1.0 / 20.0;
/// Samples over which the statistics average.
const STATISTICS_SAMPLES: f64 = 200.0;
/// Share of the correction above which the force scale adapts.
const FULL_SHARE: f64 = 0.9;
/// Smallest deviation of the load from its slow mean at which the force scale adapts, in largest forces.
const EXCITED: f64 = 0.02;
/// Bounds of the force scale.
const FORCE_SCALE_RANGE: [f64; 2] = [0.25, 4.0];

impl<T: Real, M: Memory<T>> Observer<T, M> {
    /// An observer of `actuator` along `law`, up to `max_voltage_v` (V), that remembers 64 ticks.
    ///
    /// # Errors
    ///
    /// [`ControlError`] for options that are not positive, a bandwidth that is too high for the sensor or for the model's resonance, a
    /// sensor whose samples are older than the observer remembers, and an actuator that is refused at the largest voltage.
    pub fn new(
        law: Law<T, M>,
        actuator: &Actuator,
        max_voltage_v: f64,
        options: ObserverOptions,
    ) -> Result<Self, ControlError> {
        Self::with_past(law, actuator, max_voltage_v, options)
    }
}

impl<T: Real, M: Memory<T>, const PAST: usize> Observer<T, M, PAST> {
    /// As [`new`](Self::new), remembering `PAST` ticks.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn with_past(
        law: Law<T, M>,
        actuator: &Actuator,
        max_voltage_v: f64,
        options: ObserverOptions,
    ) -> Result<Self, ControlError> {
        let drive = VoltageDrive::new(actuator, max_voltage_v, law.min_stiffness())?;
        options.check()?;
        let ObserverOptions { bandwidth_hz, delay_s, lost_after_s, adaptation_s, .. } = options;
        let step_s = law.step_s();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let late = libm::ceil(delay_s / step_s - TIME_ROUNDING) as usize;
        if late >= PAST {
            return Err(ControlError::SensorTooLate { ticks: late, most: PAST.saturating_sub(1) });
        }
        let stiffness = law.dynamic_stiffness(bandwidth_hz, law.tangent_at_rest());
        if !options.is_below_resonance(&law) {
            return Err(ControlError::NearResonance { bandwidth_hz });
        }
        let softest_stiffness = resonance::softest_stiffness(&law, bandwidth_hz);
        let adapts = adaptation_s > 0.0;
        let omega = TAU * bandwidth_hz;
        let share = |rate: f64| T::from_f64(share_per_step(rate, step_s));
        let largest_force = actuator.electrostatic_force(max_voltage_v);
        if !FORCES_N.contains(&largest_force) {
            return Err(ControlError::Force { force_n: largest_force });
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let lost_after = libm::ceil(lost_after_s / step_s - TIME_ROUNDING) as u32;
        Ok(Self {
            law,
            drive,
            gains: Gains {
                proportional: T::from_f64(stiffness.im.max(0.0)),
                integral: T::from_f64(omega * stiffness.re * step_s),
                slope: T::from_f64(0.5 * omega * omega * stiffness.re * step_s * step_s),
            },
            lost_after,
            smoothing: share(4.0 * omega),
            recovery: share(omega),
            averaging: share(AVERAGING_RATE),
            forgetting_slope: T::from_f64(share_per_step(omega, options.sample_interval_s.max(step_s))),
            forgetting: share(if adapts { 1.0 / adaptation_s } else { 0.0 }),
            adapting: T::from_f64(if adapts { 1.0 } else { 0.0 }),
            // As much as a swing of a tenth of the largest force over a tenth of a second.
            regularisation: T::from_f64(1e-3 * largest_force * largest_force / step_s),
            max_disturbance: T::from_f64(largest_force),
            max_slope: T::from_f64(largest_force * omega * step_s),
            max_innovation: T::from_f64(largest_force / softest_stiffness),
        })
    }

    /// A state whose film is `film`, with no disturbance.
    #[must_use]
    pub fn state(&self, film: LawState<T, M>) -> ObserverState<T, M, PAST> {
        let position = film.position();
        ObserverState {
            film,
            past: [position; PAST],
            newest: 0,
            integral: T::ZERO,
            slope: T::ZERO,
            proportional: T::ZERO,
            disturbance: T::ZERO,
            force_scale: T::from_f64(1.0),
            integral_mean: T::ZERO,
            load_mean: T::ZERO,
            excitation: T::ZERO,
            since_sample: 0,
            innovation: T::ZERO,
            statistics: Statistics::new(),
            load: self.drive.load(T::ZERO),
            share: T::from_f64(1.0),
            gains: self.gains,
            adapting: self.adapting,
        }
    }

    /// Steps the film under the voltage that was applied since the last tick, and corrects it with a `sample`, if one has arrived.
    /// Returns the estimated displacement (m).
    ///
    /// An observer has no model of the amplifier: the voltage on the film is a finite reading of the monitor, otherwise the command, and
    /// the last one if neither is finite.
    #[inline]
    pub fn observe(
        &self,
        state: &mut ObserverState<T, M, PAST>,
        applied: Applied<T>,
        sample: Option<SensorSample<T>>,
    ) -> T {
        let voltage = applied.reading_v.filter(|reading| is_finite(*reading)).unwrap_or(applied.commanded_v);
        let load = if is_finite(voltage) { self.drive.load(voltage) } else { state.load };
        self.step(state, load, sample)
    }

    /// Steps the film under `load`, the model's for the voltage on it, and corrects it with a `sample`, if one has arrived.
    // Not inlined: within a larger state, as a controller's, most of its fields would be beyond the reach of a load's offset.
    #[inline(never)]
    pub(crate) fn step(
        &self,
        state: &mut ObserverState<T, M, PAST>,
        load: Load<T>,
        sample: Option<SensorSample<T>>,
    ) -> T {
        state.load = load;
        let electrostatic = (load.force_n - self.drive.preload()) * state.force_scale;
        let forced = Load {
            force_n: electrostatic + self.drive.preload() + state.disturbance(),
            slope_n_per_m: load.slope_n_per_m * state.force_scale,
        };
        let position = self.law.displacement_under(&mut state.film, forced);
        state.remember(position);
        self.correct(state, sample);
        self.adapt(state, electrostatic + forced.slope_n_per_m * position);
        position
    }

    /// Reads a sample, if there is one, and moves the disturbance on by a tick.
    #[inline]
    fn correct(&self, state: &mut ObserverState<T, M, PAST>, sample: Option<SensorSample<T>>) {
        state.since_sample = state.since_sample.saturating_add(1);
        if let Some(innovation) = sample.and_then(|sample| state.innovation_of(sample)).filter(|e| is_finite(*e)) {
            self.take(state, innovation);
        }
        let lost = state.since_sample > self.lost_after;
        let corrected = clamp(state.integral + state.slope, -self.max_disturbance, self.max_disturbance);
        let recovered = state.integral + self.recovery * (state.integral_mean - state.integral);
        let mean = state.integral_mean + self.averaging * (corrected - state.integral_mean);
        state.slope = if lost { T::ZERO } else { state.slope };
        state.proportional = if lost { T::ZERO } else { state.proportional };
        state.integral = if lost { recovered } else { corrected };
        state.integral_mean = if lost { state.integral_mean } else { mean };
        let disturbance = state.integral + state.proportional;
        state.disturbance = state.disturbance + self.smoothing * (disturbance - state.disturbance);
    }

    /// Corrects with an `innovation` (m).
    #[inline]
    fn take(&self, state: &mut ObserverState<T, M, PAST>, innovation: T) {
        let innovation = clamp(innovation, -self.max_innovation, self.max_innovation);
        // A sample weighs as much as the time since the last one, but no more after a loss.
        let ticks = T::from_f64(f64::from(state.since_sample.min(self.lost_after)));
        state.since_sample = 0;
        state.innovation = innovation;
        state.statistics.update(innovation, T::from_f64(1.0 / STATISTICS_SAMPLES));
        // A film behind a curve is as much stiffer here as the curve is steeper: so are the gains.
        let scaled = state.film.slope() * innovation;
        let Gains { proportional, integral, slope } = state.gains;
        state.proportional = proportional * scaled;
        state.slope = clamp(state.slope + slope * ticks * scaled, -self.max_slope, self.max_slope);
        state.integral = state.integral + integral * ticks * scaled;
    }

    /// Moves the part of the disturbance that varies with the `load` (N) to the force scale.
    ///
    /// Recursive least squares with one parameter: the gain is the deviation of the load over the sum of its squares. At
    /// first that sum is small and the gain large, so that the first rise already shows a film that is stiffer than the model.
    #[inline]
    fn adapt(&self, state: &mut ObserverState<T, M, PAST>, load: T) {
        state.load_mean = state.load_mean + self.averaging * (load - state.load_mean);
        let deviation = load - state.load_mean;
        state.excitation = state.excitation + (deviation * deviation - self.forgetting * state.excitation);
        let [low, high] = FORCE_SCALE_RANGE.map(T::from_f64);
        // Nothing is learned without the sensor, and of a load that stays: its noise is the answer to that of the sensor.
        let learns =
            (state.since_sample <= self.lost_after) & (deviation.abs() > T::from_f64(EXCITED) * self.max_disturbance);
        let adapting = if learns { state.adapting } else { T::ZERO };
        let unexplained = state.integral - state.integral_mean;
        let change = adapting * unexplained * deviation / (state.excitation + self.regularisation);
        let scale = clamp(state.force_scale + change * state.force_scale, low, high);
        let growth = (scale - state.force_scale) / state.force_scale;
        state.integral = state.integral - growth * load;
        state.disturbance = state.disturbance - growth * load;
        state.integral_mean = state.integral_mean - growth * state.load_mean;
        state.force_scale = scale;
    }

    /// From now on this `share` of the correction is in use: the loop's bandwidth becomes as much lower. Called with every sample.
    #[inline]
    pub(crate) fn set_share(&self, state: &mut ObserverState<T, M, PAST>, share: T) {
        state.share = share;
        let Gains { proportional, integral, slope } = self.gains;
        let square = share * share;
        state.gains = Gains { proportional: square * proportional, integral: share * integral, slope: square * slope };
        // From a disturbance whose phase is lost the force scale learns nothing.
        state.adapting = if share > T::from_f64(FULL_SHARE) { self.adapting } else { T::ZERO };
        // The slope belongs to the whole correction: with less of it, it is forgotten.
        state.slope = state.slope - self.forgetting_slope * (T::from_f64(1.0) - share) * state.slope;
    }

    /// Returns the law of the film.
    #[must_use]
    pub fn law(&self) -> &Law<T, M> {
        &self.law
    }

    /// Returns the drive: force from voltage.
    #[must_use]
    pub fn drive(&self) -> &VoltageDrive<T> {
        &self.drive
    }

    /// K_P (N/m) and K_I (N/(m·s)): also the gains of a plain PI feedback with this bandwidth.
    #[must_use]
    pub fn gains(&self) -> [f64; 2] {
        [self.gains.proportional.to_f64(), self.gains.integral.to_f64() / self.law.step_s()]
    }
}
