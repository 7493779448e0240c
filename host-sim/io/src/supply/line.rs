//! Bytes to a device and back, and the time on its side.

use std::thread;
use std::time::{Duration, Instant};

use crate::error::Result;
use crate::link::Port;

/// A connection to a device. Tests have one with a clock of its own.
pub trait Line {
    /// Its name, for errors.
    fn name(&self) -> &str;

    /// Seconds since some instant.
    fn now_s(&self) -> f64;

    /// Sends `bytes`.
    fn send(&mut self, bytes: &[u8]) -> Result<()>;

    /// The next byte; nothing if none comes until `until_s`, which has passed then.
    fn receive(&mut self, until_s: f64) -> Result<Option<u8>>;
}

/// The bytes that come until a time. A device that never pauses does not hold them up: what it sends beyond some kilobytes is left for later.
pub(super) struct Burst {
    until_s: f64,
    taken: usize,
}

impl Burst {
    /// More than what a line of text and its replies take.
    const BYTES: usize = 4096;

    pub(super) fn until(until_s: f64) -> Self {
        Self { until_s, taken: 0 }
    }

    /// The next byte of `line`; nothing once the time has passed.
    pub(super) fn next(&mut self, line: &mut dyn Line) -> Result<Option<u8>> {
        if self.taken >= Self::BYTES && line.now_s() >= self.until_s {
            return Ok(None);
        }
        self.taken += 1;
        line.receive(self.until_s)
    }
}

/// A serial port, or a TCP connection.
#[derive(Debug)]
pub struct SerialLine {
    port: Port,
    start: Instant,
}

impl SerialLine {
    /// Opens `name` as [`Port::open_at`] does.
    pub fn open(name: &str, baud: u32, start: Instant) -> Result<Self> {
        Ok(Self { port: Port::open_at(name, baud)?, start })
    }
}

impl Line for SerialLine {
    fn name(&self) -> &str {
        self.port.name()
    }

    fn now_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<()> {
        self.port.write(bytes)
    }

    fn receive(&mut self, until_s: f64) -> Result<Option<u8>> {
        let until = self.start + Duration::from_secs_f64(until_s.max(0.0));
        // The last millisecond is slept: a port waits in whole ones, and would be a tick late.
        let early = until.checked_sub(Duration::from_millis(1)).unwrap_or(until);
        let byte = self.port.byte(early.max(Instant::now() + Duration::from_micros(1)))?;
        if byte.is_none() {
            thread::sleep(until.saturating_duration_since(Instant::now()));
        }
        Ok(byte)
    }
}
