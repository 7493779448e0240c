//! ADS8681, ADS8685, ADS8689: 16-bit ADC with one input. Data sheet SBAS633E (August 2022).

use crate::port::Port;
use crate::serial::{Sdi, SerialChip};
use crate::violation::{Rule, Violation, Violations};

/// Tables 6.7 and 6.8, ns, rounded up.
mod timing {
    /// tSU_CSCK, 7.5 ns: CONVST/CS falling to the first capture edge.
    pub const SELECT_TO_CLOCK: u64 = 8;
    /// tHT_CKCS, 7.5 ns: last capture edge to CONVST/CS rising.
    pub const CLOCK_TO_SELECT: u64 = 8;
    /// tDEN_CSDO, 9.5 ns at most: CONVST/CS falling to data.
    pub const SELECT_TO_DATA: u64 = 10;
    /// tD_CKDO, 12 ns at most: launch edge to data.
    pub const CLOCK_TO_DATA: u64 = 12;
}

/// tD_RST_POR: from the supplies to the first frame, ns.
pub const ADC_POWER_UP_NS: u64 = 20_000_000;

/// Addresses of registers (SBAS633E, register map).
const DATAOUT_CTL: u32 = 0x10;
const RANGE_SEL: u32 = 0x14;
/// In DATAOUT_CTL: the range follows the result.
const RANGE_INCL: u16 = 1 << 8;
/// The internal reference, V.
const REFERENCE_V: f64 = 4.096;
/// The result before the first conversion: the data sheet does not say. It looks like 0 V in a bipolar range.
const UNKNOWN_RESULT: u16 = 0x8000;

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

    /// tACQ, ns: the shortest (SBAS633E, 6.6). With the conversion it is tCYCLE, the shortest from one sample to the next (7.4.2.3).
    #[must_use]
    pub const fn acquisition_ns(self) -> u64 {
        match self {
            Self::Ads8681 => 335,
            Self::Ads8685 => 1_000,
            Self::Ads8689 => 5_000,
        }
    }
}

/// Ends of the range with this RANGE_SEL in multiples of the reference, if there is one (SBAS633E, Table 7-4).
fn ends(select: u16) -> Option<(f64, f64)> {
    const FULL_SCALE: [f64; 5] = [3.0, 2.5, 1.5, 1.25, 0.625];
    match select {
        0..=4 => Some((-FULL_SCALE[usize::from(select)], FULL_SCALE[usize::from(select)])),
        8..=11 => Some((0.0, FULL_SCALE[usize::from(select) - 8])),
        _ => None,
    }
}

/// Straight binary code of a voltage, to the nearest; beyond the ends it stays at 0x0000 and 0xffff (SBAS633E, 7.3.8).
fn code(volts: f64, (low, high): (f64, f64)) -> u16 {
    let lsb_v = (high - low) * REFERENCE_V / 65536.0;
    ((volts - low * REFERENCE_V) / lsb_v).round() as u16
}

/// The input as a function of time in ns.
type Input = Box<dyn FnMut(u64) -> f64>;

/// The chip at its pins, RST high. SPI mode 0.
///
/// It begins powered and ready, with an input of 0 V and its internal reference. All times are in ns and do not go back.
pub struct Ads868x {
    variant: Variant,
    input: Input,
    violations: Violations,
    avdd: bool,
    dvdd: bool,
    ready: u64,
    range_sel: u16,
    dataout_ctl: u16,
    // conversion
    acquiring_since: u64,
    /// End of the conversion that runs or ran last.
    end: u64,
    sampled_v: f64,
    result: u16,
    // serial port
    port: Port,
    answer: Option<u32>,
    output: u32,
    received: u32,
}

impl Ads868x {
    /// A chip that has been powered for long.
    #[must_use]
    pub fn new(variant: Variant) -> Self {
        Self {
            variant,
            input: Box::new(|_| 0.0),
            violations: Violations::default(),
            avdd: true,
            dvdd: true,
            ready: 0,
            range_sel: 0,
            dataout_ctl: 0,
            acquiring_since: 0,
            end: 0,
            sampled_v: 0.0,
            result: UNKNOWN_RESULT,
            port: Port::default(),
            answer: None,
            output: 0,
            received: 0,
        }
    }

    /// The input, V.
    pub fn set_input(&mut self, volts: f64) {
        self.input = Box::new(move |_| volts);
    }

    /// The input as a function of time: ns to V. It is asked at each sample.
    pub fn set_input_fn(&mut self, volts: impl FnMut(u64) -> f64 + 'static) {
        self.input = Box::new(volts);
    }

    /// AVDD on or off. After a loss of either supply all registers have their power-up values, and no frame is seen until
    /// both have been there for [`ADC_POWER_UP_NS`].
    pub fn set_avdd(&mut self, on: bool, now: u64) {
        self.avdd = on;
        self.restart(now);
    }

    /// DVDD on or off, as [`Self::set_avdd`].
    pub fn set_dvdd(&mut self, on: bool, now: u64) {
        self.dvdd = on;
        self.restart(now);
    }

    /// RANGE_SEL_REG.
    #[must_use]
    pub fn range_sel(&self) -> u16 {
        self.range_sel
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

    /// Nothing converts until the chip is ready, and the result is unknown.
    fn restart(&mut self, now: u64) {
        let ready = now + ADC_POWER_UP_NS;
        (self.ready, self.end, self.acquiring_since) = (ready, ready, ready);
        (self.range_sel, self.dataout_ctl, self.result) = (0, 0, UNKNOWN_RESULT);
        self.port.open = false;
        self.answer = None;
    }

    fn listens(&self, now: u64) -> bool {
        self.avdd && self.dvdd && now >= self.ready
    }

    /// Samples at `now` and converts. The result is there with the next frame, which begins after the conversion or is not seen.
    fn convert(&mut self, now: u64) {
        let acquired = now - self.acquiring_since;
        let wanted = self.variant.acquisition_ns();
        let mut volts = (self.input)(now);
        if acquired < wanted {
            self.violations.note(now, Rule::Acquisition(acquired));
            volts = self.sampled_v + (volts - self.sampled_v) * acquired as f64 / wanted as f64;
        }
        self.end = now + self.variant.conversion_ns();
        self.acquiring_since = self.end;
        self.sampled_v = volts;
        // A range that does not exist is never set.
        self.result = ends(self.range_sel).map_or(self.result, |ends| code(volts, ends));
    }

    /// Carries out a command (SBAS633E, Table 7-5): a WRITE or READ of a half-word, at an even address. Other registers, bits and
    /// commands are not modelled.
    fn execute(&mut self, now: u64) {
        let (command, address, bits) = (self.received >> 25, self.received >> 16 & 0x1fe, self.received as u16);
        match (command, address) {
            _ if self.received == 0 => {}
            (0b110_1000, DATAOUT_CTL) if bits & !RANGE_INCL == 0 => self.dataout_ctl = bits,
            (0b110_1000, RANGE_SEL) if ends(bits).is_some() => self.range_sel = bits,
            (0b110_0100, DATAOUT_CTL) => self.answer = Some(u32::from(self.dataout_ctl) << 16),
            (0b110_0100, RANGE_SEL) => self.answer = Some(u32::from(self.range_sel) << 16),
            _ => self.violations.note(now, Rule::UnknownCommand(self.received)),
        }
    }
}

impl SerialChip for Ads868x {
    fn select(&mut self, now: u64) {
        let remaining = self.end.saturating_sub(now);
        if !self.listens(now) {
            return self.violations.note(now, Rule::FrameDuringReset);
        }
        if remaining > 0 {
            return self.violations.note(now, Rule::FrameDuringConversion(remaining));
        }
        self.port.begin(now);
        // An answer, else the result and the range if it is included (SBAS633E, 7.5.3).
        let range = if self.dataout_ctl & RANGE_INCL != 0 { u32::from(self.range_sel) << 12 } else { 0 };
        self.output = self.answer.take().unwrap_or(u32::from(self.result) << 16 | range);
        self.received = 0;
        // CPHA = 0: the first bit comes with the select.
        let first = self.output >> 31 == 1;
        self.port.launch(first, first, now);
    }

    fn sclk(&mut self, level: bool, sdi: Sdi, now: u64) {
        if !self.port.open {
            return;
        }
        if !level {
            return self.port.launch(self.port.after, self.output >> 31 == 1, now);
        }
        let after_select = now - self.port.selected;
        if after_select < timing::SELECT_TO_CLOCK {
            return self.violations.note(now, Rule::ClockAfterSelect(after_select));
        }
        // SDI has to be stable for 7.5 ns before the edge (tSU_CKDI): where it changes at the edge, the old level is taken. What comes
        // in follows what goes out, as in a daisy chain (SBAS633E, 7.4.1.3).
        self.output = self.output << 1 | u32::from(sdi.before);
        self.received = self.received << 1 | u32::from(sdi.before);
        self.port.clocks += 1;
        self.port.captured = Some(now);
    }

    fn sdo(&self, now: u64) -> Option<bool> {
        if !self.port.open || now < self.port.selected + timing::SELECT_TO_DATA {
            return None;
        }
        // No shortest delay is given: at the very edge the new bit may be there. After it, the longest counts.
        let passed = now - self.port.changed;
        Some(if passed == 0 || passed >= timing::CLOCK_TO_DATA { self.port.after } else { self.port.before })
    }

    fn deselect(&mut self, now: u64) {
        let was_open = std::mem::take(&mut self.port.open);
        if !was_open || !self.listens(now) {
            return;
        }
        let clocks = self.port.end(now, timing::CLOCK_TO_SELECT, &mut self.violations);
        self.convert(now);
        if clocks >= 32 {
            self.execute(now);
        } else if clocks > 0 {
            self.violations.note(now, Rule::ShortFrame(clocks));
        }
    }
}
