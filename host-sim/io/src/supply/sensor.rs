//! A displacement sensor that sends its readings as lines of text.

use std::collections::VecDeque;

use super::line::{Burst, Line};
use super::template::number;
use crate::error::Result;

/// Longest line of a sensor.
const MAX_LINE: usize = 40;

/// The newest reading of a sensor at a port of its own: a number in a line, with the unit behind it or without.
pub struct Sensor {
    line: Box<dyn Line>,
    unit: String,
    metres: f64,
    bytes: VecDeque<u8>,
    newest: Option<(f64, f64)>,
}

impl Sensor {
    /// The sensor at `line`, in `unit`: m, mm or um. The first line counts from its second on: it may have been cut.
    pub fn new(line: Box<dyn Line>, unit: &str) -> Option<Self> {
        let metres = match unit {
            "m" => 1.0,
            "mm" => 1e-3,
            "um" => 1e-6,
            _ => return None,
        };
        Some(Self { line, unit: unit.into(), metres, bytes: [b'?'].into(), newest: None })
    }

    /// Reads what has come, and returns the newest reading (m) and its time (s).
    pub fn newest(&mut self) -> Result<Option<(f64, f64)>> {
        let mut burst = Burst::until(self.line.now_s() + 1e-3);
        while let Some(byte) = burst.next(&mut *self.line)? {
            if !matches!(byte, b'\r' | b'\n') {
                self.bytes.push_back(byte);
                self.bytes.truncate(MAX_LINE);
                continue;
            }
            let text = String::from_utf8(self.bytes.drain(..).collect()).unwrap_or_default();
            let text = text.trim();
            let text = text.strip_suffix(self.unit.as_str()).unwrap_or(text).trim_end();
            if let Some(value) = number(text) {
                self.newest = Some((self.metres * value, self.line.now_s()));
            }
        }
        Ok(self.newest)
    }
}
