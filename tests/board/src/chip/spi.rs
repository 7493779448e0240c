//! An SPI, RM0090 section 28: a full-duplex master, polled. What is on the wires is for [`lines`](crate::chip::lines).

use crate::chip::Block;
use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::{Picoseconds, SECOND};
use crate::chip::violation::Violation;

const CR1: u32 = 0x00;
const SR: u32 = 0x08;
const DR: u32 = 0x0c;

/// Bits of CR1.
const CPHA: u32 = 1 << 0;
const MSTR: u32 = 1 << 2;
const SPE: u32 = 1 << 6;
const LSBFIRST: u32 = 1 << 7;
const DFF: u32 = 1 << 11;
/// Flags in SR.
const RXNE: u32 = 1 << 0;
const TXE: u32 = 1 << 1;
const OVR: u32 = 1 << 6;
const BSY: u32 = 1 << 7;

/// A byte on the wires.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// When its last bit is sampled: by the edge before the last, or by the last.
    sampled: Picoseconds,
    last_edge: Picoseconds,
    end: Picoseconds,
    received: u8,
    delivered: bool,
}

pub struct Spi {
    /// 1 or 2.
    number: u8,
    registers: Registers,
    /// Flags that stay until they are cleared.
    flags: u32,
    /// Data were read since the overrun.
    overrun_read: bool,
    received: u8,
    waiting: Option<u8>,
    frame: Option<Frame>,
    /// When the next frame may begin.
    free: Picoseconds,
}

impl Spi {
    pub fn new(number: u8) -> Self {
        let registers = Registers::new(&[]);
        Self { number, registers, flags: 0, overrun_read: false, received: 0, waiting: None, frame: None, free: 0 }
    }

    /// 0 to 3: CPOL and CPHA; none for frames that are not bytes with their highest bit first, which are not modelled.
    pub fn mode(&self) -> Option<u8> {
        (self.registers[CR1] & (DFF | LSBFIRST) == 0).then_some((self.registers[CR1] & 0b11) as u8)
    }

    /// Clock on the wires for a bus clock, Hz.
    pub fn sck_hz(&self, pclk_hz: u32) -> u32 {
        pclk_hz >> ((self.registers[CR1] >> 3 & 0b111) + 1)
    }

    /// Whether it drives its clock.
    pub fn is_master(&self) -> bool {
        self.registers[CR1] & (MSTR | SPE) == MSTR | SPE
    }

    /// Whether its clock has edges to come.
    pub fn is_clocking(&self, now: Picoseconds) -> bool {
        self.frame.is_some_and(|frame| now < frame.last_edge)
    }

    /// Value that the frame before has left in the last bit.
    pub fn last_bit(&self) -> u8 {
        self.received & 1
    }

    /// Delivers what has been received by `now`, and gives the next byte that goes out, with its start.
    pub fn advance(&mut self, now: Picoseconds) -> Option<(u8, Picoseconds)> {
        if let Some(frame) = &mut self.frame {
            if !frame.delivered && now >= frame.sampled {
                frame.delivered = true;
                if self.flags & RXNE != 0 {
                    self.flags |= OVR;
                    self.overrun_read = false;
                } else {
                    self.received = frame.received;
                    self.flags |= RXNE;
                }
            }
            if now < frame.end {
                return None;
            }
            self.frame = None;
        }
        let byte = if self.is_master() { self.waiting.take()? } else { return None };
        Some((byte, self.free))
    }

    /// A frame that began at `start` and brings `received`.
    pub fn begin(&mut self, start: Picoseconds, sck_hz: u32, received: u8) {
        let bit = SECOND / u64::from(sck_hz.max(1));
        let end = start + 8 * bit;
        let sampled = end - bit / 2;
        // The first edge samples, half a bit after its data, or it is there with them and the second one samples.
        let last_edge = if self.registers[CR1] & CPHA == 0 { end } else { sampled };
        self.frame = Some(Frame { sampled, last_edge, end, received, delivered: false });
        self.free = end;
    }
}

impl Peripheral for Spi {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        match offset {
            SR => {
                let empty = if self.waiting.is_none() { TXE } else { 0 };
                let busy = if self.frame.is_some() { BSY } else { 0 };
                self.flags | empty | busy
            }
            DR => self.received.into(),
            _ => self.registers[offset],
        }
    }

    fn was_read(&mut self, offset: u32) {
        match offset {
            SR if self.overrun_read => self.flags &= !OVR,
            DR => {
                self.flags &= !RXNE;
                self.overrun_read = true;
            }
            _ => {}
        }
    }

    fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> Option<Violation> {
        if offset != DR {
            self.registers[offset] = value;
            return None;
        }
        self.free = self.free.max(now);
        self.waiting.replace(value as u8).map(|_| Violation::Overwritten(Block::Spi(self.number)))
    }

    fn reset(&mut self) {
        *self = Self::new(self.number);
    }
}
