//! Chips on the board's SPI buses, wired to pins.

use crate::chip::gpio::{Pin, Speed};

/// A byte as a chip on the bus sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpiByte {
    /// At the chip's input, first bit uppermost.
    pub sent: u8,
    /// When its first bit begins, ns since power-up.
    pub start_ns: u64,
    /// Clock, Hz: the byte takes eight of its periods.
    pub sck_hz: u32,
    /// 0 to 3: twice CPOL, and CPHA.
    pub mode: u8,
    /// The level of MISO where nothing drives it.
    pub idle: bool,
    /// Speeds of the chip's pads that drive clock and data.
    pub sck_speed: Speed,
    pub mosi_speed: Speed,
}

impl SpiByte {
    /// The two edges of the clock for a bit, 0 to 7, ns. With CPHA = 0 the first one comes half a period after the bit, with CPHA = 1
    /// together with it.
    #[must_use]
    pub fn edges_ns(&self, bit: u64) -> (u64, u64) {
        let half = |halves: u64| self.start_ns + halves * 500_000_000 / u64::from(self.sck_hz);
        let late = if self.mode & 1 == 0 { 1 } else { 0 };
        (half(2 * bit + late), half(2 * bit + 1 + late))
    }
}

/// A chip on an SPI bus.
///
/// Everything happens while the firmware waits within one access: an implementation must not touch the registers of the
/// chip. A panic in it ends the process, since there is no way back through the access.
pub trait SpiSlave {
    /// The select falls.
    fn select(&mut self, at_ns: u64);

    /// A byte while it is selected. Returns what is on MISO meanwhile: what it drives, and [`SpiByte::idle`] where it does not.
    fn exchange(&mut self, byte: &SpiByte) -> u8;

    /// The select rises.
    fn deselect(&mut self, at_ns: u64);

    /// Another of its inputs, connected to a pin: see [`Wiring::inputs`].
    fn input(&mut self, _pin: Pin, _high: bool, _at_ns: u64) {}
}

/// Where a chip is connected.
#[derive(Clone, Debug)]
pub struct Wiring {
    pub select: Pin,
    pub sck: Pin,
    pub miso: Pin,
    pub mosi: Pin,
    /// Other pins that it sees, such as one that clears it. A pin that nothing drives is low, by a resistor.
    pub inputs: Vec<Pin>,
}

/// A chip with its wires.
pub struct Wired {
    pub wiring: Wiring,
    pub slave: Box<dyn SpiSlave>,
    pub selected: bool,
}
