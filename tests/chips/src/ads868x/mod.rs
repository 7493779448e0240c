//! ADS8681, ADS8685, ADS8689: 16-bit ADC with one input. Data sheet SBAS633E (August 2022).

mod converter;
mod range;
mod registers;
mod word;

pub use converter::Variant;
pub use range::AdcRange;
pub use registers::address;
pub use word::{FlagOrder, alarm};

use self::converter::Converter;
use self::registers::{Command, Registers};
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
    /// tWL_RST: RST low.
    pub const RST_LOW: u64 = 100;
    /// tD_RST_POR: from RST rising, or from the supplies, to the first frame.
    pub const POWER_ON_RESET: u64 = 20_000_000;
    /// tD_RST_APP: from RST rising to the first frame while RSTn_APP is 1.
    pub const APPLICATION_RESET: u64 = 1_000;
    /// tNAP_WKUP: from CONVST/CS falling to the sample.
    pub const NAP_WAKE: u64 = 20_000;
}

/// From power-up to the first frame, and from RST rising with RSTn_APP at 0, ns.
pub const ADC_POWER_UP_NS: u64 = timing::POWER_ON_RESET;

/// The chip at its pins. SPI mode 0 until SDI_CTL says otherwise.
///
/// It begins powered and ready, with an input of 0 V and its internal reference. All times are in ns and do not go back.
pub struct Ads868x {
    registers: Registers,
    converter: Converter,
    violations: Violations,
    /// Contents of the result register before the first conversion.
    unknown_result: u16,
    flag_order: FlagOrder,
    avdd: bool,
    dvdd: bool,
    rst: bool,
    rst_fell: u64,
    ready: u64,
    // serial port
    open: bool,
    unseen: u32,
    frames: u64,
    spi_mode: u8,
    two_lines: bool,
    output: u32,
    input: u32,
    clocks: u32,
    select_fell: u64,
    capture: Option<u64>,
    sdo_before: bool,
    sdo_after: bool,
    sdo_changed: u64,
    napping: bool,
    answer: Option<u32>,
}

impl Ads868x {
    /// A chip that has been powered for long.
    #[must_use]
    pub fn new(variant: Variant) -> Self {
        let unknown_result = 0x8000;
        Self {
            registers: Registers::power_up(),
            converter: Converter::new(variant, unknown_result),
            violations: Violations::default(),
            unknown_result,
            flag_order: FlagOrder::default(),
            avdd: true,
            dvdd: true,
            rst: true,
            rst_fell: 0,
            ready: 0,
            open: false,
            unseen: 0,
            frames: 0,
            spi_mode: 0,
            two_lines: false,
            output: 0,
            input: 0,
            clocks: 0,
            select_fell: 0,
            capture: None,
            sdo_before: false,
            sdo_after: false,
            sdo_changed: 0,
            napping: false,
            answer: None,
        }
    }

    /// Another order of the flags in the output word.
    #[must_use]
    pub fn with_flag_order(mut self, order: FlagOrder) -> Self {
        self.flag_order = order;
        self
    }

    /// Result of a frame before the first conversion has ended. The data sheet does not say; 0x8000 at first, which looks
    /// like 0 V in a bipolar range.
    #[must_use]
    pub fn with_unknown_result(mut self, code: u16) -> Self {
        self.unknown_result = code;
        self.converter.reset(code, 0);
        self
    }

    /// The input, V.
    pub fn set_input(&mut self, volts: f64) {
        self.converter.input = Box::new(move |_| volts);
    }

    /// The input as a function of time: ns to V. It is asked at each sample.
    pub fn set_input_fn(&mut self, volts: impl FnMut(u64) -> f64 + 'static) {
        self.converter.input = Box::new(volts);
    }

    /// The internal reference, V: 4.096 at first.
    pub fn set_internal_reference(&mut self, volts: f64) {
        self.converter.internal_reference_v = volts;
    }

    /// Voltage at REFIO while INTREF_DIS is 1, V: 0 at first, where codes run to their ends.
    pub fn set_external_reference(&mut self, volts: f64) {
        self.converter.external_reference_v = volts;
    }

    /// Whether AVDD trips its alarms.
    pub fn set_avdd_alarm(&mut self, low: bool, high: bool) {
        self.converter.avdd_low = low;
        self.converter.avdd_high = high;
    }

    /// AVDD on or off. After a loss of either supply all registers have their power-up values, and no frame is seen until
    /// both have been there for [`ADC_POWER_UP_NS`].
    pub fn set_avdd(&mut self, on: bool, now: u64) {
        self.avdd = on;
        self.supplies_changed(now);
    }

    /// DVDD on or off, as [`Self::set_avdd`].
    pub fn set_dvdd(&mut self, on: bool, now: u64) {
        self.dvdd = on;
        self.supplies_changed(now);
    }

    /// The RST pin. Low for 100 ns or more, it resets the chip as RSTn_APP says (SBAS633E, 7.4.2.1).
    pub fn set_rst(&mut self, level: bool, now: u64) {
        if self.rst == level {
            return;
        }
        self.rst = level;
        if !level {
            self.rst_fell = now;
            return;
        }
        let low = now - self.rst_fell;
        if low < timing::RST_LOW {
            return self.violations.note(now, Rule::RstLow(low));
        }
        if self.registers.byte(address::RST_PWRCTL) & 4 == 0 {
            self.registers = Registers::power_up();
            self.restart(now + timing::POWER_ON_RESET);
        } else {
            self.registers.application_reset();
            self.restart(now + timing::APPLICATION_RESET);
        }
    }

    /// The RVS pin in the SPI protocols: low in a frame, while a conversion runs, and in reset.
    #[must_use]
    pub fn rvs(&self, now: u64) -> bool {
        self.listens(now) && !self.open && self.converter.remaining(now) == 0
    }

    /// Contents of a byte of the registers.
    #[must_use]
    pub fn register(&self, address: u16) -> u8 {
        self.registers.byte(address)
    }

    /// Frames that the chip has seen to their end.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Frames that it has not seen, since they began in a conversion or in a reset.
    #[must_use]
    pub fn unseen_frames(&self) -> u32 {
        self.unseen
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

    fn supplies_changed(&mut self, now: u64) {
        self.registers = Registers::power_up();
        self.restart(now + timing::POWER_ON_RESET);
    }

    fn restart(&mut self, ready: u64) {
        self.open = false;
        self.answer = None;
        self.napping = false;
        self.ready = ready;
        self.converter.reset(self.unknown_result, ready);
    }

    fn listens(&self, now: u64) -> bool {
        self.avdd && self.dvdd && self.rst && now >= self.ready
    }

    /// Contents of the next frame: a pattern, else an answer, else the result (SBAS633E, 7.5.3).
    fn output_word(&mut self) -> u32 {
        let result = self.converter.take_over(&mut self.registers);
        let answer = self.answer.take();
        word::pattern(&self.registers)
            .or(answer)
            .unwrap_or_else(|| word::conversion(&self.registers, result, self.flag_order))
    }

    /// Puts the next bit on SDO-0; with two lines it gets every second one (SBAS633E, 7.5.4.2.2).
    fn launch(&mut self, now: u64) {
        let place = if self.two_lines { 30 } else { 31 };
        self.sdo_before = self.sdo_after;
        self.sdo_after = self.output >> place & 1 == 1;
        self.sdo_changed = now;
    }

    /// Takes a bit from SDI. What comes in follows what goes out, as in a daisy chain (SBAS633E, 7.4.1.3).
    fn take(&mut self, bit: bool) {
        let width = if self.two_lines { 2 } else { 1 };
        self.output = self.output << width | u32::from(bit);
        self.input = self.input << 1 | u32::from(bit);
        self.clocks += 1;
    }

    fn execute(&mut self, command: Command, now: u64) {
        match command {
            Command::Read { address } => {
                self.answer = Some(u32::from(self.registers.byte(address)) << 24);
            }
            Command::ReadHalfWord { address } => {
                self.answer = Some(u32::from(self.registers.half_word(address)) << 16);
                if address == address::ALARM {
                    // The tripped flags go, the active ones stay until the next conversion.
                    let flags = self.registers.half_word(address);
                    self.registers.set_alarm(flags & (alarm::VDD_L | alarm::VDD_H | alarm::IN_L | alarm::IN_H));
                }
            }
            _ => {
                if !self.registers.execute(command) {
                    self.violations.note(now, Rule::WithoutKey);
                }
                let down = self.registers.byte(address::RST_PWRCTL) & 1 == 1;
                self.converter.set_powered_down(down, now + timing::POWER_ON_RESET);
            }
        }
    }
}

impl SerialChip for Ads868x {
    fn select(&mut self, now: u64) {
        let remaining = self.converter.remaining(now);
        let rule = match self.listens(now) {
            false => Rule::FrameDuringReset,
            true if remaining > 0 => Rule::FrameDuringConversion(remaining),
            true => {
                self.open = true;
                self.output = self.output_word();
                self.input = 0;
                self.clocks = 0;
                self.capture = None;
                self.select_fell = now;
                self.spi_mode = self.registers.byte(address::SDI_CTL) & 3;
                self.two_lines = self.registers.byte(address::SDO_CTL + 1) & 3 == 3;
                if self.spi_mode & 1 == 0 {
                    // CPHA = 0: the first bit comes with the select.
                    self.launch(now);
                    self.sdo_before = self.sdo_after;
                }
                return;
            }
        };
        self.unseen += 1;
        self.violations.note(now, rule);
    }

    fn sclk(&mut self, level: bool, sdi: Sdi, now: u64) {
        if !self.open {
            return;
        }
        let leading = level == (self.spi_mode & 2 == 0);
        if leading != (self.spi_mode & 1 == 0) {
            return self.launch(now);
        }
        let after_select = now - self.select_fell;
        if after_select < timing::SELECT_TO_CLOCK {
            return self.violations.note(now, Rule::ClockAfterSelect(after_select));
        }
        // SDI has to be stable for 7.5 ns before the edge (tSU_CKDI): where it changes at the edge, the old level is taken.
        self.take(sdi.before);
        self.capture = Some(now);
    }

    fn sdo(&self, now: u64) -> Option<bool> {
        if !self.open || !self.rst || now < self.select_fell + timing::SELECT_TO_DATA {
            return None;
        }
        // No shortest delay is given: at the very edge the new bit may be there. After it, the longest counts.
        let passed = now - self.sdo_changed;
        Some(if passed == 0 || passed >= timing::CLOCK_TO_DATA { self.sdo_after } else { self.sdo_before })
    }

    fn deselect(&mut self, now: u64) {
        if !std::mem::take(&mut self.open) {
            return;
        }
        if !self.listens(now) {
            return;
        }
        self.frames += 1;
        let after_clock = self.capture.map_or(u64::MAX, |capture| now - capture);
        if after_clock < timing::CLOCK_TO_SELECT {
            self.violations.note(now, Rule::SelectAfterClock(after_clock));
            self.clocks -= 1;
        }
        let awake = now - self.select_fell;
        let settled = !self.napping || awake >= timing::NAP_WAKE;
        if !settled {
            self.violations.note(now, Rule::NapWake(awake));
        }
        self.converter.start(now, &self.registers, settled, &mut self.violations);
        if self.clocks >= 32 {
            self.execute(Command::from_word(self.input), now);
        } else if self.clocks > 0 {
            self.violations.note(now, Rule::ShortFrame(self.clocks));
        }
        self.napping = self.registers.byte(address::RST_PWRCTL) & 2 != 0;
    }
}
