//! Flash interface of an STM32F4, and power control: RM0090 sections 3.9 and 5.4, RM0440 section 6.4. Nothing can be erased or programmed.

use crate::chip::family::Family;
use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::Picoseconds;
use crate::chip::violation::Violation;

/// A block of which only the register that matters can be written.
pub struct Memory {
    pub registers: Registers,
    reset: Registers,
}

impl Memory {
    /// The register of option bytes of [`flash`](Self::flash), and two of its fields.
    pub const OPTCR: u32 = 0x14;
    pub const WATCHDOG_BY_SOFTWARE: u32 = 1 << 5;
    pub const BROWN_OUT_OFF: u32 = 0b11 << 2;
    const VOS: u32 = 1 << 14;
    /// R1MODE of an STM32G4.
    const CR5: u32 = 0x80;
    const NORMAL: u32 = 1 << 8;

    fn new(values: &[(u32, u32)]) -> Self {
        Self { registers: Registers::new(values), reset: Registers::new(values) }
    }

    /// The flash interface, locked, with the option bytes as delivered: watchdog by software, brown-out reset off.
    pub fn flash() -> Self {
        Self::new(&[(0x10, 1 << 31), (Self::OPTCR, 0x0fff_aaed)])
    }

    /// The power control: on an STM32F4 the upper scale of the regulator is set, and ready; on an STM32G4 it is not.
    pub fn power(family: Family) -> Self {
        Self::new(match family {
            Family::F4 => &[(0x00, Self::VOS), (0x04, Self::VOS)],
            Family::G4 => &[(0x00, 0x200), (Self::CR5, Self::NORMAL)],
        })
    }

    /// Wait states of the flash.
    pub fn wait_states(&self) -> u32 {
        self.registers[0x00] & 0b111
    }

    /// Whether the regulator allows the highest clock.
    pub fn upper_scale(&self, family: Family) -> bool {
        match family {
            Family::F4 => self.registers[0x00] & Self::VOS != 0,
            Family::G4 => self.registers[Self::CR5] & Self::NORMAL == 0,
        }
    }
}

impl Peripheral for Memory {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        self.registers[offset]
    }

    fn write(&mut self, offset: u32, value: u32, _: Picoseconds) -> Option<Violation> {
        if matches!(offset, 0x00 | Self::CR5) {
            self.registers[offset] = value;
        }
        None
    }

    fn reset(&mut self) {
        self.registers = self.reset.clone();
    }
}
