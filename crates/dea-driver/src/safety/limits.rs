//! Every limit of film and bench, and the check that they can be kept.

use core::fmt;

use serde::{Deserialize, Serialize};

/// What film and bench allow.
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
    /// Largest displacement to either side, m.
    pub max_displacement_m: f32,
    /// Largest difference between voltage monitor and command.
    pub monitor: MonitorLimits,
    /// Plausible values of the displacement sensor, m.
    pub sensor: PlausibilityLimits,
    /// Reaction to an implausible value of the displacement sensor.
    pub on_sensor_fault: OnSensorFault,
    /// Longest time without a request of the host, s.
    pub heartbeat_s: f32,
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
    /// Time for which the difference may be larger, s.
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
    /// Number of ticks for which the value may stay exactly the same: a working sensor has noise. 0: no such limit.
    pub stuck_ticks: u32,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LimitsError {
    /// A quantity that is not finite or not greater than zero; the name carries its unit.
    NotPositive(&'static str),
    /// Monitor limits that cannot be kept.
    Monitor,
    /// Sensor limits that cannot be kept.
    Sensor,
    /// A limit so large that it protects nothing.
    TooLarge(&'static str),
}

impl fmt::Display for LimitsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotPositive(quantity) => write!(f, "{quantity} must be finite and greater than 0"),
            Self::Monitor => {
                f.write_str("monitor: slew and band must be greater than 0, share and settling time not negative")
            }
            Self::TooLarge(quantity) => write!(f, "{quantity} is so large that it protects nothing"),
            Self::Sensor => f.write_str("sensor: low must be below high, and the jump greater than 0"),
        }
    }
}

impl core::error::Error for LimitsError {}

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
            monitor: MonitorLimits { slew_v_per_s: 100e3, band_v: 60.0, band_share: 0.03, settle_s: 0.02 },
            sensor: PlausibilityLimits { low: -0.5e-3, high: 9e-3, jump: 0.5e-3, stuck_ticks: 1000 },
            on_sensor_fault: OnSensorFault::Trip,
            heartbeat_s: 0.5,
        }
    }

    /// Largest voltage that the monitor may show, V.
    #[must_use]
    pub fn monitored_v(&self) -> f32 {
        self.max_voltage_v * (1.0 + self.monitor.band_share) + self.monitor.band_v
    }

    /// Checks that every limit can be kept and protects something.
    ///
    /// # Errors
    ///
    /// [`LimitsError`] for the first that does not.
    pub fn check(&self) -> Result<(), LimitsError> {
        for (name, value) in [
            ("max_voltage_v", self.max_voltage_v),
            ("max_field_v_per_m", self.max_field_v_per_m),
            ("thickness_m", self.thickness_m),
            ("max_slew_v_per_s", self.max_slew_v_per_s),
            ("max_displacement_m", self.max_displacement_m),
            ("heartbeat_s", self.heartbeat_s),
        ] {
            if !positive(value) {
                return Err(LimitsError::NotPositive(name));
            }
        }
        for (name, value, most) in [
            ("heartbeat_s", self.heartbeat_s, 60.0),
            ("monitor.band_share", self.monitor.band_share, 0.5),
            ("monitor.settle_s", self.monitor.settle_s, 1.0),
        ] {
            if value > most {
                return Err(LimitsError::TooLarge(name));
            }
        }
        if !self.monitor.are_valid() {
            return Err(LimitsError::Monitor);
        }
        if !self.sensor.are_valid() {
            return Err(LimitsError::Sensor);
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
        self.low.is_finite() && self.high.is_finite() && self.low < self.high && self.jump > 0.0 && !self.jump.is_nan()
    }
}

pub(crate) fn positive(value: f32) -> bool {
    value.is_finite() && value > 0.0
}
