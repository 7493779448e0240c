//! `link self-test`: what a board finds of itself and its bench, step by step, before a film is connected.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use dea_driver::chips::Converters;
use dea_driver::wire::{Answer, Command, Identity, Mode, Part, Reject, Status};
use dea_driver::{Cause, DriverState};

use super::asking::{answer, going_on, hold, inspect, some_ticks, until_discharged, wait};
use super::live;
use crate::commands::prelude::*;
use crate::commission::Check;
use crate::interrupt;
use crate::link::{Client, named};

/// Longest time of a board for a reset.
const COMES_BACK: Duration = Duration::from_secs(5);
/// Longest time for a person to open an interlock, and to close it.
const BY_HAND: Duration = Duration::from_secs(60);
/// The monitor agrees with the command within this share of it: ranges and gains that are taken for each other are off by a sixth at
/// the least.
const SHARE: f64 = 0.1;
/// Longest time in which the output of a bench discharges; a longer one means that the bleeder is missing.
const DISCHARGE: Duration = Duration::from_secs(10);
/// The lowest reading of an ADC with something at its input, V: with the resistor there one that leads nowhere reads less.
const PLUGGED_V: f32 = 0.05;
/// The highest, as a share of its full scale: a saturated one reads more.
const PLUGGED_SHARE: f32 = 0.997;

#[derive(Debug, Args)]
pub(super) struct SelfTest {
    /// The voltage that is commanded and looked for at the monitor, V.
    #[arg(long, value_name = "V", value_parser = quantity::volts, default_value_t = 50.0)]
    voltage: f64,
    /// Ask for the interlock to be opened and closed by hand while the amplifier is enabled at 0 V.
    #[arg(long)]
    interlock: bool,
    /// Let the watchdog reset the board at the end.
    #[arg(long)]
    watchdog: bool,
}

#[derive(Serialize)]
struct Report {
    port: String,
    passed: bool,
    checks: Vec<Check>,
}

#[derive(Default)]
struct Checks(Vec<Check>);

impl Checks {
    fn add(&mut self, what: &'static str, found: impl Into<String>, wanted: impl Into<String>, passed: bool) -> bool {
        self.0.push(Check { what: what.into(), found: found.into(), wanted: wanted.into(), passed });
        passed
    }

    /// Prints the table of checks that `ended` so. What failed is an error.
    fn report(self, ended: Result<()>, port: String, json: bool, failure: &str) -> Result<()> {
        let text = self.table();
        let failed: Vec<&str> = self.0.iter().filter(|check| !check.passed).map(|check| check.what.as_str()).collect();
        let failed = failed.join(", ");
        let passed = failed.is_empty() && ended.is_ok();
        terminal::report(json, &Report { port, passed, checks: self.0 }, || text)?;
        ended?;
        if failed.is_empty() { Ok(()) } else { Err(Error::Computation(format!("{failure}: {failed}"))) }
    }

    fn passed(&self) -> bool {
        self.0.iter().all(|check| check.passed)
    }

    fn table(&self) -> String {
        let width = |column: fn(&Check) -> &str, title: &str| {
            self.0.iter().map(|check| column(check).chars().count()).max().unwrap_or(0).max(title.len())
        };
        let (what, found) = (width(|check| &check.what, "check"), width(|check| &check.found, "found"));
        let mut text = format!("        {:what$}  {:found$}  wanted", "check", "found");
        for check in &self.0 {
            let mark = if check.passed { "ok" } else { "FAILED" };
            text += &format!("\n{mark:6}  {:what$}  {:found$}  {}", check.what, check.found, check.wanted);
        }
        text
    }
}

impl SelfTest {
    /// As it is without options.
    pub(super) const USUAL: Self = Self { voltage: 50.0, interlock: false, watchdog: false };

    /// Its checks, as commissioning records them.
    pub(super) fn checks(&self, client: &mut Client, identity: &Identity, stop: &AtomicBool) -> Result<Vec<Check>> {
        let mut checks = Checks::default();
        self.all(client, identity, &mut checks, stop)?;
        Ok(checks.0)
    }

    pub(super) fn check(&self) -> Result<()> {
        if (10.0..=500.0).contains(&self.voltage) {
            Ok(())
        } else {
            Err(Error::field("voltage", "must be from 10 to 500 V: enough to be seen, and too little to move a film"))
        }
    }

    pub(super) fn run(&self, mut client: Client, identity: &Identity, port: String, json: bool) -> Result<()> {
        let stop = interrupt::live_film();
        let mut checks = Checks::default();
        let ended = self.all(&mut client, identity, &mut checks, stop);
        checks.report(ended, port, json, "the self-test failed")
    }

    /// The checks that need no voltage, all that the board would refuse to be armed for, and the age of the last self-test.
    pub(super) fn preflight(mut client: Client, board: u16, port: String, json: bool) -> Result<()> {
        let mut checks = Checks::default();
        at_rest(&mut client, board, &mut checks)?;
        match client.ask(Command::Preflight)? {
            Answer::Preflight { refusals, self_test_s } => {
                for refusal in &refusals {
                    checks.add("arming", refusal.to_string(), "nothing in the way", false);
                }
                let age = self_test_s.map_or("none since the start".into(), |age_s| format!("passed {age_s} s ago"));
                checks.add("self-test", age, "passed since the start: `link self-test`", self_test_s.is_some());
            }
            Answer::Rejected(Reject::NoParameters) => {}
            other => return Err(client.unexpected(&other)),
        }
        checks.report(Ok(()), port, json, "not ready")
    }

    /// All steps, as far as those before allow the next.
    fn all(&self, client: &mut Client, identity: &Identity, checks: &mut Checks, stop: &AtomicBool) -> Result<()> {
        let Identity { firmware, board, protocol, .. } = identity;
        checks.add("link", format!("firmware {firmware}, board {board:#06x}, protocol {protocol}"), "an answer", true);
        let rest_v = at_rest(client, *board, checks)?;
        if !checks.passed() {
            return Ok(());
        }
        until_discharged(client, stop)?;
        going_on(stop)?;
        // What another host has armed meanwhile is its own.
        client.arm_for_self_test()?;
        let tried = self.enabled(client, checks, rest_v, stop);
        // 0 V before anything else, whatever has happened.
        let disarmed = live::disarm(client);
        // As far as the board still answers.
        let off = self.off(client, checks, rest_v);
        tried.and(disarmed).and(off)?;
        if self.watchdog && checks.passed() {
            going_on(stop)?;
            stop_feeding_watchdog(client, checks)?;
        }
        // Last: a reset forgets it.
        if checks.passed() { client.order(Command::SelfTested) } else { Ok(()) }
    }

    /// Whether `volts` are within what is allowed of `wanted_v`.
    fn agree(&self, volts: f64, wanted_v: f64) -> bool {
        (volts - wanted_v).abs() <= SHARE * self.voltage
    }

    /// With the amplifier enabled: its pin, the DAC, a voltage, and the interlock.
    fn enabled(&self, client: &mut Client, checks: &mut Checks, rest_v: f64, stop: &AtomicBool) -> Result<()> {
        let zero_v = hold(client, None, stop);
        // The board trips where its pin does not follow.
        let follows = client.status()?.state != DriverState::Tripped(Cause::Enable) && inspect(client)?.enable_high;
        if !checks.add("enable, armed", level(follows), "the pin reads high: nothing holds it down", follows) {
            return Ok(());
        }
        let zero_v = zero_v?;
        let parts = inspect(client)?;
        checks.add(
            "DAC, armed",
            answer(parts.dac),
            "range, power and code read back as written",
            parts.dac == Part::Answers,
        );
        client.order(Command::Start(Mode::Voltage))?;
        let held_v = hold(client, Some(self.voltage as f32), stop)?;
        let (rise_v, wanted_v) = (held_v - zero_v, self.voltage);
        checks.add(
            "monitor",
            format!("{rise_v:.1} V above {zero_v:.1} V at a command of 0 V"),
            if parts.dac == Part::Answers && rise_v.abs() < SHARE * wanted_v {
                // The registers of a DAC without a reference are as they were written.
                format!("{wanted_v} V: reference of the DAC (an AD5754R has its own off), amplifier, divider")
            } else {
                format!("{wanted_v} V, within {:.0} %: amplifier, divider and both calibrations", 100.0 * SHARE)
            },
            self.agree(rise_v, wanted_v),
        );
        client.order(Command::Stop)?;
        if self.interlock {
            self.by_hand(client, checks, rest_v, stop)?;
        }
        Ok(())
    }

    /// Once it is disarmed again.
    fn off(&self, client: &mut Client, checks: &mut Checks, rest_v: f64) -> Result<()> {
        let never = AtomicBool::new(false);
        some_ticks(client, &never)?;
        let parts = inspect(client)?;
        checks.add("enable, at the end", level(parts.enable_high), "low", !parts.enable_high);
        let mut end_v = f64::NAN;
        let fell = wait(client, DISCHARGE, &never, |client| {
            end_v = f64::from(client.status()?.monitor_v);
            Ok(self.agree(end_v, rest_v))
        })?;
        checks.add(
            "monitor, at the end",
            format!("{end_v:.1} V"),
            format!("{rest_v:.1} V as before it was armed"),
            fell,
        );
        Ok(())
    }

    /// Asks the user to open the interlock and to close it, once the film is back at its voltage at rest, since the user may then reach
    /// in.
    fn by_hand(&self, client: &mut Client, checks: &mut Checks, rest_v: f64, stop: &AtomicBool) -> Result<()> {
        let fell = wait(client, DISCHARGE, stop, |client| {
            client.order(Command::Heartbeat)?;
            Ok(self.agree(f64::from(client.status()?.monitor_v), rest_v))
        })?;
        if !checks.add(
            "monitor, stopped",
            if fell { "fell" } else { "still up" },
            "back at rest before a hand goes near",
            fell,
        ) {
            return Ok(());
        }
        terminal::message(format!("open the interlock within {} s", BY_HAND.as_secs()));
        let trip = DriverState::Tripped(Cause::Interlock);
        let opened = wait(client, BY_HAND, stop, |client| {
            // What keeps it armed; once it has tripped it is refused.
            let _ = client.ask(Command::Heartbeat)?;
            Ok(client.status()?.state != DriverState::Armed)
        })?;
        let state = client.status()?.state;
        let found = if opened { named(state) } else { "nothing".into() };
        if !checks.add("interlock, opened", found, "a trip: the contact opens, and is wired here", state == trip) {
            return Ok(());
        }
        terminal::message(format!("close the interlock within {} s", BY_HAND.as_secs()));
        let closed = wait(client, BY_HAND, stop, |client| Ok(inspect(client)?.interlock_closed))?;
        checks.add("interlock, closed again", if closed { "closed" } else { "open" }, "closed", closed);
        client.order(Command::Acknowledge)
    }
}

/// With the amplifier disabled. Returns what the monitor shows, V.
fn at_rest(client: &mut Client, board: u16, checks: &mut Checks) -> Result<f64> {
    let status = client.status()?;
    let state = match status.state {
        DriverState::Tripped(_) => "no trip: find out why, then `link acknowledge`",
        _ => "disarmed",
    };
    checks.add("state", named(status.state), state, status.state == DriverState::Disarmed);
    let rate = if status.rate_hz > 0.0 { format!("{} Hz", status.rate_hz) } else { "none".into() };
    checks.add("parameters", rate, "some: `link upload`", status.rate_hz > 0.0);
    let parts = inspect(client)?;
    let interlock = if parts.interlock_closed { "closed" } else { "open" };
    checks.add("interlock", interlock, "closed", parts.interlock_closed);
    checks.add("enable, disarmed", level(parts.enable_high), "low", !parts.enable_high);
    checks.add("DAC", answer(parts.dac), advice(parts.dac, "power reads back"), parts.dac == Part::Answers);
    for (what, part) in [("monitor's ADC", parts.monitor), ("sensor's ADC", parts.sensor)] {
        checks.add(what, answer(part), advice(part, "every frame carries its range"), part == Part::Answers);
    }
    let volts = parts.sensor_adc_v;
    let highest_v = PLUGGED_SHARE * Converters::of_board(board).sensor_v;
    let plugged = format!("between {PLUGGED_V} and {highest_v:.1} V: neither unplugged nor saturated");
    let is_plugged = (PLUGGED_V..=highest_v).contains(&volts);
    checks.add("sensor", format!("{volts:.3} V at its ADC"), plugged, is_plugged);
    let Status { monitor_v, live, .. } = client.status()?;
    let dark = !live && monitor_v.is_finite();
    checks.add("monitor, disarmed", format!("{monitor_v:.1} V"), "within its band around 0 V", dark);
    Ok(f64::from(monitor_v))
}

/// Lets the watchdog reset the board, which reports the reset after its start.
fn stop_feeding_watchdog(client: &mut Client, checks: &mut Checks) -> Result<()> {
    client.order(Command::StopFeedingWatchdog)?;
    let reset = DriverState::Tripped(Cause::Watchdog);
    let never = AtomicBool::new(false);
    // There is no response between a reset and the first tick, which is not a fault.
    let came =
        wait(client, COMES_BACK, &never, |client| Ok(client.status().is_ok_and(|status| status.state == reset)))?;
    let found = if came { named(reset) } else { "no reset".into() };
    checks.add("watchdog", found, "a reset, and its cause", came);
    if came { client.order(Command::Acknowledge) } else { Ok(()) }
}

fn level(high: bool) -> &'static str {
    if high { "high" } else { "low" }
}

/// Advice for the answer of a converter.
fn advice(part: Part, sound: &'static str) -> &'static str {
    match part {
        Part::Wrong { found: 0 | 0xffff, .. } => "the line is not driven: check supply, select, clock and data out",
        Part::Wrong { wanted, found } if wanted ^ found == 1 => {
            "the last bit is wrong: look at the clock's edges on a scope"
        }
        Part::NoReference => "an AD5754R, or firmware for an external reference",
        Part::Wrong { .. } => "another chip, one without supply, or a line that rings",
        _ => sound,
    }
}
