//! What controller and host say to each other.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use crate::safety::{Refusal, State};
use crate::wire::FrameError;

/// Steps of a loop test in one frame.
pub const BATCH: usize = 24;

/// Bytes of an upload in one frame.
pub const CHUNK: usize = 128;

/// From host to controller. Every request is answered, with its sequence number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Chosen by the host; comes back with the answer.
    pub sequence: u16,
    /// What is asked for.
    pub command: Command,
}

/// What a host can ask for. New commands are added at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Command {
    /// Who is there? Answered by [`Answer::Identity`].
    Identify,
    /// The host is alive.
    Heartbeat,
    /// Answered by [`Answer::Status`].
    Status,
    /// Enable the amplifier at 0 V.
    Arm,
    /// Let the law command the voltage.
    Start(Mode),
    /// Back to 0 V, amplifier enabled.
    Stop,
    /// Back to 0 V, amplifier disabled.
    Disarm,
    /// Take note of a trip.
    Acknowledge,
    /// The voltage of [`Mode::Voltage`], V at the film.
    SetVoltage(f32),
    /// The displacement of [`Mode::Feedforward`] and [`Mode::Tracking`], m.
    SetReference(f32),
    /// Part of a parameter blob, in order.
    Upload {
        /// Where it belongs.
        offset: u16,
        /// The bytes.
        bytes: Vec<u8, CHUNK>,
    },
    /// Check the blob that was uploaded, keep it, and run it from now on. Only while the amplifier is
    /// disabled.
    Commit {
        /// Length of the blob.
        length: u16,
    },
    /// Answered by [`Answer::Name`].
    Query,
    /// Send every so-many-th tick as [`Message::Telemetry`]; 0 ends it.
    Stream {
        /// Ticks per sample.
        every: u16,
    },
    /// Bring the model of the loop test to rest at x = 0. Only while the amplifier is disabled.
    Rest,
    /// Step a model of its own under these voltages (V), without hardware: the loop test. Only while the amplifier is
    /// disabled. Answered by [`Answer::Steps`].
    Step(Vec<f32, BATCH>),
    /// Check the blob that was uploaded and run it until the next reset, without keeping it. Only while the amplifier is
    /// disabled.
    Try {
        /// Length of the blob.
        length: u16,
    },
    /// Answered by [`Answer::PanicMessage`].
    PanicMessage,
    /// Go wrong on purpose. Images for use reject it.
    Drill(Drill),
    /// Tick the control on a film of its own, without hardware: the loop test of the laws of control. Only while the
    /// amplifier is disabled. Answered by [`Answer::Followed`].
    Follow {
        /// The law.
        mode: Mode,
        /// Tick by tick.
        targets: Vec<Target, BATCH>,
    },
    /// Run the parameters that are kept, as after a reset. Only while the amplifier is disabled.
    Reload,
}

/// What a tick of a loop test gets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// The voltage (V) of [`Mode::Voltage`], the reference (m) of the others.
    pub value: f32,
    /// A sample of the displacement sensor, m, if one has come.
    pub sample_m: Option<f32>,
}

/// Ways to go wrong, of an image that was built to show how each ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Drill {
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

/// What the law does while running.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// The film gets the voltage that was set; the observer follows it.
    Voltage,
    /// The film gets the voltage that brings the model to the reference; the sensor is only watched.
    Feedforward,
    /// The same, less the disturbance that the observer sees.
    Tracking,
}

/// From controller to host.
#[allow(clippy::large_enum_variant)] // there is no heap to box it on
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Message {
    /// The answer to the request of that sequence number; 0 for a frame whose number could not be read.
    Answer {
        /// The request's number.
        sequence: u16,
        /// The answer.
        answer: Answer,
    },
    /// A sample that was asked for by [`Command::Stream`].
    Telemetry(Sample),
}

/// What a controller can answer. New answers are added at the end.
#[allow(clippy::large_enum_variant)] // there is no heap to box it on
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Answer {
    /// Done as asked.
    Done,
    /// Not in this state.
    Refused(Refusal),
    /// Not as it was sent.
    Rejected(Reject),
    /// Who is here.
    Identity(Identity),
    /// How things are.
    Status(Status),
    /// What the parameters are called.
    Name(String<32>),
    /// What the model did.
    Steps {
        /// Step by step.
        steps: Vec<Step, BATCH>,
        /// Cycles of the processor that all of them took.
        cycles: u32,
    },
    /// What the firmware said when it panicked last; empty if it never did.
    PanicMessage(String<200>),
    /// What the control did.
    Followed {
        /// Tick by tick.
        ticks: Vec<Followed, BATCH>,
        /// Cycles of the processor that all of them took.
        cycles: u32,
    },
}

/// Why a frame was not obeyed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Reject {
    /// The frame was damaged.
    Damaged,
    /// The frame was whole, but this firmware does not know what it says.
    Unknown,
    /// A value that is not a number, or out of range.
    Value,
    /// The upload has a gap, or another length than it should.
    Upload,
    /// The blob was refused; the old parameters stay.
    Blob,
    /// There are no parameters yet.
    NoParameters,
    /// The flash failed; the old parameters stay.
    Flash,
    /// Ticks slower or faster than this board can; the old parameters stay.
    Rate,
}

impl From<FrameError> for Reject {
    fn from(error: FrameError) -> Self {
        match error {
            FrameError::Damaged | FrameError::TooLong => Self::Damaged,
            FrameError::Version(_) | FrameError::Unknown => Self::Unknown,
        }
    }
}

/// Who is here.
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

/// How things are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Status {
    /// The supervisor's state, with the cause of a trip.
    pub state: State,
    /// Ticks per second; 0 while there are no parameters, so that it cannot be armed.
    pub rate_hz: f32,
    /// Ticks since the start, wrapping.
    pub ticks: u32,
    /// The tick of the last trip.
    pub tripped_at: u32,
    /// Voltage commanded, V.
    pub command_v: f32,
    /// Frames that were damaged.
    pub damaged_frames: u32,
    /// Frames that were not understood.
    pub unknown_frames: u32,
    /// Largest depth of the stack so far, bytes.
    pub stack_peak: u32,
}

/// A tick, for the host's log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sample {
    /// The tick.
    pub tick: u32,
    /// Samples that were dropped before this one, because the link was busy.
    pub dropped: u32,
    /// Voltage commanded, V.
    pub command_v: f32,
    /// Voltage monitor, V.
    pub monitor_v: f32,
    /// Displacement sensor, m.
    pub displacement_m: f32,
    /// Displacement that the model predicts, corrected by the sensor, m.
    pub predicted_m: f32,
    /// The shaped reference; of [`Mode::Voltage`] the prediction, m.
    pub reference_m: f32,
    /// Force that the model does not know, N.
    pub disturbance_n: f32,
    /// Electrostatic force in units of what the model takes it for.
    pub force_scale: f32,
    /// The last sample minus what was predicted for its time, m.
    pub innovation_m: f32,
    /// Limits that the command met, as bits ([`springpot::Limited`]).
    pub limited: u8,
}

/// A step of the model in a loop test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Step {
    /// Displacement under the voltage, m.
    pub displacement_m: f32,
    /// The force that holds the film there at the next step, N: it sums up the model's whole state.
    pub force_n: f32,
    /// The voltage that the inverse of Eq. 1 finds for the force of this step, V.
    pub voltage_v: f32,
}

/// A tick of the control in a loop test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Followed {
    /// The voltage that is commanded, V.
    pub voltage_v: f32,
    /// The estimated displacement, m.
    pub displacement_m: f32,
    /// The estimated disturbance, N.
    pub disturbance_n: f32,
}
