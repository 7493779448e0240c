//! The chip's own converters, RM0090 sections 13 and 14, RM0440 sections 21 and 22: channels of the DAC, and ADCs that convert one channel when they are asked to.

use crate::chip::family::Family;
use crate::chip::gpio::Pin;
use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::{MICROSECOND, Picoseconds, SECOND};
use crate::chip::violation::Violation;

/// Codes of every converter.
const CODES: f64 = 4096.0;

/// The voltage of the chip's own reference, V: data sheets, embedded reference voltage.
const REFERENCE_V: f64 = 1.21;

/// The channel of the chip's own reference, at ADC1.
pub fn reference(family: Family) -> u32 {
    match family {
        Family::F4 => 17,
        Family::G4 => 18,
    }
}

/// The address of the reference's code that the factory has found, in the upper half of its word.
pub fn factory_word(family: Family) -> u32 {
    match family {
        Family::F4 => 0x1fff_7a28,
        Family::G4 => 0x1fff_75a8,
    }
}

/// A voltage by the time since power-up, ns.
pub type Course = Box<dyn Fn(u64) -> f64>;

/// Supply, references and voltages around the converters.
pub struct Surroundings {
    /// The analog supply, which is the reference of all converters, V.
    pub supply_v: f64,
    /// The chip's own reference, V.
    pub reference_v: f64,
    /// The code that the factory has found for it.
    pub factory: u32,
    /// Voltages at pins, from outside.
    pub volts: Vec<(Pin, f64)>,
    /// The voltage at a pin that varies with time.
    pub course: Option<(Pin, Course)>,
    /// A pin of the DAC is shorted to this voltage.
    pub shorted: Option<(Pin, f64)>,
    /// Largest noise of a conversion, codes.
    pub noise: u32,
    seed: u32,
}

impl Surroundings {
    /// A board of 3 V, whose factory has found 1502 at 3.3 V, or one of 3.3 V, with 1652 at 3.0 V.
    pub fn new(family: Family) -> Self {
        let (supply_v, factory) = match family {
            Family::F4 => (3.0, 1502),
            Family::G4 => (3.3, 1652),
        };
        let (reference_v, volts) = (REFERENCE_V, Vec::new());
        Self { supply_v, reference_v, factory, volts, course: None, shorted: None, noise: 0, seed: 1 }
    }

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
    family: Family,
    registers: Registers,
    /// Its outputs hold this whatever is written.
    pub holds: Option<u32>,
}

impl Dac {
    pub fn new(family: Family) -> Self {
        Self { family, registers: Registers::new(&[]), holds: None }
    }

    pub const CR: u32 = 0x00;
    /// Modes of an STM32G4, whose buffers are no bits of CR.
    const MCR: u32 = 0x3c;
    const DHR12R: [u32; 2] = [0x08, 0x14];
    const DOR: [u32; 2] = [0x2c, 0x30];
    /// A channel's bits of CR: on, without buffer, triggered. On an STM32G4 the trigger has the place of the buffer.
    const EN: u32 = 1 << 0;
    const BOFF: u32 = 1 << 1;
    const TEN: u32 = 1 << 2;

    /// The voltage that channel 0 or 1 drives its pin with, if it does: data sheet, DAC characteristics. With its buffer it does not come within
    /// 0.2 V of its ends; without, 15 kΩ drive the resistor of 1.5 MΩ to ground.
    pub fn volts(&self, channel: usize, supply_v: f64) -> Option<f64> {
        let control = self.registers[Self::CR] >> (16 * channel);
        let (has_buffer, has_pin) = match self.family {
            Family::F4 => (control & Self::BOFF == 0, true),
            Family::G4 => {
                let mode = self.registers[Self::MCR] >> (16 * channel) & 0b111;
                (mode & 0b010 == 0, mode != 0b011)
            }
        };
        let volts = f64::from(self.registers[Self::DOR[channel]]) / CODES * supply_v;
        let driven = if has_buffer { volts.clamp(0.2, supply_v - 0.2) } else { volts * (1500.0 / 1515.0) };
        (control & Self::EN != 0 && has_pin).then_some(driven)
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
                let trigger = if self.family == Family::G4 { Self::BOFF } else { Self::TEN };
                if self.registers[Self::CR] >> (16 * channel) & trigger == 0 {
                    self.registers[Self::DOR[channel]] = self.holds.unwrap_or(value & 0xfff);
                }
            }
            // Outputs are not written.
            None if Self::DOR.contains(&offset) => {}
            // A channel that is on keeps its mode.
            None if offset == Self::MCR && self.registers[Self::CR] & (Self::EN | Self::EN << 16) != 0 => {}
            None => self.registers[offset] = value,
        }
        None
    }

    fn reset(&mut self) {
        *self = Self { holds: self.holds, ..Self::new(self.family) };
    }
}

pub struct Adc {
    family: Family,
    registers: Registers,
    number: u8,
    /// When it was switched on, and its regulator; until when it calibrates, and whether it has.
    on: Option<Picoseconds>,
    regulated: Option<Picoseconds>,
    calibrates: Option<Picoseconds>,
    is_calibrated: bool,
    /// The channel that it converts, and when that ends; when the last one ended.
    converts: Option<(u32, Picoseconds)>,
    last: Picoseconds,
    /// Whether the last transfer of the DMA was the last that it asks for.
    is_done: bool,
    /// It never ends a conversion, or always with this code.
    pub is_dead: bool,
    pub always: Option<u32>,
}

/// An ADC of an STM32F4: status, control, sampling times, channel, data.
mod f4 {
    pub const SR: u32 = 0x00;
    pub const CR2: u32 = 0x08;
    pub const SMPR: [u32; 2] = [0x10, 0x0c];
    pub const SQR: u32 = 0x34;
    pub const DR: u32 = 0x4c;
    pub const EOC: u32 = 1 << 1;
    pub const STRT: u32 = 1 << 4;
    pub const ADON: u32 = 1 << 0;
    pub const CONT: u32 = 1 << 1;
    pub const SWSTART: u32 = 1 << 30;
}

/// The same of an STM32G4.
mod g4 {
    pub const ISR: u32 = 0x00;
    pub const CR: u32 = 0x08;
    pub const CFGR: u32 = 0x0c;
    pub const CONT: u32 = 1 << 13;
    pub const SMPR: [u32; 2] = [0x14, 0x18];
    pub const SQR: u32 = 0x30;
    pub const DR: u32 = 0x40;
    pub const ADRDY: u32 = 1 << 0;
    pub const EOC: u32 = 1 << 2;
    pub const ADEN: u32 = 1 << 0;
    pub const ADSTART: u32 = 1 << 2;
    pub const ADVREGEN: u32 = 1 << 28;
    pub const ADCAL: u32 = 1 << 31;
}

/// Half cycles of sampling by their codes, and of the conversion after it.
const F4_SAMPLING: [u64; 8] = [6, 30, 56, 112, 168, 224, 288, 960];
const G4_SAMPLING: [u64; 8] = [5, 13, 25, 49, 95, 185, 495, 1281];
/// From being switched on to the first conversion, on an STM32F4; from the regulator's start to a calibration, and that; the last conversion after which the next one is right (errata sheet): data sheets,
/// ADC characteristics.
const STABLE: Picoseconds = 3 * MICROSECOND;
const REGULATES: Picoseconds = 20 * MICROSECOND;
const CALIBRATION_CYCLES: u64 = 116;
const LATE: Picoseconds = 1000 * MICROSECOND;

impl Adc {
    pub fn new(family: Family, number: u8) -> Self {
        let registers = Registers::new(match family {
            Family::F4 => &[(0x24, 0xfff)],
            Family::G4 => {
                &[(g4::CR, 1 << 29), (0x0c, 1 << 31), (0x20, 0x0fff_0000), (0x24, 0xff_0000), (0x28, 0xff_0000)]
            }
        });
        let (on, regulated, calibrates, converts, always) = (None, None, None, None, None);
        let (is_calibrated, is_done, is_dead, last) = (false, false, false, 0);
        Self {
            family,
            registers,
            number,
            on,
            regulated,
            calibrates,
            is_calibrated,
            converts,
            last,
            is_done,
            is_dead,
            always,
        }
    }

    /// The channel to convert, and half cycles of sampling and conversion.
    fn next(&self) -> (u32, u64, u64) {
        let (channel, smpr, sampling, rest) = match self.family {
            Family::F4 => (self.registers[f4::SQR] & 0x1f, f4::SMPR, F4_SAMPLING, 24),
            Family::G4 => (self.registers[g4::SQR] >> 6 & 0x1f, g4::SMPR, G4_SAMPLING, 25),
        };
        let code = self.registers[smpr[(channel / 10) as usize]] >> (3 * (channel % 10)) & 0b111;
        (channel, sampling[code as usize], rest)
    }

    /// Starts what software has asked for, at `clock_hz`. Returns what the documents forbid about it.
    pub fn begin(&mut self, now: Picoseconds, clock_hz: u32, reference_is_on: bool) -> Option<Violation> {
        let halves = |halves: u64| halves * SECOND / (2 * u64::from(clock_hz.max(1)));
        if self.family == Family::G4 && self.registers[g4::CR] & g4::ADCAL != 0 {
            let end = *self.calibrates.get_or_insert(now + halves(2 * CALIBRATION_CYCLES));
            if now >= end {
                self.registers[g4::CR] &= !g4::ADCAL;
                (self.calibrates, self.is_calibrated) = (None, true);
            }
        }
        let (control, start) = match self.family {
            Family::F4 => (f4::CR2, f4::SWSTART),
            Family::G4 => (g4::CR, g4::ADSTART),
        };
        if self.registers[control] & start == 0 || self.family == Family::G4 && self.converts.is_some() {
            return None;
        }
        let (channel, sampling, rest) = self.next();
        let is_busy = self.converts.replace((channel, now + halves(sampling + rest))).is_some();
        if self.family == Family::F4 {
            self.registers[control] &= !start;
            self.registers[f4::SR] = self.registers[f4::SR] & !f4::EOC | f4::STRT;
        }
        let adc = self.number;
        let reference_takes = if self.family == Family::F4 { 10 } else { 4 } * MICROSECOND;
        let stable = if self.family == Family::F4 { STABLE } else { 0 };
        if is_busy || self.on.is_none_or(|on| now < on + stable) {
            Some(Violation::ConversionNotReady { adc })
        } else if channel == reference(self.family)
            && (adc != 1 || !reference_is_on || halves(sampling) < reference_takes)
        {
            Some(Violation::ReferenceNotSampled { adc })
        } else {
            None
        }
    }

    /// The channel whose conversion has ended by `now`, once, and when. The next one begins there if it converts all the time.
    pub fn ended(&mut self, now: Picoseconds, clock_hz: u32) -> Option<(u32, Picoseconds)> {
        let (channel, end) = self.converts.filter(|&(_, end)| now >= end && !self.is_dead)?;
        let goes_on = match self.family {
            Family::F4 => self.registers[f4::CR2] & f4::CONT != 0,
            Family::G4 => self.registers[g4::CFGR] & g4::CONT != 0,
        };
        let (next, sampling, rest) = self.next();
        let takes = (sampling + rest) * SECOND / (2 * u64::from(clock_hz.max(1)));
        self.converts = goes_on.then_some((next, end + takes));
        if self.family == Family::G4 && !goes_on {
            self.registers[g4::CR] &= !g4::ADSTART;
        }
        Some((channel, end))
    }

    /// Register and flags of its status: a code is there, one was lost; register of the DMA's bits, and these: on, beyond the last transfer.
    fn by_dma(&self) -> (u32, [u32; 2], u32, [u32; 2]) {
        match self.family {
            Family::F4 => (f4::SR, [f4::EOC, 1 << 5], f4::CR2, [1 << 8, 1 << 9]),
            Family::G4 => (g4::ISR, [g4::EOC, 1 << 4], g4::CFGR, [1 << 0, 1 << 1]),
        }
    }

    /// The code that it asks the DMA to take: none before a lost one is cleared.
    pub fn request(&self) -> Option<u32> {
        let (status, [_, lost], control, [on, _]) = self.by_dma();
        let asks = self.registers[control] & on != 0 && self.registers[status] & lost == 0 && !self.is_done;
        asks.then_some(self.registers[if self.family == Family::F4 { f4::DR } else { g4::DR }])
    }

    /// The DMA has taken it, as the last one of its round or not.
    pub fn taken(&mut self, is_last: bool) {
        let (status, [there, _], control, [_, beyond]) = self.by_dma();
        self.registers[status] &= !there;
        self.is_done = is_last && self.registers[control] & beyond == 0;
    }

    pub fn convert(&mut self, volts: f64, around: &mut Surroundings, now: Picoseconds) {
        let code = self.always.unwrap_or_else(|| around.code(volts));
        let (status, [there, lost], control, [on, _]) = self.by_dma();
        if self.registers[control] & on != 0 && self.registers[status] & there != 0 {
            self.registers[status] |= lost;
        }
        let is_late = now - std::mem::replace(&mut self.last, now) > LATE;
        match self.family {
            Family::F4 => {
                self.registers[f4::DR] = code;
                self.registers[f4::SR] |= f4::EOC;
            }
            Family::G4 => {
                // Wrong by some codes, of which the errata sheet does not say how many.
                self.registers[g4::DR] = if is_late { code ^ 0x20 } else { code };
                self.registers[g4::ISR] |= g4::EOC;
            }
        }
    }

    fn write_f4(&mut self, offset: u32, value: u32, now: Picoseconds) {
        match offset {
            // Writing zeros clears flags.
            f4::SR => self.registers[f4::SR] &= value,
            f4::DR => {}
            f4::CR2 => {
                let before = self.registers[f4::CR2];
                (self.registers[f4::CR2], self.is_done) = (value, false);
                if value & f4::ADON == 0 {
                    (self.on, self.converts) = (None, None);
                } else if before & f4::ADON == 0 {
                    self.on = Some(now);
                }
            }
            _ => self.registers[offset] = value,
        }
    }

    fn write_g4(&mut self, offset: u32, value: u32, now: Picoseconds) -> Option<Violation> {
        match offset {
            // Writing ones clears flags.
            g4::ISR => self.registers[g4::ISR] &= !value,
            g4::DR => {}
            g4::CR => {
                let before = self.registers[g4::CR];
                // Its bits are set by ones, and cleared by what they start; the regulator's are as they are written.
                let kept = before & (g4::ADEN | g4::ADSTART | g4::ADCAL);
                self.registers[g4::CR] = value | kept;
                let risen = value & !before;
                if risen & g4::ADVREGEN != 0 {
                    self.regulated = Some(now);
                }
                let is_regulated = self.regulated.is_some_and(|since| now >= since + REGULATES);
                let calibrates_in_time = is_regulated && before & g4::ADEN == 0;
                if risen & g4::ADEN != 0 {
                    (self.on, self.registers[g4::ISR]) = (Some(now), self.registers[g4::ISR] | g4::ADRDY);
                }
                if risen & g4::ADCAL != 0 && !calibrates_in_time || risen & g4::ADEN != 0 && !self.is_calibrated {
                    return Some(Violation::ConversionNotReady { adc: self.number });
                }
            }
            _ => self.registers[offset] = value,
        }
        None
    }
}

impl Peripheral for Adc {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        self.registers[offset]
    }

    fn was_read(&mut self, offset: u32) {
        match self.family {
            Family::F4 if offset == f4::DR => self.registers[f4::SR] &= !f4::EOC,
            Family::G4 if offset == g4::DR => self.registers[g4::ISR] &= !g4::EOC,
            _ => {}
        }
    }

    fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> Option<Violation> {
        match self.family {
            Family::F4 => {
                self.write_f4(offset, value, now);
                None
            }
            Family::G4 => self.write_g4(offset, value, now),
        }
    }

    fn reset(&mut self) {
        *self =
            Self { is_dead: self.is_dead, always: self.always, last: self.last, ..Self::new(self.family, self.number) };
    }
}

/// Registers that the ADCs share: their clock, and the switch of the reference.
pub struct Common {
    family: Family,
    control: u32,
}

impl Common {
    pub fn new(family: Family) -> Self {
        Self { family, control: 0 }
    }

    fn register(&self) -> u32 {
        if self.family == Family::F4 { 0x04 } else { 0x08 }
    }

    /// The clock of the ADCs for that of their bus, Hz.
    pub fn clock_hz(&self, bus_hz: u32) -> u32 {
        let field = self.control >> 16 & 0b11;
        match self.family {
            Family::F4 => bus_hz / (2 * (field + 1)),
            // Without a mode they have a clock of their own, which nothing has set.
            Family::G4 => (bus_hz << 1 >> field) * u32::from(field != 0),
        }
    }

    pub fn reference_is_on(&self) -> bool {
        self.control & 1 << (if self.family == Family::F4 { 23 } else { 22 }) != 0
    }
}

impl Peripheral for Common {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        if offset == self.register() { self.control } else { 0 }
    }

    fn write(&mut self, offset: u32, value: u32, _: Picoseconds) -> Option<Violation> {
        if offset == self.register() {
            self.control = value;
        }
        None
    }

    fn reset(&mut self) {
        self.control = 0;
    }
}

/// The pin of a channel of an ADC: data sheets, pin definitions.
pub fn pin_of(family: Family, adc: u8, channel: u32) -> Option<Pin> {
    let channel = channel as u8;
    match (family, adc, channel) {
        (Family::F4, 3, 4..=9 | 14..) => None,
        (Family::F4, _, 0..=7) => Some(Pin::new('A', channel)),
        (Family::F4, _, 8 | 9) => Some(Pin::new('B', channel - 8)),
        (Family::F4, _, 10..=15) => Some(Pin::new('C', channel - 10)),
        (Family::G4, 3, _) => (channel == 1).then_some(Pin::new('B', 1)),
        (Family::G4, _, 1 | 2) => Some(Pin::new('A', channel - 1)),
        (Family::G4, 2, 17) => Some(Pin::new('A', 4)),
        (Family::G4, 2, 13) => Some(Pin::new('A', 5)),
        _ => None,
    }
}

/// The channel of the DAC at a pin.
pub fn dac_channel(pin: Pin) -> Option<usize> {
    [Pin::new('A', 4), Pin::new('A', 5)].into_iter().position(|other| other == pin)
}
