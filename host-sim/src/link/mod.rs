//! The host's side of the link to a controller.

mod emulator;
mod port;

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use dea_driver::wire::{
    Answer, BATCH, CHUNK, Command, FRAME_LEN, Identity, Message, Receiver, Reject, Request, Status, Step, Telemetry,
    VERSION, encode,
};
use dea_driver::{Refusal, SCHEMA, State};

pub use emulator::Emulator;
pub use port::Port;

use crate::error::{Error, Result};

/// For so long an answer may take: the flash needs a second for two sectors.
const PATIENCE: Duration = Duration::from_secs(5);

/// And so long the first of all.
const CALL: Duration = Duration::from_millis(250);

/// After so long without a message, whoever waits for one is asked again whether to wait.
const MOMENT: Duration = Duration::from_millis(50);

/// A conversation with a controller.
#[derive(Debug)]
pub struct Client {
    port: Port,
    receiver: Receiver,
    sequence: u16,
    samples: VecDeque<Telemetry>,
}

impl Client {
    /// Talks to the controller at `port`, and makes sure that both speak the same version.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] where nobody answers, or somebody of another version.
    pub fn new(port: Port) -> Result<(Self, Identity)> {
        let mut client = Self { port, receiver: Receiver::new(), sequence: 0, samples: VecDeque::new() };
        // What an earlier conversation left half said ends here.
        client.port.write(&[0])?;
        // A board that is just starting does not hear the first calls.
        let start = Instant::now();
        let answer = loop {
            match client.ask_within(Command::Identify, CALL) {
                Err(_) if start.elapsed() < PATIENCE => {}
                answer => break answer?,
            }
        };
        let identity = match answer {
            Answer::Identity(identity) => identity,
            other => return Err(client.unexpected(&other)),
        };
        if identity.protocol != VERSION || identity.schema != SCHEMA {
            return Err(client.fault(format!(
                "firmware {} speaks version {} of the link and reads version {} of the blob, this tool {VERSION} and {SCHEMA}; \
                 flash the firmware of this tool",
                identity.firmware, identity.protocol, identity.schema
            )));
        }
        Ok((client, identity))
    }

    /// The line itself, past which nothing is sent or received.
    pub fn port_mut(&mut self) -> &mut Port {
        &mut self.port
    }

    /// Sends a command and waits for its answer.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] where none comes, or the request was damaged on its way.
    pub fn ask(&mut self, command: Command) -> Result<Answer> {
        self.ask_within(command, PATIENCE)
    }

    fn ask_within(&mut self, command: Command, patience: Duration) -> Result<Answer> {
        self.sequence = self.sequence.wrapping_add(1).max(1);
        let mut frame = [0; FRAME_LEN + 1];
        let request = Request { sequence: self.sequence, command };
        let length = encode(&request, &mut frame).map_err(|e| self.fault(format!("{e:?}")))?;
        self.port.write(&frame[..length])?;
        let start = Instant::now();
        while start.elapsed() < patience {
            match self.receive()? {
                Some(Message::Answer { sequence, answer }) if sequence == self.sequence => return Ok(answer),
                Some(Message::Answer { sequence: 0, answer: Answer::Rejected(reject) }) => {
                    return Err(
                        self.fault(format!("the request did not arrive as it was sent ({reject:?}); check the wire"))
                    );
                }
                _ => {}
            }
        }
        Err(self.fault("nobody answers; is the board powered, and is this its port?"))
    }

    /// Sends a command that is either done or not.
    ///
    /// # Errors
    ///
    /// [`Error::Link`], with what the controller says against it.
    pub fn order(&mut self, command: Command) -> Result<()> {
        match self.ask(command)? {
            Answer::Done => Ok(()),
            other => Err(self.unexpected(&other)),
        }
    }

    /// How things are.
    ///
    /// # Errors
    ///
    /// As [`ask`](Self::ask).
    pub fn status(&mut self) -> Result<Status> {
        match self.ask(Command::Status)? {
            Answer::Status(status) => Ok(status),
            other => Err(self.unexpected(&other)),
        }
    }

    /// Uploads a parameter blob; it is kept over a reset if that is wanted.
    ///
    /// # Errors
    ///
    /// As [`order`](Self::order).
    pub fn upload(&mut self, blob: &[u8], keep: bool) -> Result<()> {
        for (index, piece) in blob.chunks(CHUNK).enumerate() {
            let bytes = piece.iter().copied().collect();
            self.order(Command::Upload { offset: (index * CHUNK) as u16, bytes })?;
        }
        let length = blob.len() as u16;
        self.order(if keep { Command::Commit { length } } else { Command::Try { length } })
    }

    /// Steps of the loop test under `voltages`, a batch at the most, and the cycles they took.
    ///
    /// # Errors
    ///
    /// As [`ask`](Self::ask).
    pub fn step(&mut self, voltages: &[f32]) -> Result<(heapless::Vec<Step, BATCH>, u32)> {
        match self.ask(Command::Step(voltages.iter().copied().collect()))? {
            Answer::Steps { steps, cycles } if steps.len() == voltages.len() => Ok((steps, cycles)),
            other => Err(self.unexpected(&other)),
        }
    }

    /// The next sample of a stream, if one has come.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] for a port that fails.
    pub fn sample(&mut self) -> Result<Option<Telemetry>> {
        if self.samples.is_empty() {
            self.receive()?;
        }
        Ok(self.samples.pop_front())
    }

    /// The next answer, after the samples that came before it; nothing if the line is silent for a moment, or says nothing
    /// that could be understood for a while.
    fn receive(&mut self) -> Result<Option<Message>> {
        let start = Instant::now();
        while let Some(byte) = self.port.byte()? {
            match self.receiver.push(byte) {
                Some(Ok(Message::Telemetry(sample))) => {
                    self.samples.push_back(sample);
                    return Ok(None);
                }
                Some(Ok(message)) => return Ok(Some(message)),
                // What was damaged on its way is asked for again by whoever misses it.
                Some(Err(_)) | None => {}
            }
            if start.elapsed() > MOMENT {
                break;
            }
        }
        Ok(None)
    }

    fn fault(&self, cause: impl Into<String>) -> Error {
        Error::Link { port: self.port.name().into(), cause: cause.into() }
    }

    /// What an answer other than the one hoped for means.
    pub fn unexpected(&self, answer: &Answer) -> Error {
        self.fault(match answer {
            Answer::Refused(Refusal::State(State::Tripped(cause))) => {
                format!("tripped ({cause:?}); find out why, then acknowledge")
            }
            Answer::Refused(Refusal::State(state)) => format!("not while it is {}", named(*state)),
            Answer::Refused(Refusal::InterlockOpen) => "the interlock is open".into(),
            Answer::Refused(Refusal::LiveVoltage) => {
                "the voltage monitor does not read 0 V; is it connected, and the film discharged?".into()
            }
            Answer::Refused(Refusal::Sensor(fault)) => {
                format!("the displacement sensor cannot be believed ({fault:?}); is it connected?")
            }
            Answer::Rejected(Reject::Value) => "the value is beyond the limits of the parameters".into(),
            Answer::Rejected(Reject::Blob) => "the parameter blob was refused; was it made for this board?".into(),
            Answer::Rejected(Reject::Rate) => "the board cannot tick at that rate; export with another --rate".into(),
            Answer::Rejected(Reject::NoParameters) => "there are no parameters yet; upload some".into(),
            Answer::Rejected(Reject::Flash) => "the flash did not take the parameters; the old ones stay".into(),
            Answer::Rejected(Reject::Unknown) => "the firmware does not know that command".into(),
            other => format!("unexpected answer {other:?}"),
        })
    }
}

/// A state in words.
pub fn named(state: State) -> String {
    match state {
        State::Disarmed => "disarmed".into(),
        State::Armed => "armed".into(),
        State::Running => "running".into(),
        State::Tripped(cause) => format!("tripped: {cause:?}"),
    }
}
