//! The host's side of the link to a controller.

mod emulator;
mod log;
mod port;

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use dea_driver::wire::{
    Answer, BATCH, CHUNK, Command, FRAME_LEN, FrameError, Identity, Message, Mode, Receiver, Reject, Request, Status,
    Step, Telemetry, TickCodes, Ticked, VERSION, encode,
};
use dea_driver::{Cause, DriverState, Refusal, SCHEMA};

pub use emulator::Emulator;
pub use log::Log;
pub use port::Port;

use crate::error::{Error, Result};

/// A request that may be repeated is sent again after this time without an answer, then after twice as long, and so on.
const CALL: Duration = Duration::from_millis(250);
/// The same from who has armed, whom the board waits for: a fifth of the default heartbeat.
const HEARTBEAT: Duration = Duration::from_millis(100);

const LIVE: &str = "the film is live: its monitor showed voltage although the amplifier is disabled. Do not touch it; switch the \
                    supply off, wait, measure, and only then acknowledge";

/// A conversation with a controller.
#[derive(Debug)]
pub struct Client {
    port: Port,
    receiver: Receiver,
    sequence: u32,
    /// Token of the arming that this conversation continues; 0 without one.
    token: u16,
    samples: VecDeque<Telemetry>,
    /// Bytes since the last message.
    noise: Noise,
}

/// Disarms whatever a [`Client`] is at, from another thread. To the client it is a run that another program ended.
pub struct Stopper {
    writer: port::Writer,
    frame: Vec<u8>,
}

impl Stopper {
    /// Sends the request. Its answer is not waited for: the client shows whether it was obeyed.
    ///
    /// # Errors
    ///
    /// That of a line that is cut.
    pub fn disarm(&mut self) -> std::io::Result<()> {
        self.writer.write(&self.frame)
    }
}

/// Bytes that are no message: of another device, at another baud rate, or of other firmware.
#[derive(Debug, Default)]
struct Noise {
    bytes: usize,
    /// The first of them.
    first: Vec<u8>,
    /// Version of the link that an intact frame named.
    version: Option<u8>,
}

impl Noise {
    /// So many of the first bytes are shown.
    const SHOWN: usize = 16;

    fn push(&mut self, byte: u8) {
        self.bytes += 1;
        if self.first.len() < Self::SHOWN {
            self.first.push(byte);
        }
    }

    /// Why no answer was understood.
    fn cause(&self) -> String {
        match (self.version, self.bytes) {
            (Some(version), _) => {
                format!("version {version} of the link, this tool needs {VERSION}: flash the matching firmware")
            }
            (None, 0) => "no response: check the board's power and the port".into(),
            (None, bytes) => format!(
                "unexpected data, {bytes} bytes such as \"{}\": check that this is the controller's port",
                self.first.escape_ascii()
            ),
        }
    }
}

impl Client {
    /// Talks to the controller at `port`, and makes sure that both speak the same version.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] if there is no response, or one of another version.
    pub fn new(port: Port) -> Result<(Self, Identity)> {
        let mut client = Self {
            port,
            receiver: Receiver::new(),
            sequence: 0,
            token: 0,
            samples: VecDeque::new(),
            noise: Noise::default(),
        };
        // A frame that an earlier conversation left incomplete ends here.
        client.port.write(&[0])?;
        let identity = match client.ask(Command::Identify)? {
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

    /// Name of its port.
    pub fn port_name(&self) -> &str {
        self.port.name()
    }

    /// Sends a command and waits for its answer, for as long as the port's [`patience`](Port::patience).
    ///
    /// A request that may be obeyed twice is sent again if no answer comes: a board that is just starting does not receive the
    /// first ones, and a bit may flip on the way. Any other is sent once, since an answer that is late or lost does not show
    /// whether it was obeyed.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] where no answer comes, or the request was damaged on its way.
    pub fn ask(&mut self, command: Command) -> Result<Answer> {
        let deadline = Instant::now() + self.port.patience();
        let repeats = may_be_repeated(&command);
        let mut request = Request { sequence: self.sequence, token: self.token, command };
        let mut sent = Vec::new();
        let mut rejected = None;
        // Who has armed is waited for.
        let mut call = if self.token == 0 { CALL } else { HEARTBEAT };
        let mut is_counted = false;
        'calls: loop {
            request.sequence = request.sequence.wrapping_add(1).max(1);
            self.sequence = request.sequence;
            sent.push(request.sequence);
            self.send(&request)?;
            let until = if repeats { deadline.min(Instant::now() + call) } else { deadline };
            call *= 2;
            while let Some(message) = self.receive(until)? {
                match message {
                    // It is not obeyed yet: a conversation that this one goes on with has counted further.
                    Message::Answer { sequence, answer: Answer::Stale { newest } }
                        if sent.contains(&sequence) && !is_counted =>
                    {
                        is_counted = true;
                        request.sequence = newest;
                        continue 'calls;
                    }
                    // A late answer to an earlier call is as good.
                    Message::Answer { sequence, answer } if sent.contains(&sequence) => return Ok(answer),
                    Message::Answer { sequence: 0, answer: Answer::Rejected(reject) } => {
                        rejected = Some(reject);
                        if !repeats {
                            break;
                        }
                    }
                    Message::Answer { .. } => {}
                    Message::Telemetry(sample) => self.samples.push_back(sample),
                }
            }
            // Firmware of another version does not answer later either.
            if !repeats || self.noise.version.is_some() || Instant::now() >= deadline {
                return Err(self.fault(match rejected {
                    Some(reject) => format!("the request did not arrive as it was sent ({reject:?}); check the wire"),
                    None => self.noise.cause(),
                }));
            }
        }
    }

    /// Another way to end a run: past everything that this conversation waits for.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] where the system gives the line no second writer.
    pub fn stopper(&self) -> Result<Stopper> {
        let mut frame = [0; FRAME_LEN + 1];
        let request = Request { sequence: 0, token: 0, command: Command::Disarm };
        let length = encode(&request, &mut frame).map_err(|e| self.fault(format!("{e:?}")))?;
        // What of another frame comes before it ends with the 0.
        let writer = self.port.writer().map_err(|e| self.fault(e.to_string()))?;
        Ok(Stopper { writer, frame: [&[0], &frame[..length]].concat() })
    }

    fn send(&mut self, request: &Request) -> Result<()> {
        let mut frame = [0; FRAME_LEN + 1];
        let length = encode(request, &mut frame).map_err(|e| self.fault(format!("{e:?}")))?;
        self.port.write(&frame[..length])
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

    /// Enables the amplifier at 0 V. From here on this conversation may start a run and set its targets. Returns the token with
    /// which another one may [go on](Self::go_on).
    pub fn arm(&mut self) -> Result<u16> {
        self.arm_by(Command::Arm)
    }

    /// The same for a self-test: 500 V at the most.
    pub fn arm_for_self_test(&mut self) -> Result<u16> {
        self.arm_by(Command::ArmForSelfTest)
    }

    fn arm_by(&mut self, command: Command) -> Result<u16> {
        match self.ask(command)? {
            Answer::Armed { token } => {
                self.token = token;
                Ok(token)
            }
            other => Err(self.unexpected(&other)),
        }
    }

    /// Whether the film is at 0 V, but not yet for as long as the board wants to see before it is armed. What else is against it
    /// [`arm`](Self::arm) says.
    pub fn waits_at_0_v(&mut self) -> Result<bool> {
        let Status { live, monitor_v, .. } = self.status()?;
        let is_at_0_v = !live && !monitor_v.is_nan();
        let is_awaited =
            |answer| matches!(answer, Answer::Preflight { refusals, .. } if refusals.contains(&Refusal::LiveVoltage));
        Ok(is_at_0_v && is_awaited(self.ask(Command::Preflight)?))
    }

    /// Goes on where the conversation left off that armed and got this token.
    pub fn go_on(&mut self, token: u16) {
        self.token = token;
    }

    /// How things are.
    pub fn status(&mut self) -> Result<Status> {
        match self.ask(Command::Status)? {
            Answer::Status(status) => Ok(status),
            other => Err(self.unexpected(&other)),
        }
    }

    /// Uploads a parameter blob; it is kept over a reset if that is wanted.
    pub fn upload(&mut self, blob: &[u8], keep: bool) -> Result<()> {
        for (index, piece) in blob.chunks(CHUNK).enumerate() {
            let bytes = piece.iter().copied().collect();
            self.order(Command::Upload { offset: (index * CHUNK) as u16, bytes })?;
        }
        let length = blob.len() as u16;
        self.order(if keep { Command::Commit { length } } else { Command::Try { length } })
    }

    /// Steps of the loop test under `voltages`, a batch at the most, and the cycles they took.
    pub fn step(&mut self, voltages: &[f32]) -> Result<(heapless::Vec<Step, BATCH>, u32)> {
        match self.ask(Command::Step(voltages.iter().copied().collect()))? {
            Answer::Steps { steps, cycles } if steps.len() == voltages.len() => Ok((steps, cycles)),
            other => Err(self.unexpected(&other)),
        }
    }

    /// Whole ticks of the loop test on `codes`, a batch at the most, and the cycles they took.
    pub fn tick(&mut self, mode: Mode, codes: &[TickCodes]) -> Result<(heapless::Vec<Ticked, BATCH>, u32)> {
        match self.ask(Command::Tick { mode, inputs: codes.iter().copied().collect() })? {
            Answer::Ticked { ticks, cycles } if ticks.len() == codes.len() => Ok((ticks, cycles)),
            other => Err(self.unexpected(&other)),
        }
    }

    /// Samples of a stream that have come while something else was waited for.
    pub fn waiting_samples(&mut self) -> VecDeque<Telemetry> {
        std::mem::take(&mut self.samples)
    }

    /// The next sample of a stream; nothing if none comes before `deadline`.
    pub fn sample(&mut self, deadline: Instant) -> Result<Option<Telemetry>> {
        if let Some(sample) = self.samples.pop_front() {
            return Ok(Some(sample));
        }
        while let Some(message) = self.receive(deadline)? {
            // An answer that comes now is too late: no request waits for it any more.
            if let Message::Telemetry(sample) = message {
                return Ok(Some(sample));
            }
        }
        Ok(None)
    }

    /// The next message; nothing if none comes before `deadline`.
    fn receive(&mut self, deadline: Instant) -> Result<Option<Message>> {
        while let Some(byte) = self.port.byte(deadline)? {
            self.noise.push(byte);
            match self.receiver.push(byte) {
                Some(Ok(message)) => {
                    self.noise = Noise::default();
                    return Ok(Some(message));
                }
                Some(Err(FrameError::Version(version))) => self.noise.version = Some(version),
                // A message that was damaged on its way is missed by the request that waits for it.
                Some(Err(_)) | None => {}
            }
        }
        Ok(None)
    }

    fn fault(&self, cause: impl Into<String>) -> Error {
        Error::Link { port: self.port.name().into(), cause: cause.into() }
    }

    /// Makes sure that the controller runs the parameters with this checksum: after a reset, or with a damaged flash, it may run
    /// others than were uploaded last.
    ///
    /// # Errors
    ///
    /// [`Error::Link`], naming those that it runs.
    pub fn expect_parameters(&mut self, expected: u32) -> Result<()> {
        match self.ask(Command::Query)? {
            Answer::Parameters { checksum: Some(checksum), .. } if checksum == expected => Ok(()),
            Answer::Parameters { name, checksum } => {
                let found = checksum.map_or("unknown".into(), |checksum| format!("{checksum:08x}"));
                Err(self.fault(format!(
                    "it runs the parameters {name} with the checksum {found}, not {expected:08x} as given; upload these, or leave \
                     them out"
                )))
            }
            other => Err(self.unexpected(&other)),
        }
    }

    /// There is voltage on a film whose amplifier is disabled, or there was.
    pub fn film_is_live(&self, status: &Status) -> Error {
        let now = if status.monitor_v.is_nan() {
            "the monitor does not answer".to_owned()
        } else {
            format!("monitor: {:.0} V", status.monitor_v)
        };
        self.fault(format!("{LIVE} ({now})"))
    }

    /// It is unknown whether there is voltage on the film.
    pub fn film_is_unknown(&self) -> Error {
        self.fault("no reading of the voltage monitor: treat the film as live, measure before you touch it")
    }

    /// It answers, and sends no samples of its ticks.
    pub fn silent_stream(&self) -> Error {
        self.fault("it answers, but its stream has stopped: without its ticks its progress is unknown")
    }

    /// Error for an unexpected answer.
    pub fn unexpected(&self, answer: &Answer) -> Error {
        self.fault(match answer {
            Answer::Refused(Refusal::State(DriverState::Tripped(Cause::LiveFilm))) => LIVE.into(),
            Answer::Refused(Refusal::State(DriverState::Tripped(cause))) => {
                format!("tripped ({cause:?}); find out why, then acknowledge")
            }
            Answer::Refused(Refusal::State(state)) => format!("not while it is {}", named(*state)),
            Answer::Refused(Refusal::InterlockOpen) => "the interlock is open".into(),
            Answer::Refused(Refusal::LiveVoltage) => {
                "the voltage monitor does not read 0 V, or did not within discharge_s; is it connected, and the film discharged?".into()
            }
            Answer::Refused(Refusal::Sensor(fault)) => {
                format!("displacement sensor implausible ({fault:?}): check its connection")
            }
            Answer::Refused(Refusal::SelfTest) => {
                "no self-test has passed since its start, which the parameters ask for above self_test_above_v".into()
            }
            Answer::Stale { .. } => "the request came too late, or twice, and was not obeyed".into(),
            Answer::Rejected(Reject::Value) => "the value is beyond the limits of the parameters".into(),
            Answer::Rejected(Reject::Blob) => "the parameter blob was refused; was it made for this board?".into(),
            Answer::Rejected(Reject::Ceiling) => {
                "the limits are above the ceilings of the board's firmware, which no parameters raise".into()
            }
            Answer::Rejected(Reject::Current) => {
                "this board has no monitor of the current, which self-sensing needs: leave it out of the parameters".into()
            }
            Answer::Rejected(Reject::Rate) => {
                "the board cannot tick at that rate; export with another `rate_hz`".into()
            }
            Answer::Rejected(Reject::NoParameters) => "there are no parameters yet; upload some".into(),
            Answer::Rejected(Reject::Flash) => "the flash did not take the parameters; the old ones stay".into(),
            Answer::Rejected(Reject::Unknown) => "the firmware does not know that command".into(),
            Answer::Rejected(Reject::Token) => {
                "another host armed it; disarm and arm here, or give the `token` that `arm` printed".into()
            }
            other => format!("unexpected answer {other:?}"),
        })
    }
}

/// Whether a request may be obeyed twice without anybody noticing.
fn may_be_repeated(command: &Command) -> bool {
    use Command::{
        Disarm, Heartbeat, Identify, Inspect, PanicMessage, Query, SetReference, SetVoltage, Status, Stream,
    };
    let asks = matches!(command, Identify | Status | Query | PanicMessage | Inspect);
    asks || matches!(command, Heartbeat | SetVoltage(_) | SetReference(_) | Disarm | Stream { .. })
}

/// A state in words.
pub fn named(state: DriverState) -> String {
    match state {
        DriverState::Disarmed => "disarmed".into(),
        DriverState::Armed => "armed".into(),
        DriverState::Running => "running".into(),
        DriverState::Tripped(cause) => format!("tripped: {cause:?}"),
    }
}
