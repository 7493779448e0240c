//! A sensor's ADC: one channel of an ADS8681, ADS8685 or ADS8689 on a unipolar range.

use embedded_hal::spi::SpiDevice;

use crate::chips::{AdcCode, AdcRange};

/// Write both bytes of a register, in the upper seven bits of a frame.
const WRITE: u8 = 0xd0;
/// Read both bytes of a register.
const READ: u8 = 0xc8;
/// The register of the input range.
const RANGE_SEL: u8 = 0x14;
/// RANGE_SEL of a range: 3, 2.5, 1.5 or 1.25 × the internal reference of 4.096 V, unipolar.
const fn range_sel(range: AdcRange) -> u16 {
    match range {
        AdcRange::UpTo12V288 => 0b1000,
        AdcRange::UpTo10V24 => 0b1001,
        AdcRange::UpTo6V144 => 0b1010,
        AdcRange::UpTo5V12 => 0b1011,
    }
}

/// An ADS868x. SPI mode 0, frames of 32 bits.
///
/// The chip samples when its select line rises at the end of a frame and answers in the next: a reading is as old as the
/// tick before.
///
/// ```
/// use dea_driver::chips::{AdcRange, Ads868x};
/// # use embedded_hal_mock::eh1::spi::{Mock as Spi, Transaction as OnSpi};
/// # let frame = |sent: [u8; 4], answer: [u8; 4]| {
/// #     [OnSpi::transaction_start(), OnSpi::transfer_in_place(sent.to_vec(), answer.to_vec()), OnSpi::transaction_end()]
/// # };
/// # let configured = [frame([0xd0, 0x14, 0, 9], [0; 4]), frame([0xc8, 0x14, 0, 0], [0; 4]), frame([0; 4], [0, 9, 0, 0])];
/// # let spi = Spi::new(&[configured.concat(), frame([0; 4], [0x80, 0, 0, 0]).to_vec()].concat());
///
/// // `spi` is an SpiDevice.
/// let mut adc = Ads868x::new(spi, AdcRange::UpTo10V24);
/// adc.configure()?;
/// // In every tick:
/// assert_eq!(adc.volts()?, 5.12);
/// # adc.destroy().done();
/// # Ok::<(), dea_driver::chips::AdcError>(())
/// ```
pub struct Ads868x<SPI> {
    spi: SPI,
    range: AdcRange,
    configured: bool,
}

/// Why an ADC cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AdcError {
    /// The transfer on the bus failed.
    Bus,
    /// The register of the range does not hold what was written: no chip, or another one.
    Range {
        /// Its content.
        found: u16,
    },
    /// Its range was not set yet.
    Unconfigured,
}

impl<SPI: SpiDevice> Ads868x<SPI> {
    /// An ADC on `spi`, not configured yet.
    pub const fn new(spi: SPI, range: AdcRange) -> Self {
        Self { spi, range, configured: false }
    }

    /// Whether its range was set.
    pub const fn is_configured(&self) -> bool {
        self.configured
    }

    /// Sets the range and reads it back.
    ///
    /// # Errors
    ///
    /// [`AdcError`] where the chip does not answer as it should; try again once it has power.
    pub fn configure(&mut self) -> Result<(), AdcError> {
        self.configured = false;
        let [high, low] = range_sel(self.range).to_be_bytes();
        self.frame([WRITE, RANGE_SEL, high, low])?;
        self.frame([READ, RANGE_SEL, 0, 0])?;
        self.check_range()
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

    /// The same, after a check that the chip still has its range. It needs a second frame. A chip whose supply has dipped is back on
    /// another range, on which 0 V reads as half of full scale: it counts as unconfigured from then on.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read), and [`AdcError::Range`].
    pub fn read_checked(&mut self) -> Result<AdcCode, AdcError> {
        if !self.configured {
            return Err(AdcError::Unconfigured);
        }
        let [high, low, ..] = self.frame([READ, RANGE_SEL, 0, 0])?;
        self.check_range()?;
        Ok(AdcCode(u16::from_be_bytes([high, low])))
    }

    /// [`read_checked`](Self::read_checked) in volts.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn volts_checked(&mut self) -> Result<f32, AdcError> {
        self.read_checked().map(|code| code.volts(self.range))
    }

    /// Takes the answer to a question for the range.
    fn check_range(&mut self) -> Result<(), AdcError> {
        let [high, low, ..] = self.frame([0; 4])?;
        let found = u16::from_be_bytes([high, low]);
        // The upper bits hold alarms.
        self.configured = found & 0x000f == range_sel(self.range);
        if self.configured { Ok(()) } else { Err(AdcError::Range { found }) }
    }

    /// [`read`](Self::read) in volts.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn volts(&mut self) -> Result<f32, AdcError> {
        self.read().map(|code| code.volts(self.range))
    }

    fn frame(&mut self, command: [u8; 4]) -> Result<[u8; 4], AdcError> {
        let mut bytes = command;
        self.spi.transfer_in_place(&mut bytes).map_err(|_| AdcError::Bus)?;
        Ok(bytes)
    }

    /// Returns the bus.
    pub fn destroy(self) -> SPI {
        self.spi
    }
}
