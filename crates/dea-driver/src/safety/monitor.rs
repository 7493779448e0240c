//! The voltage monitor against the command.

use crate::safety::MonitorLimits;

/// Follows the command at the amplifier's own slew and compares the monitor with it.
///
/// ```
/// use dea_driver::{Limits, Monitor};
///
/// // 20 ticks of disagreement are allowed.
/// let mut monitor = Monitor::new(Limits::bench(160e-6).monitor, 1000.0);
/// assert!((0..1000).all(|_| monitor.agrees(3000.0, 3000.0)));
/// assert!((0..20).all(|_| monitor.agrees(3000.0, 0.0)));
/// assert!(!monitor.agrees(3000.0, 0.0));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Monitor {
    slew_v_per_tick: f32,
    band_v: f32,
    band_share: f32,
    largest_excess: u32,
    /// Where an amplifier may be that follows the command at its slew or faster, V.
    lowest_v: f32,
    highest_v: f32,
    /// The same in the tick before.
    lowest_before_v: f32,
    highest_before_v: f32,
    /// [`OUTSIDE`] more for every tick outside the band, one less for every tick inside.
    excess: u32,
}

/// Ticks inside the band that make up for one outside. A film that arcs again and again is outside more often than that.
const OUTSIDE: u32 = 16;

impl Monitor {
    /// A monitor at 0 V, checked `rate_hz` times a second.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    pub fn new(limits: MonitorLimits, rate_hz: f32) -> Self {
        Self {
            slew_v_per_tick: limits.slew_v_per_s / rate_hz,
            band_v: limits.band_v,
            band_share: limits.band_share,
            largest_excess: ((limits.settle_s * rate_hz + 0.5) as u32).saturating_mul(OUTSIDE),
            lowest_v: 0.0,
            highest_v: 0.0,
            lowest_before_v: 0.0,
            highest_before_v: 0.0,
            excess: 0,
        }
    }

    /// Starts again at 0 V, with nothing counted.
    pub fn reset(&mut self) {
        (self.lowest_v, self.highest_v, self.excess) = (0.0, 0.0, 0);
        (self.lowest_before_v, self.highest_before_v) = (0.0, 0.0);
    }

    /// Compares the command of the last tick (V) with the monitor (V); false once they have differed for longer than the settle
    /// time, in one piece or in many: sixteen ticks of agreement make up for one without. An amplifier may be faster than its
    /// slew: any voltage agrees that one of that slew or more can have, also where the command has turned back meanwhile. The
    /// reading may be new or have been sampled a tick ago, as a converter has it that answers with the sample of the frame before:
    /// so what agreed in the tick before agrees as well. NaN differs.
    #[must_use]
    pub fn agrees(&mut self, command_v: f32, monitor_v: f32) -> bool {
        let (lowest_before_v, highest_before_v) = (self.lowest_before_v, self.highest_before_v);
        (self.lowest_before_v, self.highest_before_v) = (self.lowest_v, self.highest_v);
        // The slowest from below and from above.
        let risen_v = self.lowest_v + self.slew_v_per_tick;
        let fallen_v = self.highest_v - self.slew_v_per_tick;
        self.lowest_v = if risen_v < command_v { risen_v } else { command_v };
        self.highest_v = if fallen_v > command_v { fallen_v } else { command_v };
        let lowest_v = if self.lowest_v < lowest_before_v { self.lowest_v } else { lowest_before_v };
        let highest_v = if self.highest_v > highest_before_v { self.highest_v } else { highest_before_v };
        let band = self.band_v + self.band_share * highest_v;
        let inside = lowest_v - band <= monitor_v && monitor_v <= highest_v + band;
        self.excess = if inside { self.excess.saturating_sub(1) } else { self.excess.saturating_add(OUTSIDE) };
        self.excess <= self.largest_excess
    }
}

/// `value`, no larger than `bound` in size: without the panic of [`f32::clamp`] for a NaN bound.
pub(crate) fn bounded(value: f32, bound: f32) -> f32 {
    if value > bound {
        bound
    } else if value < -bound {
        -bound
    } else {
        value
    }
}
