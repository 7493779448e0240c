//! Frames: COBS around version, postcard and CRC-32.

use heapless::Vec;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::wire::VERSION;

/// Largest length of a frame without its closing zero, bytes.
pub const FRAME_LEN: usize = 360;

const CHECKSUM: usize = 4;
/// Most bytes that COBS adds: one in front, and one for every 254.
const STUFFING: usize = 1 + FRAME_LEN / 254;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Reasons to refuse a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FrameError {
    /// Its checksum does not match, or its stuffing is broken.
    #[error("the frame is damaged: send it again")]
    Damaged,
    /// Longer than [`FRAME_LEN`].
    #[error("the frame is longer than {FRAME_LEN} bytes")]
    TooLong,
    /// Another version of the protocol.
    #[error("the frame has version {0} of the protocol, not {VERSION}: use a program of the same version")]
    Version(u8),
    /// A message that this version does not know.
    #[error("the frame has a message that version {VERSION} does not know: use a program of the same version")]
    Unknown,
}

/// Writes the frame of `message`, with its closing zero, to `bytes` and returns its length.
///
/// # Errors
///
/// [`FrameError::TooLong`] for a message that does not fit in a frame, or too little room.
pub fn encode<T: Serialize>(message: &T, bytes: &mut [u8]) -> Result<usize, FrameError> {
    let mut plain = [0; FRAME_LEN];
    plain[0] = VERSION;
    let room = FRAME_LEN - STUFFING - CHECKSUM;
    let length = 1 + postcard::to_slice(message, &mut plain[1..room]).map_err(|_| FrameError::TooLong)?.len();
    let checksum = CRC.checksum(&plain[..length]).to_le_bytes();
    plain[length..length + CHECKSUM].copy_from_slice(&checksum);
    let plain = &plain[..length + CHECKSUM];
    let stuffed = cobs::try_encode(plain, bytes).map_err(|_| FrameError::TooLong)?;
    *bytes.get_mut(stuffed).ok_or(FrameError::TooLong)? = 0;
    Ok(stuffed + 1)
}

/// Collects bytes into frames.
#[derive(Clone, Debug, Default)]
pub struct Receiver {
    bytes: Vec<u8, FRAME_LEN>,
    overflowed: bool,
    damaged: u32,
    unknown: u32,
}

impl Receiver {
    /// A receiver that has received nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: Vec::new(), overflowed: false, damaged: 0, unknown: 0 }
    }

    /// Adds a byte; at the end of a frame, returns its message or why it was refused.
    pub fn push<T: DeserializeOwned>(&mut self, byte: u8) -> Option<Result<T, FrameError>> {
        if byte != 0 {
            self.overflowed |= self.bytes.push(byte).is_err();
            return None;
        }
        // Zeros between frames are not frames.
        if self.bytes.is_empty() {
            return None;
        }
        let frame = if self.overflowed { Err(FrameError::TooLong) } else { decode(&mut self.bytes) };
        self.bytes.clear();
        self.overflowed = false;
        match frame {
            Err(FrameError::Damaged | FrameError::TooLong) => self.damaged = self.damaged.saturating_add(1),
            Err(FrameError::Version(_) | FrameError::Unknown) => self.unknown = self.unknown.saturating_add(1),
            Ok(_) => {}
        }
        Some(frame)
    }

    /// Frames that were damaged.
    #[must_use]
    pub fn damaged(&self) -> u32 {
        self.damaged
    }

    /// Frames that were intact but unknown.
    #[must_use]
    pub fn unknown(&self) -> u32 {
        self.unknown
    }
}

fn decode<T: DeserializeOwned>(stuffed: &mut [u8]) -> Result<T, FrameError> {
    let length = cobs::decode_in_place(stuffed).map_err(|_| FrameError::Damaged)?;
    let plain = stuffed.get(..length).ok_or(FrameError::Damaged)?;
    let (body, checksum) = plain.split_at_checked(length.wrapping_sub(CHECKSUM)).ok_or(FrameError::Damaged)?;
    if CRC.checksum(body).to_le_bytes() != checksum {
        return Err(FrameError::Damaged);
    }
    let (&version, message) = body.split_first().ok_or(FrameError::Damaged)?;
    if version != VERSION {
        return Err(FrameError::Version(version));
    }
    match postcard::take_from_bytes(message) {
        Ok((message, [])) => Ok(message),
        _ => Err(FrameError::Unknown),
    }
}
