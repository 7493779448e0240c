//! A conversation with a host: bytes in, answers out.

use heapless::String;

use crate::control::{AdaptationOrder, Controller, LearningOrder, Mode};
use crate::parameters::{Blob, BlobError, ControllerMemory, SCHEMA, StoreError};
use crate::safety::{Cause, DriverState, Refusal};
use crate::server::{Board, Denial, Device, Upload};
use crate::wire::{Answer, Command, Identity, Message, RECORDS, Receiver, Reject, Request, Status, VERSION};

/// The board's side of the link.
///
/// ```
/// use dea_driver::server::{Board, Session};
/// use dea_driver::wire::{Answer, Command, FRAME_LEN, Message, Request, encode};
/// use dea_driver::{Device, RamFlash, Store};
///
/// struct MyBoard {
///     device: Device,
///     store: Store<RamFlash>,
/// }
///
/// impl Board for MyBoard {
///     type Flash = RamFlash;
///     const ID: u16 = 7;
///     // On a chip: in a critical section, or under the lock that the tick takes.
///     fn with<R>(&mut self, work: impl FnOnce(&mut Device) -> R) -> (R, u32) {
///         (work(&mut self.device), 0)
///     }
///     fn rates_hz(&self) -> (f32, f32) {
///         (100.0, 2000.0)
///     }
///     fn store(&mut self) -> &mut Store<RamFlash> {
///         &mut self.store
///     }
///     fn set_rate(&mut self, _rate_hz: f32) {}
/// }
///
/// let store = Store::new(RamFlash::default(), MyBoard::ID).expect("room for two slots");
/// let mut board = MyBoard { device: Device::new(None), store };
/// let mut session = Session::new("0.1.0");
/// assert!(session.begin(&mut board).is_err()); // no parameters yet; the link works all the same
///
/// // Bytes of the line, one by one:
/// let mut frame = [0; FRAME_LEN + 1];
/// let length = encode(&Request { sequence: 5, token: 0, command: Command::Identify }, &mut frame).expect("fits");
/// let answer = frame[..length].iter().find_map(|&byte| session.serve(byte, &mut board));
/// assert!(matches!(answer, Some(Message::Answer { sequence: 5, answer: Answer::Identity(_) })));
/// ```
#[derive(Clone, Debug)]
pub struct Session {
    firmware: &'static str,
    receiver: Receiver,
    upload: Upload,
    /// Token of the host that armed last; 0 if none has.
    token: u16,
    /// The newest number of a request with that token.
    newest: u32,
    /// Whether the parameters in use are only tried.
    on_trial: bool,
}

impl Session {
    /// Largest number of bytes that a [`turn`](Self::turn) serves: the answers to the shortest frames in them take 20 ms of the line.
    pub const TURN: usize = 128;

    /// A session that has received nothing, of this `firmware` version.
    #[must_use]
    pub const fn new(firmware: &'static str) -> Self {
        Self { firmware, receiver: Receiver::new(), upload: Upload::new(), token: 0, newest: 0, on_trial: false }
    }

    /// Ticks with the stored parameters, if there are any: to be called once after a reset. If other parameters were on trial before it,
    /// [`Cause::Parameters`](crate::Cause) is latched.
    ///
    /// # Errors
    ///
    /// [`StartError`] if there are no stored parameters, or if they were refused; the link works all the same.
    pub fn begin<M: ControllerMemory, B: Board<M>>(&mut self, board: &mut B) -> Result<(), StartError> {
        install_stored(board)?;
        if board.remembers_trial() {
            board.with(Device::lose_parameters);
        }
        Ok(())
    }

    /// One turn of the background's loop: reports that the background is alive, checks a part of the memory, serves at most
    /// [`TURN`](Self::TURN) of the waiting `bytes`, and passes the answers to `send`. Returns whether there were any bytes. A turn is short
    /// however many bytes wait, so a flood delays requests and telemetry, but does not stop the background.
    pub fn turn<M: ControllerMemory, B: Board<M>>(
        &mut self,
        bytes: impl Iterator<Item = u8>,
        board: &mut B,
        mut send: impl FnMut(&Message),
    ) -> bool {
        let is_intact = board.image_is_intact();
        board.with(|device| {
            device.background_is_running();
            device.check_memory();
            if !is_intact {
                device.latch(Cause::Memory);
            }
        });
        let mut quiet = true;
        for byte in bytes.take(Self::TURN) {
            quiet = false;
            if let Some(message) = self.serve(byte, board) {
                send(&message);
            }
        }
        !quiet
    }

    /// Adds a byte from the host; at the end of a request, executes it and returns the answer.
    pub fn serve<M: ControllerMemory, B: Board<M>>(&mut self, byte: u8, board: &mut B) -> Option<Message> {
        Some(match self.receiver.push(byte)? {
            Ok(Request { sequence, token, command }) => {
                let armed_it = token != 0 && token == self.token;
                let is_newer = (1..=WINDOW).contains(&sequence.wrapping_sub(self.newest));
                let answer = if armed_it && !is_newer && acts(&command) {
                    Answer::Stale { newest: self.newest }
                } else {
                    self.newest = if armed_it && is_newer { sequence } else { self.newest };
                    self.answer((sequence, token), &command, board)
                };
                Message::Answer { sequence, answer }
            }
            Err(error) => Message::Answer { sequence: 0, answer: Answer::Rejected(error.into()) },
        })
    }

    /// Executes a command: the only place that distinguishes commands.
    fn answer<M: ControllerMemory, B: Board<M>>(
        &mut self,
        (sequence, token): (u32, u16),
        command: &Command,
        board: &mut B,
    ) -> Answer {
        let done = match *command {
            Command::Identify => return self.identity(B::ID),
            Command::Heartbeat => self.drive(token, Act::StayAlive, board),
            Command::Status => return self.status(board),
            Command::Arm => return self.arm(sequence, Device::arm, board),
            Command::ArmForSelfTest => return self.arm(sequence, Device::arm_for_self_test, board),
            Command::Start(mode) => self.drive(token, Act::Start(mode), board),
            Command::Stop => board.with(Device::stop).0,
            Command::Disarm => board.with(Device::disarm).0,
            Command::Acknowledge => self.acknowledge(board),
            Command::SetVoltage(volts) => self.drive(token, Act::SetVoltage(volts), board),
            Command::SetReference(metres) => self.drive(token, Act::SetReference(metres), board),
            Command::Upload { offset, ref bytes } => {
                self.upload.push(usize::from(offset), bytes).map_err(Denial::Rejected)
            }
            Command::Commit { length } => self.take_over(usize::from(length), true, board),
            Command::Try { length } => self.take_over(usize::from(length), false, board),
            Command::Query => {
                let found = board.with(|device| device.parameters()).0;
                return found.map_or_else(Answer::from, |(name, checksum)| Answer::Parameters { name, checksum });
            }
            Command::Stream { every } => {
                board.with(|device| device.stream(every));
                Ok(())
            }
            Command::PanicMessage => return Answer::PanicMessage(shortened(board.panic_message())),
            Command::InjectFault(fault) if board.inject_fault(fault) => Ok(()),
            Command::InjectFault(_) => Err(Denial::Rejected(Reject::Unknown)),
            Command::Learning(order) => self.drive(token, Act::Learning(order), board),
            Command::Adapt(AdaptationOrder::Keep) => self.keep_adapted(board),
            Command::Adapt(order) => self.drive(token, Act::Adapt(order), board),
            Command::Adaptation => {
                let found = board.with(|device| device.adaptation()).0;
                return found.map_or_else(Answer::from, Answer::Adaptation);
            }
            Command::Reload => self.reload(board),
            Command::Inspect => {
                let found = board.with(|device| device.inspection()).0;
                return found.map_or(Answer::Rejected(Reject::Unknown), Answer::Inspection);
            }
            Command::Preflight => {
                let found = board.with(|device| device.preflight()).0;
                return found
                    .map_or_else(Answer::from, |(refusals, self_test_s)| Answer::Preflight { refusals, self_test_s });
            }
            Command::SelfTested => board.with(Device::note_self_test).0,
            Command::FlightRecords { back } => {
                let older = (u32::from(back)..).map_while(|back| board.flight_record(back));
                return Answer::FlightRecords(older.take(RECORDS).collect());
            }
            Command::StopFeedingWatchdog => {
                board.with(|device| device.is_off()).0.map_err(Denial::Refused).and_then(|()| {
                    if board.stop_feeding_watchdog() { Ok(()) } else { Err(Denial::Rejected(Reject::Unknown)) }
                })
            }
            #[cfg(feature = "loop-test")]
            Command::Rest => board.with(Device::rest).0,
            #[cfg(feature = "loop-test")]
            Command::Step(ref volts) => {
                let (steps, cycles) = board.with(|device| device.step(volts));
                return steps.map_or_else(Answer::from, |steps| Answer::Steps { steps, cycles });
            }
            #[cfg(feature = "loop-test")]
            Command::Follow { mode, ref targets } => {
                let (ticks, cycles) = board.with(|device| device.follow(mode, targets));
                return ticks.map_or_else(Answer::from, |ticks| Answer::Followed { ticks, cycles });
            }
            #[cfg(feature = "loop-test")]
            Command::Tick { mode, ref inputs } => {
                let (ticks, cycles) = board.with(|device| device.tick_test(mode, inputs));
                return ticks.map_or_else(Answer::from, |ticks| Answer::Ticked { ticks, cycles });
            }
            #[cfg(not(feature = "loop-test"))]
            Command::Rest | Command::Step(_) | Command::Follow { .. } | Command::Tick { .. } => {
                Err(Denial::Rejected(Reject::Unknown))
            }
        };
        done.map_or_else(Answer::from, |()| Answer::Done)
    }

    fn reload<M: ControllerMemory, B: Board<M>>(&mut self, board: &mut B) -> Result<(), Denial> {
        install_stored(board).map_err(|error| match error {
            StartError::Refused(refusal) => Denial::Refused(refusal),
            StartError::Rejected(reject) => Denial::Rejected(reject),
            StartError::Store(_) => Denial::Rejected(Reject::NoParameters),
        })?;
        self.try_out(false, board);
        Ok(())
    }

    /// Stores the parameters in use with the learned changes of the film.
    #[inline(never)] // its room on the stack is not that of every request
    fn keep_adapted<M: ControllerMemory, B: Board<M>>(&mut self, board: &mut B) -> Result<(), Denial> {
        if self.on_trial {
            return Err(Denial::Rejected(Reject::Value));
        }
        let parameters = board.with(Device::adapted_parameters).0?;
        let bytes = self.upload.room();
        let length = board.store().encode(&parameters, bytes).map_err(|_| Denial::Rejected(Reject::Blob))?;
        board.save(&bytes[..length]).map_err(|_| Denial::Rejected(Reject::Flash))
    }

    fn acknowledge<M: ControllerMemory, B: Board<M>>(&mut self, board: &mut B) -> Result<(), Denial> {
        let before = board.with(|device| device.state()).0;
        board.with(Device::acknowledge).0?;
        if before == DriverState::Tripped(Cause::Parameters) {
            // Acknowledged; parameters that are tried since then are another trial.
            self.try_out(self.on_trial, board);
        }
        Ok(())
    }

    fn try_out<M: ControllerMemory, B: Board<M>>(&mut self, on_trial: bool, board: &mut B) {
        self.on_trial = on_trial;
        board.remember_trial(on_trial);
    }

    fn arm<M: ControllerMemory, B: Board<M>>(
        &mut self,
        sequence: u32,
        arm: fn(&mut Device<M>) -> Result<(), Denial>,
        board: &mut B,
    ) -> Answer {
        let (armed, _) = board.with(|device| arm(device).map(|()| device.status().ticks));
        match armed {
            Ok(ticks) => {
                self.token = another_token(self.token, ticks ^ board.noise());
                self.newest = sequence;
                Answer::Armed { token: self.token }
            }
            Err(denial) => denial.into(),
        }
    }

    /// Acts for the host that armed, and restarts its timeout. While the amplifier is enabled, no other host's request keeps it
    /// so, or moves it.
    fn drive<M: ControllerMemory, B: Board<M>>(&self, token: u16, act: Act, board: &mut B) -> Result<(), Denial> {
        let armed_it = token != 0 && token == self.token;
        let work = |device: &mut Device<M>| {
            if device.state().is_live() && !armed_it {
                return Err(Denial::Rejected(Reject::Token));
            }
            match act {
                Act::StayAlive => {}
                Act::Start(mode) => device.start(mode)?,
                Act::SetVoltage(volts) => device.set_voltage(volts)?,
                Act::SetReference(metres) => device.set_reference(metres)?,
                Act::Learning(order) => device.order_learning(order)?,
                Act::Adapt(order) => device.order_adaptation(order)?,
            }
            device.heartbeat();
            Ok(())
        };
        board.with(work).0
    }

    fn identity(&self, board: u16) -> Answer {
        let firmware = shortened(self.firmware);
        Answer::Identity(Identity { protocol: VERSION, schema: SCHEMA, board, firmware })
    }

    fn status<M: ControllerMemory, B: Board<M>>(&self, board: &mut B) -> Answer {
        let status = board.with(|device| device.status()).0;
        Answer::Status(Status {
            damaged_frames: self.receiver.damaged(),
            unknown_frames: self.receiver.unknown(),
            stack_peak: board.stack_peak(),
            lost_bytes: board.lost_bytes(),
            ..status
        })
    }

    /// Runs the uploaded blob from now on, and stores it if `keep`. Whatever fails, the old parameters stay.
    fn take_over<M: ControllerMemory, B: Board<M>>(
        &mut self,
        length: usize,
        keep: bool,
        board: &mut B,
    ) -> Result<(), Denial> {
        let bytes = self.upload.finish(length).map_err(Denial::Rejected)?;
        board.with(|device| device.is_off()).0?;
        let blob = board.store().decode(bytes).map_err(|error| match error {
            StoreError::Refused(BlobError::Ceiling { .. }) => Denial::Rejected(Reject::Ceiling),
            StoreError::Refused(BlobError::NoCurrent) => Denial::Rejected(Reject::Current),
            _ => Denial::Rejected(Reject::Blob),
        })?;
        // What this board cannot run is not stored either.
        let controller = controller(blob, board).map_err(Denial::Rejected)?;
        if keep {
            board.save(bytes).map_err(|_| Denial::Rejected(Reject::Flash))?;
        }
        install(controller, board)?;
        self.try_out(!keep, board);
        Ok(())
    }
}

fn controller<M: ControllerMemory>(blob: Blob<M>, board: &impl Board<M>) -> Result<Controller<M>, Reject> {
    let (slowest, fastest) = board.rates_hz();
    if !(slowest..=fastest).contains(&blob.parameters().rate_hz) {
        return Err(Reject::Rate);
    }
    Ok(Controller::new(blob))
}

fn install_stored<M: ControllerMemory, B: Board<M>>(board: &mut B) -> Result<(), StartError> {
    let stored = board.store().load().map_err(StartError::Store)?;
    let controller = controller(stored.blob, board).map_err(StartError::Rejected)?;
    install(controller, board).map_err(StartError::Refused)?;
    if stored.newer_lost {
        board.with(Device::lose_parameters);
    }
    Ok(())
}

fn install<M: ControllerMemory>(controller: Controller<M>, board: &mut impl Board<M>) -> Result<(), Refusal> {
    let rate_hz = controller.parameters().rate_hz;
    board.with(|device| device.install(controller)).0?;
    board.set_rate(rate_hz);
    Ok(())
}

/// An action of the host that armed, and of no other.
#[derive(Clone, Copy)]
enum Act {
    StayAlive,
    Start(Mode),
    SetVoltage(f32),
    SetReference(f32),
    Learning(LearningOrder),
    Adapt(AdaptationOrder),
}

/// How far ahead of the newest request of the host that armed the number of its next one may be. What is older, or was obeyed already, came from a
/// buffer on the way, or from another program that has recorded it.
const WINDOW: u32 = 256;

/// Whether a command could do harm if it were obeyed late or twice: neither queries nor commands that lead to 0 V.
fn acts(command: &Command) -> bool {
    !matches!(
        command,
        Command::Identify
            | Command::Status
            | Command::Query
            | Command::PanicMessage
            | Command::Inspect
            | Command::FlightRecords { .. }
            | Command::Preflight
            | Command::Adaptation
            | Command::Stop
            | Command::Disarm
            | Command::Stream { .. }
    )
}

/// A token other than `last`, and not 0, which depends on `noise`, so that a host that armed before a reset does not know it. 16 bits keep confused
/// hosts apart, not hostile ones.
#[allow(clippy::cast_possible_truncation)] // mixed
fn another_token(last: u16, noise: u32) -> u16 {
    let drawn = (noise ^ noise >> 16) as u16;
    let token = drawn.wrapping_mul(0x9e37).wrapping_add(last).wrapping_add(1);
    if token == 0 || token == last { last.wrapping_add(1).max(1) } else { token }
}

/// Why a board starts without parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StartError {
    /// None are stored that can be read.
    Store(StoreError),
    /// The stored parameters cannot run on this board.
    Rejected(Reject),
    /// The amplifier is enabled.
    Refused(Refusal),
}

/// As many characters of `text` as there is room for.
fn shortened<const N: usize>(text: &str) -> String<N> {
    let mut short = String::new();
    // The first character that does not fit ends it.
    let _ = text.chars().try_for_each(|letter| short.push(letter));
    short
}

#[test]
fn no_token_is_0_or_the_last_one_whatever_the_noise() {
    for last in [0, 1, u16::MAX - 1, u16::MAX] {
        for noise in 0..=u32::from(u16::MAX) {
            let token = another_token(last, noise);
            assert!(token != 0 && token != last);
        }
    }
}
