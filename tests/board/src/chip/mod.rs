//! The chip: its blocks at their addresses, its time, and what is wired to it.
//!
//! The models follow the reference manual (RM0090) and the data sheet of the STM32F405, not the firmware. They know what the firmware's
//! modules for hardware use, and report what they do not know.

pub mod clocks;
pub mod gpio;
pub mod lines;
pub mod memory;
pub mod pads;
pub mod rcc;
pub mod spi;
mod time;
mod timer;
pub mod usart;
pub mod violation;

use crate::wires::Wired;
use clocks::Clocks;
use gpio::{PINS, Pin, Port};
use lines::Change;
use memory::{Flash, Power};
use rcc::{Gate, Oscillators, Rcc};
use spi::Spi;
use time::{NANOSECOND, Picoseconds};
use timer::Timer;
use usart::Usart;
use violation::{Violation, Violations};

/// Ports of pins, from A to I.
const PORTS: usize = 9;
/// From here on each word is one bit of the peripherals.
const BITS: u32 = 0x4200_0000;
const PERIPHERALS: u32 = 0x4000_0000;

/// A block of registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Block {
    Tim5,
    /// 1 to 3.
    Spi(u8),
    Usart2,
    Power,
    Rcc,
    Flash,
    /// By its place among the ports.
    Port(u8),
}

impl Block {
    /// The block at an address, and where in it.
    fn at(address: u32) -> Option<(Self, u32)> {
        let (block, start) = match address {
            0x4000_0c00..0x4000_1000 => (Self::Tim5, 0x4000_0c00),
            0x4000_3800..0x4000_3c00 => (Self::Spi(2), 0x4000_3800),
            0x4000_3c00..0x4000_4000 => (Self::Spi(3), 0x4000_3c00),
            0x4000_4400..0x4000_4800 => (Self::Usart2, 0x4000_4400),
            0x4000_7000..0x4000_7400 => (Self::Power, 0x4000_7000),
            0x4001_3000..0x4001_3400 => (Self::Spi(1), 0x4001_3000),
            0x4002_0000..0x4002_2400 => {
                let port = (address >> 10 & 0xf) as u8;
                (Self::Port(port), 0x4002_0000 + (u32::from(port) << 10))
            }
            0x4002_3800..0x4002_3c00 => (Self::Rcc, 0x4002_3800),
            0x4002_3c00..0x4002_4000 => (Self::Flash, 0x4002_3c00),
            _ => return None,
        };
        Some((block, address - start))
    }

    /// Register bits that switch its clock and reset it.
    pub fn gate(self) -> Option<Gate> {
        Some(match self {
            Self::Tim5 => Gate::apb1(3),
            Self::Spi(1) => Gate::apb2(12),
            Self::Spi(number) => Gate::apb1(12 + u32::from(number)),
            Self::Usart2 => Gate::apb1(17),
            Self::Power => Gate::apb1(28),
            Self::Port(port) => Gate::ahb1(port.into()),
            Self::Rcc | Self::Flash => return None,
        })
    }

    /// The clock of its bus, Hz.
    fn bus_hz(self, clocks: &Clocks) -> u32 {
        match self {
            Self::Tim5 | Self::Spi(2..) | Self::Usart2 | Self::Power => clocks.pclk1_hz,
            Self::Spi(_) => clocks.pclk2_hz,
            Self::Rcc | Self::Flash | Self::Port(_) => clocks.hclk_hz,
        }
    }

    /// Whether the bus writes single bytes. The others repeat them over the word: RM0090 section 2.1.12.
    fn has_byte_lanes(self) -> bool {
        matches!(self, Self::Rcc | Self::Flash | Self::Port(_))
    }
}

/// The chip and what is wired to it.
pub struct Chip {
    pub rcc: Rcc,
    pub flash: Flash,
    power: Power,
    ports: [Port; PORTS],
    spi: [Spi; 3],
    timer: Timer,
    pub usart2: Usart,
    wired: Vec<Wired>,
    /// Levels that pins drive.
    driven: [[Option<bool>; PINS]; PORTS],
    /// Changes of what pins drive.
    changes: Vec<Change>,
    violations: Violations,
    now: Picoseconds,
    accesses: u64,
    /// State at the last check for violations.
    judged: Option<(Clocks, u32, bool)>,
}

impl Chip {
    /// A chip after power-up.
    pub fn new(oscillators: Oscillators) -> Self {
        let port = |index: usize| Port::new((b'A' + index as u8) as char);
        Self {
            rcc: Rcc::new(oscillators),
            flash: Flash::default(),
            power: Power::default(),
            ports: std::array::from_fn(port),
            spi: Default::default(),
            timer: Timer::default(),
            usart2: Usart::default(),
            wired: Vec::new(),
            driven: [[None; PINS]; PORTS],
            changes: Vec::new(),
            violations: Violations::default(),
            now: 0,
            accesses: 0,
            judged: None,
        }
    }

    /// Time since power-up, ns.
    pub fn now_ns(&self) -> u64 {
        self.now / NANOSECOND
    }

    /// Accesses of registers so far.
    pub fn accesses(&self) -> u64 {
        self.accesses
    }

    /// Violations by the firmware, with the times in nanoseconds.
    pub fn violations(&self) -> &[(u64, Violation)] {
        self.violations.list()
    }

    pub fn clocks(&self) -> Clocks {
        self.rcc.clocks()
    }

    /// An SPI, 1 to 3.
    pub fn spi(&self, number: usize) -> &Spi {
        &self.spi[number - 1]
    }

    /// The clock of an SPI, 1 to 3, on its wires, Hz.
    pub fn sck_hz(&self, number: u8) -> u32 {
        self.spi(number.into()).sck_hz(Block::Spi(number).bus_hz(&self.clocks()))
    }

    /// The core waits.
    pub fn wait_cycles(&mut self, cycles: u32) {
        self.now += time::of_cycles(cycles.into(), self.clocks().hclk_hz);
        self.advance();
    }

    /// Time without the firmware, ns.
    pub fn wait_ns(&mut self, time_ns: u64) {
        self.now += time_ns * NANOSECOND;
        self.advance();
    }

    /// The firmware reads a word.
    pub fn read(&mut self, address: u32) -> u32 {
        let (word, bit) = word_of(address);
        let Some((block, offset)) = self.access(word) else { return 0 };
        let value = self.read_block(block, offset);
        bit.map_or(value, |bit| value >> bit & 1)
    }

    /// The firmware writes some bytes.
    pub fn write(&mut self, address: u32, value: u32, bytes: u32) {
        let (word, bit) = word_of(address);
        let Some((block, offset)) = self.access(word) else { return };
        let value = match (bit, bytes) {
            (Some(bit), _) => self.read_block(block, offset) & !(1 << bit) | (value & 1) << bit,
            (None, 4) => value,
            (None, 2) if !block.has_byte_lanes() => (value & 0xffff) * 0x0001_0001,
            (None, _) if !block.has_byte_lanes() => (value & 0xff) * 0x0101_0101,
            (None, _) => {
                let shift = 8 * (address & 3);
                let mask = ((1 << (8 * bytes)) - 1) << shift;
                self.read_block(block, offset) & !mask | value << shift & mask
            }
        };
        if !self.rcc.resets(block) {
            self.write_block(block, offset, value);
        }
        if block == Block::Rcc {
            self.reset_blocks();
        }
        self.advance();
        if matches!(block, Block::Rcc | Block::Port(_)) {
            self.move_lines();
        }
    }

    /// Lets the time of an access pass. None: there is nothing to access.
    fn access(&mut self, word: u32) -> Option<(Block, u32)> {
        self.accesses += 1;
        let clocks = self.clocks();
        let found = Block::at(word);
        let bus_hz = found.map_or(clocks.hclk_hz, |(block, _)| block.bus_hz(&clocks));
        self.now += time::of_access(clocks.hclk_hz, bus_hz);
        self.advance();
        let Some((block, _)) = found else {
            self.violations.add(self.now, Violation::NoModel { address: word });
            return None;
        };
        if !self.rcc.enables(block) {
            self.violations.add(self.now, Violation::NoClock(block));
            return None;
        }
        found
    }

    fn read_block(&mut self, block: Block, offset: u32) -> u32 {
        match block {
            Block::Tim5 => self.timer.read(offset),
            Block::Spi(number) => self.spi[usize::from(number) - 1].read(offset),
            Block::Usart2 => self.usart2.read(offset, self.now),
            Block::Power => self.power.read(offset),
            Block::Rcc => self.rcc.read(offset),
            Block::Flash => self.flash.read(offset),
            Block::Port(port) => self.ports[usize::from(port)].read(offset),
        }
    }

    fn write_block(&mut self, block: Block, offset: u32, value: u32) {
        let now = self.now;
        let kept = match block {
            Block::Tim5 => {
                self.timer.write(offset, value);
                true
            }
            Block::Spi(number) => self.spi[usize::from(number) - 1].write(offset, value, now),
            Block::Usart2 => self.usart2.write(offset, value, now),
            Block::Power => {
                self.power.write(offset, value);
                true
            }
            Block::Rcc => {
                if let Some(violation) = self.rcc.write(offset, value, now) {
                    self.violations.add(now, violation);
                }
                true
            }
            Block::Flash => {
                self.flash.write(offset, value);
                true
            }
            Block::Port(port) => {
                self.ports[usize::from(port)].write(offset, value);
                true
            }
        };
        if !kept {
            self.violations.add(now, Violation::Overwritten(block));
        }
    }

    fn reset_blocks(&mut self) {
        for number in 1..=3 {
            if self.rcc.resets(Block::Spi(number)) {
                self.spi[usize::from(number) - 1] = Spi::default();
            }
        }
        for (index, port) in self.ports.iter_mut().enumerate() {
            if self.rcc.resets(Block::Port(index as u8)) {
                port.reset((b'A' + index as u8) as char);
            }
        }
        if self.rcc.resets(Block::Tim5) {
            self.timer = Timer::default();
        }
        if self.rcc.resets(Block::Usart2) {
            self.usart2.reset();
        }
        if self.rcc.resets(Block::Power) {
            self.power = Power::default();
        }
    }

    /// Brings every block up to the present.
    fn advance(&mut self) {
        self.rcc.advance(self.now);
        let clocks = self.clocks();
        let state = (clocks, self.flash.wait_states(), self.power.upper_scale());
        if self.judged != Some(state) {
            self.judged = Some(state);
            self.violations.standing(self.now, clocks.violations(state.1, state.2));
        }
        let timer_hz = self.rcc.enables(Block::Tim5).then_some(clocks.timers1_hz);
        self.timer.advance(self.now, timer_hz, self.rcc.slow(self.now));
        self.usart2.advance(self.now, clocks.pclk1_hz);
        for number in 1..=3 {
            self.advance_spi(number, Block::Spi(number).bus_hz(&clocks));
        }
    }

    /// A pin's port.
    fn port(&self, pin: Pin) -> &Port {
        &self.ports[pin.index()]
    }
}

/// The word that an address belongs to, and its bit where the address is one: RM0090 section 2.3.2.
fn word_of(address: u32) -> (u32, Option<u32>) {
    if address >> 24 != BITS >> 24 {
        return (address & !3, None);
    }
    let bit = (address - BITS) / 4;
    (PERIPHERALS + bit / 32 * 4, Some(bit % 32))
}
