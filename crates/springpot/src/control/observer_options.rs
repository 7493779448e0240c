//! Options of an observer, and the bandwidth that its sensor allows.

use core::f64::consts::TAU;

use crate::error::{ControlError, first_not_positive};

/// Largest ω (interval + delay): phase lag of the samples at the bandwidth, rad.
const MAX_PHASE: f64 = 0.35;

/// Smallest bandwidth, Hz: in single precision the weights of a sample are far from 0.
const MIN_BANDWIDTH_HZ: f64 = 1e-9;

/// How an [`Observer`](crate::Observer) corrects. Times in s.
///
/// ```
/// use springpot::{Actuator, ControlError, Law, Observer, ObserverOptions, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let model = Preset::TABLE3_N2.model()?;
/// let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
/// // A camera of 50 Hz, 15 ms late.
/// let camera = ObserverOptions { sample_interval_s: 0.02, delay_s: 0.015, ..ObserverOptions::at_bandwidth(0.5) };
/// let observer = Observer::new(law.clone(), &Actuator::KARNER_2022, 6000.0, camera)?;
///
/// // The camera is too slow for this bandwidth.
/// let fast = ObserverOptions { bandwidth_hz: 2.0, ..camera };
/// let refused = Observer::new(law, &Actuator::KARNER_2022, 6000.0, fast).err();
/// assert!(matches!(refused, Some(ControlError::SensorTooSlow { .. })));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ObserverOptions {
    /// Bandwidth of the correction, Hz: below it the estimate follows the sensor, above it the model.
    pub bandwidth_hz: f64,
    /// Time from one sensor sample to the next, s.
    pub sample_interval_s: f64,
    /// Time from a measurement until its sample arrives, s; may be 0.
    pub delay_s: f64,
    /// Time without a sample after which the sensor counts as lost, s.
    pub lost_after_s: f64,
    /// Time over which a disturbance that varies with the load becomes a change of the force scale, s. Infinite: nothing is forgotten; 0:
    /// the force scale stays 1.
    pub adaptation_s: f64,
}

impl ObserverOptions {
    /// A sensor of 100 Hz whose samples come 10 ms late, and counts as lost after 50 ms; adaptation over 30 s.
    #[must_use]
    pub const fn at_bandwidth(bandwidth_hz: f64) -> Self {
        Self { bandwidth_hz, sample_interval_s: 0.01, delay_s: 0.01, lost_after_s: 0.05, adaptation_s: 30.0 }
    }

    /// The largest bandwidth that a sensor of this interval and delay allows, Hz.
    #[must_use]
    pub fn max_bandwidth_hz(&self) -> f64 {
        MAX_PHASE / (TAU * (self.sample_interval_s + self.delay_s))
    }

    pub(super) fn check(&self) -> Result<(), ControlError> {
        let Self { bandwidth_hz, sample_interval_s, delay_s, lost_after_s, adaptation_s } = *self;
        let values =
            [("bandwidth_hz", bandwidth_hz), ("sample_interval_s", sample_interval_s), ("lost_after_s", lost_after_s)];
        if let Some((quantity, value)) = first_not_positive(&values) {
            return Err(ControlError::NotPositive { quantity, value });
        }
        if bandwidth_hz < MIN_BANDWIDTH_HZ {
            return Err(ControlError::BandwidthTooLow { bandwidth_hz });
        }
        if !(delay_s.is_finite() && delay_s >= 0.0) {
            return Err(ControlError::NotPositive { quantity: "delay_s", value: delay_s });
        }
        // Infinite: nothing is forgotten.
        if adaptation_s.is_nan() || adaptation_s < 0.0 {
            return Err(ControlError::NotPositive { quantity: "adaptation_s", value: adaptation_s });
        }
        if lost_after_s < sample_interval_s {
            return Err(ControlError::LostBetweenSamples { lost_after_s, sample_interval_s });
        }
        let largest_hz = self.max_bandwidth_hz();
        if bandwidth_hz > largest_hz {
            return Err(ControlError::SensorTooSlow { bandwidth_hz, largest_hz });
        }
        Ok(())
    }
}
