//! A sensor's ADC: one channel of an ADS8681, ADS8685 or ADS8689 on a unipolar range.

use embedded_hal::spi::SpiDevice;

use crate::chips::{AdcCode, AdcRange};

/// Write both bytes of a register, in the upper seven bits of a frame.
const WRITE: u8 = 0xd0;
/// Read both bytes of a register.
const READ: u8 = 0xc8;
/// The register of the fields that a frame carries with its sample.
const DATAOUT_CTL: u8 = 0x10;
/// The input range, in the four bits behind the sample. Alone: the order of several fields differs between data sheets of the family.
const RANGE_INCL: u16 = 1 << 8;
/// The register of the input range.
const RANGE_SEL: u8 = 0x14;
/// RANGE_SEL of a range: 3, 2.5, 1.5 or 1.25 × the internal reference of 4.096 V, unipolar. The other bits are reserved, but one
/// which switches that reference off: all of them are 0.
const fn range_sel(range: AdcRange) -> u16 {
    match range {
        AdcRange::UpTo12V288 => 0b1000,
        AdcRange::UpTo10V24 => 0b1001,
        AdcRange::UpTo6V144 => 0b1010,
        AdcRange::UpTo5V12 => 0b1011,
    }
}

/// An ADS868x. SPI mode 0, frames of 32 bits, one of them in every tick.
///
/// The chip samples when its select line rises at the end of a frame and answers in the next: a reading is as old as the tick
/// before. It converts after every frame, for 5 µs at the most (ADS8689), and does not see a frame that begins meanwhile. So there
/// is one frame to a reading, also while the chip is set up: that takes four readings, which fail with [`AdcError::Starting`].
///
/// Every frame carries the chip's range beside the sample. A missing chip, or one whose supply has dipped and that is back on ±12.288 V,
/// where 0 V is half of its codes, fails in the same tick and is set up again from the next one on.
///
/// ```
/// use dea_driver::chips::{AdcError, AdcRange, Ads868x};
/// # use embedded_hal_mock::eh1::spi::{Mock as Spi, Transaction as OnSpi};
/// # let frame = |sent: [u8; 4], answer: [u8; 4]| {
/// #     [OnSpi::transaction_start(), OnSpi::transfer_in_place(sent.to_vec(), answer.to_vec()), OnSpi::transaction_end()]
/// # };
/// # let set = [frame([0xd0, 0x14, 0, 9], [0; 4]), frame([0xd0, 0x10, 1, 0], [0; 4])].concat();
/// # let asked = [frame([0xc8, 0x14, 0, 0], [0; 4]), frame([0; 4], [0, 9, 0, 0]), frame([0; 4], [0x80, 0, 0x90, 0])].concat();
/// # let spi = Spi::new(&[set, asked].concat());
///
/// // `spi` is an SpiDevice.
/// let mut adc = Ads868x::new(spi, AdcRange::UpTo10V24);
/// // In every tick:
/// for _ in 0..4 {
///     assert_eq!(adc.volts(), Err(AdcError::Starting));
/// }
/// assert_eq!(adc.volts()?, 5.12);
/// # adc.destroy().done();
/// # Ok::<(), AdcError>(())
/// ```
pub struct Ads868x<SPI> {
    spi: SPI,
    range: AdcRange,
    next: Frame,
    /// Why there is no sample while the chip is set up.
    fault: AdcError,
}

/// Purpose of the next frame.
#[derive(Clone, Copy)]
enum Frame {
    SetRange,
    SetFields,
    AskRange,
    TakeRange,
    Sample,
}

/// Why an ADC has no reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AdcError {
    /// The transfer on the bus failed.
    #[error("the transfer from the ADC failed: check its bus")]
    Bus,
    /// The chip does not have the range that it was set to: it is missing, another one, or has lost its supply.
    #[error("the ADC returns {found:#06x} instead of {wanted:#06x}: check its type, supply and wiring")]
    Range {
        /// The expected value: the register, or the part of a frame beside its sample.
        wanted: u16,
        /// The received value.
        found: u16,
    },
    /// It is being set up for the first time. After the first setup the previous fault is reported until a sample arrives.
    #[error("the ADC is being set up: read it again in the next tick")]
    Starting,
}

impl<SPI: SpiDevice> Ads868x<SPI> {
    /// An ADC on `spi`, not set up yet.
    pub const fn new(spi: SPI, range: AdcRange) -> Self {
        Self { spi, range, next: Frame::SetRange, fault: AdcError::Starting }
    }

    /// The sample that was taken at the end of the last frame. One frame; leave 10 µs between two of them.
    ///
    /// # Errors
    ///
    /// [`AdcError`] where there is no sample yet, or no reliable one: the chip is set up again by the next readings.
    pub fn read(&mut self) -> Result<AdcCode, AdcError> {
        let [range_high, range_low] = range_sel(self.range).to_be_bytes();
        let [fields_high, fields_low] = RANGE_INCL.to_be_bytes();
        let (command, then) = match self.next {
            Frame::SetRange => ([WRITE, RANGE_SEL, range_high, range_low], Frame::SetFields),
            Frame::SetFields => ([WRITE, DATAOUT_CTL, fields_high, fields_low], Frame::AskRange),
            Frame::AskRange => ([READ, RANGE_SEL, 0, 0], Frame::TakeRange),
            Frame::TakeRange | Frame::Sample => ([0; 4], Frame::Sample),
        };
        let is_for = core::mem::replace(&mut self.next, Frame::SetRange);
        let answer = self.frame(command);
        if let Err(error) = answer {
            self.fault = error;
        }
        let [first, second, third, fourth] = answer?;
        let (upper, lower) = (u16::from_be_bytes([first, second]), u16::from_be_bytes([third, fourth]));
        let (found, wanted) = match is_for {
            Frame::TakeRange => (upper, range_sel(self.range)),
            Frame::Sample => (lower, range_sel(self.range) << 12),
            _ => (0, 0),
        };
        if found != wanted {
            self.fault = AdcError::Range { wanted, found };
            return Err(self.fault);
        }
        self.next = then;
        if let Frame::Sample = is_for {
            self.fault = AdcError::Starting;
            Ok(AdcCode(upper))
        } else {
            Err(self.fault)
        }
    }

    /// [`read`](Self::read) in volts.
    #[allow(clippy::missing_errors_doc)] // as the one above
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
