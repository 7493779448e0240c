//! A USART, RM0090 section 30: what it sends, and what it is made to hear.

use crate::chip::time::{Picoseconds, SECOND};

const SR: u32 = 0x00;
const DR: u32 = 0x04;
const BRR: u32 = 0x08;
const CR1: u32 = 0x0c;
const CR3: u32 = 0x14;

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

#[derive(Default)]
pub struct Usart {
    brr: u32,
    cr: [u32; 3],
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
    /// As after a reset; what went out stays on record.
    pub fn reset(&mut self) {
        *self = Self { sent: std::mem::take(&mut self.sent), ..Self::default() };
    }

    pub fn cr1(&self) -> u32 {
        self.cr[0]
    }

    /// Bits per second for a bus clock.
    pub fn baud(&self, pclk_hz: u32) -> f64 {
        let (whole, fraction) = (self.brr >> 4, self.brr & 0xf);
        let (oversampling, parts) = if self.cr[0] & OVER8 == 0 { (16.0, 16.0) } else { (8.0, 8.0) };
        f64::from(pclk_hz) / (oversampling * (f64::from(whole) + f64::from(fraction) / parts))
    }

    /// A byte comes in, with error flags if it is broken.
    pub fn hear(&mut self, byte: u8, errors: u32) {
        if self.cr[0] & (UE | RE) != UE | RE {
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
        if self.cr[0] & (UE | TE) != UE | TE {
            return;
        }
        while now >= self.end
            && let Some(byte) = self.waiting.take()
        {
            self.sent.push((self.end, byte));
            self.end += (BITS as f64 * SECOND as f64 / self.baud(pclk_hz)) as Picoseconds;
        }
    }

    pub fn read(&mut self, offset: u32, now: Picoseconds) -> u32 {
        match offset {
            SR => {
                self.status_was_read = true;
                let empty = if self.waiting.is_none() { flag::EMPTY } else { 0 };
                let complete = if self.waiting.is_none() && now >= self.end { flag::COMPLETE } else { 0 };
                self.flags | empty | complete
            }
            DR => {
                self.flags &= !flag::RECEIVED;
                if self.status_was_read {
                    self.flags &= !ERRORS;
                }
                self.received.into()
            }
            BRR => self.brr,
            CR1..=CR3 => self.cr[(offset - CR1) as usize / 4],
            _ => 0,
        }
    }

    /// Writes a register. False: a byte that waited was lost.
    pub fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> bool {
        match offset {
            DR => {
                self.end = self.end.max(now);
                return self.waiting.replace(value as u8).is_none();
            }
            BRR => self.brr = value & 0xffff,
            CR1..=CR3 => self.cr[(offset - CR1) as usize / 4] = value,
            _ => {}
        }
        true
    }
}
