//! The messages between controller and host.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use crate::control::{
    AdaptationOrder, AdaptationStatus, FlightRecord, Followed, LearningOrder, Mode, Step, Target, Telemetry, TickCodes,
    Ticked,
};
use crate::safety::{DriverState, Refusal};
use crate::wire::{FrameError, Inspection};

/// Steps of a loop test in one frame.
pub const BATCH: usize = 24;

/// Records of the flight recorder in one frame.
pub const RECORDS: usize = 8;

/// Reasons to refuse to be armed, all at once.
pub const REFUSALS: usize = 5;

/// Bytes of an upload in one frame.
pub const CHUNK: usize = 128;

/// From host to controller. Every request is answered, with its sequence number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Chosen by the host; comes back with the answer.
    pub sequence: u32,
    /// The token of [`Answer::Armed`] from the host that armed; 0 from any other.
    pub token: u16,
    /// The command.
    pub command: Command,
}

/// The commands of a host. New commands are added at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Command {
    /// Identify the board. Answered by [`Answer::Identity`].
    Identify,
    /// Restart the timeout of the host. Only from the host that armed.
    Heartbeat,
    /// Answered by [`Answer::Status`].
    Status,
    /// Enable the amplifier at 0 V. Answered by [`Answer::Armed`].
    Arm,
    /// Let the law command the voltage. Only from the host that armed.
    Start(Mode),
    /// Back to 0 V, amplifier enabled.
    Stop,
    /// Back to 0 V, amplifier disabled.
    Disarm,
    /// Acknowledge a trip.
    Acknowledge,
    /// The voltage of [`Mode::Voltage`], V at the film. Only from the host that armed, whose timeout it restarts.
    SetVoltage(f32),
    /// The displacement of [`Mode::Feedforward`] and [`Mode::Tracking`], m. Likewise.
    SetReference(f32),
    /// Part of a parameter blob, in order.
    Upload {
        /// Where it belongs.
        offset: u16,
        /// The bytes.
        bytes: Vec<u8, CHUNK>,
    },
    /// Check the uploaded blob, store it, and run it from now on. Only while the amplifier is
    /// disabled.
    Commit {
        /// Length of the blob.
        length: u16,
    },
    /// Answered by [`Answer::Parameters`].
    Query,
    /// Send the record of every n-th tick as [`Message::Telemetry`]; 0 ends it.
    Stream {
        /// Ticks per record, n.
        every: u16,
    },
    /// Bring the model of the loop test to rest at x = 0. Only while the amplifier is disabled.
    Rest,
    /// Step the model of the loop test under these voltages (V), without hardware. Only while the amplifier is disabled.
    /// Answered by [`Answer::Steps`]; rejected as unknown by an image without the feature `loop-test`.
    Step(Vec<f32, BATCH>),
    /// Check the uploaded blob and run it until the next reset, without storing it. Only while the amplifier is
    /// disabled.
    Try {
        /// Length of the blob.
        length: u16,
    },
    /// Answered by [`Answer::PanicMessage`].
    PanicMessage,
    /// Inject a fault. Only an image with a virtual bench does; others reject it.
    InjectFault(InjectedFault),
    /// Tick the control on the film of the loop test, without hardware. Only while the amplifier is disabled.
    /// Answered by [`Answer::Followed`]; rejected as unknown by an image without the feature `loop-test`.
    Follow {
        /// Task of the law.
        mode: Mode,
        /// Tick by tick.
        targets: Vec<Target, BATCH>,
    },
    /// Run the stored parameters, as after a reset. Only while the amplifier is disabled.
    Reload,
    /// Asks for the state of the board's parts. Answered by [`Answer::Inspection`]; rejected as unknown by a board without that.
    Inspect,
    /// Stop feeding the watchdog, so that it resets the chip. Only while the amplifier is disabled; rejected as unknown by a board that
    /// cannot.
    StopFeedingWatchdog,
    /// Tick the whole controller of the loop test, armed and running, on these codes, without hardware. Only while the amplifier is
    /// disabled. Answered by [`Answer::Ticked`]; rejected as unknown by an image without the feature `loop-test`.
    Tick {
        /// Target of the controller.
        mode: Mode,
        /// Tick by tick.
        inputs: Vec<TickCodes, BATCH>,
    },
    /// An order for the correction learned for a periodic reference. While the amplifier is enabled, only from the host that armed.
    Learning(LearningOrder),
    /// Asks for the flight recorder's records, from the one that is `back` records older than the newest. Answered by
    /// [`Answer::FlightRecords`].
    FlightRecords {
        /// 0 for the newest.
        back: u16,
    },
    /// Asks for all reasons for which `Arm` would be refused. Answered by [`Answer::Preflight`].
    Preflight,
    /// Report that a host's self-test of the bench has passed. Only while the amplifier is disabled.
    SelfTested,
    /// Enable the amplifier at 0 V for a self-test, with 500 V at the most. Answered by [`Answer::Armed`].
    ArmForSelfTest,
    /// An order for the adaptation of the law. While the amplifier is enabled, only from the host that armed.
    Adapt(AdaptationOrder),
    /// Asks for the learned changes of the film. Answered by [`Answer::Adaptation`].
    Adaptation,
}

/// Faults that an image with a virtual bench injects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum InjectedFault {
    /// The interlock opens.
    Interlock,
    /// The voltage monitor stays where it is.
    Monitor,
    /// The displacement sensor is unplugged.
    Sensor,
    /// The monitor's converter does not answer.
    Bus,
    /// A tick takes longer than it may.
    Overrun,
    /// The firmware panics.
    Panic,
    /// The tick hangs.
    Hang,
}

/// From controller to host.
#[allow(clippy::large_enum_variant)] // there is no heap to box it on
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Message {
    /// The answer to the request of that sequence number; 0 for a frame whose number could not be read.
    Answer {
        /// The request's number.
        sequence: u32,
        /// The answer.
        answer: Answer,
    },
    /// The record of a tick, after [`Command::Stream`].
    Telemetry(Telemetry),
}

/// The answers of a controller. New answers are added at the end.
#[allow(clippy::large_enum_variant)] // there is no heap to box it on
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Answer {
    /// Done as asked.
    Done,
    /// Not in this state.
    Refused(Refusal),
    /// Not accepted.
    Rejected(Reject),
    /// The identity of a board.
    Identity(Identity),
    /// The state of a board.
    Status(Status),
    /// The parameters in use.
    Parameters {
        /// Name of the set.
        name: String<32>,
        /// Checksum of their blob, its last four bytes.
        checksum: Option<u32>,
    },
    /// Result of the model.
    Steps {
        /// Step by step.
        steps: Vec<Step, BATCH>,
        /// Cycles of the processor that all of them took.
        cycles: u32,
    },
    /// Message of the firmware's last panic; empty if there was none.
    PanicMessage(String<200>),
    /// Result of the control.
    Followed {
        /// Tick by tick.
        ticks: Vec<Followed, BATCH>,
        /// Cycles of the processor that all of them took.
        cycles: u32,
    },
    /// The amplifier is enabled, for the host that sends this token with its requests.
    Armed {
        /// Different every time; never 0.
        token: u16,
    },
    /// State of the board's parts.
    Inspection(Inspection),
    /// Result of the controller.
    Ticked {
        /// Tick by tick.
        ticks: Vec<Ticked, BATCH>,
        /// Cycles of the processor that all of them took.
        cycles: u32,
    },
    /// Not obeyed: the number of the request is not within 256 after the newest one with that token.
    Stale {
        /// The newest number.
        newest: u32,
    },
    /// Records of the flight recorder, each older than the one before; none where they end.
    FlightRecords(Vec<FlightRecord, RECORDS>),
    /// Reasons for which [`Command::Arm`] would be refused now.
    Preflight {
        /// All reasons; none if it may be armed.
        refusals: Vec<Refusal, REFUSALS>,
        /// Time since a self-test has passed, s; none since the start.
        self_test_s: Option<u32>,
    },
    /// The learned changes of the film.
    Adaptation(AdaptationStatus),
}

/// Why a frame was not obeyed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Reject {
    /// The frame was damaged.
    Damaged,
    /// The frame was intact, but this firmware does not know the message.
    Unknown,
    /// A value that is NaN or out of range.
    Value,
    /// The upload has a gap, or another length than stated.
    Upload,
    /// The blob was refused; the old parameters stay.
    Blob,
    /// There are no parameters yet.
    NoParameters,
    /// The flash failed; the old parameters stay.
    Flash,
    /// A tick rate that this board does not support; the old parameters stay.
    Rate,
    /// From another host than the one that armed.
    Token,
    /// The blob allows more than the ceilings of this board; the old parameters stay.
    Ceiling,
    /// The blob has self-sensing, and this board has no monitor of the current; the old parameters stay.
    Current,
}

impl From<FrameError> for Reject {
    fn from(error: FrameError) -> Self {
        match error {
            FrameError::Damaged | FrameError::TooLong => Self::Damaged,
            FrameError::Version(_) | FrameError::Unknown => Self::Unknown,
        }
    }
}

/// The identity of a board.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Version of the protocol.
    pub protocol: u8,
    /// Version of the parameter blob.
    pub schema: u16,
    /// The board.
    pub board: u16,
    /// Version of the firmware.
    pub firmware: String<16>,
}

/// The state of a board.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Status {
    /// The supervisor's state, with the cause of a trip.
    pub state: DriverState,
    /// Ticks per second; 0 while there are no parameters, so that it cannot be armed.
    pub rate_hz: f32,
    /// Ticks since the start, wrapping.
    pub ticks: u32,
    /// The tick of the last trip.
    pub tripped_at: u32,
    /// Voltage commanded, V.
    pub command_v: f32,
    /// Voltage at the film by the monitor, V; NaN if the monitor did not answer, and without parameters.
    pub monitor_v: f32,
    /// Whether the monitor shows more voltage than its band around 0 V.
    pub live: bool,
    /// Frames that were damaged.
    pub damaged_frames: u32,
    /// Frames that were intact but unknown.
    pub unknown_frames: u32,
    /// Largest depth of the stack so far, bytes.
    pub stack_peak: u32,
    /// Bytes that arrived faster than they could be served, and were lost with their frames: the line is flooded.
    pub lost_bytes: u32,
    /// Falls of the monitor's reading since it was armed last, such as arcs.
    pub falls: u16,
}
