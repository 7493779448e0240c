//! The parameters of a board as bytes: what `host-sim export` writes and the [`Store`](crate::Store) keeps.
//!
//! `docs/blob.md` describes the format.

use core::fmt;

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};
use springpot::{Actuator, ActuatorError, MAX_BRANCHES, Maxwell, ModelError, Preload, Springpot, Topology};

use crate::convert::{AdcCode, Calibration, CommandRange};
use crate::supervisor::{Limits, LimitsError, Supervisor};

/// The version of the format.
pub const SCHEMA: u16 = 1;

/// No blob is longer, in bytes.
pub const BLOB_LEN: usize = 512;

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
    /// Whether branches are connected as published (Eq. 11) instead of side by side.
    pub eq11: bool,
    /// c (N·s^α/m) and α of the main springpot, then of both of every branch.
    pub elements: Vec<(f64, f64), { 1 + 2 * MAX_BRANCHES }>,
    /// Relative permittivity, length, width and thickness (m), mass (kg), stretch coupling (1/m).
    pub actuator: [f64; 6],
    /// Whether the weight acts from the start.
    pub from_start: bool,
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
}

/// A set of parameters that was found good, with what is built from it.
#[derive(Clone, Debug)]
pub struct Blob {
    /// The parameters.
    pub parameters: Parameters,
    /// The model of the film.
    pub model: Maxwell,
    /// The actuator around it.
    pub actuator: Actuator,
    /// The supervisor of its limits, disarmed.
    pub supervisor: Supervisor,
}

/// Why a blob was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// Elements that do not come in pairs beside the main springpot.
    Elements,
    /// A rate that is not within 1 Hz…100 kHz.
    Rate,
    /// An offset of the sensor that is not finite.
    Offset,
    /// A calibration that cannot be inverted.
    Calibration(&'static str),
    /// A model that was refused.
    Model(ModelError),
    /// An actuator that was refused.
    Actuator(ActuatorError),
    /// Limits that were refused.
    Limits(LimitsError),
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
            Self::Elements => f.write_str("a model has a main springpot and pairs in its branches"),
            Self::Rate => f.write_str("rate_hz must be from 1 to 100000"),
            Self::Offset => f.write_str("sensor_offset_m must be finite"),
            Self::Calibration(which) => write!(f, "the calibration of the {which} must rise over its full scale"),
            Self::Model(error) => write!(f, "model: {error}"),
            Self::Actuator(error) => write!(f, "actuator: {error}"),
            Self::Limits(error) => write!(f, "limits: {error}"),
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
        let [relative_permittivity, length_m, width_m, thickness_m, mass_kg, stretch_coupling] = parameters.actuator;
        let preload = if parameters.from_start { Preload::FromStart } else { Preload::Settled };
        let actuator =
            Actuator { relative_permittivity, length_m, width_m, thickness_m, mass_kg, preload, stretch_coupling };
        actuator.check().map_err(BlobError::Actuator)?;

        let (main, rest) = parameters.elements.split_first().ok_or(BlobError::Elements)?;
        let springpot = |&(c, alpha): &(f64, f64)| Springpot::new(c, alpha);
        let elements: Vec<Springpot, { 2 * MAX_BRANCHES }> = rest.iter().map(springpot).collect();
        let (branches, odd) = elements.as_chunks::<2>();
        if !odd.is_empty() {
            return Err(BlobError::Elements);
        }
        let topology = if parameters.eq11 { Topology::Eq11 } else { Topology::Parallel };
        let model = Maxwell::new(springpot(main), branches, topology, mass_kg).map_err(BlobError::Model)?;
        let supervisor = Supervisor::new(&parameters.limits, parameters.rate_hz).map_err(BlobError::Limits)?;
        Ok(Self { parameters, model, actuator, supervisor })
    }
}
