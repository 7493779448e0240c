//! ST's erratum on slow pads.

/// Value of the last bit of a received byte.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum LastBit {
    /// The last bit of the byte received before, which is what ST says.
    #[default]
    OfPreviousByte,
    /// The bit before it in the same byte.
    Repeated,
}

/// SCK on a pin of low output speed: the last bit of each received byte may be wrong.
///
/// ES0182 (STM32F405), section 2.5.2 in older revisions, "Corrupted last bit of data and/or CRC, received in master mode
/// with delayed SCK feedback": the last bit is not captured when the feedback from the SCK pin is late, and its place
/// keeps the value of the transfer before. What counts is the clock of the APB, the load on SCK, and its output speed;
/// the SPI's own frequency has no influence. stm32f4xx-hal's issue 564 saw it at 2 MHz.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct SlowPad {
    /// The bit is wrong when SCK is faster than this, Hz. 0 as ST has it: at every frequency.
    pub above_hz: u32,
    /// Value that is read instead.
    pub last_bit: LastBit,
}

impl SlowPad {
    /// Returns the byte that the master receives for `byte`, after `previous`.
    #[must_use]
    pub(crate) fn received(self, sck_hz: u32, byte: u8, previous: u8) -> u8 {
        if sck_hz <= self.above_hz {
            return byte;
        }
        let last = match self.last_bit {
            LastBit::OfPreviousByte => previous & 1,
            LastBit::Repeated => byte >> 1 & 1,
        };
        byte & !1 | last
    }
}
