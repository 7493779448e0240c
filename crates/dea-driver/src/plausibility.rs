//! Whether a sensor can be believed.

use serde::{Deserialize, Serialize};

/// What a sensor may read.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PlausibilityLimits {
    /// Lowest plausible value, in the sensor's unit.
    pub low: f32,
    /// Highest plausible value.
    pub high: f32,
    /// Largest plausible change from one tick to the next.
    pub jump: f32,
    /// So many ticks may show the very same value: a living sensor has noise. 0 for a sensor that may stand still.
    pub stuck_ticks: u32,
}

/// Why a sensor is not believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SensorFault {
    /// Beyond its range, or not a number: unplugged, saturated.
    Range,
    /// A change that the film cannot make: a drop-out, a loose contact.
    Jump,
    /// The same value for too long: frozen.
    Stuck,
}

impl PlausibilityLimits {
    /// Whether they can be kept at all.
    #[must_use]
    pub fn are_valid(&self) -> bool {
        self.low.is_finite() && self.high.is_finite() && self.low < self.high && self.jump > 0.0 && !self.jump.is_nan()
    }
}

/// Watches one sensor.
#[derive(Clone, Copy, Debug)]
pub struct Plausibility {
    limits: PlausibilityLimits,
    last: Option<f32>,
    same: u32,
}

impl Plausibility {
    /// A watch that has seen nothing yet.
    #[must_use]
    pub const fn new(limits: PlausibilityLimits) -> Self {
        Self { limits, last: None, same: 0 }
    }

    /// Takes in the value of this tick.
    pub fn check(&mut self, value: f32) -> Option<SensorFault> {
        let PlausibilityLimits { low, high, jump, stuck_ticks } = self.limits;
        let before = self.last.replace(value);
        // A value that is not a number is in no range.
        if !(low <= value && value <= high) {
            return Some(SensorFault::Range);
        }
        let before = before?;
        let change = value - before;
        let same = value.to_bits() == before.to_bits();
        self.same = if same { self.same.saturating_add(1) } else { 0 };
        if change > jump || change < -jump {
            Some(SensorFault::Jump)
        } else if stuck_ticks > 0 && self.same >= stuck_ticks {
            Some(SensorFault::Stuck)
        } else {
            None
        }
    }

    /// Forgets what was seen: after the sensor was out of use.
    pub fn reset(&mut self) {
        self.last = None;
        self.same = 0;
    }
}
