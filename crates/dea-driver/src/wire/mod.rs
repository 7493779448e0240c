//! The link between controller and host: frames and messages.
//!
//! A frame is the protocol's version, a message in postcard, and a CRC-32, stuffed by COBS and ended by a zero byte; see
//! `docs/link.md`. A frame that is damaged or not understood is counted and answered, never obeyed.

mod frame;
mod message;

pub use frame::{FRAME_LEN, FrameError, Receiver, encode};
pub use message::{
    Answer, BATCH, CHUNK, Command, Drill, Followed, Identity, Message, Mode, Reject, Request, Sample, Status, Step,
    Target,
};

/// The version of the protocol.
pub const VERSION: u8 = 1;
