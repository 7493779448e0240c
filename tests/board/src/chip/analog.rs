//! The chip's own converters, RM0090 sections 13 and 14: channels of the DAC, and ADCs that convert one channel when they are asked to.

use crate::chip::gpio::Pin;
use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::{MICROSECOND, Picoseconds, SECOND};
use crate::chip::violation::Violation;

/// Codes of every converter.
const CODES: f64 = 4096.0;

/// The channel of the chip's own reference.
pub const REFERENCE: u32 = 17;
/// The voltage of that reference, V, and the code that the factory has found for it at 3.3 V: data sheet, embedded reference voltage.
const REFERENCE_V: f64 = 1.21;
const FACTORY: u32 = 1502;
/// The code's address, in the upper half of its word.
pub const FACTORY_WORD: u32 = 0x1fff_7a28;

/// Supply, references and voltages around the converters.
pub struct Surroundings {
    /// The analog supply, which is the reference of all converters, V.
    pub supply_v: f64,
    /// The chip's own reference, V.
    pub reference_v: f64,
    pub factory: u32,
    /// Voltages at pins, from outside.
    pub volts: Vec<(Pin, f64)>,
    /// A pin of the DAC is shorted to this voltage.
    pub shorted: Option<(Pin, f64)>,
    /// Largest noise of a conversion, codes.
    pub noise: u32,
    seed: u32,
}

impl Default for Surroundings {
    fn default() -> Self {
        let (supply_v, reference_v) = (3.0, REFERENCE_V);
        Self { supply_v, reference_v, factory: FACTORY, volts: Vec::new(), shorted: None, noise: 0, seed: 1 }
    }
}

impl Surroundings {
    pub fn factory_word(&self) -> u32 {
        self.factory << 16
    }

    /// The code of a voltage, with noise.
    fn code(&mut self, volts: f64) -> u32 {
        self.seed = self.seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(self.seed >> 16) / 65_536.0 * 2.0 - 1.0;
        (volts / self.supply_v * CODES + noise * f64::from(self.noise)).round().clamp(0.0, CODES - 1.0) as u32
    }
}

/// The DAC: what its holding registers get goes to its outputs.
pub struct Dac {
    registers: Registers,
    /// Its outputs hold this whatever is written.
    pub holds: Option<u32>,
}

impl Dac {
    pub const CR: u32 = 0x00;
    const DHR12R: [u32; 2] = [0x08, 0x14];
    const DOR: [u32; 2] = [0x2c, 0x30];
    /// A channel's bits of CR: on, without buffer, triggered.
    const EN: u32 = 1 << 0;
    const BOFF: u32 = 1 << 1;
    const TEN: u32 = 1 << 2;

    /// The voltage that channel 0 or 1 drives its pin with, if it does: data sheet, DAC characteristics. With its buffer it does not come within
    /// 0.2 V of its ends; without, 15 kΩ drive the resistor of 1.5 MΩ to ground.
    pub fn volts(&self, channel: usize, supply_v: f64) -> Option<f64> {
        let control = self.registers[Self::CR] >> (16 * channel);
        let volts = f64::from(self.registers[Self::DOR[channel]]) / CODES * supply_v;
        let driven =
            if control & Self::BOFF == 0 { volts.clamp(0.2, supply_v - 0.2) } else { volts * (1500.0 / 1515.0) };
        (control & Self::EN != 0).then_some(driven)
    }
}

impl Default for Dac {
    fn default() -> Self {
        Self { registers: Registers::new(&[]), holds: None }
    }
}

impl Peripheral for Dac {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        self.registers[offset]
    }

    fn write(&mut self, offset: u32, value: u32, _: Picoseconds) -> Option<Violation> {
        match (0..2).find(|&channel| Self::DHR12R[channel] == offset) {
            Some(channel) => {
                self.registers[offset] = value & 0xfff;
                if self.registers[Self::CR] >> (16 * channel) & Self::TEN == 0 {
                    self.registers[Self::DOR[channel]] = self.holds.unwrap_or(value & 0xfff);
                }
            }
            // Outputs are not written.
            None if Self::DOR.contains(&offset) => {}
            None => self.registers[offset] = value,
        }
        None
    }

    fn reset(&mut self) {
        *self = Self { holds: self.holds, ..Self::default() };
    }
}

/// An ADC.
pub struct Adc {
    registers: Registers,
    number: u8,
    /// When it was switched on.
    on: Option<Picoseconds>,
    /// The channel that it converts, and when that ends.
    converts: Option<(u32, Picoseconds)>,
    /// It never ends a conversion, or always with this code.
    pub is_dead: bool,
    pub always: Option<u32>,
}

const SR: u32 = 0x00;
const CR2: u32 = 0x08;
const SMPR1: u32 = 0x0c;
const SMPR2: u32 = 0x10;
const SQR3: u32 = 0x34;
const DR: u32 = 0x4c;
const EOC: u32 = 1 << 1;
const STRT: u32 = 1 << 4;
const ADON: u32 = 1 << 0;
const SWSTART: u32 = 1 << 30;
/// Sampling times by their codes, cycles.
const SAMPLING: [u64; 8] = [3, 15, 28, 56, 84, 112, 144, 480];
/// From being switched on to the first conversion, and the sampling time of the reference: data sheet, ADC characteristics and embedded reference
/// voltage.
const STABLE: Picoseconds = 3 * MICROSECOND;
const REFERENCE_SAMPLING: Picoseconds = 10 * MICROSECOND;

impl Adc {
    pub fn new(number: u8) -> Self {
        let registers = Registers::new(&[(0x24, 0xfff)]);
        Self { registers, number, on: None, converts: None, is_dead: false, always: None }
    }

    /// The channel to convert and its sampling time in cycles.
    fn next(&self) -> (u32, u64) {
        let channel = self.registers[SQR3] & 0x1f;
        let (register, place) = if channel < 10 { (SMPR2, channel) } else { (SMPR1, channel - 10) };
        (channel, SAMPLING[(self.registers[register] >> (3 * place) & 0b111) as usize])
    }

    /// Starts what software has asked for, at `clock_hz`. Returns what the documents forbid about it.
    pub fn begin(&mut self, now: Picoseconds, clock_hz: u32, reference_is_on: bool) -> Option<Violation> {
        if self.registers[CR2] & SWSTART == 0 {
            return None;
        }
        self.registers[CR2] &= !SWSTART;
        let (channel, sampling) = self.next();
        let cycles = |cycles: u64| cycles * SECOND / u64::from(clock_hz.max(1));
        let is_busy = self.converts.replace((channel, now + cycles(sampling + 12))).is_some();
        self.registers[SR] = self.registers[SR] & !EOC | STRT;
        let adc = self.number;
        if is_busy || self.on.is_none_or(|on| now < on + STABLE) {
            Some(Violation::ConversionNotReady { adc })
        } else if channel == REFERENCE && (adc != 1 || !reference_is_on || cycles(sampling) < REFERENCE_SAMPLING) {
            Some(Violation::ReferenceNotSampled { adc })
        } else {
            None
        }
    }

    /// The channel whose conversion has ended by `now`, once.
    pub fn ended(&mut self, now: Picoseconds) -> Option<u32> {
        let (channel, _) = self.converts.filter(|&(_, end)| now >= end && !self.is_dead)?;
        self.converts = None;
        Some(channel)
    }

    pub fn convert(&mut self, volts: f64, around: &mut Surroundings) {
        self.registers[DR] = self.always.unwrap_or_else(|| around.code(volts));
        self.registers[SR] |= EOC;
    }
}

impl Peripheral for Adc {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        self.registers[offset]
    }

    fn was_read(&mut self, offset: u32) {
        if offset == DR {
            self.registers[SR] &= !EOC;
        }
    }

    fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> Option<Violation> {
        match offset {
            // Writing zeros clears flags.
            SR => self.registers[SR] &= value,
            DR => {}
            CR2 => {
                let before = self.registers[CR2];
                self.registers[CR2] = value;
                if value & ADON == 0 {
                    (self.on, self.converts) = (None, None);
                } else if before & ADON == 0 {
                    self.on = Some(now);
                }
            }
            _ => self.registers[offset] = value,
        }
        None
    }

    fn reset(&mut self) {
        *self = Self { is_dead: self.is_dead, always: self.always, ..Self::new(self.number) };
    }
}

/// Registers that the ADCs share: their clock, and the switch of the reference.
#[derive(Default)]
pub struct Common {
    control: u32,
}

const CCR: u32 = 0x04;

impl Common {
    /// The clock of the ADCs for that of their bus, Hz.
    pub fn clock_hz(&self, pclk2_hz: u32) -> u32 {
        pclk2_hz / (2 * ((self.control >> 16 & 0b11) + 1))
    }

    pub fn reference_is_on(&self) -> bool {
        self.control & 1 << 23 != 0
    }
}

impl Peripheral for Common {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        if offset == CCR { self.control } else { 0 }
    }

    fn write(&mut self, offset: u32, value: u32, _: Picoseconds) -> Option<Violation> {
        if offset == CCR {
            self.control = value;
        }
        None
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}

/// The pin of a channel of ADC1 and ADC2: data sheet, pin definitions.
pub fn pin_of(channel: u32) -> Option<Pin> {
    let channel = channel as u8;
    match channel {
        0..=7 => Some(Pin::new('A', channel)),
        8 | 9 => Some(Pin::new('B', channel - 8)),
        10..=15 => Some(Pin::new('C', channel - 10)),
        _ => None,
    }
}

/// The channel of the DAC at a pin.
pub fn dac_channel(pin: Pin) -> Option<usize> {
    [Pin::new('A', 4), Pin::new('A', 5)].into_iter().position(|other| other == pin)
}
