//! AD5754: quad 16-bit DAC with an external reference. From drivers that agree, and from memory: see the README.

mod outputs;
mod registers;
mod unspecified;

pub use outputs::{POWER_UP_NS as DAC_POWER_UP_NS, SETTLING_NS as DAC_SETTLING_NS};
pub use registers::{Channel, Coding, DacRange};
pub use unspecified::{AfterShutdown, DacRegisterReads, FirstOutput, Unspecified};

use self::outputs::Outputs;
use self::registers::{Channels, Control, Frame, PowerControl, Readable};
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
    /// t10, SYNC rising to LDAC falling.
    pub const SYNC_TO_LDAC: u64 = 130;
    /// t11, LDAC low.
    pub const LDAC_LOW: u64 = 20;
    /// t13, CLR low.
    pub const CLR_LOW: u64 = 20;
    /// t16, clock rising to SDO valid, at most.
    pub const SDO_VALID: u64 = 40;
    /// t17, SYNC high between a read command and its answer.
    pub const SYNC_HIGH_READ: u64 = 200;
}

const WORD: u32 = 0x00ff_ffff;

/// The chip at its pins. SPI mode 1: it samples SDIN when SCLK falls and changes SDO when SCLK rises.
///
/// It begins with its supplies on, LDAC, CLR, and SYNC high, and 2.5 V at REFIN. All times are in ns and do not go back.
#[derive(Debug)]
pub struct Ad5754 {
    outputs: Outputs,
    violations: Violations,
    dvcc: bool,
    lines_before_dvcc: bool,
    loses_next_frame: bool,
    // serial port
    open: bool,
    shift: u32,
    clocks: u32,
    answer: Option<u32>,
    sync_fell: u64,
    sync_rose: Option<u64>,
    clock_fell: Option<u64>,
    sdo_before: bool,
    sdo_after: bool,
    sdo_changed: u64,
    // load and clear pins
    ldac: bool,
    ldac_fell: u64,
    clr: bool,
    clr_fell: u64,
    /// Outputs before LDAC or CLR fell, for a pulse that turns out to be too short.
    before_pulse: Option<Box<Outputs>>,
    /// The last frame wrote a code.
    wrote_code: bool,
}

impl Ad5754 {
    /// A chip with BIN/2sCOMP strapped as `coding` says, [hostile](Unspecified::hostile) where the data sheet is silent.
    #[must_use]
    pub fn new(coding: Coding) -> Self {
        Self::with_unspecified(coding, Unspecified::hostile())
    }

    /// A chip with chosen behaviour where the data sheet is silent.
    #[must_use]
    pub fn with_unspecified(coding: Coding, unspecified: Unspecified) -> Self {
        let mut chip = Self {
            outputs: Outputs::new(coding, unspecified),
            violations: Violations::default(),
            dvcc: true,
            lines_before_dvcc: false,
            loses_next_frame: false,
            open: false,
            shift: 0,
            clocks: 0,
            answer: None,
            sync_fell: 0,
            sync_rose: None,
            clock_fell: None,
            sdo_before: false,
            sdo_after: false,
            sdo_changed: 0,
            ldac: true,
            ldac_fell: 0,
            clr: true,
            clr_fell: 0,
            before_pulse: None,
            wrote_code: false,
        };
        chip.reset_port();
        chip
    }

    /// Voltage at REFIN, V; 0 without a reference.
    pub fn set_reference(&mut self, volts: f64, now: u64) {
        self.outputs.reference_v = volts;
        self.outputs.settle(now);
    }

    /// DVCC on or off. Off, and the chip forgets all, drives no SDO, and holds its outputs at 0 V; on, and all registers
    /// have their power-up values ("Configuring the AD5724/AD5734/AD5754").
    pub fn set_dvcc(&mut self, on: bool, now: u64) {
        self.dvcc = on;
        self.open = false;
        self.reset_port();
        self.outputs.power_on_reset(now);
        self.loses_next_frame = on && self.lines_before_dvcc;
    }

    /// AVDD and AVSS on or off. Off, and the outputs are held at 0 V ("Analog Output Control"); the registers stay or not as
    /// [`Unspecified::avdd_dip_resets`] says.
    pub fn set_avdd(&mut self, on: bool, now: u64) {
        self.outputs.set_avdd(on, now);
    }

    /// Whether SYNC and the other lines are driven while DVCC is off: then the first frame after DVCC comes back is lost
    /// ("Configuring the AD5724/AD5734/AD5754" says that it may be). Off at first.
    pub fn set_lines_before_dvcc(&mut self, driven: bool) {
        self.lines_before_dvcc = driven;
    }

    /// The LDAC pin. It loads all channels when it falls; while it is low, the channels that a frame has written are loaded
    /// when SYNC rises ("Load DAC").
    pub fn set_ldac(&mut self, level: bool, now: u64) {
        if self.ldac == level {
            return;
        }
        self.ldac = level;
        if level {
            let low = now - self.ldac_fell;
            if low < timing::LDAC_LOW {
                self.violations.note(now, Rule::LdacLow(low));
                self.undo_pulse(now);
            }
            self.before_pulse = None;
            return;
        }
        self.ldac_fell = now;
        self.before_pulse = Some(Box::new(self.outputs.clone()));
        let after_sync = self.sync_rose.map_or(u64::MAX, |rose| now - rose);
        if after_sync < timing::SYNC_TO_LDAC && self.wrote_code {
            self.violations.note(now, Rule::LdacAfterSync(after_sync));
        } else {
            self.outputs.load(Channels::ALL, now, &mut self.violations);
        }
    }

    /// The CLR pin. While it is low, the DAC registers hold the clear code and cannot be loaded; when it rises, they keep it
    /// until they are loaded anew ("Asynchronous Clear").
    pub fn set_clr(&mut self, level: bool, now: u64) {
        if self.clr == level {
            return;
        }
        self.clr = level;
        if level {
            self.outputs.held_clear = false;
            let low = now - self.clr_fell;
            if low < timing::CLR_LOW {
                self.violations.note(now, Rule::ClrLow(low));
                self.undo_pulse(now);
            }
            self.before_pulse = None;
            return;
        }
        self.clr_fell = now;
        self.before_pulse = Some(Box::new(self.outputs.clone()));
        self.outputs.held_clear = true;
        self.outputs.clear(now);
    }

    /// Too hot or not. It acts only while TSD enable is set: then all outputs are off and TSD reads 1.
    pub fn set_over_temperature(&mut self, hot: bool, now: u64) {
        self.outputs.set_over_temperature(hot, now);
    }

    /// Too much current at an output or not. OC reads 1; with the clamp disabled the channel is powered down, PU reads 0,
    /// and OC stays 1 until PU is set again.
    pub fn set_over_current(&mut self, channel: Channel, on: bool, now: u64) {
        self.outputs.set_over_current(channel.index(), on, now);
    }

    /// Output, V.
    #[must_use]
    pub fn volts(&self, channel: Channel, now: u64) -> f64 {
        self.outputs.volts(channel.index(), now)
    }

    /// Range of a channel.
    #[must_use]
    pub fn range(&self, channel: Channel) -> DacRange {
        self.outputs.range(channel.index())
    }

    /// Whether the PU bit of a channel is set.
    #[must_use]
    pub fn is_powered(&self, channel: Channel) -> bool {
        self.outputs.is_powered(channel.index())
    }

    /// The code that drives a channel.
    #[must_use]
    pub fn loaded_code(&self, channel: Channel) -> u16 {
        self.outputs.loaded(channel.index())
    }

    /// DB3 to DB0 of the control register.
    #[must_use]
    pub fn control_bits(&self) -> u16 {
        self.outputs.control.bits()
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

    fn reset_port(&mut self) {
        self.shift = u32::from(self.outputs.unspecified.answer_head) * 0x01_0101;
        self.clocks = 0;
        self.answer = None;
        self.sync_rose = None;
        self.clock_fell = None;
        self.wrote_code = false;
    }

    fn undo_pulse(&mut self, now: u64) {
        if let Some(outputs) = self.before_pulse.take() {
            self.outputs = *outputs;
            self.outputs.settle(now);
        }
    }

    fn execute(&mut self, now: u64) {
        let (outputs, violations) = (&mut self.outputs, &mut self.violations);
        match Frame::from_bits(self.shift) {
            Frame::Dac { channels, code } => {
                outputs.write_dac(channels, code, now, violations);
                self.wrote_code = true;
                if !self.ldac {
                    outputs.load(channels, now, violations);
                }
            }
            Frame::Range { channels, bits } => match DacRange::from_bits(bits) {
                Some(range) => outputs.write_range(channels, range, now),
                None => violations.note(now, Rule::UnknownCommand(self.shift)),
            },
            Frame::Power { bits } => outputs.write_power(bits, now),
            Frame::SetControl { bits } => outputs.write_control(bits, now),
            Frame::Clear => outputs.clear(now),
            Frame::Load => outputs.load(Channels::ALL, now, violations),
            Frame::Nop => {}
            Frame::Read(register) => {
                let (bits, mask) = match register {
                    Readable::Dac(k) => (outputs.read_dac(k), u16::MAX),
                    Readable::Range(k) => (outputs.range(k).bits(), 7),
                    Readable::Power => (outputs.read_power(), PowerControl::MASK),
                    Readable::Control => (outputs.control.bits(), Control::MASK),
                };
                self.reply(bits, mask);
            }
            Frame::Unknown => {
                violations.note(now, Rule::UnknownCommand(self.shift));
                if self.shift >> 23 == 1 {
                    self.reply(0, 0);
                }
            }
        }
    }

    /// Gets an answer ready: `bits` where `mask` is 1, don't-cares elsewhere.
    fn reply(&mut self, bits: u16, mask: u16) {
        let unspecified = self.outputs.unspecified;
        let dont_care = if unspecified.dont_care { !mask } else { 0 };
        self.answer = Some(u32::from(unspecified.answer_head) << 16 | u32::from(bits & mask | dont_care));
    }
}

impl SerialChip for Ad5754 {
    fn select(&mut self, now: u64) {
        if !self.dvcc {
            return;
        }
        let high = self.sync_rose.map_or(u64::MAX, |rose| now - rose);
        if high < timing::SYNC_HIGH {
            self.violations.note(now, Rule::SyncHigh(high));
            return;
        }
        if let Some(answer) = self.answer.take() {
            if high < timing::SYNC_HIGH_READ {
                self.violations.note(now, Rule::SyncHighBeforeAnswer(high));
            } else {
                self.shift = answer;
            }
        }
        self.open = true;
        self.clocks = 0;
        self.clock_fell = None;
        self.sync_fell = now;
    }

    fn sclk(&mut self, level: bool, sdi: Sdi, now: u64) {
        if !self.open {
            return;
        }
        if level {
            self.sdo_before = self.sdo(now).unwrap_or(self.sdo_after);
            self.sdo_after = self.shift >> 23 & 1 == 1;
            self.sdo_changed = now;
            return;
        }
        let after_select = now - self.sync_fell;
        let period = self.clock_fell.replace(now).map_or(u64::MAX, |fell| now - fell);
        if after_select < timing::SELECT_TO_CLOCK {
            return self.violations.note(now, Rule::ClockAfterSelect(after_select));
        }
        if period < timing::PERIOD {
            return self.violations.note(now, Rule::ClockPeriod(period));
        }
        // SDIN has to stay for some ns after the edge (t8): where it changes at the edge, the new level is taken.
        self.shift = (self.shift << 1 | u32::from(sdi.after)) & WORD;
        self.clocks += 1;
    }

    fn sdo(&self, now: u64) -> Option<bool> {
        if !self.dvcc || self.outputs.control.sdo_disable {
            return None;
        }
        let settled = now >= self.sdo_changed + timing::SDO_VALID;
        Some(if settled { self.sdo_after } else { self.sdo_before })
    }

    fn deselect(&mut self, now: u64) {
        if !self.dvcc {
            return;
        }
        self.sync_rose = Some(now);
        if !std::mem::take(&mut self.open) {
            return;
        }
        let after_clock = self.clock_fell.map_or(u64::MAX, |fell| now - fell);
        if after_clock < timing::CLOCK_TO_SELECT {
            self.violations.note(now, Rule::SelectAfterClock(after_clock));
            self.clocks = self.clocks.saturating_sub(1);
        }
        self.wrote_code = false;
        if self.clocks < 24 {
            return self.violations.note(now, Rule::ShortFrame(self.clocks));
        }
        if !self.clocks.is_multiple_of(24) {
            self.violations.note(now, Rule::OddFrame(self.clocks));
        }
        if std::mem::take(&mut self.loses_next_frame) {
            return;
        }
        self.execute(now);
    }
}
