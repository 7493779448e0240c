//! The four channels of the AD5754 from their registers to their pins.

use super::registers::{Channels, Coding, Control, DacRange, PowerControl};
use super::unspecified::{AfterShutdown, DacRegisterReads, FirstOutput, Unspecified};
use crate::violation::{Rule, Violations};

/// t12: an output reaches its new voltage in 10 µs (20 V step, to 0.03 % of full scale).
pub const SETTLING_NS: u64 = 10_000;

/// After its PU bit is set, a channel needs 10 µs before it may be loaded (data sheet, table "Power Control Register").
pub const POWER_UP_NS: u64 = 10_000;

/// A voltage on its way: straight from one to the other in [`SETTLING_NS`].
#[derive(Clone, Copy, Debug)]
struct Ramp {
    from_v: f64,
    to_v: f64,
    begin_ns: u64,
}

impl Ramp {
    const ZERO: Self = Self { from_v: 0.0, to_v: 0.0, begin_ns: 0 };

    fn volts(&self, now: u64) -> f64 {
        let passed = now.saturating_sub(self.begin_ns);
        if passed >= SETTLING_NS {
            return self.to_v;
        }
        self.from_v + (self.to_v - self.from_v) * passed as f64 / SETTLING_NS as f64
    }
}

#[derive(Clone, Copy, Debug)]
struct Output {
    input: u16,
    loaded: u16,
    range: DacRange,
    /// When its PU bit was set; `None` while it is 0.
    powered_ns: Option<u64>,
    /// The channel was loaded since the supplies came.
    loaded_once: bool,
    over_current: bool,
    /// Switched off by an over-current, and not powered up since.
    tripped: bool,
    ramp: Ramp,
}

impl Output {
    const POWER_UP: Self = Self {
        input: 0,
        loaded: 0,
        range: DacRange::Unipolar5,
        powered_ns: None,
        loaded_once: false,
        over_current: false,
        tripped: false,
        ramp: Ramp::ZERO,
    };
}

/// Registers and pins of the four channels.
#[derive(Clone, Debug)]
pub(crate) struct Outputs {
    channels: [Output; 4],
    pub control: Control,
    pub coding: Coding,
    pub reference_v: f64,
    pub unspecified: Unspecified,
    pub avdd: bool,
    over_temperature: bool,
    /// CLR is low.
    pub held_clear: bool,
}

impl Outputs {
    pub fn new(coding: Coding, unspecified: Unspecified) -> Self {
        Self {
            channels: [Output::POWER_UP; 4],
            control: Control::POWER_UP,
            coding,
            reference_v: 2.5,
            unspecified,
            avdd: true,
            over_temperature: false,
            held_clear: false,
        }
    }

    /// All registers at their power-up values; the pins go to 0 V from where they are.
    pub fn power_on_reset(&mut self, now: u64) {
        self.control = Control::POWER_UP;
        for channel in &mut self.channels {
            let (ramp, over_current) = (channel.ramp, channel.over_current);
            *channel = Output { ramp, over_current, ..Output::POWER_UP };
        }
        self.settle(now);
    }

    /// AVDD came or went.
    pub fn set_avdd(&mut self, on: bool, now: u64) {
        self.avdd = on;
        if !on {
            self.channels.iter_mut().for_each(|channel| channel.loaded_once = false);
            if self.unspecified.avdd_dip_resets {
                self.power_on_reset(now);
            }
        }
        self.settle(now);
    }

    pub fn volts(&self, channel: usize, now: u64) -> f64 {
        self.channels[channel].ramp.volts(now)
    }

    pub fn range(&self, channel: usize) -> DacRange {
        self.channels[channel].range
    }

    pub fn is_powered(&self, channel: usize) -> bool {
        self.channels[channel].powered_ns.is_some()
    }

    pub fn loaded(&self, channel: usize) -> u16 {
        self.channels[channel].loaded
    }

    /// Source of a read of the DAC register.
    pub fn read_dac(&self, channel: usize) -> u16 {
        match self.unspecified.dac_register_reads {
            DacRegisterReads::Input => self.channels[channel].input,
            DacRegisterReads::Loaded => self.channels[channel].loaded,
        }
    }

    /// A write to a channel that is powered down is ignored (data sheet, "Configuring the AD5724/AD5734/AD5754").
    pub fn write_dac(&mut self, channels: Channels, code: u16, now: u64, violations: &mut Violations) {
        for k in channels.indices() {
            if self.is_powered(k) {
                self.channels[k].input = code;
            } else {
                violations.note(now, Rule::WriteWhilePoweredDown(k as u8));
            }
        }
    }

    pub fn write_range(&mut self, channels: Channels, range: DacRange, now: u64) {
        for k in channels.indices() {
            self.channels[k].range = range;
        }
        self.settle(now);
    }

    pub fn write_control(&mut self, bits: u16, now: u64) {
        self.control = Control::from_bits(bits);
        self.protect();
        self.settle(now);
    }

    /// Codes go from the input registers to the DAC registers of channels that are powered up.
    pub fn load(&mut self, channels: Channels, now: u64, violations: &mut Violations) {
        if self.held_clear {
            violations.note(now, Rule::LoadWhileClear);
            return;
        }
        for k in channels.indices() {
            let channel = &mut self.channels[k];
            match channel.powered_ns {
                Some(since) if now < since + POWER_UP_NS => violations.note(now, Rule::LoadDuringPowerUp(k as u8)),
                Some(_) => {
                    channel.loaded = channel.input;
                    channel.loaded_once = true;
                }
                None => {}
            }
        }
        self.settle(now);
    }

    /// All DAC registers to the clear code of their range. The input registers keep what they have.
    pub fn clear(&mut self, now: u64) {
        for channel in &mut self.channels {
            channel.loaded = channel.range.clear_code(self.control.clear_select, self.coding);
        }
        self.settle(now);
    }

    pub fn write_power(&mut self, bits: u16, now: u64) {
        for (k, channel) in self.channels.iter_mut().enumerate() {
            let on = bits & PowerControl::power_up(k) != 0;
            if on {
                channel.tripped = false;
            }
            channel.powered_ns = on.then(|| channel.powered_ns.unwrap_or(now));
        }
        self.protect();
        self.settle(now);
    }

    pub fn read_power(&self) -> u16 {
        let mut bits = if self.is_shut_down() { PowerControl::TSD } else { 0 };
        for (k, channel) in self.channels.iter().enumerate() {
            if channel.powered_ns.is_some() {
                bits |= PowerControl::power_up(k);
            }
            if channel.over_current || channel.tripped {
                bits |= PowerControl::over_current(k);
            }
        }
        bits
    }

    pub fn set_over_temperature(&mut self, hot: bool, now: u64) {
        self.over_temperature = hot;
        self.protect();
        self.settle(now);
    }

    pub fn set_over_current(&mut self, channel: usize, on: bool, now: u64) {
        self.channels[channel].over_current = on;
        self.protect();
        self.settle(now);
    }

    /// The thermal shutdown acts only where it is enabled.
    fn is_shut_down(&self) -> bool {
        self.over_temperature && self.control.tsd_enable
    }

    /// Effect of an over-current without clamp, or of the thermal shutdown, on the PU bits.
    fn protect(&mut self) {
        let stays_down = self.is_shut_down() && self.unspecified.after_shutdown == AfterShutdown::StaysDown;
        for channel in &mut self.channels {
            if channel.over_current && !self.control.clamp_enable && channel.powered_ns.is_some() {
                channel.powered_ns = None;
                channel.tripped = true;
            }
            if stays_down {
                channel.powered_ns = None;
            }
        }
    }

    /// Sends each pin towards the voltage that the registers ask for.
    pub fn settle(&mut self, now: u64) {
        let clamped = !self.avdd || self.is_shut_down();
        for channel in &mut self.channels {
            let waits = self.unspecified.first_output == FirstOutput::ClampedUntilLoaded && !channel.loaded_once;
            let to_v = if clamped || channel.powered_ns.is_none() || waits {
                0.0
            } else {
                channel.range.volts(channel.loaded, self.coding, self.reference_v)
            };
            if to_v != channel.ramp.to_v {
                channel.ramp = Ramp { from_v: channel.ramp.volts(now), to_v, begin_ns: now };
            }
        }
    }
}
