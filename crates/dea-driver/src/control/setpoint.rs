//! Values that a host sets from time to time.

use crate::safety::DriverState;

/// A value that a host sets from time to time: approached in a straight line, in the time since the one before.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ramp {
    /// NaN until one is set.
    value: f32,
    increment: f32,
    target: f32,
    ticks: u16,
    since_set: u16,
}

impl Ramp {
    /// Nothing was set.
    pub(crate) const NONE: Self =
        Self { value: f32::NAN, increment: 0.0, target: f32::NAN, ticks: 0, since_set: u16::MAX };

    pub(crate) fn is_set(&self) -> bool {
        !self.target.is_nan()
    }

    /// Sets a new target, to be reached within `most` ticks.
    pub(crate) fn set(&mut self, target: f32, most: u16) {
        let ticks = self.since_set.clamp(1, most.max(1));
        self.since_set = 0;
        self.target = target;
        let from = if self.value.is_nan() { target } else { self.value };
        self.value = from;
        self.ticks = ticks;
        self.increment = (target - from) / f32::from(ticks);
    }

    /// The value of this tick; NaN if none is set.
    pub(crate) fn next(&mut self) -> f32 {
        self.since_set = self.since_set.saturating_add(1);
        if self.ticks > 1 {
            self.ticks -= 1;
            self.value += self.increment;
        } else {
            // The last step ends exactly at the target.
            self.value = self.target;
        }
        self.value
    }
}

/// Why a voltage or a reference was not set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SetpointError {
    /// NaN, or beyond the limits.
    #[error("the value is NaN or beyond the limits")]
    OutOfRange,
    /// The amplifier is disabled: a set-point would wait for the next run.
    #[error("no set-point in the state {0:?}")]
    NotLive(DriverState),
}
