//! The parameters of a board as bytes: what `host-sim export` writes and the [`Store`](crate::Store) keeps.
//!
//! `docs/blob.md` describes the format.

use core::fmt;

use heapless::String;
use serde::{Deserialize, Serialize};
use springpot::{
    Actuator, ActuatorError, Coefficients, CommandLimits, ControlError, Law, LawError, ObserverOptions, Tracking,
};

use crate::chips::{AdcCode, Calibration, CommandRange};
use crate::safety::{Limits, LimitsError, Supervisor};

/// The version of the format.
pub const SCHEMA: u16 = 1;

/// No blob is longer, in bytes.
pub const BLOB_LEN: usize = 768;

const MAGIC: [u8; 4] = *b"DEA\x01";
/// Magic, schema, board, length.
const HEADER: usize = 10;
const CHECKSUM: usize = 4;

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// All that a controller needs to know about its board and film. SI units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// What the set is called.
    pub name: String<32>,
    /// Ticks per second.
    pub rate_hz: f32,
    /// The film's law at that rate, as a host computed it.
    pub law: Coefficients<f32>,
    /// The actuator, whose mass is the law's.
    pub actuator: Actuator,
    /// What the displacement sensor reads of a film at rest, m.
    pub sensor_offset_m: f32,
    /// Range of the amplifier's command.
    pub command_range: CommandRange,
    /// Command (V) → high voltage (V).
    pub amplifier: Calibration,
    /// Monitor (V) → high voltage (V).
    pub monitor: Calibration,
    /// Displacement sensor (V) → displacement (m).
    pub sensor: Calibration,
    /// What film and bench allow.
    pub limits: Limits,
    /// How references are followed and the film is observed.
    pub control: Control,
}

/// How references are followed and the film is observed: [`CommandLimits`] and [`ObserverOptions`], as far as they do not
/// follow from the [`Limits`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Control {
    /// Largest speed of a reference, m/s.
    pub max_velocity_m_per_s: f32,
    /// Largest acceleration of a reference, m/s².
    pub max_acceleration_m_per_s2: f32,
    /// Two poles that lead the film back after a limit, Hz.
    pub return_hz: f32,
    /// Up to here the film follows the sensor, beyond it the model, Hz.
    pub bandwidth_hz: f32,
    /// Time from one sample that is used to the next, s: a tick, or longer for a sensor that is slower.
    pub sample_interval_s: f32,
    /// Age of a sample when it is read, s.
    pub delay_s: f32,
    /// After so long without a sample the sensor counts as lost, s.
    pub lost_after_s: f32,
    /// Time over which the force scale adapts, s; 0: never.
    pub adaptation_s: f32,
}

impl Control {
    /// For a sensor of 100 Hz whose samples come 10 ms late, on a film whose resonance is at 3 Hz or above.
    pub const BENCH: Self = Self {
        max_velocity_m_per_s: 0.05,
        max_acceleration_m_per_s2: 0.5,
        return_hz: 5.0,
        bandwidth_hz: 0.6,
        sample_interval_s: 0.01,
        delay_s: 0.01,
        lost_after_s: 0.05,
        adaptation_s: 30.0,
    };

    fn command_limits(&self, limits: &Limits) -> CommandLimits {
        CommandLimits {
            max_voltage_v: f64::from(limits.max_voltage_v),
            max_field_v_per_m: f64::from(limits.max_field_v_per_m),
            max_slew_v_per_s: f64::from(limits.max_slew_v_per_s),
            max_velocity_m_per_s: f64::from(self.max_velocity_m_per_s),
            max_acceleration_m_per_s2: f64::from(self.max_acceleration_m_per_s2),
            return_hz: f64::from(self.return_hz),
        }
    }

    fn observer_options(&self) -> ObserverOptions {
        ObserverOptions {
            bandwidth_hz: f64::from(self.bandwidth_hz),
            sample_interval_s: f64::from(self.sample_interval_s),
            delay_s: f64::from(self.delay_s),
            lost_after_s: f64::from(self.lost_after_s),
            adaptation_s: f64::from(self.adaptation_s),
        }
    }
}

/// A set of parameters that was found good, with what is built from it.
#[derive(Clone, Debug)]
pub struct Blob {
    /// The parameters.
    pub parameters: Parameters,
    /// The law of the film, with what follows references along it.
    pub tracking: Tracking<f32>,
    /// The supervisor of its limits, disarmed.
    pub supervisor: Supervisor,
}

/// Why a blob was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum BlobError {
    /// Fewer bytes than it says, or than a header has.
    Truncated,
    /// Not a blob.
    Magic,
    /// Another version of the format.
    Schema {
        /// The version found.
        found: u16,
    },
    /// Made for another board.
    Board {
        /// The board it is for.
        found: u16,
    },
    /// Longer than a blob can be.
    TooLong,
    /// Damaged: the checksum is another one.
    Checksum,
    /// The checksum holds, but the contents are no parameters.
    Contents,
    /// A rate that is not within 1 Hz…100 kHz.
    Rate,
    /// An offset of the sensor that is not finite.
    Offset,
    /// A calibration that cannot be inverted.
    Calibration(&'static str),
    /// A law that was refused.
    Law(LawError),
    /// An actuator that was refused, on its own or at the largest voltage.
    Actuator(ActuatorError),
    /// Limits that were refused.
    Limits(LimitsError),
    /// Settings of the control that were refused.
    Control(ControlError),
    /// An instrument that does not reach from 0 V to the largest voltage of the limits.
    Reach(&'static str),
    /// Limits for a film of another thickness than the actuator's.
    Thickness,
}

impl fmt::Display for BlobError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated => f.write_str("the parameter blob is truncated"),
            Self::Magic => f.write_str("this is no parameter blob"),
            Self::Schema { found } => write!(f, "the blob has schema {found}; this firmware reads {SCHEMA}"),
            Self::Board { found } => write!(f, "the blob is for board {found}"),
            Self::TooLong => write!(f, "longer than {BLOB_LEN} bytes"),
            Self::Checksum => f.write_str("the blob is damaged: its checksum does not hold"),
            Self::Contents => f.write_str("the blob holds no parameters"),
            Self::Rate => f.write_str("rate_hz must be from 1 to 100000"),
            Self::Offset => f.write_str("sensor_offset_m must be finite"),
            Self::Calibration(which) => write!(f, "the calibration of the {which} must rise over its full scale"),
            Self::Law(error) => write!(f, "law: {error}"),
            Self::Actuator(error) => write!(f, "actuator: {error}"),
            Self::Limits(error) => write!(f, "limits: {error}"),
            Self::Control(error) => write!(f, "control: {error}"),
            Self::Reach(which) => {
                write!(f, "the {which} does not reach from 0 V to limits.max_voltage_v, within the monitor's band")
            }
            Self::Thickness => f.write_str("limits.thickness_m is not the actuator's thickness_m"),
        }
    }
}

impl core::error::Error for BlobError {}

impl Parameters {
    /// Writes the blob for `board` to `bytes` and returns its length.
    ///
    /// # Errors
    ///
    /// [`BlobError`] for parameters that a controller would refuse, or less room than [`BLOB_LEN`].
    pub fn encode(&self, board: u16, bytes: &mut [u8]) -> Result<usize, BlobError> {
        Blob::new(self.clone())?;
        let room = bytes.len().min(BLOB_LEN);
        let body = bytes.get_mut(HEADER..room).ok_or(BlobError::TooLong)?;
        let length = postcard::to_slice(self, body).map_err(|_| BlobError::TooLong)?.len();
        let end = HEADER + length;
        let header = MAGIC.iter().copied().chain(SCHEMA.to_le_bytes()).chain(board.to_le_bytes());
        #[allow(clippy::cast_possible_truncation)] // below BLOB_LEN
        let header = header.chain((length as u16).to_le_bytes());
        bytes.iter_mut().zip(header).for_each(|(byte, value)| *byte = value);
        let checksum = CRC.checksum(&bytes[..end]).to_le_bytes();
        bytes.get_mut(end..end + CHECKSUM).ok_or(BlobError::TooLong)?.copy_from_slice(&checksum);
        Ok(end + CHECKSUM)
    }
}

impl Blob {
    /// Reads and checks the blob at the start of `bytes`, which must be for `board`.
    ///
    /// # Errors
    ///
    /// [`BlobError`] for the first thing that is wrong.
    pub fn decode(bytes: &[u8], board: u16) -> Result<Self, BlobError> {
        let header = bytes.get(..HEADER).ok_or(BlobError::Truncated)?;
        let word = |at: usize| u16::from_le_bytes([header[at], header[at + 1]]);
        if header[..4] != MAGIC {
            return Err(BlobError::Magic);
        }
        let end = HEADER + usize::from(word(8));
        if end + CHECKSUM > BLOB_LEN {
            return Err(BlobError::TooLong);
        }
        let found = bytes.get(end..end + CHECKSUM).ok_or(BlobError::Truncated)?;
        if CRC.checksum(&bytes[..end]).to_le_bytes() != found {
            return Err(BlobError::Checksum);
        }
        // What follows is as it was written.
        if word(4) != SCHEMA {
            return Err(BlobError::Schema { found: word(4) });
        }
        if word(6) != board {
            return Err(BlobError::Board { found: word(6) });
        }
        let (parameters, rest) = postcard::take_from_bytes(&bytes[HEADER..end]).map_err(|_| BlobError::Contents)?;
        if !rest.is_empty() {
            return Err(BlobError::Contents);
        }
        Self::new(parameters)
    }

    /// Checks `parameters` and builds what a controller needs from them.
    ///
    /// # Errors
    ///
    /// [`BlobError`] for the first value that is wrong.
    pub fn new(parameters: Parameters) -> Result<Self, BlobError> {
        if !(1.0..=100_000.0).contains(&parameters.rate_hz) {
            return Err(BlobError::Rate);
        }
        if !parameters.sensor_offset_m.is_finite() {
            return Err(BlobError::Offset);
        }
        for (name, calibration, full_scale_v) in [
            ("amplifier", &parameters.amplifier, parameters.command_range.full_scale_v()),
            ("monitor", &parameters.monitor, AdcCode::FULL_SCALE_V),
            ("sensor", &parameters.sensor, AdcCode::FULL_SCALE_V),
        ] {
            if !calibration.rises_up_to(full_scale_v) {
                return Err(BlobError::Calibration(name));
            }
        }
        let actuator = parameters.actuator;
        actuator.check().map_err(BlobError::Actuator)?;
        let step_s = 1.0 / f64::from(parameters.rate_hz);
        let law = Law::from_coefficients(&parameters.law, step_s, actuator.mass_kg).map_err(BlobError::Law)?;
        let supervisor = Supervisor::new(&parameters.limits, parameters.rate_hz).map_err(BlobError::Limits)?;
        // A monitor that ends below the limit could never show that it is exceeded.
        let limits = &parameters.limits;
        if parameters.monitor.apply(AdcCode(u16::MAX).volts()) < limits.monitored_v() {
            return Err(BlobError::Reach("monitor"));
        }
        // The last code is one step short of full scale.
        if parameters.amplifier.apply(parameters.command_range.full_scale_v()) < limits.max_voltage_v {
            return Err(BlobError::Reach("amplifier"));
        }
        // Disabled or not, a command of 0 V must be one.
        let at_rest = parameters.amplifier.offset;
        if at_rest > limits.monitor.band_v || at_rest < -limits.monitor.band_v {
            return Err(BlobError::Reach("amplifier"));
        }
        if !(0.99..=1.01).contains(&(f64::from(limits.thickness_m) / actuator.thickness_m)) {
            return Err(BlobError::Thickness);
        }
        let limits = parameters.control.command_limits(&parameters.limits);
        let tracking = Tracking::new(law, &actuator, limits, parameters.control.observer_options());
        let tracking = tracking.map_err(|error| match error {
            ControlError::Actuator(error) => BlobError::Actuator(error),
            error => BlobError::Control(error),
        })?;
        Ok(Self { parameters, tracking, supervisor })
    }
}
