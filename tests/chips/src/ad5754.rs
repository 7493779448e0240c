//! AD5754 and AD5754R: 16-bit DAC with a reference of 2.5 V, external or its own, its channel A. From drivers that agree, and from memory: see the README.

use crate::port::Port;
use crate::serial::{Sdi, SerialChip};
use crate::violation::{Rule, Violation, Violations};

/// Table "Timing Characteristics", ns.
mod timing {
    /// t1, clock period.
    pub const PERIOD: u64 = 33;
    /// t4, SYNC falling to the first falling edge of the clock.
    pub const SELECT_TO_CLOCK: u64 = 13;
    /// t5, last falling edge of the clock to SYNC rising.
    pub const CLOCK_TO_SELECT: u64 = 13;
    /// t6, SYNC high between writes.
    pub const SYNC_HIGH: u64 = 100;
    /// t16, clock rising to SDO valid, at most.
    pub const SDO_VALID: u64 = 40;
    /// t17, SYNC high between a read command and its answer.
    pub const SYNC_HIGH_READ: u64 = 200;
}

/// t12: an output reaches its new voltage in 10 µs (20 V step, to 0.03 % of full scale).
pub const DAC_SETTLING_NS: u64 = 10_000;

/// After its PU bit is set, a channel needs 10 µs before it may be loaded (data sheet, table "Power Control Register").
pub const DAC_POWER_UP_NS: u64 = 10_000;

const WORD: u32 = 0x00ff_ffff;
/// DB23 to DB16 of an answer to a read command, and what SDO shows before the first frame: the data sheet does not say.
const ANSWER_HEAD: u32 = 0x5a;
/// At REFIN, or from inside, V.
const REFERENCE_V: f64 = 2.5;

/// Bits of the control register: thermal shutdown, and the clamp, which alone is set at power-up.
const TSD_ENABLE: u16 = 1 << 3;
const CLAMP_ENABLE: u16 = 1 << 2;
/// Bits of the power control register: power-up, that of the internal reference, thermal shutdown, over-current. DB15 to DB11 are don't-cares.
const PU: u16 = 1 << 0;
const PU_REF: u16 = 1 << 4;
const TSD: u16 = 1 << 5;
const OC: u16 = 1 << 7;
const POWER_MASK: u16 = 0x07ff;

/// Full scale over REFIN by the range's code; ranges from 3 on are bipolar (data sheet, table "Output Range Options").
const GAINS: [f64; 6] = [2.0, 4.0, 4.32, 4.0, 8.0, 8.64];
const FIRST_BIPOLAR: u16 = 3;

/// A voltage on its way: straight from one to the other in [`DAC_SETTLING_NS`].
#[derive(Clone, Copy, Debug, Default)]
struct Ramp {
    from_v: f64,
    to_v: f64,
    begin_ns: u64,
}

impl Ramp {
    fn volts(&self, now: u64) -> f64 {
        let passed = now.saturating_sub(self.begin_ns).min(DAC_SETTLING_NS);
        self.from_v + (self.to_v - self.from_v) * (passed as f64 / DAC_SETTLING_NS as f64)
    }
}

/// Registers that a loss of DVCC puts back, and the serial port.
#[derive(Clone, Debug)]
struct Registers {
    control: u16,
    range: u16,
    input: u16,
    loaded: u16,
    /// PU_REF, of an AD5754R.
    reference: bool,
    /// When the PU bit was set; `None` while it is 0.
    powered_ns: Option<u64>,
    shift: u32,
    answer: Option<u32>,
    sync_rose: Option<u64>,
}

impl Registers {
    const POWER_UP: Self = Self {
        control: CLAMP_ENABLE,
        range: 0,
        input: 0,
        loaded: 0,
        reference: false,
        powered_ns: None,
        shift: ANSWER_HEAD * 0x01_0101,
        answer: None,
        sync_rose: None,
    };
}

/// The chip at its pins. SPI mode 1: it samples SDIN when SCLK falls and changes SDO when SCLK rises.
///
/// It begins with its supplies on, and LDAC, CLR, and SYNC high. All times are in ns and do not go back.
#[derive(Debug)]
pub struct Ad5754 {
    registers: Registers,
    violations: Violations,
    /// Whether it is an AD5754R, and whether something drives REFIN.
    has_reference: bool,
    is_driven: bool,
    dvcc: bool,
    ldac: bool,
    clr: bool,
    hot: bool,
    over_current: bool,
    ramp: Ramp,
    port: Port,
}

impl Default for Ad5754 {
    fn default() -> Self {
        Self {
            registers: Registers::POWER_UP,
            violations: Violations::default(),
            has_reference: false,
            is_driven: true,
            dvcc: true,
            ldac: true,
            clr: true,
            hot: false,
            over_current: false,
            ramp: Ramp::default(),
            port: Port::default(),
        }
    }
}

impl Ad5754 {
    /// A chip with BIN/2sCOMP at DVCC: straight binary.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// An AD5754R, with 2.5 V at its REFIN/REFOUT pin or nothing there. Its own reference is off after power-up.
    #[must_use]
    pub fn with_reference(is_driven: bool) -> Self {
        Self { has_reference: true, is_driven, ..Self::default() }
    }

    /// DVCC on or off. Off, and the chip forgets all, drives no SDO, and holds its outputs at 0 V; on, and all registers
    /// have their power-up values ("Configuring the AD5724/AD5734/AD5754").
    pub fn set_dvcc(&mut self, on: bool, now: u64) {
        self.dvcc = on;
        self.port.open = false;
        self.registers = Registers::POWER_UP;
        self.settle(now);
    }

    /// The LDAC pin. It loads when it falls; while it is low, a code is loaded when SYNC rises ("Load DAC").
    pub fn set_ldac(&mut self, level: bool, now: u64) {
        let falls = self.ldac && !level;
        self.ldac = level;
        if falls {
            self.load(now);
        }
    }

    /// The CLR pin. While it is low, the DAC register holds the clear code, 0 V, and cannot be loaded; when it rises, it keeps it
    /// until it is loaded anew ("Asynchronous Clear").
    pub fn set_clr(&mut self, level: bool, now: u64) {
        self.clr = level;
        if !level {
            self.registers.loaded = if self.registers.range < FIRST_BIPOLAR { 0 } else { 0x8000 };
            self.settle(now);
        }
    }

    /// Too hot or not. It acts only while TSD enable is set: then all outputs are off and TSD reads 1.
    pub fn set_over_temperature(&mut self, hot: bool, now: u64) {
        self.hot = hot;
        self.settle(now);
    }

    /// Too much current at the output or not: OC reads 1, and the clamp limits it.
    pub fn set_over_current(&mut self, on: bool) {
        self.over_current = on;
    }

    /// Output, V.
    #[must_use]
    pub fn volts(&self, now: u64) -> f64 {
        self.ramp.volts(now)
    }

    /// Code of the range: 0 and 1 are 0 V to 5 V and to 10 V.
    #[must_use]
    pub fn range(&self) -> u16 {
        self.registers.range
    }

    /// DB3 to DB0 of the control register.
    #[must_use]
    pub fn control_bits(&self) -> u16 {
        self.registers.control
    }

    /// Violations of the data sheet by the master, in order.
    #[must_use]
    pub fn violations(&self) -> &[Violation] {
        self.violations.all()
    }

    /// Forgets the violations so far.
    pub fn clear_violations(&mut self) {
        self.violations.clear();
    }

    fn is_shut_down(&self) -> bool {
        self.hot && self.registers.control & TSD_ENABLE != 0
    }

    /// The code goes from the input register to the DAC register of a channel that is powered up.
    fn load(&mut self, now: u64) {
        match self.registers.powered_ns {
            _ if !self.clr => self.violations.note(now, Rule::LoadWhileClear),
            Some(since) if now < since + DAC_POWER_UP_NS => self.violations.note(now, Rule::LoadDuringPowerUp),
            Some(_) => self.registers.loaded = self.registers.input,
            None => {}
        }
        self.settle(now);
    }

    /// Sends the pin towards the voltage that the registers ask for: gain × REFIN × D / 65536, less half of full scale in a
    /// bipolar range ("Transfer Function").
    fn settle(&mut self, now: u64) {
        let Registers { range, loaded, powered_ns, .. } = self.registers;
        let share = f64::from(loaded) / 65536.0 - if range < FIRST_BIPOLAR { 0.0 } else { 0.5 };
        let is_on = powered_ns.is_some() && !self.is_shut_down();
        let reference_v = if self.is_driven || self.registers.reference { REFERENCE_V } else { 0.0 };
        let to_v = if is_on { GAINS[usize::from(range)] * reference_v * share } else { 0.0 };
        if to_v != self.ramp.to_v {
            self.ramp = Ramp { from_v: self.ramp.volts(now), to_v, begin_ns: now };
        }
    }

    /// Carries out a frame of 24 bits: R/W, 0, REG2 to REG0, A2 to A0, DB15 to DB0 ("Input Shift Register Format").
    fn execute(&mut self, now: u64) {
        let (head, bits) = (self.registers.shift >> 16, self.registers.shift as u16);
        match head {
            // A write to a channel that is powered down is ignored ("Configuring the AD5724/AD5734/AD5754").
            0x00 if self.registers.powered_ns.is_none() => self.violations.note(now, Rule::WriteWhilePoweredDown),
            0x00 => self.registers.input = bits,
            0x08 if usize::from(bits & 7) < GAINS.len() => self.registers.range = bits & 7,
            // Power to other channels, a clamp that switches off, another clear code and an SDO that is off are not modelled.
            0x10 if bits & 0xe == 0 => {
                let since = self.registers.powered_ns.unwrap_or(now);
                self.registers.powered_ns = (bits & PU != 0).then_some(since);
                self.registers.reference = self.has_reference && bits & PU_REF != 0;
                if self.registers.reference && self.is_driven {
                    self.violations.note(now, Rule::TwoReferences);
                }
            }
            0x18 => {}
            0x19 if bits & 0x7 == CLAMP_ENABLE => self.registers.control = bits & 0xf,
            // Which of its registers is read is not known: the input register does not show whether the code was loaded.
            0x80 => self.reply(self.registers.input, u16::MAX),
            0x88 => self.reply(self.registers.range, 7),
            0x90 => {
                let flag = |on: bool, bit: u16| if on { bit } else { 0 };
                let power = flag(self.registers.powered_ns.is_some(), PU);
                let power = power | flag(self.registers.reference, PU_REF);
                self.reply(power | flag(self.is_shut_down(), TSD) | flag(self.over_current, OC), POWER_MASK);
            }
            0x99 => self.reply(self.registers.control, 0xf),
            _ => {
                self.violations.note(now, Rule::UnknownCommand(self.registers.shift));
                if head >> 7 == 1 {
                    self.reply(0, 0);
                }
            }
        }
        if head == 0x00 && !self.ldac {
            self.load(now);
        }
        self.settle(now);
    }

    /// Gets an answer ready: `bits` where `mask` is 1, ones elsewhere.
    fn reply(&mut self, bits: u16, mask: u16) {
        self.registers.answer = Some(ANSWER_HEAD << 16 | u32::from(bits & mask | !mask));
    }
}

impl SerialChip for Ad5754 {
    fn select(&mut self, now: u64) {
        if !self.dvcc {
            return;
        }
        let high = self.registers.sync_rose.map_or(u64::MAX, |rose| now - rose);
        if high < timing::SYNC_HIGH {
            self.violations.note(now, Rule::SyncHigh(high));
            return;
        }
        if let Some(answer) = self.registers.answer.take() {
            if high < timing::SYNC_HIGH_READ {
                self.violations.note(now, Rule::SyncHighBeforeAnswer(high));
            } else {
                self.registers.shift = answer;
            }
        }
        self.port.begin(now);
    }

    fn sclk(&mut self, level: bool, sdi: Sdi, now: u64) {
        if !self.port.open {
            return;
        }
        if level {
            let before = self.sdo(now).unwrap_or(self.port.after);
            return self.port.launch(before, self.registers.shift >> 23 & 1 == 1, now);
        }
        let after_select = now - self.port.selected;
        let period = self.port.captured.replace(now).map_or(u64::MAX, |fell| now - fell);
        if after_select < timing::SELECT_TO_CLOCK {
            return self.violations.note(now, Rule::ClockAfterSelect(after_select));
        }
        if period < timing::PERIOD {
            return self.violations.note(now, Rule::ClockPeriod(period));
        }
        // SDIN has to stay for some ns after the edge (t8): where it changes at the edge, the new level is taken.
        self.registers.shift = (self.registers.shift << 1 | u32::from(sdi.after)) & WORD;
        self.port.clocks += 1;
    }

    fn sdo(&self, now: u64) -> Option<bool> {
        let settled = now >= self.port.changed + timing::SDO_VALID;
        self.dvcc.then_some(if settled { self.port.after } else { self.port.before })
    }

    fn deselect(&mut self, now: u64) {
        if !self.dvcc {
            return;
        }
        self.registers.sync_rose = Some(now);
        if !self.port.open {
            return;
        }
        let clocks = self.port.end(now, timing::CLOCK_TO_SELECT, &mut self.violations);
        if clocks < 24 {
            return self.violations.note(now, Rule::ShortFrame(clocks));
        }
        if !clocks.is_multiple_of(24) {
            self.violations.note(now, Rule::OddFrame(clocks));
        }
        self.execute(now);
    }
}
