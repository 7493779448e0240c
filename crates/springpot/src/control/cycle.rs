//! The period of a reference, found from its own crossings.

use crate::numbers::Numbers;
use crate::scalar::Real;

/// Share of the last swing by which a reference must turn back before its extreme counts as a turning point.
const HYSTERESIS: f64 = 0.1;
/// Time constant with which a swing decays, s: smaller swings are found again after that.
const FORGETTING_S: f64 = 20.0;
/// Largest relative difference of two intervals of the same period.
const AGREEMENT: f64 = 0.02;
/// Periods without a crossing after which a reference counts as no longer periodic.
const MISSED: f64 = 1.5;

/// Settings of [`Cycle`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CycleFinder<T> {
    /// Smallest swing of a periodic reference, m.
    least: T,
    /// Share by which a swing decays in a tick.
    forgetting: T,
}

/// Turning points and crossings of a reference.
///
/// A period is the time from one crossing of the middle between the last two turning points, upwards, to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cycle<T> {
    /// The reference one tick ago, m.
    before: T,
    /// Whether the reference has risen since its last turning point.
    rises: bool,
    /// Its extreme since then, m.
    extreme: T,
    /// The last turning points, m.
    upper: T,
    lower: T,
    /// Distance of the last turning points, m; decays slowly.
    swing: T,
    /// Whether the next crossing upwards counts: one for each lower turning point.
    armed: bool,
    /// Ticks since the last crossing.
    since: T,
    /// The last interval between crossings, ticks; 0 without one.
    interval: T,
    /// Whether the last two intervals agree.
    agrees: bool,
}

impl<T: Real> CycleFinder<T> {
    /// For swings of at least `least_m` (m), ticked every `step_s` (s).
    pub(crate) fn new(least_m: f64, step_s: f64) -> Self {
        Self { least: T::from_f64(least_m), forgetting: T::from_f64(step_s / (step_s + FORGETTING_S)) }
    }

    /// Visits what a period is found with.
    pub(crate) fn numbers(&self, take: &mut impl Numbers<T>) {
        take.number("least_swing", self.least, "of a reference that counts, m");
        take.number("swing_forgetting", self.forgetting, "share of a swing that is forgotten in a tick");
        take.number("hysteresis", T::from_f64(HYSTERESIS), "");
        take.number(
            "missed",
            T::from_f64(MISSED),
            "periods without a crossing after which a reference is not periodic",
        );
        take.number("agreement", T::from_f64(AGREEMENT), "");
    }

    /// Takes the next `reference` (m). Returns the ticks since a crossing upwards, 0 to 1, where there was one in this tick.
    #[inline]
    pub(crate) fn advance(&self, cycle: &mut Cycle<T>, reference: T) -> Option<T> {
        let one = T::from_f64(1.0);
        cycle.swing = cycle.swing - self.forgetting * cycle.swing;
        let hysteresis = T::from_f64(HYSTERESIS) * cycle.swing;
        let hysteresis = if hysteresis > self.least { hysteresis } else { self.least };
        let further = if cycle.rises { reference > cycle.extreme } else { reference < cycle.extreme };
        if further {
            cycle.extreme = reference;
        }
        let back = if cycle.rises { cycle.extreme - reference } else { reference - cycle.extreme };
        if back > hysteresis {
            if cycle.rises {
                cycle.upper = cycle.extreme;
            } else {
                cycle.lower = cycle.extreme;
                cycle.armed = true;
            }
            cycle.swing = cycle.upper - cycle.lower;
            cycle.rises = !cycle.rises;
            cycle.extreme = reference;
        }

        let before = cycle.before;
        cycle.before = reference;
        cycle.since = cycle.since + one;
        if cycle.since > T::from_f64(MISSED) * cycle.interval {
            cycle.agrees = false;
        }
        let middle = T::from_f64(0.5) * (cycle.upper + cycle.lower);
        if !(cycle.armed && before < middle && reference >= middle) {
            return None;
        }
        cycle.armed = false;
        let late = (reference - middle) / (reference - before);
        let interval = cycle.since - late;
        let difference = interval - cycle.interval;
        let tolerance = T::from_f64(AGREEMENT) * interval;
        cycle.agrees = difference < tolerance && -difference < tolerance;
        cycle.interval = interval;
        cycle.since = late;
        Some(late)
    }
}

impl<T: Real> Cycle<T> {
    /// The state for a reference at rest at `position` (m).
    pub(crate) fn at(position: T) -> Self {
        Self {
            before: position,
            rises: true,
            extreme: position,
            upper: position,
            lower: position,
            swing: T::ZERO,
            armed: false,
            since: T::ZERO,
            interval: T::ZERO,
            agrees: false,
        }
    }

    /// The period in ticks; `None` unless the last two intervals agree within 2 % and the next crossing is not overdue.
    pub(crate) fn period(&self) -> Option<T> {
        self.agrees.then_some(self.interval)
    }
}
