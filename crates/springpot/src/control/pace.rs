//! How fast an amplifier is, estimated from its monitor.

use crate::control::amplifier::{AmplifierLag, AmplifierModel};
use crate::control::path::clamp;
use crate::error::ControlError;
use crate::numbers::Numbers;
use crate::scalar::Real;

/// An amplifier that lags, and is faster or slower than its time constants say by a factor p, its pace: recursive least squares of one
/// number.
///
/// The sensitivity w = ∂V/∂p of the modelled voltage V obeys V's own recursion. A reading R of the monitor differs from V by
/// w (p − p_true), and
///
/// ```text
/// Λ ← λ Λ + w²,      p ← p − w (V − R) / (Λ₀ + Λ)
/// ```
///
/// A reading between the voltages of two ticks is no difference: a converter may answer with the sample of the frame before. Readings are
/// used for p alone, so that their noise does not return in commands.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PacedAmplifier<T> {
    nominal: AmplifierModel<T>,
}

/// State of a [`PacedAmplifier`]: changes with every tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pace<T> {
    /// p.
    factor: T,
    /// w, V.
    slope: T,
    /// Λ, V².
    information: T,
}

/// A reading of the monitor, and how much it weighs.
pub(crate) struct Reading<T> {
    /// V, apart from the amplifier's gain.
    pub(crate) voltage: T,
    /// 1 − λ: the weight of a tick in means over [`GAIN_S`].
    pub(crate) forgotten: T,
    /// V.
    pub(crate) max_voltage: T,
}

/// Time over which the amplifier's gain and pace are estimated, s: a few cycles of a slow reference.
pub(crate) const GAIN_S: f64 = 10.0;
/// Standard deviation of the pace from 1 before the first reading, and errors of readings as a share of the largest voltage.
const DEVIATION: f64 = 0.3;
const READING_SHARE: f64 = 0.004;
/// Bounds of the pace: those within which the driver's monitor lets an amplifier be.
const PACES: [f64; 2] = [1.0 / 1.5, 2.0];

impl<T: Real> Reading<T> {
    /// Λ₀ (V²): errors of readings last, so those of a second count as one.
    fn initial_information(&self) -> T {
        let error = T::from_f64(READING_SHARE / DEVIATION) * self.max_voltage;
        // 1 − λ is h / (GAIN_S + h), with h the duration of a tick.
        let ticks_per_s = (T::from_f64(1.0) - self.forgotten) / (T::from_f64(GAIN_S) * self.forgotten);
        error * error * ticks_per_s
    }
}

impl<T: Real> Pace<T> {
    pub(crate) fn nominal() -> Self {
        Self { factor: T::from_f64(1.0), slope: T::ZERO, information: T::ZERO }
    }
}

impl<T: Real> PacedAmplifier<T> {
    /// The amplifier of `lag`, in ticks of `step_s`; `None` without lag, which costs nothing.
    pub(crate) fn lagging(lag: AmplifierLag, step_s: f64) -> Result<Option<Self>, ControlError> {
        Ok(AmplifierModel::lagging(lag, step_s)?.map(|nominal| Self { nominal }))
    }

    /// Visits the constants of the voltage.
    pub(crate) fn numbers(&self, take: &mut impl Numbers<T>) {
        take.structure("amplifier", "An amplifier that lags.");
        take.number("up", self.nominal.up, "share of the distance to the command that it goes in a tick, upwards");
        take.number("down", self.nominal.down, "and downwards");
        take.number("left", self.nominal.left, "share of the voltage that is left after a tick at a command of 0 V");
        take.number("reading_share", T::from_f64(READING_SHARE / DEVIATION), "");
        take.number("gain_s", T::from_f64(GAIN_S), "s");
        take.array("paces", PACES.map(T::from_f64), "bounds of how much faster it may be");
    }

    /// The amplifier, as fast as its monitor has shown it to be.
    #[inline]
    fn at(&self, pace: &Pace<T>) -> AmplifierModel<T> {
        let one = T::from_f64(1.0);
        let faster = |share: T| {
            let share = pace.factor * share;
            if share < one { share } else { one }
        };
        let AmplifierModel { up, down, left } = self.nominal;
        AmplifierModel { up: faster(up), down: faster(down), left: one - faster(one - left) }
    }

    /// The command that takes `voltage` (V) to `wanted` (V) by the end of a tick, and whether it can fall that fast.
    #[inline(never)] // what does not lag pays nothing for it
    pub(crate) fn lead(&self, state: &Pace<T>, voltage: T, wanted: T) -> (T, bool) {
        let model = self.at(state);
        (model.lead(voltage, wanted), wanted >= model.lowest(voltage))
    }

    /// The voltage (V) at the end of a tick under `command` (V), from `voltage` (V) at its begin. Learns from the reading (V, at its end) how
    /// fast the amplifier is.
    #[inline(never)]
    pub(crate) fn advance(&self, state: &mut Pace<T>, voltage: T, command: T, reading: Option<Reading<T>>) -> T {
        let one = T::from_f64(1.0);
        let model = self.at(state);
        let next = model.advance(voltage, command);
        let rises = command > voltage;
        let (share, nominal) = if rises { (model.up, self.nominal.up) } else { (model.down, self.nominal.down) };
        state.slope = if !rises && next <= model.lowest(voltage) {
            model.left * state.slope - (one - self.nominal.left) * voltage
        } else if share < one {
            (one - share) * state.slope + nominal * (command - voltage)
        } else {
            // Without lag it cannot be faster.
            T::ZERO
        };
        let Some(reading) = reading else { return next };
        let (low, high) = if next > voltage { (voltage, next) } else { (next, voltage) };
        let difference = clamp(reading.voltage, low, high) - reading.voltage;
        state.information = (one - reading.forgotten) * state.information + state.slope * state.slope;
        let step = state.slope * difference / (reading.initial_information() + state.information);
        let [slowest, fastest] = PACES.map(T::from_f64);
        state.factor = clamp(state.factor - step, slowest, fastest);
        next
    }
}
