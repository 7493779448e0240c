//! The link between controller and host: frames and messages, pure data.
//!
//! A frame is the protocol's version, a message in postcard, and a CRC-32, stuffed by COBS and ended by a zero byte; see
//! [below](#the-link). A frame that is damaged or unknown is counted and answered, never executed.
//!
//! ```
//! use dea_driver::Mode;
//! use dea_driver::wire::{Command, FRAME_LEN, Receiver, Request, encode};
//!
//! let request = Request { sequence: 1, token: 0, command: Command::Start(Mode::Tracking) };
//! let mut frame = [0; FRAME_LEN + 1];
//! let length = encode(&request, &mut frame).expect("every request fits");
//!
//! let mut receiver = Receiver::new();
//! let mut received = None;
//! for &byte in &frame[..length] {
//!     received = received.or(receiver.push::<Request>(byte));
//! }
//! assert_eq!(received, Some(Ok(request)));
//! ```
#![doc = include_str!("../../doc/link.md")]

mod frame;
mod inspection;
mod message;

pub use frame::{FRAME_LEN, FrameError, Receiver, encode};
pub use inspection::{Inspection, Part};
pub use message::{
    Answer, BATCH, CHUNK, Command, Identity, InjectedFault, Message, RECORDS, REFUSALS, Reject, Request, Status,
};

pub use crate::chips::boards;
pub use crate::control::{
    AdaptationOrder, AdaptationStatus, FlightRecord, Followed, LearningOrder, Mode, Step, Target, Telemetry, TickCodes,
    Ticked,
};

/// The version of the protocol.
pub const VERSION: u8 = 7;

/// Baud rate of the serial line, 8N1. 42 MHz, the clock of the STM32F405's USART, divides to it within 0.2 %, and common USB
/// adapters support it.
pub const BAUD: u32 = 460_800;
