//! Every limit of film and bench, and the check that they can be kept.

use serde::{Deserialize, Serialize};
use springpot::AmplifierLag;

use crate::chips::Ceilings;

/// Smallest number of ticks in which a sensor can be watched.
pub(crate) const MIN_TICKS: u32 = 5;

/// Limits of film and bench.
///
/// ```
/// use dea_driver::{Limits, LimitsError};
///
/// // A bench like the paper's with a thinner film, at 4 kV and 2 mm at the most.
/// let limits = Limits { max_voltage_v: 4000.0, max_displacement_m: 2e-3, ..Limits::bench(100e-6) };
/// assert_eq!(limits.check(), Ok(()));
///
/// // Limits that protect nothing are refused.
/// let deaf = Limits { heartbeat_s: 1e6, ..limits };
/// assert_eq!(deaf.check(), Err(LimitsError::TooLarge { quantity: "heartbeat_s", value: 1e6, max: 10.0 }));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limits {
    /// Largest voltage, V.
    pub max_voltage_v: f32,
    /// Largest field across the film, V/m; VHB 4910 breaks down near 1e8 V/m, sooner where it is thin.
    pub max_field_v_per_m: f32,
    /// Thickness of the film at rest, m.
    pub thickness_m: f32,
    /// Largest change of the command, V/s.
    pub max_slew_v_per_s: f32,
    /// Largest displacement to either side, m: of the sensor in its range, plausible or not, and of the model under the commanded
    /// voltage.
    pub max_displacement_m: f32,
    /// Largest force that the model may leave unexplained while tracking, as a share of the force at the largest voltage.
    #[serde(default = "max_disturbance_share")]
    pub max_disturbance_share: f32,
    /// Largest difference between voltage monitor and command.
    pub monitor: MonitorLimits,
    /// Plausible values of the displacement sensor, m.
    pub sensor: PlausibilityLimits,
    /// Reaction to an implausible value of the displacement sensor.
    pub on_sensor_fault: OnSensorFault,
    /// Longest time without a heartbeat or a set-point of the host that armed, s.
    pub heartbeat_s: f32,
    /// Time from disabling the amplifier until the film is at 0 V, s: through the amplifier's bleeder, or a film's own leakage. If the
    /// amplifier's `fall_s` takes longer from the largest voltage, that time counts.
    #[serde(default = "discharge_s")]
    pub discharge_s: f32,
}

/// Largest difference between the voltage monitor and the command.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MonitorLimits {
    /// Slew of the amplifier under load, V/s.
    pub slew_v_per_s: f32,
    /// Allowed difference at 0 V, V.
    pub band_v: f32,
    /// Allowed difference as a share of the voltage.
    pub band_share: f32,
    /// Longest time outside the band, s, in sum: sixteen ticks inside the band cancel one outside. A reading that falls below three
    /// quarters of the voltage is an arc: it may recover for this time, and not occur again within half a second after that.
    pub settle_s: f32,
}

/// Plausible values of a sensor.
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
    /// Number of ticks after which a sensor with exactly the same value counts as stuck. [`Motion`](crate::Motion) compares means over a
    /// tenth of them with the model. At least five times the sensor's delay and sample interval together.
    pub stuck_ticks: u32,
    /// Band of a stuck sensor, in its unit: it counts as stuck once the model has moved by five times as much. More than the noise of its
    /// converter.
    #[serde(default = "stuck_band")]
    pub stuck_band: f32,
}

/// The share of files that do not state it.
fn max_disturbance_share() -> f32 {
    0.1
}

/// The time of files that do not state it, s.
fn discharge_s() -> f32 {
    1.0
}

/// The band of files that do not state it, m.
fn stuck_band() -> f32 {
    2e-6
}

/// Reaction to an implausible value of the displacement sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum OnSensorFault {
    /// Trip.
    Trip,
    /// Continue without it: the law predicts the displacement.
    OpenLoop,
}

/// Why limits were refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LimitsError {
    /// A quantity that is not finite or not greater than zero; the name carries its unit.
    #[error("{quantity} is {value}; it must be finite and greater than 0")]
    NotPositive {
        /// Name of the quantity.
        quantity: &'static str,
        /// The value.
        value: f32,
    },
    /// Monitor limits that cannot be kept.
    #[error(
        "monitor: slew_v_per_s ({}) and band_v ({}) must be greater than 0, band_share ({}) and settle_s ({}) not negative, and all finite",
        .0.slew_v_per_s, .0.band_v, .0.band_share, .0.settle_s
    )]
    Monitor(MonitorLimits),
    /// Sensor limits that cannot be kept.
    #[error(
        "sensor: low ({}) must be below high ({}), jump ({}) and stuck_band ({}) greater than 0, stuck_ticks ({}) at least \
         {MIN_TICKS}, and all finite",
        .0.low, .0.high, .0.jump, .0.stuck_band, .0.stuck_ticks
    )]
    Sensor(PlausibilityLimits),
    /// Time constants of the amplifier that are negative, not finite or above 10 s / 1.5: an amplifier may be half as slow again.
    #[error("amplifier: rise_s ({}) and fall_s ({}) must be from 0 to 6.66", .0.rise_s, .0.fall_s)]
    Amplifier(AmplifierLag),
    /// A limit so large that it protects nothing, alone or with the others.
    #[error("{quantity} is {value}, too large to protect anything; it must be at most {max}")]
    TooLarge {
        /// Name of the limit; in the sensor's unit for those of the sensor.
        quantity: &'static str,
        /// The value.
        value: f32,
        /// Largest value that protects something.
        max: f32,
    },
    /// A limit so small that it protects nothing.
    #[error("{quantity} is {value}, too small to protect anything; it must be at least {min}")]
    TooSmall {
        /// Name of the limit.
        quantity: &'static str,
        /// The value.
        value: f32,
        /// Smallest value that protects something.
        min: f32,
    },
}

impl Limits {
    /// Limits of a bench like the paper's with a film of `thickness_m` (m): 6 kV, 42 V/µm, 8 mm, a monitor and a sensor
    /// whose noise is small against the bands.
    #[must_use]
    pub const fn bench(thickness_m: f32) -> Self {
        Self {
            max_voltage_v: 6000.0,
            max_field_v_per_m: 4.2e7,
            thickness_m,
            max_slew_v_per_s: 50e3,
            max_displacement_m: 8e-3,
            max_disturbance_share: 0.1,
            monitor: MonitorLimits { slew_v_per_s: 100e3, band_v: 60.0, band_share: 0.03, settle_s: 0.02 },
            sensor: PlausibilityLimits { low: -0.5e-3, high: 9e-3, jump: 0.5e-3, stuck_ticks: 500, stuck_band: 2e-6 },
            on_sensor_fault: OnSensorFault::Trip,
            heartbeat_s: 0.5,
            discharge_s: 1.0,
        }
    }

    /// Largest voltage that the monitor may show, V.
    #[must_use]
    pub fn monitored_v(&self) -> f32 {
        self.max_voltage_v * (1.0 + self.monitor.band_share) + self.monitor.band_v
    }

    /// The first limit that is above its ceiling, with both. A NaN ceiling refuses every limit.
    pub(crate) fn exceeded(&self, ceilings: &Ceilings) -> Option<(&'static str, f32, f32)> {
        let values = [
            ("max_voltage_v", self.max_voltage_v, ceilings.voltage_v),
            ("max_field_v_per_m", self.max_field_v_per_m, ceilings.field_v_per_m),
            ("max_displacement_m", self.max_displacement_m, ceilings.stroke_m),
        ];
        first(&values, |&(_, value, ceiling)| {
            let within = value <= ceiling;
            !within
        })
        .copied()
    }

    /// Checks that every limit can be kept and protects something.
    ///
    /// # Errors
    ///
    /// [`LimitsError`] for the first that does not.
    pub fn check(&self) -> Result<(), LimitsError> {
        let values = [
            ("max_voltage_v", self.max_voltage_v),
            ("max_field_v_per_m", self.max_field_v_per_m),
            ("thickness_m", self.thickness_m),
            ("max_slew_v_per_s", self.max_slew_v_per_s),
            ("max_displacement_m", self.max_displacement_m),
            ("max_disturbance_share", self.max_disturbance_share),
            ("heartbeat_s", self.heartbeat_s),
            ("discharge_s", self.discharge_s),
        ];
        first(&values, |&(_, value)| !positive(value))
            .map_or(Ok(()), |&(quantity, value)| Err(LimitsError::NotPositive { quantity, value }))?;
        if !self.monitor.are_valid() {
            return Err(LimitsError::Monitor(self.monitor));
        }
        if !self.sensor.are_valid() {
            return Err(LimitsError::Sensor(self.sensor));
        }
        self.check_that_they_protect()
    }

    /// Checks the bounds beyond which a limit has another unit, or is ineffective.
    fn check_that_they_protect(&self) -> Result<(), LimitsError> {
        let sensor = &self.sensor;
        let farthest_m = sensor.low.abs().max(sensor.high.abs());
        let bounds = [
            ("max_voltage_v", self.max_voltage_v, Ceilings::NONE.voltage_v),
            ("max_field_v_per_m", self.max_field_v_per_m, Ceilings::NONE.field_v_per_m),
            // No film is as thick.
            ("thickness_m", self.thickness_m, 0.01),
            // From 0 V to the largest voltage within a tick of a millisecond.
            ("max_slew_v_per_s", self.max_slew_v_per_s, 1000.0 * self.max_voltage_v),
            // The sensor shows no more.
            ("max_displacement_m", self.max_displacement_m, farthest_m),
            // A loop that swings from 0 V to the largest voltage on its own needs more than half of the force.
            ("max_disturbance_share", self.max_disturbance_share, 0.4),
            // Longer than a link pauses.
            ("heartbeat_s", self.heartbeat_s, 10.0),
            ("discharge_s", self.discharge_s, 60.0),
            // Voltages within it count as 0 V.
            ("monitor.band_v", self.monitor.band_v, 0.1 * self.max_voltage_v),
            ("monitor.band_share", self.monitor.band_share, 0.5),
            ("monitor.settle_s", self.monitor.settle_s, 1.0),
            ("sensor.jump", sensor.jump, 0.25 * (sensor.high - sensor.low)),
            ("sensor.stuck_band", sensor.stuck_band, 0.01 * self.max_displacement_m),
        ];
        let beyond = first(&bounds, |&(_, value, max)| value > max);
        beyond.map_or(Ok(()), |&(quantity, value, max)| Err(LimitsError::TooLarge { quantity, value, max }))?;
        // A dead monitor shows once the expected voltage has left the band: within a second.
        let (value, min) = (self.monitor.slew_v_per_s, self.max_voltage_v);
        if value < min {
            return Err(LimitsError::TooSmall { quantity: "monitor.slew_v_per_s", value, min });
        }
        Ok(())
    }
}

/// The first item that is `wrong`. Not inlined: unrolled, the checks of a table take twice its space in flash.
#[inline(never)]
fn first<T>(items: &[T], wrong: impl Fn(&T) -> bool) -> Option<&T> {
    items.iter().find(|item| wrong(item))
}

/// Longest time of a stuck sensor that limits may allow, s.
const MAX_STUCK_S: f32 = 10.0;

impl PlausibilityLimits {
    /// Checks that a stuck sensor is noticed in time, at `rate_hz` ticks a second.
    #[allow(clippy::cast_precision_loss)] // compared, not counted
    pub(crate) fn check_rate(&self, rate_hz: f32) -> Result<(), LimitsError> {
        let (value, max) = (self.stuck_ticks as f32, MAX_STUCK_S * rate_hz);
        if value > max {
            return Err(LimitsError::TooLarge { quantity: "sensor.stuck_ticks", value, max });
        }
        Ok(())
    }
}

impl MonitorLimits {
    fn are_valid(&self) -> bool {
        let not_negative = |value: f32| value.is_finite() && value >= 0.0;
        positive(self.slew_v_per_s)
            && positive(self.band_v)
            && not_negative(self.band_share)
            && not_negative(self.settle_s)
    }
}

impl PlausibilityLimits {
    fn are_valid(&self) -> bool {
        self.low.is_finite()
            && self.high.is_finite()
            && self.low < self.high
            && positive(self.jump)
            && positive(self.stuck_band)
            && self.stuck_ticks >= MIN_TICKS
    }
}

pub(crate) fn positive(value: f32) -> bool {
    value.is_finite() && value > 0.0
}
