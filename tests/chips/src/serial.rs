//! The serial pins of a chip, edge by edge.

use embedded_hal::spi::{Mode, Phase, Polarity};

/// The level at a chip's serial input around an edge of the clock.
///
/// The two differ when the master changes the level at this very edge. The chip's set-up or hold time is violated then,
/// and each chip says which level it takes.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Sdi {
    /// Level until the edge.
    pub before: bool,
    /// Level from the edge on.
    pub after: bool,
}

impl Sdi {
    /// A level that does not change at the edge.
    #[must_use]
    pub const fn stable(level: bool) -> Self {
        Self { before: level, after: level }
    }
}

/// A chip's select, clock, and data pins. Times are in ns and do not go back.
pub trait SerialChip {
    /// The select pin (SYNC, CONVST/CS) falls.
    fn select(&mut self, now: u64);

    /// The clock pin goes to `level`.
    fn sclk(&mut self, level: bool, sdi: Sdi, now: u64);

    /// Level of the serial output at `now`; `None` where the chip does not drive it.
    fn sdo(&self, now: u64) -> Option<bool>;

    /// The select pin rises.
    fn deselect(&mut self, now: u64);
}

/// No chip: the line keeps one level.
#[derive(Clone, Copy, Debug)]
pub struct Absent {
    /// The level that is read: `true` gives 0xff, `false` gives 0x00.
    pub level: bool,
}

impl SerialChip for Absent {
    fn select(&mut self, _now: u64) {}
    fn sclk(&mut self, _level: bool, _sdi: Sdi, _now: u64) {}
    fn sdo(&self, _now: u64) -> Option<bool> {
        Some(self.level)
    }
    fn deselect(&mut self, _now: u64) {}
}

/// Bits that a master sends, the highest first.
#[derive(Clone, Copy, Debug)]
pub struct Bits {
    /// The bits, as the lowest ones.
    pub value: u64,
    /// How many bits.
    pub count: u32,
    /// Level of the line before.
    pub previous: bool,
}

impl Bits {
    fn bit(self, index: u32) -> bool {
        self.value >> (self.count - 1 - index) & 1 == 1
    }

    /// Clocks them as a master in `mode` does, with the edges at these times in ns, by their numbers. Returns what it samples, with `idle` where the chip
    /// drives nothing, and for how many bits it does not.
    ///
    /// With CPHA = 0 the master changes its output at the trailing edge and samples at the leading one; with CPHA = 1 it is
    /// the other way round.
    pub fn clock(self, chip: &mut dyn SerialChip, mode: Mode, edge_ns: impl Fn(u64) -> u64, idle: bool) -> (u64, u32) {
        let leading_level = mode.polarity == Polarity::IdleLow;
        (0..self.count).fold((0, 0), |(received, floating), k| {
            let (value, leading_ns, trailing_ns) =
                (self.bit(k), edge_ns(u64::from(2 * k)), edge_ns(u64::from(2 * k + 1)));
            let sampled = match mode.phase {
                Phase::CaptureOnFirstTransition => {
                    chip.sclk(leading_level, Sdi::stable(value), leading_ns);
                    let sampled = chip.sdo(leading_ns);
                    let after = if k + 1 < self.count { self.bit(k + 1) } else { value };
                    chip.sclk(!leading_level, Sdi { before: value, after }, trailing_ns);
                    sampled
                }
                Phase::CaptureOnSecondTransition => {
                    let before = if k > 0 { self.bit(k - 1) } else { self.previous };
                    chip.sclk(leading_level, Sdi { before, after: value }, leading_ns);
                    chip.sclk(!leading_level, Sdi::stable(value), trailing_ns);
                    chip.sdo(trailing_ns)
                }
            };
            (received << 1 | u64::from(sampled.unwrap_or(idle)), floating + u32::from(sampled.is_none()))
        })
    }
}
