//! A sensor's ADC: one channel of an ADS8681, ADS8685 or ADS8689 on its 0…10.24 V range.

use embedded_hal::spi::SpiDevice;

use crate::chips::AdcCode;

/// Write both bytes of a register, in the upper seven bits of a frame.
const WRITE: u8 = 0xd0;
/// Read both bytes of a register.
const READ: u8 = 0xc8;
/// The register of the input range.
const RANGE_SEL: u8 = 0x14;
/// 0 to 2.5 × the internal reference of 4.096 V.
const UNIPOLAR_10_24_V: u16 = 0b1001;

/// An ADS868x. SPI mode 0, frames of 32 bits.
///
/// The chip samples when its select line rises at the end of a frame and answers in the next: a reading is as old as the
/// tick before.
pub struct Ads868x<SPI> {
    spi: SPI,
    configured: bool,
}

/// Why an ADC cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AdcError {
    /// The bus did not carry a frame.
    Bus,
    /// The register of the range does not hold what was written: no chip, or another one.
    Range {
        /// What it holds.
        found: u16,
    },
    /// Its range was not set yet.
    Unconfigured,
}

impl<SPI: SpiDevice> Ads868x<SPI> {
    /// An ADC on `spi`, nothing said to it yet.
    pub const fn new(spi: SPI) -> Self {
        Self { spi, configured: false }
    }

    /// Whether its range was set.
    pub const fn is_configured(&self) -> bool {
        self.configured
    }

    /// Sets the range to 0…10.24 V and reads it back.
    ///
    /// # Errors
    ///
    /// [`AdcError`] where the chip does not answer as it should; try again once it has power.
    pub fn configure(&mut self) -> Result<(), AdcError> {
        self.configured = false;
        let [high, low] = UNIPOLAR_10_24_V.to_be_bytes();
        self.frame([WRITE, RANGE_SEL, high, low])?;
        self.frame([READ, RANGE_SEL, 0, 0])?;
        let [high, low, ..] = self.frame([0; 4])?;
        let found = u16::from_be_bytes([high, low]);
        // The upper bits hold alarms.
        self.configured = found & 0x000f == UNIPOLAR_10_24_V;
        if self.configured { Ok(()) } else { Err(AdcError::Range { found }) }
    }

    /// The sample that was taken at the end of the last frame.
    ///
    /// # Errors
    ///
    /// [`AdcError::Bus`], [`AdcError::Unconfigured`].
    pub fn read(&mut self) -> Result<AdcCode, AdcError> {
        if !self.configured {
            return Err(AdcError::Unconfigured);
        }
        let [high, low, ..] = self.frame([0; 4])?;
        Ok(AdcCode(u16::from_be_bytes([high, low])))
    }

    fn frame(&mut self, command: [u8; 4]) -> Result<[u8; 4], AdcError> {
        let mut bytes = command;
        self.spi.transfer_in_place(&mut bytes).map_err(|_| AdcError::Bus)?;
        Ok(bytes)
    }

    /// Gives the bus back.
    pub fn destroy(self) -> SPI {
        self.spi
    }
}
