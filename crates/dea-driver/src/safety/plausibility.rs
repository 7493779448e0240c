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

/// So many good values in a row, and a sensor that was not believed is believed again.
const RETURN_TICKS: u32 = 10;

/// Watches one sensor.
#[derive(Clone, Copy, Debug)]
pub struct Plausibility {
    limits: PlausibilityLimits,
    last: Option<f32>,
    same: u32,
    /// Good values that are still wanted before it is believed.
    doubted: u32,
    /// Why it was not believed last.
    fault: SensorFault,
}

impl Plausibility {
    /// A watch that has seen nothing yet.
    #[must_use]
    pub const fn new(limits: PlausibilityLimits) -> Self {
        Self { limits, last: None, same: 0, doubted: 0, fault: SensorFault::Range }
    }

    /// Takes in the value of this tick, where the model takes the film to be at `predicted`. A sensor that was not believed is
    /// believed again after ten values in a row that are in range, steady, and no further from the model than a plausible
    /// jump: one that has slipped stays out.
    pub fn check(&mut self, value: f32, predicted: f32) -> Option<SensorFault> {
        let PlausibilityLimits { low, high, jump, stuck_ticks } = self.limits;
        let before = self.last.replace(value);
        let near = |other: f32| (-jump..=jump).contains(&(value - other));
        let same = before.is_some_and(|before| value.to_bits() == before.to_bits());
        self.same = if same { self.same.saturating_add(1) } else { 0 };
        // A value that is not a number is in no range, and near nothing.
        let fault = if !(low <= value && value <= high) {
            Some(SensorFault::Range)
        } else if !before.is_none_or(near) {
            Some(SensorFault::Jump)
        } else if stuck_ticks > 0 && self.same >= stuck_ticks {
            Some(SensorFault::Stuck)
        } else {
            None
        };
        if let Some(fault) = fault {
            self.fault = fault;
            self.doubted = RETURN_TICKS;
        } else if self.doubted > 0 {
            self.doubted = if near(predicted) { self.doubted - 1 } else { RETURN_TICKS };
        }
        if self.doubted > 0 { Some(self.fault) } else { None }
    }

    /// Forgets what was seen: after the sensor was out of use.
    pub fn reset(&mut self) {
        *self = Self::new(self.limits);
    }
}
