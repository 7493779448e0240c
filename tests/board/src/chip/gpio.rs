//! A port of pins, RM0090 section 8, RM0440 section 9.

use crate::chip::family::Family;
pub use crate::chip::pin::Pin;
use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::Picoseconds;
use crate::chip::violation::Violation;

/// Pins of a port.
pub const PINS: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Input,
    Output,
    /// With the number of the alternate function.
    Alternate(u8),
    Analog,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pull {
    None,
    Up,
    Down,
}

/// How fast a pad's edges are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Speed {
    Low,
    Medium,
    High,
    VeryHigh,
}

impl Speed {
    /// The fastest signal, Hz: data sheet, input/output AC characteristics, 2.7 V and more, 50 pF (40 and 30 pF for the upper two).
    pub fn limit_hz(self) -> u32 {
        match self {
            Self::Low => 4_000_000,
            Self::Medium => 25_000_000,
            Self::High => 50_000_000,
            Self::VeryHigh => 100_000_000,
        }
    }
}

/// How a pin is set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pad {
    pub mode: Mode,
    pub open_drain: bool,
    pub speed: Speed,
    pub pull: Pull,
}

const MODER: u32 = 0x00;
const OTYPER: u32 = 0x04;
const OSPEEDR: u32 = 0x08;
const PUPDR: u32 = 0x0c;
const IDR: u32 = 0x10;
const ODR: u32 = 0x14;
const BSRR: u32 = 0x18;
const AFRL: u32 = 0x20;

/// A port's registers and what is connected to its pins.
#[derive(Clone)]
pub struct Port {
    family: Family,
    name: char,
    registers: Registers,
    /// Levels from outside.
    pub outside: [Option<bool>; PINS],
}

impl Port {
    /// A port after a reset: the debug pins of A and B are set for the probe.
    pub fn new(family: Family, name: char) -> Self {
        let (moder, ospeedr, pupdr) = match (family, name) {
            (Family::F4, 'A') => (0xa800_0000, 0x0c00_0000, 0x6400_0000),
            (Family::F4, 'B') => (0x0000_0280, 0x0000_00c0, 0x0000_0100),
            (Family::F4, _) => (0, 0, 0),
            // The others are analog.
            (Family::G4, 'A') => (0xabff_ffff, 0x0c00_0000, 0x6400_0000),
            (Family::G4, 'B') => (0xffff_febf, 0x0000_00c0, 0x0000_0100),
            (Family::G4, _) => (0xffff_ffff, 0, 0),
        };
        let registers = Registers::new(&[(MODER, moder), (OSPEEDR, ospeedr), (PUPDR, pupdr)]);
        Self { family, name, registers, outside: [None; PINS] }
    }

    pub fn pad(&self, number: usize) -> Pad {
        let field = |register: u32| register >> (2 * number) & 0b11;
        let mode = match field(self.registers[MODER]) {
            0b00 => Mode::Input,
            0b01 => Mode::Output,
            0b10 => Mode::Alternate((self.registers[AFRL + number as u32 / 8 * 4] >> (4 * (number % 8)) & 0xf) as u8),
            _ => Mode::Analog,
        };
        let speed = match field(self.registers[OSPEEDR]) {
            0b00 => Speed::Low,
            0b01 => Speed::Medium,
            0b10 => Speed::High,
            _ => Speed::VeryHigh,
        };
        let pull = match field(self.registers[PUPDR]) {
            0b01 => Pull::Up,
            0b10 => Pull::Down,
            _ => Pull::None,
        };
        Pad { mode, open_drain: self.registers[OTYPER] >> number & 1 != 0, speed, pull }
    }

    /// The level that the pin drives as an output, if it does.
    pub fn driven(&self, number: usize) -> Option<bool> {
        let pad = self.pad(number);
        let high = self.registers[ODR] >> number & 1 != 0;
        (pad.mode == Mode::Output && !(pad.open_drain && high)).then_some(high)
    }

    /// The level at the pin. One that nothing drives or pulls is low.
    pub fn level(&self, number: usize) -> bool {
        let pulled = self.pad(number).pull == Pull::Up;
        self.driven(number).or(self.outside[number]).unwrap_or(pulled)
    }
}

impl Peripheral for Port {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        if offset != IDR {
            return self.registers[offset];
        }
        let digital = |&number: &usize| self.pad(number).mode != Mode::Analog && self.level(number);
        (0..PINS).filter(digital).fold(0, |levels, number| levels | 1 << number)
    }

    fn write(&mut self, offset: u32, value: u32, _: Picoseconds) -> Option<Violation> {
        match offset {
            OTYPER | ODR => self.registers[offset] = value & 0xffff,
            IDR => {}
            // Setting wins over clearing.
            BSRR => self.registers[ODR] = self.registers[ODR] & !(value >> 16) | value & 0xffff,
            _ => self.registers[offset] = value,
        }
        None
    }

    /// As after a reset; what is connected stays.
    fn reset(&mut self) {
        *self = Self { outside: self.outside, ..Self::new(self.family, self.name) };
    }
}
