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
    ///
    /// # Errors
    ///
    /// [`Error::Link`](crate::Error::Link) for a line that is cut.
    fn send(&mut self, bytes: &[u8]) -> Result<()>;

    /// The next byte; nothing if none comes until `until_s`, which has passed then.
    ///
    /// # Errors
    ///
    /// As [`send`](Self::send).
    fn receive(&mut self, until_s: f64) -> Result<Option<u8>>;
}

/// A serial port, or a TCP connection.
#[derive(Debug)]
pub struct SerialLine {
    port: Port,
    start: Instant,
}

impl SerialLine {
    /// Opens `name` as [`Port::open_at`] does.
    ///
    /// # Errors
    ///
    /// As there.
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
