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

/// Baud rate of the serial line, 8N1. 42 MHz, the clock of the STM32F405's USART, divides to it within 0.2 %, and common USB
/// adapters support it.
pub const BAUD: u32 = 460_800;

/// Boards that this repository has firmware for: the number in [`Identity::board`] and in the header of a blob.
pub mod boards {
    /// The STM32F405 of the crate `firmware`.
    pub const STM32F405: u16 = 0x0405;
}
