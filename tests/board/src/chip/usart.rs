//! A USART, RM0090 section 30, RM0440 section 37: what it sends, and what it is made to hear.

use crate::chip::Block;
use crate::chip::family::Family;
use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::{Picoseconds, SECOND};
use crate::chip::violation::Violation;

/// Offsets of a family's registers. An STM32G4 has a register that clears flags, and two for data.
struct Places {
    status: u32,
    clear: Option<u32>,
    received: u32,
    sent: u32,
    divider: u32,
    control: u32,
    /// Enables it, in the control register.
    enable: u32,
}

const F4: Places =
    Places { status: 0x00, clear: None, received: 0x04, sent: 0x04, divider: 0x08, control: 0x0c, enable: 1 << 13 };
const G4: Places = Places {
    status: 0x1c,
    clear: Some(0x20),
    received: 0x24,
    sent: 0x28,
    divider: 0x0c,
    control: 0x00,
    enable: 1 << 0,
};

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
/// Reading SR and then DR clears them, or the register that is there for it.
const ERRORS: u32 = flag::PARITY | flag::FRAMING | flag::NOISE | flag::OVERRUN;

/// Bits of CR1.
const RE: u32 = 1 << 2;
const TE: u32 = 1 << 3;
const OVER8: u32 = 1 << 15;
/// A byte on the line: start, eight bits, stop.
const BITS: u64 = 10;

pub struct Usart {
    family: Family,
    places: &'static Places,
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
    pub fn new(family: Family) -> Self {
        let places = match family {
            Family::F4 => &F4,
            Family::G4 => &G4,
        };
        let registers = Registers::new(&[]);
        let (flags, received, waiting, end, sent) = (0, 0, None, 0, Vec::new());
        Self { family, places, registers, flags, status_was_read: false, received, waiting, end, sent }
    }

    pub fn cr1(&self) -> u32 {
        self.registers[self.places.control]
    }

    /// Bits per second for a bus clock.
    pub fn baud(&self, pclk_hz: u32) -> f64 {
        let (whole, fraction) = (self.registers[self.places.divider] >> 4, self.registers[self.places.divider] & 0xf);
        let (oversampling, parts) =
            if self.registers[self.places.control] & OVER8 == 0 { (16.0, 16.0) } else { (8.0, 8.0) };
        f64::from(pclk_hz) / (oversampling * (f64::from(whole) + f64::from(fraction) / parts))
    }

    /// A byte comes in, with error flags if it is broken.
    pub fn hear(&mut self, byte: u8, errors: u32) {
        if self.registers[self.places.control] & (self.places.enable | RE) != self.places.enable | RE {
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
        if self.registers[self.places.control] & (self.places.enable | TE) != self.places.enable | TE {
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

impl Peripheral for Usart {
    fn value(&self, offset: u32, now: Picoseconds) -> u32 {
        if offset == self.places.status {
            let empty = if self.waiting.is_none() { flag::EMPTY } else { 0 };
            let complete = if self.waiting.is_none() && now >= self.end { flag::COMPLETE } else { 0 };
            self.flags | empty | complete
        } else if offset == self.places.received {
            self.received.into()
        } else {
            self.registers[offset]
        }
    }

    fn was_read(&mut self, offset: u32) {
        if offset == self.places.status {
            self.status_was_read = true;
        } else if offset == self.places.received {
            let errors = if self.status_was_read && self.places.clear.is_none() { ERRORS } else { 0 };
            self.flags &= !(flag::RECEIVED | errors);
        }
    }

    fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> Option<Violation> {
        if Some(offset) == self.places.clear {
            self.flags &= !(value & ERRORS);
        } else if offset == self.places.sent {
            self.end = self.end.max(now);
            return self.waiting.replace(value as u8).map(|_| Violation::Overwritten(Block::Usart2));
        } else {
            self.registers[offset] = value & 0xffff;
        }
        None
    }

    /// As after a reset; what went out stays on record.
    fn reset(&mut self) {
        *self = Self { sent: std::mem::take(&mut self.sent), ..Self::new(self.family) };
    }
}
