//! The link for people: one verb per request, and two that keep talking.

mod adaptation;
mod asking;
mod bench;
mod board_time;
mod fault_injection;
mod flight_recorder;
mod live;
mod self_test;
mod status;

pub(super) use self::bench::LinkedBench;

use std::sync::atomic::AtomicBool;

use clap::{Subcommand, ValueEnum};
use dea_driver::wire::{Answer, Command, Identity, LearningOrder};
use dea_driver::{Blob, BlobHeader};

use super::options::{blob_to_drive, load_at};
use crate::bench::reference::What;
use crate::commands::prelude::*;
use crate::link::{Client, Port};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Port of the controller: a serial port such as /dev/ttyUSB0, or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT")]
    port: String,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Print board, firmware and parameters.
    Identify,
    /// State, last trip, voltage, damaged frames.
    Status,
    /// Enable the amplifier at 0 V and print a token. The board trips if this host is silent for longer than heartbeat_s;
    /// `play` sends heartbeats.
    Arm,
    /// Begin a run, at 0 V.
    Start {
        /// Quantity that the controller follows.
        #[arg(value_enum)]
        mode: What,
        #[command(flatten)]
        token: Token,
    },
    /// Back to 0 V, amplifier enabled.
    Stop,
    /// Return to 0 V and disable the amplifier.
    Disarm,
    /// Acknowledge a trip.
    Acknowledge,
    /// Load the stored parameters, as after a reset.
    Reload,
    /// Set the voltage or the displacement of the run.
    Set(Set),
    /// Forget what was learned of a periodic reference, or carry it over to the next run, for parameters with board.control.harmonics.
    Learning {
        /// Use of what was learned.
        #[arg(value_enum)]
        order: Order,
        #[command(flatten)]
        token: Token,
    },
    /// Let the law follow a film that changes, or not, and show how far the film has moved from it.
    Adaptation(adaptation::Adaptation),
    /// Send parameters and store them on the board.
    Upload(Upload),
    /// Write what the controller measures and predicts to a file, until Ctrl-C.
    Stream(live::Stream),
    /// Arm, play the voltage or the displacement of a recording, and disarm; Ctrl-C ends it at 0 V.
    Play(live::Play),
    /// Print the message of the last panic of the firmware.
    Panic,
    /// Show all that is in the way of arming, without a voltage: state, parameters, interlock, converters, sensor, monitor, and when the last
    /// self-test was.
    Preflight,
    /// Show how the last run ended: its last two seconds, also after a trip or a reset, as long as the board has its supply.
    FlightRecorder(flight_recorder::FlightRecorder),
    /// Cause faults on purpose, one after another, and show that each ends at 0 V: on the virtual board (`cargo xtask board`) alone.
    #[command(name = "drill")]
    FaultInjection(fault_injection::FaultInjection),
    /// Check buses, converters, enable output, interlock and monitor, at 50 V at the most: the first thing to run on a new board, and
    /// before a film is connected.
    SelfTest(self_test::SelfTest),
}

/// Use of what was learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Order {
    /// It is forgotten now.
    Forget,
    /// The next run begins with it; it must follow the same reference from its beginning on.
    CarryOver,
}

#[derive(Debug, Args)]
struct Set {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    token: Token,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Target {
    /// Voltage at the film, V.
    #[arg(long, value_name = "V", value_parser = quantity::volts)]
    voltage: Option<f64>,
    /// Displacement, m.
    #[arg(long, value_name = "M", value_parser = quantity::metres)]
    reference: Option<f64>,
}

#[derive(Clone, Copy, Debug, Args)]
struct Token {
    /// Token that `arm` printed: only the host that armed may continue.
    #[arg(long, value_name = "N", default_value_t = 0)]
    token: u16,
}

#[derive(Serialize)]
struct Armed {
    port: String,
    done: &'static str,
    token: u16,
}

#[derive(Debug, Args)]
struct Upload {
    #[command(flatten)]
    source: Source,
    /// Only run them until the next reset.
    #[arg(long = "try")]
    only_try: bool,
}

/// Where a blob comes from.
#[derive(Debug, Args)]
struct Source {
    /// Parameter file (TOML), or preset:NAME such as preset:table3-n2.
    #[arg(long, value_name = "P", conflicts_with = "blob")]
    params: Option<String>,
    /// Temperature of the film, °C, where it was fitted at several; that of its parameters if left out.
    #[arg(long, value_name = "C", allow_negative_numbers = true, value_parser = quantity::celsius, requires = "params", conflicts_with = "blob")]
    temperature: Option<f64>,
    /// A blob that `export` wrote.
    #[arg(long, value_name = "P.bin")]
    blob: Option<PathBuf>,
    /// Ticks per second.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz, default_value_t = 1000.0, conflicts_with = "blob")]
    rate: f64,
    /// Take calibrations and limits of the paper's bench (10 V for 10 kV, 6 kV at the most) where the file has none.
    #[arg(long)]
    bench: bool,
}

/// Report of a verb without figures.
#[derive(Serialize)]
struct Done {
    port: String,
    done: &'static str,
}

#[derive(Serialize)]
struct Who {
    port: String,
    firmware: String,
    board: u16,
    protocol: u8,
    schema: u16,
    /// Name of the parameters; null without parameters.
    parameters: Option<String>,
    /// Checksum of their blob, as hexadecimal digits.
    checksum: Option<String>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    // Errors in files are reported before the port is opened.
    let blob = match &arguments.verb {
        Verb::Upload(upload) => match upload.source.blob()? {
            Some(blob) => Some(blob),
            None => return Err(Error::field("params", "parameters are needed: --params P, or --blob P.bin")),
        },
        Verb::Play(play) => play.check()?,
        Verb::Stream(stream) => stream.check().map(|()| None)?,
        Verb::SelfTest(test) => test.check().map(|()| None)?,
        Verb::FaultInjection(faults) => faults.check().map(|()| None)?,
        Verb::FlightRecorder(recorder) => recorder.check().map(|()| None)?,
        Verb::Adaptation(adaptation) => adaptation.check()?,
        _ => None,
    };
    let (mut client, identity) = Client::new(Port::open(&arguments.port)?)?;
    let port = arguments.port.clone();
    let done = match &arguments.verb {
        Verb::Identify => return identify(client, &identity, port, json),
        Verb::Status => return status::report(client, port, json),
        Verb::Adaptation(adaptation) => return adaptation.run(client, blob.as_deref(), port, json),
        Verb::Panic => return panicked(client, port, json),
        Verb::Stream(stream) => return stream.run(client, json),
        Verb::SelfTest(test) => return test.run(client, &identity, port, json),
        Verb::FaultInjection(faults) => return faults.run(client, port, json),
        Verb::Preflight => return self_test::SelfTest::preflight(client, identity.board, port, json),
        Verb::FlightRecorder(recorder) => return recorder.run(client, port, json),
        Verb::Play(play) => return play.run(client, blob.as_deref(), json),
        Verb::Arm => {
            asking::until_discharged(&mut client, &AtomicBool::new(false))?;
            let armed = Armed { port, done: "armed", token: client.arm()? };
            return terminal::report(json, &armed, || format!("{}: armed; --token {}", armed.port, armed.token));
        }
        Verb::Start { mode, token } => {
            client.go_on(token.token);
            client.order(Command::Start((*mode).into())).map(|()| "running")
        }
        Verb::Stop => client.order(Command::Stop).map(|()| "stopped: 0 V, still armed"),
        Verb::Disarm => live::disarm(&mut client).map(|()| "disarmed"),
        Verb::Acknowledge => client.order(Command::Acknowledge).map(|()| "acknowledged"),
        Verb::Reload => client.order(Command::Reload).map(|()| "runs the parameters that it keeps"),
        Verb::Set(set) => {
            client.go_on(set.token.token);
            client.order(set.target.command()).map(|()| "set")
        }
        Verb::Learning { order, token } => {
            client.go_on(token.token);
            let (order, done) = match order {
                Order::Forget => (LearningOrder::Forget, "what was learned is forgotten"),
                Order::CarryOver => (LearningOrder::CarryOver, "the next run begins with what was learned"),
            };
            client.order(Command::Learning(order)).map(|()| done)
        }
        Verb::Upload(upload) => {
            client.upload(&blob.unwrap_or_default(), !upload.only_try)?;
            Ok(if upload.only_try {
                "runs these parameters until the next reset"
            } else {
                "runs and keeps these parameters"
            })
        }
    }?;
    terminal::report(json, &Done { port: port.clone(), done }, || format!("{port}: {done}"))
}

impl Target {
    fn command(&self) -> Command {
        match (self.voltage, self.reference) {
            (Some(volts), _) => Command::SetVoltage(volts as f32),
            (None, metres) => Command::SetReference(metres.unwrap_or_default() as f32),
        }
    }
}

impl Source {
    /// Whether parameters are named.
    fn is_given(&self) -> bool {
        self.params.is_some() || self.blob.is_some()
    }

    /// The blob, if there is to be one.
    fn blob(&self) -> Result<Option<Vec<u8>>> {
        Ok(Some(match (&self.params, &self.blob) {
            (None, None) => return Ok(None),
            (Some(params), _) => {
                let parameters = load_at(params, "temperature", self.temperature)?;
                blob_to_drive(params, &parameters, self.rate, self.bench)?
            }
            (None, Some(path)) => {
                let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
                // A blob for another board is refused there; whatever else is wrong is found here.
                let refused = |error| Error::file(path, error);
                let board = BlobHeader::read(&bytes).map_err(refused)?.board;
                Blob::decode(&bytes, board).map_err(refused)?;
                bytes
            }
        }))
    }
}

/// Name and checksum of the parameters of a board, if it has any.
fn parameters_of(client: &mut Client) -> Result<Option<(String, Option<u32>)>> {
    Ok(match client.ask(Command::Query)? {
        Answer::Parameters { name, checksum } => Some((name.to_string(), checksum)),
        _ => None,
    })
}

/// A checksum as people compare it.
fn digits(checksum: Option<u32>) -> Option<String> {
    checksum.map(|checksum| format!("{checksum:08x}"))
}

fn identify(mut client: Client, identity: &Identity, port: String, json: bool) -> Result<()> {
    let (parameters, checksum) = parameters_of(&mut client)?.unzip();
    let who = Who {
        port,
        firmware: identity.firmware.to_string(),
        board: identity.board,
        protocol: identity.protocol,
        schema: identity.schema,
        parameters,
        checksum: digits(checksum.flatten()),
    };
    terminal::report(json, &who, || {
        let checksum = who.checksum.as_deref().unwrap_or("unknown");
        let parameters = who
            .parameters
            .as_deref()
            .map_or("no parameters yet".into(), |name| format!("parameters {name}, checksum {checksum}"));
        format!("{}: firmware {} on board {:#06x}, {parameters}", who.port, who.firmware, who.board)
    })
}

#[derive(Serialize)]
struct LastPanic {
    port: String,
    message: Option<String>,
}

fn panicked(mut client: Client, port: String, json: bool) -> Result<()> {
    let message = match client.ask(Command::PanicMessage)? {
        Answer::PanicMessage(text) => Some(text.to_string()).filter(|text| !text.is_empty()),
        other => return Err(client.unexpected(&other)),
    };
    let last = LastPanic { port, message };
    terminal::report(json, &last, || {
        let message = last.message.as_deref().unwrap_or("the firmware did not panic before this start");
        format!("{}: {}", last.port, shown(message.as_ref()))
    })
}
