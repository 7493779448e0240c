//! `link drill`: faults that the virtual board causes on purpose, and how each of them ends.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use dea_driver::wire::{Answer, Command, InjectedFault, Mode, Reject, Status};
use dea_driver::{Cause, DriverState, SensorFault};

use super::asking::{PATIENCE, going_on, hold, some_ticks, until_discharged, wait};
use super::live;
use crate::commands::prelude::*;
use crate::interrupt;
use crate::link::{Client, named};

/// Longest time of a board that panics until it answers again.
const COMES_BACK: Duration = Duration::from_secs(60);

#[derive(Debug, Args)]
pub(super) struct FaultInjection {
    /// Which faults; all but `hang` by default, which needs a watchdog that QEMU does not have.
    #[arg(value_parser = fault(), value_name = "FAULT")]
    faults: Vec<&'static Fault>,
    /// The voltage at which the fault comes, V.
    #[arg(long, value_name = "V", value_parser = quantity::volts, default_value_t = 1000.0)]
    voltage: f64,
}

/// A fault that is caused on purpose.
#[derive(Debug, PartialEq)]
struct Fault {
    name: &'static str,
    injected: InjectedFault,
    /// Cause of the trip that it ends in.
    cause: Cause,
    help: &'static str,
}

/// In the order in which they are caused: the panic takes parameters along that were only tried.
static FAULTS: [Fault; 7] = [
    Fault::new("interlock", InjectedFault::Interlock, Cause::Interlock, "The interlock opens"),
    Fault::new("monitor", InjectedFault::Monitor, Cause::Monitor, "The voltage monitor stays where it is"),
    Fault::new(
        "sensor",
        InjectedFault::Sensor,
        Cause::Sensor(SensorFault::Range),
        "The displacement sensor is unplugged",
    ),
    Fault::new("bus", InjectedFault::Bus, Cause::Bus, "The monitor's converter does not answer"),
    Fault::new("overrun", InjectedFault::Overrun, Cause::Overrun, "A tick takes longer than it may"),
    Fault::new(
        "panic",
        InjectedFault::Panic,
        Cause::Panic,
        "The firmware panics: the chip starts again, and parameters that were only tried are gone",
    ),
    Fault::new("hang", InjectedFault::Hang, Cause::Watchdog, "The tick hangs, which the watchdog ends"),
];

impl Fault {
    const fn new(name: &'static str, injected: InjectedFault, cause: Cause, help: &'static str) -> Self {
        Self { name, injected, cause, help }
    }

    /// Whether the chip starts again.
    fn resets(&self) -> bool {
        matches!(self.injected, InjectedFault::Panic | InjectedFault::Hang)
    }
}

/// Reads the name of a fault.
fn fault() -> impl TypedValueParser<Value = &'static Fault> {
    let names = FAULTS.iter().map(|fault| PossibleValue::new(fault.name).help(fault.help));
    PossibleValuesParser::new(names)
        .try_map(|name| FAULTS.iter().find(|fault| fault.name == name).ok_or("no such fault"))
}

/// How a fault ended.
#[derive(Serialize)]
struct Ended {
    fault: &'static str,
    /// Voltage of the monitor before the fault.
    #[serde(rename = "stood_v")]
    held_v: f64,
    wanted: String,
    state: String,
    command_v: f32,
    passed: bool,
}

#[derive(Serialize)]
struct Report {
    port: String,
    passed: bool,
    #[serde(rename = "drills")]
    ended: Vec<Ended>,
}

impl Report {
    fn table(&self) -> String {
        let mut text = format!("        {:10} {:>8}  {:26} then", "fault", "at", "ended in");
        for Ended { fault, held_v, wanted, state, command_v, passed } in &self.ended {
            let mark = if *passed { "ok" } else { "FAILED" };
            let wanted = if *passed { String::new() } else { format!(" (wanted: {wanted})") };
            text += &format!("\n{mark:6}  {fault:10} {held_v:6.0} V  {state:26} {command_v:.0} V{wanted}");
        }
        text
    }
}

impl FaultInjection {
    pub(super) fn check(&self) -> Result<()> {
        if (100.0..=10e3).contains(&self.voltage) {
            Ok(())
        } else {
            Err(Error::field("voltage", "must be from 100 to 10000 V: enough to be seen at the monitor"))
        }
    }

    pub(super) fn run(&self, mut client: Client, port: String, json: bool) -> Result<()> {
        let stop = interrupt::live_film();
        let by_default = || FAULTS.iter().filter(|fault| fault.injected != InjectedFault::Hang).collect();
        let faults: Vec<&Fault> = if self.faults.is_empty() { by_default() } else { self.faults.clone() };
        let mut ended = Vec::new();
        let done: Result<()> = faults.iter().try_for_each(|fault| {
            ended.push(self.inject(fault, &mut client, stop)?);
            Ok(())
        });
        let report = Report { port, passed: done.is_ok() && ended.iter().all(|ended| ended.passed), ended };
        let failed: Vec<&str> = report.ended.iter().filter(|e| !e.passed).map(|e| e.fault).collect();
        let failed = failed.join(", ");
        if done.is_ok() || !report.ended.is_empty() {
            terminal::report(json, &report, || report.table())?;
        }
        done?;
        if client.status()?.rate_hz == 0.0 {
            terminal::message(
                "the board has started again, without the parameters that were only tried: upload them anew",
            );
        }
        if failed.is_empty() {
            Ok(())
        } else {
            Err(Error::Computation(format!("faults that did not end as wanted: {failed}")))
        }
    }

    /// Brings the film to the voltage, causes the fault, and acknowledges what it ended in.
    fn inject(&self, fault: &Fault, client: &mut Client, stop: &AtomicBool) -> Result<Ended> {
        going_on(stop)?;
        if client.status()?.rate_hz > 0.0 {
            // The board refuses by what a tick has found since the last fault.
            some_ticks(client, stop)?;
        }
        until_discharged(client, stop)?;
        // What another host has armed meanwhile is its own.
        client.arm()?;
        let ended = self.cause(fault, client, stop);
        if ended.is_err() {
            // 0 V before anything else.
            live::disarm(client)?;
        }
        let ended = ended?;
        if let DriverState::Tripped(_) = client.status()?.state {
            at_0_v(client, stop)?;
            client.order(Command::Acknowledge)?;
        } else {
            live::disarm(client)?;
        }
        Ok(ended)
    }

    /// With the amplifier enabled.
    fn cause(&self, fault: &Fault, client: &mut Client, stop: &AtomicBool) -> Result<Ended> {
        client.order(Command::Start(Mode::Voltage))?;
        let held_v = hold(client, Some(self.voltage as f32), stop)?;
        match client.ask(Command::InjectFault(fault.injected)) {
            Ok(Answer::Done) => {}
            Ok(Answer::Rejected(Reject::Unknown)) => return Err(unknown(fault)),
            Ok(other) => return Err(client.unexpected(&other)),
            // The answer may be lost with what was on its way when the chip started again.
            Err(_) if fault.resets() => {}
            Err(error) => return Err(error),
        }
        if fault.injected == InjectedFault::Monitor {
            // It stays where it is, which shows once the voltage changes.
            client.order(Command::SetVoltage(0.5 * self.voltage as f32))?;
        }
        let patience = if fault.resets() { COMES_BACK } else { PATIENCE };
        let mut status: Option<Status> = None;
        wait(client, patience, stop, |client| {
            status = match client.status() {
                Ok(status) => Some(status),
                // There is no response between a reset and the start, which is not a fault.
                Err(_) if fault.resets() => None,
                Err(error) => return Err(error),
            };
            Ok(status.is_some_and(|status| matches!(status.state, DriverState::Tripped(_))))
        })?;
        let Some(status) = status else { return Err(Error::Computation("the board does not come back".into())) };
        let wanted = DriverState::Tripped(fault.cause);
        Ok(Ended {
            fault: fault.name,
            held_v,
            wanted: named(wanted),
            state: named(status.state),
            command_v: status.command_v,
            passed: status.state == wanted && status.command_v == 0.0,
        })
    }
}

/// Waits until the monitor answers and shows 0 V: only then is a trip acknowledged.
fn at_0_v(client: &mut Client, stop: &AtomicBool) -> Result<()> {
    let fell = wait(client, PATIENCE, stop, |client| {
        let Status { rate_hz, monitor_v, live, .. } = client.status()?;
        // Without parameters nothing ticks, and nothing is enabled.
        Ok(rate_hz == 0.0 || (monitor_v.is_finite() && !live))
    })?;
    let status = client.status()?;
    if fell { Ok(()) } else { Err(client.film_is_live(&status)) }
}

/// An image that does not cause this fault.
fn unknown(fault: &Fault) -> Error {
    let cause = if fault.injected == InjectedFault::Hang {
        "this board does not cause it: a tick that hangs is ended by the watchdog, which QEMU does not have"
    } else {
        "this board causes no faults on purpose; the virtual board does: cargo xtask board"
    };
    Error::Computation(format!("{}: {cause}", fault.name))
}
