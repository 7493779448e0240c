//! A port of pins, RM0090 section 8.

use std::fmt;

/// Pins of a port.
pub const PINS: usize = 16;

/// A pin by its port and number.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Pin {
    /// From 'A' to 'I'.
    pub port: char,
    pub number: u8,
}

impl Pin {
    pub const fn new(port: char, number: u8) -> Self {
        Self { port, number }
    }

    /// Place of the port among the ports.
    pub fn index(self) -> usize {
        self.port as usize - 'A' as usize
    }
}

impl fmt::Debug for Pin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "P{}{}", self.port, self.number)
    }
}

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

/// A port's registers and what is connected to its pins.
#[derive(Clone)]
pub struct Port {
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    odr: u32,
    lckr: u32,
    afr: [u32; 2],
    /// Levels from outside.
    pub outside: [Option<bool>; PINS],
}

impl Port {
    /// A port after a reset: the debug pins of A and B are set for the probe.
    pub fn new(port: char) -> Self {
        let (moder, ospeedr, pupdr) = match port {
            'A' => (0xa800_0000, 0x0c00_0000, 0x6400_0000),
            'B' => (0x0000_0280, 0x0000_00c0, 0x0000_0100),
            _ => (0, 0, 0),
        };
        Self { moder, otyper: 0, ospeedr, pupdr, odr: 0, lckr: 0, afr: [0; 2], outside: [None; PINS] }
    }

    /// As after a reset; what is connected stays.
    pub fn reset(&mut self, port: char) {
        *self = Self { outside: self.outside, ..Self::new(port) };
    }

    pub fn pad(&self, number: usize) -> Pad {
        let field = |register: u32| register >> (2 * number) & 0b11;
        let mode = match field(self.moder) {
            0b00 => Mode::Input,
            0b01 => Mode::Output,
            0b10 => Mode::Alternate((self.afr[number / 8] >> (4 * (number % 8)) & 0xf) as u8),
            _ => Mode::Analog,
        };
        let speed = match field(self.ospeedr) {
            0b00 => Speed::Low,
            0b01 => Speed::Medium,
            0b10 => Speed::High,
            _ => Speed::VeryHigh,
        };
        let pull = match field(self.pupdr) {
            0b01 => Pull::Up,
            0b10 => Pull::Down,
            _ => Pull::None,
        };
        Pad { mode, open_drain: self.otyper >> number & 1 != 0, speed, pull }
    }

    /// The level that the pin drives as an output, if it does.
    pub fn driven(&self, number: usize) -> Option<bool> {
        let pad = self.pad(number);
        let high = self.odr >> number & 1 != 0;
        (pad.mode == Mode::Output && !(pad.open_drain && high)).then_some(high)
    }

    /// The level at the pin. One that nothing drives or pulls is low.
    pub fn level(&self, number: usize) -> bool {
        let pulled = self.pad(number).pull == Pull::Up;
        self.driven(number).or(self.outside[number]).unwrap_or(pulled)
    }

    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x00 => self.moder,
            0x04 => self.otyper,
            0x08 => self.ospeedr,
            0x0c => self.pupdr,
            0x10 => {
                let digital = |&number: &usize| self.pad(number).mode != Mode::Analog && self.level(number);
                (0..PINS).filter(digital).fold(0, |levels, number| levels | 1 << number)
            }
            0x14 => self.odr,
            0x1c => self.lckr,
            0x20 => self.afr[0],
            0x24 => self.afr[1],
            _ => 0,
        }
    }

    pub fn write(&mut self, offset: u32, value: u32) {
        match offset {
            0x00 => self.moder = value,
            0x04 => self.otyper = value & 0xffff,
            0x08 => self.ospeedr = value,
            0x0c => self.pupdr = value,
            0x14 => self.odr = value & 0xffff,
            // Setting wins over clearing.
            0x18 => self.odr = self.odr & !(value >> 16) | value & 0xffff,
            0x1c => self.lckr = value,
            0x20 => self.afr[0] = value,
            0x24 => self.afr[1] = value,
            _ => {}
        }
    }
}
