//! An SPI, RM0090 section 28: a full-duplex master, polled. What is on the wires is for [`lines`](crate::chip::lines).

use crate::chip::time::{Picoseconds, SECOND};

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SR: u32 = 0x08;
pub const DR: u32 = 0x0c;

/// Bits of CR1.
const CPHA: u32 = 1 << 0;
const MSTR: u32 = 1 << 2;
const SPE: u32 = 1 << 6;
const LSBFIRST: u32 = 1 << 7;
const SSI: u32 = 1 << 8;
const SSM: u32 = 1 << 9;
const DFF: u32 = 1 << 11;
/// Flags in SR.
const RXNE: u32 = 1 << 0;
const TXE: u32 = 1 << 1;
const MODF: u32 = 1 << 5;
const OVR: u32 = 1 << 6;
const BSY: u32 = 1 << 7;

/// A frame on the wires.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// When its last bit is sampled: by the edge before the last, or by the last.
    sampled: Picoseconds,
    last_edge: Picoseconds,
    end: Picoseconds,
    received: u16,
    delivered: bool,
}

#[derive(Default)]
pub struct Spi {
    cr1: u32,
    cr2: u32,
    /// Flags that stay until they are cleared.
    flags: u32,
    /// Data were read since the overrun.
    overrun_read: bool,
    received: u16,
    waiting: Option<u16>,
    frame: Option<Frame>,
    /// When the next frame may begin.
    free: Picoseconds,
}

impl Spi {
    /// 0 to 3: CPOL and CPHA.
    pub fn mode(&self) -> u8 {
        (self.cr1 & 0b11) as u8
    }

    /// Clock on the wires for a bus clock, Hz.
    pub fn sck_hz(&self, pclk_hz: u32) -> u32 {
        pclk_hz >> ((self.cr1 >> 3 & 0b111) + 1)
    }

    /// Bits of a frame.
    pub fn bits(&self) -> u32 {
        if self.cr1 & DFF != 0 { 16 } else { 8 }
    }

    pub fn is_lsb_first(&self) -> bool {
        self.cr1 & LSBFIRST != 0
    }

    /// Whether it drives its clock.
    pub fn is_master(&self) -> bool {
        self.cr1 & (MSTR | SPE) == MSTR | SPE
    }

    /// Whether its clock has edges to come.
    pub fn is_clocking(&self, now: Picoseconds) -> bool {
        self.frame.is_some_and(|frame| now < frame.last_edge)
    }

    /// Value that the frame before has left in the last bit.
    pub fn last_bit(&self) -> u16 {
        self.received & 1
    }

    /// Delivers what has been received by `now`, and gives the next word that goes out, with its start.
    pub fn advance(&mut self, now: Picoseconds) -> Option<(u16, Picoseconds)> {
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
        let word = if self.is_master() { self.waiting.take()? } else { return None };
        Some((word, self.free))
    }

    /// A frame that began at `start` and brings `received`.
    pub fn begin(&mut self, start: Picoseconds, sck_hz: u32, received: u16) {
        let bit = SECOND / u64::from(sck_hz.max(1));
        let end = start + u64::from(self.bits()) * bit;
        let sampled = end - bit / 2;
        // The first edge samples, half a bit after its data, or it is there with them and the second one samples.
        let last_edge = if self.cr1 & CPHA == 0 { end } else { sampled };
        self.frame = Some(Frame { sampled, last_edge, end, received, delivered: false });
        self.free = end;
    }

    pub fn read(&mut self, offset: u32) -> u32 {
        match offset {
            CR1 => self.cr1,
            CR2 => self.cr2,
            SR => {
                let status = self.status();
                if self.overrun_read {
                    self.flags &= !OVR;
                }
                status
            }
            DR => {
                self.flags &= !RXNE;
                self.overrun_read = true;
                self.received.into()
            }
            _ => 0,
        }
    }

    fn status(&self) -> u32 {
        let empty = if self.waiting.is_none() { TXE } else { 0 };
        let busy = if self.frame.is_some() { BSY } else { 0 };
        self.flags | empty | busy
    }

    /// Writes a register. False: data that waited were lost.
    pub fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> bool {
        match offset {
            CR1 => {
                self.cr1 = value;
                self.flags &= !MODF;
                // A master whose own select is low is not alone.
                if value & MSTR != 0 && value & SSM != 0 && value & SSI == 0 {
                    self.cr1 &= !(MSTR | SPE);
                    self.flags |= MODF;
                }
            }
            CR2 => self.cr2 = value,
            DR => {
                self.free = self.free.max(now);
                let mask = if self.bits() == 8 { 0xff } else { 0xffff };
                return self.waiting.replace(value as u16 & mask).is_none();
            }
            _ => {}
        }
        true
    }
}
