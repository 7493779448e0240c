//! From the input of the ADS868x to its result: sampling, conversion time, alarms.

use super::range::AdcRange;
use super::registers::{Registers, address};
use super::word::alarm;
use crate::violation::{Rule, Violations};

/// Which chip of the family.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Variant {
    /// 1 MSPS.
    Ads8681,
    /// 500 kSPS.
    Ads8685,
    /// 100 kSPS.
    Ads8689,
}

impl Variant {
    /// tCONV, ns: the longest (SBAS633E, 6.6).
    #[must_use]
    pub const fn conversion_ns(self) -> u64 {
        match self {
            Self::Ads8681 => 665,
            Self::Ads8685 => 1_000,
            Self::Ads8689 => 5_000,
        }
    }

    /// tACQ, ns: the shortest (SBAS633E, 6.6).
    #[must_use]
    pub const fn acquisition_ns(self) -> u64 {
        match self {
            Self::Ads8681 => 335,
            Self::Ads8685 => 1_000,
            Self::Ads8689 => 5_000,
        }
    }

    /// tCYCLE, ns: the shortest from one sample to the next, conversion and acquisition (SBAS633E, 6.6 and 7.4.2.3).
    #[must_use]
    pub const fn cycle_ns(self) -> u64 {
        self.conversion_ns() + self.acquisition_ns()
    }
}

/// The input as a function of time in ns.
pub(crate) type Input = Box<dyn FnMut(u64) -> f64>;

pub(crate) struct Converter {
    pub variant: Variant,
    pub input: Input,
    pub internal_reference_v: f64,
    pub external_reference_v: f64,
    /// AVDD is too low or too high, as the test says.
    pub avdd_low: bool,
    pub avdd_high: bool,
    /// From when on the input is acquired.
    acquiring_since: u64,
    /// End of the conversion that runs or ran last.
    end: u64,
    /// Result, until it is taken over.
    running: Option<u16>,
    sampled_v: f64,
    result: u16,
    /// From when on it converts; later than now after a power-down.
    on_since: u64,
    powered_down: bool,
}

impl Converter {
    pub fn new(variant: Variant, result: u16) -> Self {
        Self {
            variant,
            input: Box::new(|_| 0.0),
            internal_reference_v: 4.096,
            external_reference_v: 0.0,
            avdd_low: false,
            avdd_high: false,
            acquiring_since: 0,
            end: 0,
            running: None,
            sampled_v: 0.0,
            result,
            on_since: 0,
            powered_down: false,
        }
    }

    /// After a reset that is over at `ready`: nothing converts, and the result is unknown.
    pub fn reset(&mut self, result: u16, ready: u64) {
        self.running = None;
        self.result = result;
        self.end = ready;
        self.acquiring_since = ready;
        self.on_since = ready;
        self.powered_down = false;
    }

    /// Time to the end of the conversion, ns; 0 without one.
    pub fn remaining(&self, now: u64) -> u64 {
        self.end.saturating_sub(now)
    }

    /// The PWRDN bit, and when a converter that is switched on again is ready.
    pub fn set_powered_down(&mut self, down: bool, ready: u64) {
        if self.powered_down && !down {
            self.on_since = ready;
        }
        self.powered_down = down;
    }

    /// Takes over a conversion that has ended, and its alarms. To be called when the bus looks at the result.
    pub fn take_over(&mut self, registers: &mut Registers) -> u16 {
        if let Some(code) = self.running.take() {
            self.result = code;
            self.update_alarms(code, registers);
        }
        self.result
    }

    /// Samples at `now` and converts. `settled` is false where the chip woke too late.
    pub fn start(&mut self, now: u64, registers: &Registers, settled: bool, violations: &mut Violations) {
        if self.powered_down || now < self.on_since {
            return;
        }
        let acquired = now - self.acquiring_since;
        let wanted = self.variant.acquisition_ns();
        let mut volts = (self.input)(now);
        if acquired < wanted {
            violations.note(now, Rule::Acquisition(acquired));
            volts = self.sampled_v + (volts - self.sampled_v) * acquired as f64 / wanted as f64;
        }
        self.end = now + self.variant.conversion_ns();
        self.acquiring_since = self.end;
        if settled {
            self.sampled_v = volts;
            self.running = Some(self.code(volts, registers));
        }
    }

    fn code(&self, volts: f64, registers: &Registers) -> u16 {
        let select = registers.byte(address::RANGE_SEL);
        let external = select & 0x40 != 0;
        let reference_v = if external { self.external_reference_v } else { self.internal_reference_v };
        AdcRange::from_bits(select & 0x0f).unwrap_or(AdcRange::Bipolar3).code(volts, reference_v)
    }

    /// Flags at the end of a conversion (SBAS633E, 7.3.9). Tripped flags stay until ALARM_REG is read.
    fn update_alarms(&self, code: u16, registers: &mut Registers) {
        let power = registers.byte(address::RST_PWRCTL);
        let (vdd, input) = (power & 0x20 == 0, power & 0x10 == 0);
        let mut flags = registers.half_word(address::ALARM)
            & (alarm::TRIPPED_VDD_L | alarm::TRIPPED_VDD_H | alarm::TRIPPED_IN_L | alarm::TRIPPED_IN_H);
        for (on, active, tripped) in [
            (vdd && self.avdd_low, alarm::VDD_L, alarm::TRIPPED_VDD_L),
            (vdd && self.avdd_high, alarm::VDD_H, alarm::TRIPPED_VDD_H),
            (input && code < registers.half_word(address::ALARM_L_TH), alarm::IN_L, alarm::TRIPPED_IN_L),
            (input && code > registers.half_word(address::ALARM_H_TH), alarm::IN_H, alarm::TRIPPED_IN_H),
        ] {
            if on {
                flags |= active | tripped;
            }
        }
        if flags != 0 {
            flags |= alarm::OVERVIEW;
        }
        registers.set_alarm(flags);
    }
}
