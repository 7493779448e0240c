//! A USART, RM0090 section 30: what it sends, and what it is made to hear.

use crate::chip::Block;
use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::{Picoseconds, SECOND};
use crate::chip::violation::Violation;

const SR: u32 = 0x00;
const DR: u32 = 0x04;
const BRR: u32 = 0x08;
const CR1: u32 = 0x0c;

/// Flags in SR.
pub mod flag {
    pub const PARITY: u32 = 1 << 0;
    pub const FRAMING: u32 = 1 << 1;
    pub const NOISE: u32 = 1 << 2;
    pub const OVERRUN: u32 = 1 << 3;
    pub const RECEIVED: u32 = 1 << 5;
    pub const COMPLETE: u32 = 1 << 6;
    pub const EMPTY: u32 = 1 << 7;
}
/// Reading SR and then DR clears them.
const ERRORS: u32 = flag::PARITY | flag::FRAMING | flag::NOISE | flag::OVERRUN;

/// Bits of CR1.
const RE: u32 = 1 << 2;
const TE: u32 = 1 << 3;
const UE: u32 = 1 << 13;
const OVER8: u32 = 1 << 15;
/// A byte on the line: start, eight bits, stop.
const BITS: u64 = 10;

pub struct Usart {
    registers: Registers,
    flags: u32,
    status_was_read: bool,
    received: u8,
    waiting: Option<u8>,
    /// When the byte on the line ends.
    end: Picoseconds,
    /// Bytes that went out, with their starts.
    pub sent: Vec<(Picoseconds, u8)>,
}

impl Usart {
    pub fn cr1(&self) -> u32 {
        self.registers[CR1]
    }

    /// Bits per second for a bus clock.
    pub fn baud(&self, pclk_hz: u32) -> f64 {
        let (whole, fraction) = (self.registers[BRR] >> 4, self.registers[BRR] & 0xf);
        let (oversampling, parts) = if self.registers[CR1] & OVER8 == 0 { (16.0, 16.0) } else { (8.0, 8.0) };
        f64::from(pclk_hz) / (oversampling * (f64::from(whole) + f64::from(fraction) / parts))
    }

    /// A byte comes in, with error flags if it is broken.
    pub fn hear(&mut self, byte: u8, errors: u32) {
        if self.registers[CR1] & (UE | RE) != UE | RE {
            return;
        }
        self.status_was_read = false;
        if self.flags & flag::RECEIVED != 0 {
            // The one before stays.
            self.flags |= flag::OVERRUN;
        } else {
            self.received = byte;
            self.flags |= flag::RECEIVED | errors & ERRORS;
        }
    }

    /// Something is wrong on the line, without a byte.
    pub fn complain(&mut self, errors: u32) {
        self.status_was_read = false;
        self.flags |= errors & ERRORS;
    }

    pub fn advance(&mut self, now: Picoseconds, pclk_hz: u32) {
        if self.registers[CR1] & (UE | TE) != UE | TE {
            return;
        }
        while now >= self.end
            && let Some(byte) = self.waiting.take()
        {
            self.sent.push((self.end, byte));
            self.end += (BITS as f64 * SECOND as f64 / self.baud(pclk_hz)) as Picoseconds;
        }
    }
}

impl Default for Usart {
    fn default() -> Self {
        let registers = Registers::new(&[]);
        Self { registers, flags: 0, status_was_read: false, received: 0, waiting: None, end: 0, sent: Vec::new() }
    }
}

impl Peripheral for Usart {
    fn value(&self, offset: u32, now: Picoseconds) -> u32 {
        match offset {
            SR => {
                let empty = if self.waiting.is_none() { flag::EMPTY } else { 0 };
                let complete = if self.waiting.is_none() && now >= self.end { flag::COMPLETE } else { 0 };
                self.flags | empty | complete
            }
            DR => self.received.into(),
            _ => self.registers[offset],
        }
    }

    fn was_read(&mut self, offset: u32) {
        match offset {
            SR => self.status_was_read = true,
            DR if self.status_was_read => self.flags &= !(flag::RECEIVED | ERRORS),
            DR => self.flags &= !flag::RECEIVED,
            _ => {}
        }
    }

    fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> Option<Violation> {
        if offset != DR {
            self.registers[offset] = value & 0xffff;
            return None;
        }
        self.end = self.end.max(now);
        self.waiting.replace(value as u8).map(|_| Violation::Overwritten(Block::Usart2))
    }

    /// As after a reset; what went out stays on record.
    fn reset(&mut self) {
        *self = Self { sent: std::mem::take(&mut self.sent), ..Self::default() };
    }
}
