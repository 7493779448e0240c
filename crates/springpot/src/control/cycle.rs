//! The period of a reference, found from its own crossings.

use crate::numbers::Numbers;
use crate::scalar::Real;

/// Share of the last swing by which a reference must turn back before its extreme counts as a turning point.
const HYSTERESIS: f64 = 0.1;
/// Time constant with which a swing decays, s: smaller swings are found again after that.
const DECAY_S: f64 = 20.0;
/// Largest relative difference of two intervals of the same period.
const AGREEMENT: f64 = 0.02;
/// Periods without a crossing after which a reference counts as no longer periodic.
const OVERDUE: f64 = 1.5;

/// Settings of [`Cycle`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CycleFinder<T> {
    /// Smallest swing of a periodic reference, m.
    min_swing: T,
    /// Share by which a swing decays in a tick.
    decay: T,
}

/// Turning points and crossings of a reference.
///
/// A period is the time from one crossing of the middle between the last two turning points, upwards, to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cycle<T> {
    /// The reference one tick ago, m.
    previous: T,
    /// Whether the reference has risen since its last turning point.
    is_rising: bool,
    /// Its extreme since then, m.
    extreme: T,
    /// The last turning points, m.
    upper: T,
    lower: T,
    /// Distance of the last turning points, m; decays slowly.
    swing: T,
    /// Whether the next crossing upwards counts: one for each lower turning point.
    is_armed: bool,
    /// Ticks since the last crossing.
    ticks_since_crossing: T,
    /// The last interval between crossings, ticks; 0 without one.
    interval: T,
    /// Whether the last two intervals agree.
    is_periodic: bool,
}

impl<T: Real> CycleFinder<T> {
    /// For swings of at least `min_swing_m` (m), ticked every `step_s` (s).
    pub(crate) fn new(min_swing_m: f64, step_s: f64) -> Self {
        Self { min_swing: T::from_f64(min_swing_m), decay: T::from_f64(step_s / (step_s + DECAY_S)) }
    }

    /// Visits the constants of the search for a period.
    pub(crate) fn numbers(&self, take: &mut impl Numbers<T>) {
        take.number("min_swing", self.min_swing, "of a reference that counts, m");
        take.number("swing_decay", self.decay, "share of a swing that is lost in a tick");
        take.number("hysteresis", T::from_f64(HYSTERESIS), "");
        take.number(
            "overdue",
            T::from_f64(OVERDUE),
            "periods without a crossing after which a reference is not periodic",
        );
        take.number("agreement", T::from_f64(AGREEMENT), "");
    }

    /// Takes the next `reference` (m). Returns the ticks since a crossing upwards, 0 to 1, where there was one in this tick.
    #[inline]
    pub(crate) fn advance(&self, cycle: &mut Cycle<T>, reference: T) -> Option<T> {
        let one = T::from_f64(1.0);
        cycle.swing = cycle.swing - self.decay * cycle.swing;
        let hysteresis = T::from_f64(HYSTERESIS) * cycle.swing;
        let hysteresis = if hysteresis > self.min_swing { hysteresis } else { self.min_swing };
        let is_beyond = if cycle.is_rising { reference > cycle.extreme } else { reference < cycle.extreme };
        if is_beyond {
            cycle.extreme = reference;
        }
        let reversal = if cycle.is_rising { cycle.extreme - reference } else { reference - cycle.extreme };
        if reversal > hysteresis {
            if cycle.is_rising {
                cycle.upper = cycle.extreme;
            } else {
                cycle.lower = cycle.extreme;
                cycle.is_armed = true;
            }
            cycle.swing = cycle.upper - cycle.lower;
            cycle.is_rising = !cycle.is_rising;
            cycle.extreme = reference;
        }

        let previous = cycle.previous;
        cycle.previous = reference;
        cycle.ticks_since_crossing = cycle.ticks_since_crossing + one;
        if cycle.ticks_since_crossing > T::from_f64(OVERDUE) * cycle.interval {
            cycle.is_periodic = false;
        }
        let middle = T::from_f64(0.5) * (cycle.upper + cycle.lower);
        if !(cycle.is_armed && previous < middle && reference >= middle) {
            return None;
        }
        cycle.is_armed = false;
        let ticks_ago = (reference - middle) / (reference - previous);
        let interval = cycle.ticks_since_crossing - ticks_ago;
        let difference = interval - cycle.interval;
        let tolerance = T::from_f64(AGREEMENT) * interval;
        cycle.is_periodic = difference < tolerance && -difference < tolerance;
        cycle.interval = interval;
        cycle.ticks_since_crossing = ticks_ago;
        Some(ticks_ago)
    }
}

impl<T: Real> Cycle<T> {
    /// The state for a reference at rest at `position` (m).
    pub(crate) fn at(position: T) -> Self {
        Self {
            previous: position,
            is_rising: true,
            extreme: position,
            upper: position,
            lower: position,
            swing: T::ZERO,
            is_armed: false,
            ticks_since_crossing: T::ZERO,
            interval: T::ZERO,
            is_periodic: false,
        }
    }

    /// The period in ticks; `None` unless the last two intervals agree within 2 % and the next crossing is not overdue.
    pub(crate) fn period(&self) -> Option<T> {
        self.is_periodic.then_some(self.interval)
    }
}
