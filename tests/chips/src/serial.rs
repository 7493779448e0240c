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

/// One bit from a master.
#[derive(Clone, Copy, Debug)]
pub struct Bit {
    /// Bits from the master.
    pub value: bool,
    /// Level of the line before.
    pub previous: bool,
    /// Next bits from the master, if they follow at once.
    pub next: Option<bool>,
    /// Time of the leading edge, ns.
    pub leading_ns: u64,
    /// Time of the trailing edge, ns.
    pub trailing_ns: u64,
}

/// Clocks one bit as a master in `mode` does, and returns what it samples.
///
/// With CPHA = 0 the master changes its output at the trailing edge and samples at the leading one; with CPHA = 1 it is
/// the other way round.
pub fn clock_bit(chip: &mut dyn SerialChip, mode: Mode, bit: Bit) -> Option<bool> {
    let leading_level = mode.polarity == Polarity::IdleLow;
    match mode.phase {
        Phase::CaptureOnFirstTransition => {
            chip.sclk(leading_level, Sdi::stable(bit.value), bit.leading_ns);
            let sampled = chip.sdo(bit.leading_ns);
            let after = bit.next.unwrap_or(bit.value);
            chip.sclk(!leading_level, Sdi { before: bit.value, after }, bit.trailing_ns);
            sampled
        }
        Phase::CaptureOnSecondTransition => {
            chip.sclk(leading_level, Sdi { before: bit.previous, after: bit.value }, bit.leading_ns);
            chip.sclk(!leading_level, Sdi::stable(bit.value), bit.trailing_ns);
            chip.sdo(bit.trailing_ns)
        }
    }
}
