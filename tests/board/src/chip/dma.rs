//! The DMA for the codes of ADC3: stream 0 of DMA2 of an STM32F4, RM0090 section 10, and channel 1 of DMA1 of an STM32G4 with its request, RM0440
//! sections 12 and 13. It writes the firmware's ring, and nothing else.

use crate::chip::family::Family;
use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::Picoseconds;
use crate::chip::violation::Violation;
use crate::current::{LEN, RING};

pub struct Dma {
    registers: Registers,
    places: &'static Places,
    /// Transfers of a round.
    round: u32,
    /// Registers of the multiplexer: the request of the first channel.
    pub mux: Mux,
}

/// Places of registers, of which number, peripheral and memory follow the control; bits of the control.
struct Places {
    flags: u32,
    clear: u32,
    control: u32,
    /// The flag of the end of a round.
    ended: u32,
    circular: u32,
    /// Half words to one address after the other, and what selects the request of ADC3.
    mask: u32,
    halves: u32,
    request: u32,
    source: u32,
    /// A flag that is set keeps it from being switched on, and switching it off sets the flag.
    waits_for_flag: bool,
}

const F4: Places = Places {
    flags: 0x00,
    clear: 0x08,
    control: 0x10,
    ended: 1 << 5,
    circular: 1 << 8,
    mask: 0b111 << 25 | 0b11_1111 << 9 | 0b11 << 6,
    halves: 2 << 25 | 1 << 13 | 1 << 11 | 1 << 10,
    request: 0,
    source: 0x4001_224c,
    waits_for_flag: true,
};
const G4: Places = Places {
    flags: 0x00,
    clear: 0x04,
    control: 0x08,
    ended: 1 << 1,
    circular: 1 << 5,
    mask: 1 << 14 | 0b1111_1100_0000 | 1 << 4,
    halves: 1 << 10 | 1 << 8 | 1 << 7,
    request: 37,
    source: 0x5000_0440,
    waits_for_flag: false,
};
const EN: u32 = 1;

impl Dma {
    pub fn new(family: Family) -> Self {
        let places = if family == Family::F4 { &F4 } else { &G4 };
        Self { registers: Registers::new(&[]), places, round: 0, mux: Mux(0) }
    }

    /// Takes a code of ADC3, if it is on and selects its request; returns whether that was the last of a round.
    pub fn take(&mut self, code: u32) -> Option<Result<bool, Violation>> {
        let &Places { flags, control, ended, circular, mask, halves, request, source, .. } = self.places;
        let [number, peripheral, memory] = [4, 8, 12].map(|offset| control + offset);
        let set = self.registers[control];
        // The channel of an STM32F4 is a part of what it is set to.
        if set & EN == 0 || self.mux.0 & 0x7f != request || (set ^ halves) & mask & 0b111 << 25 != 0 {
            return None;
        }
        let address = self.registers[memory];
        let is_ring = address == RING.start() as u32 && self.round as usize <= LEN;
        if set & mask != halves || self.registers[peripheral] != source || !is_ring {
            return Some(Err(Violation::DmaTarget { address }));
        }
        let left = self.registers[number];
        // SAFETY: within the ring.
        unsafe { RING.start().add((self.round - left) as usize).write_volatile(code as u16) };
        self.registers[number] = left - 1;
        if left == 1 {
            self.registers[flags] |= ended;
            self.registers[number] = self.round;
            self.registers[control] &= if set & circular == 0 { !EN } else { !0 };
        }
        Some(Ok(left == 1))
    }
}

impl Peripheral for Dma {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        self.registers[offset]
    }

    fn write(&mut self, offset: u32, value: u32, _: Picoseconds) -> Option<Violation> {
        let &Places { flags, clear, control, ended, waits_for_flag, .. } = self.places;
        let before = self.registers[control];
        if offset == clear {
            self.registers[flags] &= !value;
        } else if before & EN != 0 && (offset != control || value & EN != 0) {
            return Some(Violation::DmaSetWhileOn);
        } else if offset == control && value & EN != 0 {
            if waits_for_flag && self.registers[flags] & ended != 0 {
                return Some(Violation::DmaSetWhileOn);
            }
            self.round = self.registers[control + 4];
            self.registers[control] = value;
        } else if offset != flags {
            self.registers[offset] = value;
            self.registers[flags] |= if waits_for_flag && before & EN != 0 { ended } else { 0 };
        }
        None
    }

    fn reset(&mut self) {
        (self.registers, self.round) = (Registers::new(&[]), 0);
    }
}

/// The request of the first channel of an STM32G4.
pub struct Mux(u32);

impl Peripheral for Mux {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        if offset == 0 { self.0 } else { 0 }
    }

    fn write(&mut self, offset: u32, value: u32, _: Picoseconds) -> Option<Violation> {
        self.0 = if offset == 0 { value } else { self.0 };
        None
    }

    fn reset(&mut self) {
        self.0 = 0;
    }
}
