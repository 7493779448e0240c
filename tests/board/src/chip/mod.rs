//! The chip: its blocks at their addresses, its time, and what is wired to it.
//!
//! The models follow the reference manuals (RM0090, RM0440) and the data sheets of the STM32F405, STM32F407 and STM32G474, not the firmware. They know what the firmware's
//! modules for hardware use, and report what they do not know.

pub mod analog;
pub mod clocks;
mod dma;
pub mod family;
pub mod flash;
pub mod gpio;
pub mod lines;
pub mod memory;
pub mod pads;
mod pin;
pub mod rcc;
pub mod registers;
pub mod spi;
mod time;
mod timer;
pub mod usart;
pub mod violation;
pub mod watchdog;

use crate::wires::{Watch, Wired};
use analog::{Adc, Common, Dac, Surroundings};
use clocks::Clocks;
use dma::Dma;
use family::Family;
use flash::Flash;
use gpio::{Mode, PINS, Pin, Port};
use lines::Change;
use memory::Memory;
use rcc::{Gate, Oscillators, Rcc};
use registers::Peripheral;
use spi::Spi;
use time::{NANOSECOND, Picoseconds};
use timer::Timer;
use usart::Usart;
use violation::Violation;
use watchdog::Watchdog;

/// Ports of pins, from A to I.
const PORTS: usize = 9;
/// From here on each word is one bit of the peripherals.
const BITS: u32 = 0x4200_0000;
const PERIPHERALS: u32 = 0x4000_0000;

/// A block of registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Block {
    Tim5,
    /// 1 or 2.
    Spi(u8),
    Usart2,
    Watchdog,
    Dac,
    /// 1 to 3, and what they share.
    Adc(u8),
    AdcCommon,
    /// The same of ADC3 of an STM32G4.
    Adc3Common,
    Dma,
    Dmamux,
    Power,
    Rcc,
    Flash,
    /// By its place among the ports.
    Port(u8),
}

impl Block {
    /// The block at an address, and where in it.
    fn at(family: Family, address: u32) -> Option<(Self, u32)> {
        let common = match address {
            0x4000_0c00..0x4000_1000 => Some((Self::Tim5, 0x4000_0c00)),
            0x4000_3000..0x4000_3400 => Some((Self::Watchdog, 0x4000_3000)),
            0x4000_4400..0x4000_4800 => Some((Self::Usart2, 0x4000_4400)),
            0x4000_7000..0x4000_7400 => Some((Self::Power, 0x4000_7000)),
            _ => None,
        };
        let (block, start) = common.or_else(|| match family {
            Family::F4 => Self::at_f4(address),
            Family::G4 => Self::at_g4(address),
        })?;
        Some((block, address - start))
    }

    /// The block at an address of an STM32G4, and its first address.
    fn at_g4(address: u32) -> Option<(Self, u32)> {
        Some(match address {
            0x4002_0000..0x4002_0400 => (Self::Dma, 0x4002_0000),
            0x4002_0800..0x4002_0c00 => (Self::Dmamux, 0x4002_0800),
            0x4002_1000..0x4002_1400 => (Self::Rcc, 0x4002_1000),
            0x4002_2000..0x4002_2400 => (Self::Flash, 0x4002_2000),
            0x4800_0000..0x4800_1c00 => {
                let port = (address >> 10 & 0xf) as u8;
                (Self::Port(port), 0x4800_0000 + (u32::from(port) << 10))
            }
            0x5000_0000..0x5000_0100 => (Self::Adc(1), 0x5000_0000),
            0x5000_0100..0x5000_0200 => (Self::Adc(2), 0x5000_0100),
            0x5000_0300..0x5000_0400 => (Self::AdcCommon, 0x5000_0300),
            0x5000_0400..0x5000_0500 => (Self::Adc(3), 0x5000_0400),
            0x5000_0700..0x5000_0800 => (Self::Adc3Common, 0x5000_0700),
            0x5000_0800..0x5000_0c00 => (Self::Dac, 0x5000_0800),
            _ => return None,
        })
    }

    /// The same of an STM32F4.
    fn at_f4(address: u32) -> Option<(Self, u32)> {
        Some(match address {
            0x4000_3800..0x4000_3c00 => (Self::Spi(2), 0x4000_3800),
            0x4000_7400..0x4000_7800 => (Self::Dac, 0x4000_7400),
            0x4001_2000..0x4001_2300 => {
                let index = (address >> 8 & 0b11) as u8;
                (Self::Adc(index + 1), 0x4001_2000 + (u32::from(index) << 8))
            }
            0x4001_2300..0x4001_2400 => (Self::AdcCommon, 0x4001_2300),
            0x4001_3000..0x4001_3400 => (Self::Spi(1), 0x4001_3000),
            0x4002_0000..0x4002_2400 => {
                let port = (address >> 10 & 0xf) as u8;
                (Self::Port(port), 0x4002_0000 + (u32::from(port) << 10))
            }
            0x4002_3800..0x4002_3c00 => (Self::Rcc, 0x4002_3800),
            0x4002_6400..0x4002_6800 => (Self::Dma, 0x4002_6400),
            0x4002_3c00..0x4002_4000 => (Self::Flash, 0x4002_3c00),
            _ => return None,
        })
    }

    /// Register bits that switch its clock and reset it.
    pub fn gate(self, family: Family) -> Option<Gate> {
        let [ahb, apb1, apb2] = match family {
            Family::F4 => [[0x30, 0x10], [0x40, 0x20], [0x44, 0x24]],
            Family::G4 => [[0x4c, 0x2c], [0x58, 0x38], [0x60, 0x40]],
        }
        .map(|[enable, reset]| move |bit| Gate { enable, reset, bit, reset_bit: bit });
        Some(match (self, family) {
            (Self::Tim5, _) => apb1(3),
            (Self::Usart2, _) => apb1(17),
            (Self::Power, _) => apb1(28),
            (Self::Port(port), _) => ahb(port.into()),
            (Self::Spi(1), _) => apb2(12),
            (Self::Spi(_), _) => apb1(14),
            (Self::Dac, Family::F4) => apb1(29),
            // One bit resets all three.
            (Self::Adc(number), Family::F4) => Gate { reset_bit: 8, ..apb2(7 + u32::from(number)) },
            (Self::AdcCommon, Family::F4) => apb2(8),
            (Self::Dac, Family::G4) => ahb(16),
            (Self::Adc(3) | Self::Adc3Common, _) => ahb(14),
            (Self::Adc(_) | Self::AdcCommon, Family::G4) => ahb(13),
            (Self::Dma, Family::F4) => ahb(22),
            // AHB1.
            (Self::Dma, Family::G4) => Gate { enable: 0x48, reset: 0x28, bit: 0, reset_bit: 0 },
            (Self::Dmamux, _) => Gate { enable: 0x48, reset: 0x28, bit: 2, reset_bit: 2 },
            (Self::Rcc | Self::Flash | Self::Watchdog, _) => return None,
        })
    }

    /// The clock of its bus, Hz.
    fn bus_hz(self, clocks: &Clocks) -> u32 {
        match self {
            Self::Watchdog | Self::Tim5 | Self::Spi(2) | Self::Usart2 | Self::Dac | Self::Power => clocks.pclk1_hz,
            Self::Spi(_) | Self::Adc(_) | Self::AdcCommon | Self::Adc3Common => clocks.pclk2_hz,
            Self::Dma | Self::Dmamux | Self::Rcc | Self::Flash | Self::Port(_) => clocks.hclk_hz,
        }
    }
}

pub struct Chip {
    family: Family,
    pub rcc: Rcc,
    /// The flash interface of an STM32F4, and that of an STM32G4.
    pub flash: Memory,
    pub flash_g4: Flash,
    pub watchdog: Watchdog,
    power: Memory,
    ports: [Port; PORTS],
    spi: [Spi; 2],
    timer: Timer,
    pub usart2: Usart,
    pub dac: Dac,
    pub adcs: [Adc; 3],
    commons: [Common; 2],
    dma: Dma,
    pub around: Surroundings,
    wired: Vec<Wired>,
    watches: Vec<Watch>,
    /// Levels that pins drive.
    driven: [[Option<bool>; PINS]; PORTS],
    /// Changes of what pins drive.
    changes: Vec<Change>,
    /// Actions of the firmware that the documents forbid, each once.
    violations: Vec<Violation>,
    now: Picoseconds,
}

impl Chip {
    pub fn new(family: Family, oscillators: Oscillators) -> Self {
        let port = |index: usize| Port::new(family, (b'A' + index as u8) as char);
        Self {
            family,
            rcc: Rcc::new(family, oscillators),
            flash: Memory::flash(),
            flash_g4: Flash::default(),
            watchdog: Watchdog::default(),
            power: Memory::power(family),
            ports: std::array::from_fn(port),
            spi: [1, 2].map(Spi::new),
            timer: Timer::new(family),
            usart2: Usart::new(family),
            dac: Dac::new(family),
            adcs: [1, 2, 3].map(|number| Adc::new(family, number)),
            commons: [(); 2].map(|()| Common::new(family)),
            dma: Dma::new(family),
            around: Surroundings::new(family),
            wired: Vec::new(),
            watches: Vec::new(),
            driven: [[None; PINS]; PORTS],
            changes: Vec::new(),
            violations: Vec::new(),
            now: 0,
        }
    }

    /// Time since power-up, ns.
    pub fn now_ns(&self) -> u64 {
        self.now / NANOSECOND
    }

    /// Violations by the firmware, in the order of their first times.
    pub fn violations(&self) -> &[Violation] {
        &self.violations
    }

    fn note(&mut self, violation: Violation) {
        if !self.violations.contains(&violation) {
            self.violations.push(violation);
        }
    }

    pub fn clocks(&self) -> Clocks {
        self.rcc.clocks()
    }

    /// An SPI, 1 or 2.
    pub fn spi(&self, number: usize) -> &Spi {
        &self.spi[number - 1]
    }

    /// The clock of an SPI, 1 or 2, on its wires, Hz.
    pub fn sck_hz(&self, number: u8) -> u32 {
        self.spi(number.into()).sck_hz(Block::Spi(number).bus_hz(&self.clocks()))
    }

    pub fn wait_cycles(&mut self, cycles: u32) {
        self.now += time::of_cycles(cycles.into(), self.clocks().hclk_hz);
        self.advance();
    }

    /// Time without the firmware, ns.
    pub fn wait_ns(&mut self, time_ns: u64) {
        self.now += time_ns * NANOSECOND;
        self.advance();
    }

    /// The slow oscillator has another frequency from now on, Hz, or none.
    pub fn change_slow(&mut self, hz: Option<u32>) {
        self.rcc.change_slow(hz, self.now);
    }

    /// A reset of the chip by any of its causes: every block is as after power-up, and what is connected stays.
    pub fn reset(&mut self) {
        self.blocks()
            .chain([Block::Rcc, Block::Flash, Block::Watchdog])
            .for_each(|block| self.peripheral(block).reset());
        self.advance();
        self.move_lines();
    }

    /// Blocks that the clock control can reset.
    fn blocks(&self) -> impl Iterator<Item = Block> + use<> {
        let ports = (0..PORTS as u8).map(Block::Port);
        let converters = [Block::Dac, Block::Adc(1), Block::Adc(2), Block::Adc(3), Block::AdcCommon, Block::Adc3Common];
        [Block::Dma, Block::Dmamux, Block::Tim5, Block::Spi(1), Block::Spi(2), Block::Usart2, Block::Power]
            .into_iter()
            .chain(converters)
            .chain(ports)
    }

    /// The firmware reads a word.
    pub fn read(&mut self, address: u32) -> u32 {
        if address & !3 == analog::factory_word(self.family) {
            return self.around.factory_word();
        }
        if is_page(address) {
            return self.flash_g4.word(address & !3);
        }
        let (word, bit) = word_of(address);
        let Some((block, offset)) = self.access(word) else { return 0 };
        let now = self.now;
        let peripheral = self.peripheral(block);
        let value = peripheral.value(offset, now);
        peripheral.was_read(offset);
        bit.map_or(value, |bit| value >> bit & 1)
    }

    /// The value of a word, which the firmware does not see.
    pub fn peek(&mut self, address: u32) -> u32 {
        let (word, bit) = word_of(address);
        let now = self.now;
        let value = Block::at(self.family, word).map_or(0, |(block, offset)| self.peripheral(block).value(offset, now));
        bit.map_or(value, |bit| value >> bit & 1)
    }

    /// The firmware writes a word.
    pub fn write(&mut self, address: u32, value: u32) {
        if is_page(address) {
            if let Some(violation) = self.flash_g4.program(address, value, self.now) {
                self.note(violation);
            }
            return;
        }
        let (word, bit) = word_of(address);
        let Some((block, offset)) = self.access(word) else { return };
        let value = bit.map_or(value, |bit| self.peek(word) & !(1 << bit) | (value & 1) << bit);
        let now = self.now;
        if !self.rcc.resets(block)
            && let Some(violation) = self.peripheral(block).write(offset, value, now)
        {
            self.note(violation);
        }
        if block == Block::Rcc {
            for block in self.blocks() {
                if self.rcc.resets(block) {
                    self.peripheral(block).reset();
                }
            }
        }
        self.advance();
        if matches!(block, Block::Rcc | Block::Port(_)) {
            self.move_lines();
        }
    }

    /// Lets the time of an access pass. None: there is nothing to access.
    fn access(&mut self, word: u32) -> Option<(Block, u32)> {
        let clocks = self.clocks();
        let found = Block::at(self.family, word);
        let bus_hz = found.map_or(clocks.hclk_hz, |(block, _)| block.bus_hz(&clocks));
        self.now += time::of_access(clocks.hclk_hz, bus_hz);
        self.advance();
        let Some((block, _)) = found else {
            self.note(Violation::NoModel { address: word });
            return None;
        };
        if !self.rcc.enables(block) {
            self.note(Violation::NoClock(block));
            return None;
        }
        found
    }

    fn peripheral(&mut self, block: Block) -> &mut dyn Peripheral {
        match block {
            Block::Tim5 => &mut self.timer,
            Block::Spi(number) => &mut self.spi[usize::from(number) - 1],
            Block::Usart2 => &mut self.usart2,
            Block::Watchdog => &mut self.watchdog,
            Block::Dac => &mut self.dac,
            Block::Adc(number) => &mut self.adcs[usize::from(number) - 1],
            Block::AdcCommon => &mut self.commons[0],
            Block::Adc3Common => &mut self.commons[1],
            Block::Dma => &mut self.dma,
            Block::Dmamux => &mut self.dma.mux,
            Block::Power => &mut self.power,
            Block::Rcc => &mut self.rcc,
            Block::Flash if self.family == Family::G4 => &mut self.flash_g4,
            Block::Flash => &mut self.flash,
            Block::Port(port) => &mut self.ports[usize::from(port)],
        }
    }

    /// Brings every block up to the present.
    fn advance(&mut self) {
        self.rcc.advance(self.now);
        let clocks = self.clocks();
        let wait_states = match self.family {
            Family::F4 => self.flash.wait_states(),
            Family::G4 => self.flash_g4.wait_states(),
        };
        let broken = clocks.violations(wait_states, self.power.upper_scale(self.family), self.family.layout());
        broken.into_iter().for_each(|violation| self.note(violation));
        let timer_hz = self.rcc.enables(Block::Tim5).then_some(clocks.timers1_hz);
        self.timer.advance(self.now, timer_hz, self.rcc.slow(self.now));
        self.usart2.advance(self.now, clocks.pclk1_hz);
        for number in [1, 2] {
            self.advance_spi(number, Block::Spi(number).bus_hz(&clocks));
        }
        for index in 0..self.adcs.len() {
            self.advance_adc(index, Block::AdcCommon.bus_hz(&clocks));
        }
    }

    /// Begins and ends conversions of an ADC up to the present.
    fn advance_adc(&mut self, index: usize, bus_hz: u32) {
        let common = &self.commons[usize::from(self.family == Family::G4 && index == 2)];
        let (now, clock_hz, reference_is_on) = (self.now, common.clock_hz(bus_hz), common.reference_is_on());
        if let Some(violation) = self.adcs[index].begin(now, clock_hz, reference_is_on) {
            self.note(violation);
        }
        while let Some((channel, end)) = self.adcs[index].ended(now, clock_hz) {
            if clock_hz > self.family.layout().adcs {
                self.note(Violation::ConverterClock { hz: clock_hz });
            }
            let volts = self.channel_volts(index as u8 + 1, channel, end);
            self.adcs[index].convert(volts, &mut self.around, end);
            // The DMA is that of ADC3.
            let code = self.adcs[index].request().filter(|_| index == 2 && self.rcc.enables(Block::Dma));
            match code.and_then(|code| self.dma.take(code)) {
                Some(Ok(is_last)) => self.adcs[index].taken(is_last),
                Some(Err(violation)) => self.note(violation),
                None => {}
            }
        }
    }

    /// The voltage at a channel of the ADCs.
    fn channel_volts(&mut self, adc: u8, channel: u32, at: Picoseconds) -> f64 {
        let Some(pin) = analog::pin_of(self.family, adc, channel) else {
            return if channel == analog::reference(self.family) { self.around.reference_v } else { 0.0 };
        };
        if self.pad(pin).mode != Mode::Analog {
            self.note(Violation::NotAnalog { pin });
        }
        let course = self.around.course.as_ref().filter(|(other, _)| *other == pin);
        course.map_or_else(|| self.volts(pin), |(_, course)| course(at / NANOSECOND))
    }

    /// The voltage at a pin: that of the DAC, or from outside; 0 V by a resistor where nothing drives it.
    pub fn volts(&self, pin: Pin) -> f64 {
        if let Some((shorted, volts)) = self.around.shorted
            && shorted == pin
        {
            return volts;
        }
        let analog = self.pad(pin).mode == Mode::Analog;
        let driven = analog::dac_channel(pin).filter(|_| analog);
        let driven = driven.and_then(|channel| self.dac.volts(channel, self.around.supply_v));
        let outside = self.around.volts.iter().find(|(other, _)| *other == pin);
        driven.or(outside.map(|(_, volts)| *volts)).unwrap_or(0.0)
    }

    /// Puts a voltage to a pin from outside, V.
    pub fn put(&mut self, pin: Pin, volts: f64) {
        self.around.volts.retain(|(other, _)| *other != pin);
        self.around.volts.push((pin, volts));
    }

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

/// Whether an address is in the pages of the parameters.
fn is_page(address: u32) -> bool {
    (flash::START..flash::START + flash::LENGTH).contains(&address)
}
