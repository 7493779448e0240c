//! The voltage monitor against the command.

use crate::safety::MonitorLimits;

/// Follows the command at the amplifier's own slew and compares the monitor with it.
#[derive(Clone, Copy, Debug)]
pub struct Monitor {
    slew_v_per_tick: f32,
    band_v: f32,
    band_share: f32,
    settle_ticks: u32,
    expected_v: f32,
    outside_ticks: u32,
}

impl Monitor {
    /// A monitor at 0 V, checked `rate_hz` times a second.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    pub fn new(limits: MonitorLimits, rate_hz: f32) -> Self {
        Self {
            slew_v_per_tick: limits.slew_v_per_s / rate_hz,
            band_v: limits.band_v,
            band_share: limits.band_share,
            settle_ticks: (limits.settle_s * rate_hz + 0.5) as u32,
            expected_v: 0.0,
            outside_ticks: 0,
        }
    }

    /// Compares the command of the last tick (V) with the monitor (V); false once they have differed for longer than the settle
    /// time. An amplifier may be faster than its slew: any voltage between the one at that slew and the command agrees. NaN
    /// differs.
    #[must_use]
    pub fn agrees(&mut self, command_v: f32, monitor_v: f32) -> bool {
        let ahead = command_v - self.expected_v;
        self.expected_v += bounded(ahead, self.slew_v_per_tick);
        let (low, high) = if ahead < 0.0 { (command_v, self.expected_v) } else { (self.expected_v, command_v) };
        let band = self.band_v + self.band_share * high;
        let inside = low - band <= monitor_v && monitor_v <= high + band;
        self.outside_ticks = if inside { 0 } else { self.outside_ticks.saturating_add(1) };
        self.outside_ticks <= self.settle_ticks
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
