//! The high-voltage amplifier: its command from an AD5754, and its enable input.

use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;

use crate::chips::{CommandRange, DacCode, Drive};

/// Registers of channel A, as the first byte of a frame; then come 16 bits.
const DAC_A: u8 = 0x00;
const RANGE_A: u8 = 0x08;
const POWER: u8 = 0x10;
const NOTHING: u8 = 0x18;
/// Set where a register is to be read: its content comes with the next frame.
const READ: u8 = 0x80;
/// Channel A has power.
const POWER_A: u16 = 1;

/// An amplifier that follows channel A of an AD5754 while its enable input is high.
///
/// The DAC drives 0…5 V or 0…10 V, straight binary (its BIN/2sCOMP pin high), LDAC tied low. SPI mode 1, up to 17 MHz. SDO must be
/// wired: before the amplifier is enabled the DAC's range, power and code are read back, and with every command the code that stood.
/// A DAC that does not hold what it was sent disables the amplifier.
///
/// ```
/// use dea_driver::chips::{Amplifier, CommandRange, Drive};
/// # use embedded_hal_mock::eh1::digital::{Mock as Pin, State, Transaction as OnPin};
/// # use embedded_hal_mock::eh1::spi::{Mock as Spi, Transaction as OnSpi};
/// # let sent = |bytes: [u8; 3]| [OnSpi::transaction_start(), OnSpi::write_vec(bytes.to_vec()), OnSpi::transaction_end()];
/// # let answered = |bytes: [u8; 3], answer: [u8; 3]| {
/// #     [OnSpi::transaction_start(), OnSpi::transfer_in_place(bytes.to_vec(), answer.to_vec()), OnSpi::transaction_end()]
/// # };
/// # let read = |register: u8, low: u8| [sent([0x80 | register, 0, 0]), answered([0x18, 0, 0], [0, 0, low])].concat();
/// # let start = [sent([0x08, 0, 1]), sent([0, 0, 0]), sent([0x10, 0, 1])].concat();
/// # let checked = [read(0x08, 1), read(0x10, 1), read(0, 0)].concat();
/// # let command = [sent([0x80, 0, 0]), answered([0, 0x4c, 0xcd], [0; 3])].concat();
/// # let spi = Spi::new(&[start.clone(), start, checked, command, sent([0, 0, 0]).to_vec()].concat());
/// # let enable = Pin::new(&[State::Low, State::High, State::Low].map(OnPin::set));
///
/// // `spi` is an SpiDevice, `enable` an OutputPin.
/// let mut amplifier = Amplifier::new(spi, enable, CommandRange::TenVolts)?;
/// // What a tick returns, in every tick: enabled at 0 V first, then 3 V of 10 V.
/// amplifier.apply(Drive { enable: true, dac_v: 3.0, range: CommandRange::TenVolts })?;
/// amplifier.apply(Drive { range: CommandRange::TenVolts, ..Drive::OFF })?;
/// # let (mut spi, mut enable) = amplifier.destroy();
/// # spi.done();
/// # enable.done();
/// # Ok::<(), dea_driver::chips::AmplifierError>(())
/// ```
pub struct Amplifier<SPI, EN> {
    spi: SPI,
    enable: EN,
    range: CommandRange,
    enabled: bool,
    /// The last code that was written.
    code: DacCode,
}

/// Why the amplifier did not follow. It is disabled then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AmplifierError {
    /// The transfer on the bus failed.
    Bus,
    /// The enable output did not switch.
    Enable,
    /// The DAC does not hold what it was sent: it is not there, has lost its supply, or its SDO is not wired.
    Readback {
        /// What it was sent.
        wanted: u16,
        /// What it holds.
        found: u16,
    },
}

impl<SPI: SpiDevice, EN: OutputPin> Amplifier<SPI, EN> {
    /// Disables the amplifier, sets the range of its command and brings that to 0 V.
    ///
    /// # Errors
    ///
    /// [`AmplifierError`] where a chip does not answer; the enable output has been set low first.
    pub fn new(spi: SPI, mut enable: EN, range: CommandRange) -> Result<Self, AmplifierError> {
        enable.set_low().map_err(|_| AmplifierError::Enable)?;
        let mut amplifier = Self { spi, enable, range, enabled: false, code: DacCode::ZERO };
        amplifier.start()?;
        Ok(amplifier)
    }

    /// Applies the `drive` of a tick: disables before anything else, enables at 0 V.
    ///
    /// # Errors
    ///
    /// [`AmplifierError`]; call [`disable`](Self::disable) then.
    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        if !drive.enable {
            self.disable()?;
            return if drive.range == self.range { Ok(()) } else { self.set_range(drive.range) };
        }
        if !self.enabled {
            self.enable()?;
        }
        self.command(DacCode::from_volts(drive.dac_v, drive.range))
    }

    /// The register keeps its code when the range changes, so it is brought to 0 V after.
    fn set_range(&mut self, range: CommandRange) -> Result<(), AmplifierError> {
        self.write(RANGE_A, range_code(range))?;
        self.range = range;
        self.zero()
    }

    fn zero(&mut self) -> Result<(), AmplifierError> {
        self.write(DAC_A, DacCode::ZERO.0)?;
        self.code = DacCode::ZERO;
        Ok(())
    }

    /// Writes the amplifier's command, and checks that the DAC still holds the one before.
    ///
    /// # Errors
    ///
    /// [`AmplifierError::Bus`], [`AmplifierError::Readback`]; call [`disable`](Self::disable) then.
    pub fn command(&mut self, code: DacCode) -> Result<(), AmplifierError> {
        let before = self.code.0;
        self.write(DAC_A | READ, 0)?;
        let found = self.exchange(DAC_A, code.0)?;
        self.code = code;
        matches(before, found)
    }

    /// Range, 0 V, power: 0 V before power, so that the output never shows what the register held.
    fn start(&mut self) -> Result<(), AmplifierError> {
        self.set_range(self.range)?;
        self.write(POWER, POWER_A)
    }

    /// Brings the command to 0 V and enables the amplifier. The DAC is started again before and read back: it may have been without
    /// supply since it was started last.
    ///
    /// # Errors
    ///
    /// [`AmplifierError`]; it is not enabled then.
    pub fn enable(&mut self) -> Result<(), AmplifierError> {
        self.start()?;
        matches(range_code(self.range), self.read(RANGE_A)?)?;
        // The upper bits hold alarms, those between the power of other channels.
        matches(POWER_A, self.read(POWER)? & POWER_A)?;
        matches(DacCode::ZERO.0, self.read(DAC_A)?)?;
        self.enable.set_high().map_err(|_| AmplifierError::Enable)?;
        self.enabled = true;
        Ok(())
    }

    /// Disables the amplifier and brings the command to 0 V: both are tried, whatever fails.
    ///
    /// # Errors
    ///
    /// [`AmplifierError`] for the first that failed.
    pub fn disable(&mut self) -> Result<(), AmplifierError> {
        self.enabled = false;
        let enable = self.enable.set_low().map_err(|_| AmplifierError::Enable);
        let command = self.zero();
        enable.and(command)
    }

    fn write(&mut self, register: u8, value: u16) -> Result<(), AmplifierError> {
        let [high, low] = value.to_be_bytes();
        self.spi.write(&[register, high, low]).map_err(|_| AmplifierError::Bus)
    }

    /// The same, and what the frame before asked for.
    fn exchange(&mut self, register: u8, value: u16) -> Result<u16, AmplifierError> {
        let [high, low] = value.to_be_bytes();
        let mut frame = [register, high, low];
        self.spi.transfer_in_place(&mut frame).map_err(|_| AmplifierError::Bus)?;
        let [_, high, low] = frame;
        Ok(u16::from_be_bytes([high, low]))
    }

    fn read(&mut self, register: u8) -> Result<u16, AmplifierError> {
        self.write(register | READ, 0)?;
        self.exchange(NOTHING, 0)
    }

    /// Returns the bus and the enable output.
    pub fn destroy(self) -> (SPI, EN) {
        (self.spi, self.enable)
    }
}

/// The range in its register.
const fn range_code(range: CommandRange) -> u16 {
    match range {
        CommandRange::FiveVolts => 0,
        CommandRange::TenVolts => 1,
    }
}

fn matches(wanted: u16, found: u16) -> Result<(), AmplifierError> {
    if wanted == found { Ok(()) } else { Err(AmplifierError::Readback { wanted, found }) }
}
