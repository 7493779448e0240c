//! Polls a board until a condition holds.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dea_driver::wire::{Answer, Command, Inspection, Part, Status};
use dea_driver::{DriverState, Refusal};

use crate::error::{Error, Result};
use crate::link::Client;

/// A board that takes longer is not ticking.
pub(super) const PATIENCE: Duration = Duration::from_secs(60);
/// No board gives a film more time to discharge.
pub(super) const DISCHARGE: Duration = Duration::from_secs(70);
/// How often it is asked.
const EVERY: Duration = Duration::from_millis(20);
/// A constant voltage is measured after the first of these times and for the second, s. Both are times of the board, since an emulator
/// may be slow.
const SETTLES_S: f32 = 0.1;
const MEASURED_S: f32 = 0.3;
/// Fewest readings that are averaged.
const READINGS: f64 = 5.0;

/// Polls until the condition holds, `most` has passed, or Ctrl-C comes.
pub(super) fn wait(
    client: &mut Client,
    most: Duration,
    stop: &AtomicBool,
    mut is_so: impl FnMut(&mut Client) -> Result<bool>,
) -> Result<bool> {
    let start = Instant::now();
    while start.elapsed() < most {
        going_on(stop)?;
        if is_so(client)? {
            return Ok(true);
        }
        std::thread::sleep(EVERY);
    }
    Ok(false)
}

/// Waits, with the film at 0 V, until the board has seen that for as long as it wants to before it is armed again.
pub(super) fn until_discharged(client: &mut Client, stop: &AtomicBool) -> Result<()> {
    wait(client, DISCHARGE, stop, |client| Ok(!client.waits_at_0_v()?)).map(drop)
}

/// An error once Ctrl-C has come.
pub(super) fn going_on(stop: &AtomicBool) -> Result<()> {
    if stop.load(Ordering::Relaxed) { Err(Error::Computation("stopped by Ctrl-C".into())) } else { Ok(()) }
}

/// State of the board's parts.
pub(super) fn inspect(client: &mut Client) -> Result<Inspection> {
    match client.ask(Command::Inspect)? {
        Answer::Inspection(found) => Ok(found),
        other => Err(client.unexpected(&other)),
    }
}

/// Holds `volts`, or 0 V, and returns the mean of the monitor once the command is constant, V.
pub(super) fn hold(client: &mut Client, volts: Option<f32>, stop: &AtomicBool) -> Result<f64> {
    let (mut sum_v, mut count, mut constant_since) = (0.0, 0.0, None);
    let wanted_v = volts.unwrap_or(0.0);
    let measured = wait(client, PATIENCE, stop, |client| {
        client.order(volts.map_or(Command::Heartbeat, Command::SetVoltage))?;
        let Status { state, rate_hz, ticks, command_v, monitor_v, .. } = client.status()?;
        if let DriverState::Tripped(_) = state {
            return Err(client.unexpected(&Answer::Refused(Refusal::State(state))));
        }
        if (command_v - wanted_v).abs() > 0.5 {
            (sum_v, count, constant_since) = (0.0, 0.0, None);
            return Ok(false);
        }
        let held_s = ticks.wrapping_sub(*constant_since.get_or_insert(ticks)) as f32 / rate_hz;
        if held_s >= SETTLES_S {
            sum_v += f64::from(monitor_v);
            count += 1.0;
        }
        Ok(held_s >= SETTLES_S + MEASURED_S && count >= READINGS)
    })?;
    if measured {
        Ok(sum_v / count)
    } else {
        Err(Error::Computation(format!(
            "{wanted_v} V were not commanded within {} s; check limits and slew with `link status`",
            PATIENCE.as_secs()
        )))
    }
}

/// Lets the board tick a few times, so that what it found is of now.
pub(super) fn some_ticks(client: &mut Client, stop: &AtomicBool) -> Result<()> {
    let before = client.status()?.ticks;
    if wait(client, PATIENCE, stop, |client| Ok(client.status()?.ticks.wrapping_sub(before) > 5))? {
        Ok(())
    } else {
        Err(Error::Computation("the board does not tick".into()))
    }
}

/// How a part answers, in words.
pub(super) fn answer(part: Part) -> String {
    match part {
        Part::Answers => "answers".into(),
        Part::Wrong { wanted, found } => format!("{found:#06x} for {wanted:#06x}"),
        Part::Starting => "is being set up".into(),
        Part::Pin => "its pin does not switch".into(),
        Part::NoReference => "has no internal reference".into(),
        _ => "does not answer".into(),
    }
}
