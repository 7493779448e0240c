//! A conversation with a supply: commands in order, each reply checked, and 0 V at its end.

use std::collections::VecDeque;

use super::description::{Exchange, Supply};
use super::line::{Burst, Line};
use super::template::Template;
use crate::error::{Error, Result};

/// Share of the voltage by which the read-back may be wrong.
const READ_SHARE: f64 = 0.02;
/// Garbled replies in a row that end a run.
const MAX_GARBLED: u32 = 2;
/// Longest line of a supply.
const MAX_LINE: usize = 80;
/// How often 0 V is commanded at the end, until the read-back shows it.
const ATTEMPTS: u32 = 5;

/// A conversation with a supply. When it is dropped, however that came, 0 V and the end of the output are commanded.
pub struct Session {
    pub(super) supply: Supply,
    line: Box<dyn Line>,
    /// Replies that are still to come.
    pending: VecDeque<Pending>,
    bytes: Vec<u8>,
    /// Garbled replies in a row.
    garbled: u32,
    /// Voltages that were commanded and when, of the time that a read-back may show.
    commands: VecDeque<(f64, f64)>,
    reading_v: Option<f64>,
    /// How far the last read-back was beyond what the commands explain, V.
    unexplained_v: f64,
    /// The same of the last two, where they agree: one alone may be a garbled digit.
    deviation_v: f64,
    /// The slowest reply so far, s.
    pub(super) slowest_reply_s: f64,
    is_live: bool,
}

struct Pending {
    reply: Template,
    sent: f64,
    since_s: f64,
    /// Volts per number, of a read-back.
    reads: Option<f64>,
}

impl Session {
    /// Begins with `supply` at `line`: it must be the device that the description is of. Its output is at 0 V and on afterwards.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] for another device, one that does not answer as described, and one whose film is not at 0 V.
    pub fn begin(supply: Supply, line: Box<dyn Line>) -> Result<Self> {
        let mut session = Self {
            supply,
            line,
            pending: VecDeque::new(),
            bytes: Vec::new(),
            garbled: 0,
            commands: [(0.0, 0.0)].into(),
            reading_v: None,
            unexplained_v: 0.0,
            deviation_v: 0.0,
            slowest_reply_s: 0.0,
            is_live: false,
        };
        session.drain()?;
        // Nothing is set on an unknown device.
        let identify = session.supply.identify.clone();
        session.send(&identify, 0.0)?;
        session.wait().map_err(|error| session.fault(&format!("no {} at this port: {error}", session.supply.name)))?;
        session.is_live = true;
        session.set(0.0)?;
        session.wait()?;
        for command in session.supply.start.clone() {
            session.order(&command)?;
        }
        session.query()?;
        session.wait()?;
        match session.reading_v {
            Some(volts) if volts.abs() <= session.supply.read_band_v => Ok(session),
            Some(volts) => Err(session.fault(&format!("{volts:.0} V at a command of 0 V; nothing was started"))),
            None => Err(session.fault("the voltage is not read back; nothing was started")),
        }
    }

    /// Seconds on the line's clock.
    pub fn now_s(&self) -> f64 {
        self.line.now_s()
    }

    /// The last read-back, V.
    pub fn reading_v(&self) -> Option<f64> {
        self.reading_v
    }

    /// How far the last two read-backs were beyond what the commands of the time explain, V; 0 where one of them was not.
    pub fn deviation_v(&self) -> f64 {
        self.deviation_v
    }

    /// How wrong the read-back of `volts` may be, V.
    pub fn read_error_v(&self, volts: f64) -> f64 {
        self.supply.read_band_v + READ_SHARE * volts
    }

    /// Whether a read-back is on its way.
    pub fn is_reading(&self) -> bool {
        self.pending.iter().any(|pending| pending.reads.is_some())
    }

    /// Commands `volts`, in the supply's steps, and returns them.
    pub fn set(&mut self, volts: f64) -> Result<f64> {
        let volts = self.supply.in_steps(volts);
        let set = self.supply.set.clone();
        self.send(&set, volts)?;
        self.commands.push_back((self.line.now_s(), volts));
        let shown_since_s = self.line.now_s() - self.supply.late_s - self.supply.settle_s;
        // The one before counts until the next one acts.
        while self.commands.get(1).is_some_and(|&(time_s, _)| time_s < shown_since_s) {
            self.commands.pop_front();
        }
        Ok(volts)
    }

    /// Asks for the voltage.
    pub fn query(&mut self) -> Result<()> {
        let read = self.supply.read.clone();
        self.send(&read, 0.0)
    }

    fn send(&mut self, exchange: &Exchange, volts: f64) -> Result<()> {
        let number = format!("{:.*}", exchange.decimals, exchange.per_volt * volts);
        let command = exchange.command.filled(&number);
        let since_s = self.line.now_s();
        self.line.send(format!("{command}{}", self.supply.line_end).as_bytes())?;
        // An echo has no place for a number.
        let echo = self.supply.echo.then(|| Template::literal(&command));
        for reply in echo.into_iter().chain(exchange.reply.clone()) {
            let reads = reply.has_number().then_some(1.0 / exchange.per_volt);
            let sent = number.parse().unwrap_or(0.0);
            self.pending.push_back(Pending { reply, sent, since_s, reads });
        }
        Ok(())
    }

    /// Takes what comes until `until_s`, which has passed then.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] for a reply that refuses, that is late, or that is garbled for the second time in a row.
    pub fn listen(&mut self, until_s: f64) -> Result<()> {
        let mut burst = Burst::until(until_s);
        while let Some(byte) = burst.next(&mut *self.line)? {
            if !matches!(byte, b'\r' | b'\n') {
                self.bytes.push(byte);
                self.bytes.truncate(MAX_LINE);
            } else if !self.bytes.is_empty() {
                let bytes = std::mem::take(&mut self.bytes);
                self.take(&String::from_utf8_lossy(&bytes))?;
            }
        }
        let waited_s = self.pending.front().map_or(0.0, |pending| self.line.now_s() - pending.since_s);
        if waited_s > self.supply.late_s {
            return Err(self.fault(&format!("no reply within {} s", self.supply.late_s)));
        }
        Ok(())
    }

    /// Sends a command without a number, and waits for its reply and as long after it as it says.
    fn order(&mut self, command: &Exchange) -> Result<()> {
        self.send(command, 0.0)?;
        self.wait()?;
        self.listen(self.line.now_s() + command.pause_s)
    }

    /// Waits for all replies, and takes no garbled one.
    fn wait(&mut self) -> Result<()> {
        while !self.pending.is_empty() {
            self.listen(self.line.now_s() + 1e-3)?;
        }
        if self.garbled > 0 { Err(self.fault("its reply is not as described")) } else { Ok(()) }
    }

    /// Takes a line: the reply that is due, or garbled.
    fn take(&mut self, line: &str) -> Result<()> {
        let line = line.trim();
        if self.supply.errors.iter().any(|error| line.starts_with(error.as_str())) {
            return Err(self.fault(&format!("the supply refuses a command: {line:?}")));
        }
        let now_s = self.line.now_s();
        let read = self.pending.pop_front().and_then(|pending| {
            let value = pending.reply.read(line, pending.sent)?;
            let volts = pending.reads.map(|scale| scale * value);
            // More than it can give is no read-back: two of them that have run into one.
            let possible = |volts: &f64| volts.abs() <= 1.1 * self.supply.max_voltage_v + self.supply.read_band_v;
            volts.as_ref().is_none_or(possible).then_some((volts, pending.since_s))
        });
        let Some((volts, since_s)) = read else {
            self.garbled += 1;
            if self.garbled >= MAX_GARBLED {
                let shown: String = line.escape_debug().take(40).collect();
                return Err(self
                    .fault(&format!("{MAX_GARBLED} replies in a row are not as described; the last is \"{shown}\"")));
            }
            return Ok(());
        };
        self.garbled = 0;
        self.slowest_reply_s = self.slowest_reply_s.max(now_s - since_s);
        if let Some(volts) = volts {
            self.verify(volts, since_s);
        }
        Ok(())
    }

    /// Compares a read-back that was asked for at `since_s` with the commands that may have acted then.
    fn verify(&mut self, volts: f64, since_s: f64) {
        let from_s = since_s - self.supply.settle_s - self.supply.latency_s;
        let first = self.commands.iter().rposition(|&(time_s, _)| time_s <= from_s).unwrap_or(0);
        let acting = self.commands.iter().skip(first).map(|&(_, volts)| volts);
        let (low, high) = acting.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        let band = |of: f64| self.read_error_v(of);
        let unexplained_v = (volts - high - band(high)).max(0.0) - (low - band(low) - volts).max(0.0);
        let before_v = std::mem::replace(&mut self.unexplained_v, unexplained_v);
        // The same sign twice: the smaller of the two at least is real.
        let agrees = before_v * unexplained_v > 0.0;
        self.deviation_v = if agrees { unexplained_v.signum() * before_v.abs().min(unexplained_v.abs()) } else { 0.0 };
        if unexplained_v == 0.0 || agrees {
            self.reading_v = Some(volts);
        }
    }

    /// Ends at 0 V with the output off, and checks that by the read-back within `discharge_s`.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] where the voltage is not known to be 0 V.
    pub fn end(mut self, discharge_s: f64) -> Result<()> {
        let mut ended = Ok(());
        for attempt in 0..ATTEMPTS {
            ended = self.try_to_end(discharge_s / f64::from(ATTEMPTS));
            if ended.is_ok() {
                self.is_live = false;
                return Ok(());
            }
            // Its watchdog acts once nothing is sent any more.
            if self.reading_v.is_none() && attempt > 0 {
                break;
            }
        }
        self.is_live = false;
        let then = match self.supply.watchdog_s {
            Some(seconds) => format!("its watchdog should bring 0 V within {seconds} s"),
            None => "it has no watchdog: switch it off by hand".into(),
        };
        let cause = ended.err().map_or_else(String::new, |error| format!(" ({error})"));
        Err(self.fault(&format!("the film may be live; {then}. Measure before you touch it{cause}")))
    }

    fn try_to_end(&mut self, within_s: f64) -> Result<()> {
        self.drain()?;
        self.set_0_v()?;
        // All commands go out, whatever the replies are; the read-back decides.
        let mut replied = self.wait();
        for stop in self.supply.stop.clone() {
            replied = replied.and(self.order(&stop));
        }
        let until_s = self.line.now_s() + within_s;
        loop {
            self.drain()?;
            self.reading_v = None;
            replied = self.query().and_then(|()| self.wait()).and(replied);
            match self.reading_v {
                Some(volts) if volts.abs() <= self.supply.read_band_v => return Ok(()),
                Some(volts) if self.line.now_s() > until_s => {
                    return Err(self.fault(&format!("{volts:.0} V are read back at a command of 0 V")));
                }
                None if self.line.now_s() > until_s => {
                    return replied.and(Err(self.fault("the voltage is not read back")));
                }
                _ => {}
            }
        }
    }

    /// Commands 0 V, whatever was commanded before.
    fn set_0_v(&mut self) -> Result<()> {
        self.set(0.0)?;
        self.commands = [(self.line.now_s(), 0.0)].into();
        // The next read-back counts, alone.
        self.unexplained_v = 1.0;
        Ok(())
    }

    /// Forgets what is to come and what comes for as long as a reply may take.
    fn drain(&mut self) -> Result<()> {
        self.pending.clear();
        let until_s = self.line.now_s() + if self.is_live { 0.02 } else { self.supply.late_s };
        let mut burst = Burst::until(until_s);
        while burst.next(&mut *self.line)?.is_some() {}
        self.bytes.clear();
        self.garbled = 0;
        Ok(())
    }

    /// An error of this supply.
    pub fn fault(&self, cause: &str) -> Error {
        Error::Link { port: self.line.name().into(), cause: cause.into() }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        if self.is_live {
            // The error that ended the run is reported; the line may be cut, and no reply is waited for.
            let stop = self.supply.stop.clone();
            let _ = self.set_0_v().and_then(|()| stop.iter().try_for_each(|command| self.send(command, 0.0)));
        }
    }
}
