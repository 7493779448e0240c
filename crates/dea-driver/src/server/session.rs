//! A conversation with a host: what comes in byte by byte, and what is answered.

use embedded_storage::nor_flash::NorFlash;
use heapless::String;

use crate::control::Controller;
use crate::parameters::{Blob, SCHEMA};
use crate::parameters::{Store, StoreError};
use crate::safety::Refusal;
use crate::server::{Device, Upload};
use crate::wire::{Answer, Command, Drill, Identity, Message, Reject, Request, Status};
use crate::wire::{Receiver, VERSION};

/// What a board lends to a [`Session`].
pub trait Board {
    /// The flash of its parameters.
    type Flash: NorFlash;

    /// Its number; blobs for another one are refused.
    const ID: u16;

    /// Does `work` while no tick can come between, and tells how many cycles of the processor it took.
    fn with<R>(&mut self, work: impl FnOnce(&mut Device) -> R) -> (R, u32);

    /// The slowest and the fastest it can tick, Hz.
    fn rates_hz(&self) -> (f32, f32);

    /// The store of its parameters.
    fn store(&mut self) -> &mut Store<Self::Flash>;

    /// Saves a blob. Ticks may be held up for as long as the flash takes to erase and write, a second or two; the amplifier
    /// is disabled.
    ///
    /// # Errors
    ///
    /// As [`Store::save`].
    fn save(&mut self, blob: &[u8]) -> Result<(), StoreError> {
        self.store().save(blob).map(drop)
    }

    /// Ticks at `rate_hz` from now on.
    fn set_rate(&mut self, rate_hz: f32);

    /// Largest depth of the stack so far, bytes.
    fn stack_peak(&self) -> u32;

    /// What the firmware said when it panicked last; empty if it never did.
    fn panic_message(&self) -> &str;

    /// Goes wrong on purpose, in an image that was built to show how that ends; false in any other.
    fn drill(&mut self, drill: Drill) -> bool {
        let _ = drill;
        false
    }
}

/// The board's side of the link.
#[derive(Debug)]
pub struct Session {
    firmware: &'static str,
    receiver: Receiver,
    upload: Upload,
}

impl Session {
    /// A session that has heard nothing, of a `firmware` of that version.
    #[must_use]
    pub const fn new(firmware: &'static str) -> Self {
        Self { firmware, receiver: Receiver::new(), upload: Upload::new() }
    }

    /// Ticks with the parameters that the board keeps, if it keeps any.
    ///
    /// # Errors
    ///
    /// Why it keeps none, or why they were refused; the link works nonetheless.
    pub fn begin<B: Board>(&mut self, board: &mut B) -> Result<(), StartError> {
        let blob = board.store().load().map_err(StartError::Store)?;
        let controller = Self::controller(blob, board).map_err(StartError::Rejected)?;
        // Nothing is enabled yet that could refuse it.
        Self::install(controller, board).map_err(StartError::Refused)
    }

    /// Takes in a byte from the host; at the end of a request, does as it says and returns the answer.
    pub fn serve<B: Board>(&mut self, byte: u8, board: &mut B) -> Option<Message> {
        Some(match self.receiver.push(byte)? {
            Ok(Request { sequence, command }) => Message::Answer { sequence, answer: self.answer(&command, board) },
            Err(error) => Message::Answer { sequence: 0, answer: Answer::Rejected(error.into()) },
        })
    }

    fn answer<B: Board>(&mut self, command: &Command, board: &mut B) -> Answer {
        board.with(Device::heartbeat);
        match command {
            Command::Identify => Answer::Identity(Identity {
                protocol: VERSION,
                schema: SCHEMA,
                board: B::ID,
                firmware: shortened(self.firmware),
            }),
            Command::Status => {
                let status = board.with(|device| device.status()).0;
                Answer::Status(Status {
                    damaged_frames: self.receiver.damaged(),
                    unknown_frames: self.receiver.unknown(),
                    stack_peak: board.stack_peak(),
                    ..status
                })
            }
            Command::Reload => match self.begin(board) {
                Ok(()) => Answer::Done,
                Err(StartError::Refused(refusal)) => Answer::Refused(refusal),
                Err(StartError::Rejected(reject)) => Answer::Rejected(reject),
                Err(StartError::Store(_)) => Answer::Rejected(Reject::NoParameters),
            },
            Command::PanicMessage => Answer::PanicMessage(shortened(board.panic_message())),
            Command::Upload { offset, bytes } => match self.upload.take(usize::from(*offset), bytes) {
                Ok(()) => Answer::Done,
                Err(_) => Answer::Rejected(Reject::Upload),
            },
            Command::Commit { length } => self.take_over(usize::from(*length), true, board),
            Command::Try { length } => self.take_over(usize::from(*length), false, board),
            Command::Drill(drill) if board.drill(*drill) => Answer::Done,
            Command::Drill(_) => Answer::Rejected(Reject::Unknown),
            Command::Step(_) | Command::Follow { .. } => match board.with(|device| device.obey(command)) {
                (Answer::Steps { steps, .. }, cycles) => Answer::Steps { steps, cycles },
                (Answer::Followed { ticks, .. }, cycles) => Answer::Followed { ticks, cycles },
                (other, _) => other,
            },
            _ => board.with(|device| device.obey(command)).0,
        }
    }

    /// Runs what was uploaded from now on, and keeps it if that is wanted. Whatever fails, the old parameters stay.
    fn take_over<B: Board>(&mut self, length: usize, keep: bool, board: &mut B) -> Answer {
        self.try_take_over(length, keep, board).map_or_else(Answer::from, |()| Answer::Done)
    }

    fn try_take_over<B: Board>(&mut self, length: usize, keep: bool, board: &mut B) -> Result<(), Fault> {
        let bytes = self.upload.finish(length).map_err(|_| Fault::Rejected(Reject::Upload))?;
        board.with(|device| device.is_off()).0.map_err(Fault::Refused)?;
        let blob = Blob::decode(bytes, B::ID).map_err(|_| Fault::Rejected(Reject::Blob))?;
        // What this board cannot run is not kept either.
        let controller = Self::controller(blob, board).map_err(Fault::Rejected)?;
        if keep {
            board.save(bytes).map_err(|_| Fault::Rejected(Reject::Flash))?;
        }
        Self::install(controller, board).map_err(Fault::Refused)
    }

    fn controller<B: Board>(blob: Blob, board: &B) -> Result<Controller, Reject> {
        let (slowest, fastest) = board.rates_hz();
        if !(slowest..=fastest).contains(&blob.parameters.rate_hz) {
            return Err(Reject::Rate);
        }
        Ok(Controller::new(blob))
    }

    fn install<B: Board>(controller: Controller, board: &mut B) -> Result<(), Refusal> {
        let rate_hz = controller.parameters().rate_hz;
        board.with(|device| device.install(controller)).0?;
        board.set_rate(rate_hz);
        Ok(())
    }
}

/// Why a board starts without parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StartError {
    /// It keeps none that can be read.
    Store(StoreError),
    /// It keeps some that it cannot run.
    Rejected(Reject),
    /// Somebody has enabled the amplifier.
    Refused(Refusal),
}

/// Why a request was not met.
enum Fault {
    Refused(Refusal),
    Rejected(Reject),
}

impl From<Fault> for Answer {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Refused(refusal) => Self::Refused(refusal),
            Fault::Rejected(reject) => Self::Rejected(reject),
        }
    }
}

/// As much of `text` as there is room for.
fn shortened<const N: usize>(text: &str) -> String<N> {
    let mut short = String::new();
    // The first letter that finds no room ends it.
    let _ = text.chars().try_for_each(|letter| short.push(letter));
    short
}
