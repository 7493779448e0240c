//! The high-voltage amplifier: its command from an AD5754, and its enable input.

use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;

use crate::chips::{CommandRange, DacCode, Drive};

/// Registers of channel A, as the first byte of a frame; then come 16 bits.
const DAC_A: u8 = 0x00;
const RANGE_A: u8 = 0x08;
const POWER: u8 = 0x10;
const NOTHING: u8 = 0x18;
const CONTROL: u8 = 0x19;
/// Set where a register is to be read: its content comes with the next frame.
const READ: u8 = 0x80;
/// Channel A has power.
const POWER_A: u16 = 1;
/// The internal reference of an AD5754R has power.
const POWER_REFERENCE: u16 = 1 << 4;
/// Channel A is at its current limit, and the chip is too hot: read with the power.
const ALARMS: u16 = 1 << 7 | 1 << 5;
/// Thermal shutdown, which is off after power-up, and the current limit of 20 mA, which is on then.
const PROTECTION: u16 = 1 << 3 | 1 << 2;
/// The defined bits of a register.
const CONTROL_BITS: u16 = 0xf;
const RANGE_BITS: u16 = 0x7;

/// The source of the DAC's reference of 2.5 V.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reference {
    /// Another chip, at REFIN: any AD5754. The internal reference of an AD5754R stays off, so that they do not drive against each other;
    /// without the other chip its output stays at 0 V.
    #[default]
    External,
    /// The internal reference of an AD5754R, with nothing else at REFIN/REFOUT. A chip without one is refused before it is enabled.
    Internal,
}

/// An amplifier that follows channel A of an AD5754 while its enable input is high.
///
/// The DAC drives 0…5 V or 0…10 V, straight binary (its BIN/2sCOMP pin high), LDAC tied low. SPI mode 1, up to 17 MHz. SDO must be
/// wired: before the amplifier is enabled the DAC's range, protection, power and code are read back, with every command the code
/// before it, and while it is disabled the power. A DAC that does not hold what it was sent, or is at its limits, disables the amplifier.
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
/// # let start = [sent([0x19, 0, 0xc]), sent([0x08, 0, 1]), sent([0, 0, 0]), sent([0x10, 0, 1])].concat();
/// # let checked = [read(0x19, 0xc), read(0x08, 1), read(0x10, 1), read(0, 0)].concat();
/// # let command = [sent([0x80, 0, 0]), answered([0, 0x4c, 0xcd], [0; 3])].concat();
/// # let spi = Spi::new(&[start.clone(), start, checked, command, sent([0, 0, 0]).to_vec(), read(0x10, 1)].concat());
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
    /// The bits of the power control register that are set.
    power: u16,
    enabled: bool,
    /// Whether the last read-back of the DAC was correct.
    holds: bool,
    /// The last code that was written.
    code: DacCode,
}

/// Why the amplifier did not follow. It is disabled then.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AmplifierError {
    /// The transfer on the bus failed.
    #[error("the transfer to the DAC failed: check its bus")]
    Bus,
    /// The enable output did not switch.
    #[error("the enable output did not switch: check its pin and load")]
    Enable,
    /// The DAC does not hold the value that it was sent: it is missing, has lost its supply, or its SDO is not wired.
    #[error("the DAC holds {found:#06x} instead of {wanted:#06x}: check its supply and the wiring of SDO")]
    Readback {
        /// The value that it was sent.
        wanted: u16,
        /// The value that it holds.
        found: u16,
    },
    /// The DAC has no internal reference that could be switched on: it is no AD5754R. It needs one at REFIN, and [`Reference::External`].
    #[error("the DAC has no internal reference: give it one at REFIN, and use Reference::External")]
    NoReference,
}

impl<SPI: SpiDevice, EN: OutputPin> Amplifier<SPI, EN> {
    /// Disables the amplifier, sets the range of its command and brings that to 0 V.
    ///
    /// # Errors
    ///
    /// [`AmplifierError`] where a chip does not answer; the enable output has been set low first.
    pub fn new(spi: SPI, enable: EN, range: CommandRange) -> Result<Self, AmplifierError> {
        Self::with_reference(spi, enable, range, Reference::External)
    }

    /// The same with a DAC on this `reference`.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new); a DAC without the reference is refused by [`apply`](Self::apply).
    pub fn with_reference(
        spi: SPI,
        mut enable: EN,
        range: CommandRange,
        reference: Reference,
    ) -> Result<Self, AmplifierError> {
        enable.set_low().map_err(|_| AmplifierError::Enable)?;
        let power = match reference {
            Reference::External => POWER_A,
            Reference::Internal => POWER_A | POWER_REFERENCE,
        };
        let mut amplifier = Self { spi, enable, range, power, enabled: false, holds: true, code: DacCode::ZERO };
        amplifier.start()?;
        Ok(amplifier)
    }

    /// Applies the `drive` of a tick: disables before anything else, enables at 0 V. While it is disabled the DAC is asked whether it
    /// still has power, so that a missing DAC is detected before arming; one that had none is started again.
    ///
    /// # Errors
    ///
    /// [`AmplifierError`]; call [`disable`](Self::disable) then.
    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        if !drive.enable {
            self.disable()?;
            if !self.holds || drive.range != self.range {
                self.range = drive.range;
                self.start()?;
            }
            return self.check_power();
        }
        if !self.enabled {
            self.enable()?;
        }
        self.command(DacCode::from_volts(drive.dac_v, drive.range))
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

    /// Protection, range, 0 V, power: 0 V before power, so that the output never shows what the register held, and after the range,
    /// since the register keeps its code when that changes.
    fn start(&mut self) -> Result<(), AmplifierError> {
        self.write(CONTROL, PROTECTION)?;
        self.write(RANGE_A, range_code(self.range))?;
        self.zero()?;
        self.write(POWER, self.power)
    }

    /// Brings the command to 0 V and enables the amplifier. The DAC is started again before and read back: it may have been without
    /// supply since it was started last.
    ///
    /// # Errors
    ///
    /// [`AmplifierError`]; it is not enabled then.
    pub fn enable(&mut self) -> Result<(), AmplifierError> {
        self.start()?;
        matches(PROTECTION, self.read(CONTROL)? & CONTROL_BITS)?;
        matches(range_code(self.range), self.read(RANGE_A)? & RANGE_BITS)?;
        self.check_power()?;
        matches(DacCode::ZERO.0, self.read(DAC_A)?)?;
        self.enable.set_high().map_err(|_| AmplifierError::Enable)?;
        self.enabled = true;
        Ok(())
    }

    /// The other bits of the register are those of other channels.
    fn check_power(&mut self) -> Result<(), AmplifierError> {
        let wanted = self.power;
        let checked = self.read(POWER).and_then(|power| match power & (wanted | ALARMS) {
            POWER_A if wanted != POWER_A => Err(AmplifierError::NoReference),
            found => matches(wanted, found),
        });
        self.holds = checked.is_ok();
        checked
    }

    /// Disables the amplifier and brings the command to 0 V; tries both even if one fails.
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

    /// The same, and returns the register that the frame before has requested.
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
