//! The check that a sensor is plausible.

use serde::{Deserialize, Serialize};

use crate::safety::PlausibilityLimits;

/// Why a sensor is implausible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SensorFault {
    /// Out of range or NaN: unplugged, saturated.
    Range,
    /// A change that the film cannot make: a drop-out, a loose contact.
    Jump,
    /// The same value for too long, or hardly moving while the model moves: frozen.
    Stuck,
}

/// Good values in a row after which a sensor counts as plausible again.
const RETURN_TICKS: u32 = 10;

/// Checks one sensor.
///
/// ```
/// use dea_driver::{Limits, Plausibility, SensorFault};
///
/// let mut sensor = Plausibility::new(Limits::bench(160e-6).sensor);
/// assert_eq!(sensor.check(1.0e-3, 1.0e-3, false), None);
/// // 0.6 mm in a tick are a jump, and stay one: the estimate has not moved.
/// assert_eq!(sensor.check(1.6e-3, 1.0e-3, false), Some(SensorFault::Jump));
/// assert_eq!(sensor.check(1.6e-3, 1.0e-3, false), Some(SensorFault::Jump));
/// assert_eq!(sensor.check(f32::NAN, 1.0e-3, false), Some(SensorFault::Range));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Plausibility {
    limits: PlausibilityLimits,
    last: Option<f32>,
    same: u32,
    /// Good values that are still missing before it counts as plausible.
    missing: u32,
    /// The last fault.
    fault: SensorFault,
}

impl Plausibility {
    /// The limits.
    #[cfg(feature = "link")]
    pub(crate) fn limits(&self) -> PlausibilityLimits {
        self.limits
    }

    /// A check without values.
    #[must_use]
    pub const fn new(limits: PlausibilityLimits) -> Self {
        Self { limits, last: None, same: 0, missing: 0, fault: SensorFault::Range }
    }

    /// Checks the `value` of this tick. `predicted` is the estimate, which this sensor may have corrected; `is_frozen`: whether
    /// the film [moves](crate::Motion) and the sensor does not. After a fault the sensor
    /// counts as plausible again once ten values in a row are in range, steady, and no further from the estimate than a plausible
    /// jump: a sensor that has slipped stays implausible.
    pub fn check(&mut self, value: f32, predicted: f32, is_frozen: bool) -> Option<SensorFault> {
        let PlausibilityLimits { jump, stuck_ticks, .. } = self.limits;
        let before = self.last.replace(value);
        let near = |other: f32| (-jump..=jump).contains(&(value - other));
        let same = before.is_some_and(|before| value.to_bits() == before.to_bits());
        self.same = if same { self.same.saturating_add(1) } else { 0 };
        // NaN is out of range.
        let fault = if !self.is_in_range(value) {
            Some(SensorFault::Range)
        } else if !before.is_none_or(near) {
            Some(SensorFault::Jump)
        } else if is_frozen || self.same >= stuck_ticks {
            Some(SensorFault::Stuck)
        } else {
            None
        };
        if let Some(fault) = fault {
            self.fault = fault;
            self.missing = RETURN_TICKS;
        } else if self.missing > 0 {
            self.missing = if near(predicted) { self.missing - 1 } else { RETURN_TICKS };
        }
        if self.missing > 0 { Some(self.fault) } else { None }
    }

    /// Whether `value` is in the range of the sensor: NaN is not.
    #[inline]
    pub(crate) fn is_in_range(&self, value: f32) -> bool {
        self.limits.low <= value && value <= self.limits.high
    }

    /// Starts again, without values.
    pub fn reset(&mut self) {
        *self = Self::new(self.limits);
    }
}
