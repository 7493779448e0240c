//! A master that sends any number of bits at any speed.

use converter_chips::{Ad5754, Ads868x, Bits, Rule, SerialChip, Variant};
use embedded_hal::spi::{MODE_0, MODE_1, Mode};

pub struct Master {
    pub mode: Mode,
    pub now: u64,
    /// Half a period of the clock, ns.
    pub half_ns: u64,
    /// Select high before each frame, ns.
    pub high_ns: u64,
    /// Select to the first edge, and last edge to deselect, ns.
    pub margin_ns: u64,
    /// Bits of the last frame that no chip drove.
    pub floating: u32,
}

impl Master {
    pub fn new(mode: Mode) -> Self {
        Self { mode, now: 1_000_000, half_ns: 50, high_ns: 100_000, margin_ns: 50, floating: 0 }
    }

    /// Sends the lowest `count` bits of `value`, highest first, and returns what was read.
    pub fn send(&mut self, chip: &mut dyn SerialChip, value: u64, count: u32) -> u64 {
        self.now += self.high_ns;
        chip.select(self.now);
        self.now += self.margin_ns;
        let bits = Bits { value, count, previous: false };
        let (read, floating) = bits.clock(chip, self.mode, |edge| self.now + edge * self.half_ns, false);
        self.floating = floating;
        if count > 0 {
            self.now += u64::from(2 * count - 1) * self.half_ns;
        }
        self.now += self.margin_ns;
        chip.deselect(self.now);
        read
    }
}

/// A chip and its master.
pub struct Bench<C> {
    pub chip: C,
    pub master: Master,
}

pub type Dac = Bench<Ad5754>;
pub type Adc = Bench<Ads868x>;

impl<C> Bench<C> {
    pub fn wait(&mut self, ns: u64) {
        self.master.now += ns;
    }
}

impl Dac {
    pub fn new() -> Self {
        Self { chip: Ad5754::new(), master: Master::new(MODE_1) }
    }

    /// Powered up in `range`, and ready to be loaded.
    pub fn powered(range: u64) -> Self {
        let mut dac = Self::new();
        dac.write(0x08_0000 | range);
        dac.write(0x10_0001);
        dac.wait(10_000);
        dac
    }

    /// Powered up in `range`, and loaded with `code` by LDAC, which stays low.
    pub fn loaded(range: u64, code: u64) -> Self {
        let mut dac = Self::powered(range);
        dac.chip.set_ldac(false, dac.master.now);
        dac.write(code);
        dac
    }

    pub fn write(&mut self, word: u64) -> u64 {
        self.master.send(&mut self.chip, word, 24)
    }

    /// The answer to a read command, all 24 bits.
    pub fn read(&mut self, word: u64) -> u64 {
        self.write(word);
        self.write(0x18_0000)
    }

    pub fn rules(&self) -> Vec<Rule> {
        self.chip.violations().iter().map(|violation| violation.rule).collect()
    }

    /// The output after it has settled, V.
    pub fn settled(&mut self) -> f64 {
        self.wait(10_000);
        self.chip.volts(self.master.now)
    }
}

impl Adc {
    pub fn new(variant: Variant) -> Self {
        Self { chip: Ads868x::new(variant), master: Master::new(MODE_0) }
    }

    pub fn frame(&mut self, word: u32) -> u32 {
        self.master.send(&mut self.chip, u64::from(word), 32) as u32
    }

    pub fn rules(&self) -> Vec<Rule> {
        self.chip.violations().iter().map(|violation| violation.rule).collect()
    }

    /// A conversion of the present input, and the word that brings its result.
    pub fn convert(&mut self) -> u32 {
        self.frame(0);
        self.frame(0)
    }
}
