//! The high-voltage amplifier: its command from an AD5754, and its enable input.

use ad57xx::ad57x4::ChannelQuad as Channel;
use ad57xx::marker::Ad57x4;
use ad57xx::{Ad57xx, Ad57xxShared, OutputRange};
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiDevice;

use crate::chips::{CommandRange, DacCode, Drive};

/// An amplifier that follows channel A of an AD5754 while its enable input is high.
///
/// The DAC drives 0…5 V or 0…10 V, straight binary (its BIN/2sCOMP pin high), LDAC tied low. SPI mode 1 or 2, up to 30 MHz.
///
/// ```
/// use dea_driver::chips::{Amplifier, CommandRange, Drive};
/// # use embedded_hal_mock::eh1::digital::{Mock as Pin, State, Transaction as OnPin};
/// # use embedded_hal_mock::eh1::spi::{Mock as Spi, Transaction as OnSpi};
/// # let sent = |bytes: [u8; 3]| [OnSpi::transaction_start(), OnSpi::write_vec(bytes.to_vec()), OnSpi::transaction_end()];
/// # let start = [sent([0x08, 0, 1]), sent([0, 0, 0]), sent([0x10, 0, 1])].concat();
/// # let on = [start.clone(), start, sent([0, 0x4c, 0xcd]).to_vec(), sent([0, 0, 0]).to_vec()].concat();
/// # let spi = Spi::new(&on);
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
    dac: Ad57xxShared<SPI, Ad57x4>,
    enable: EN,
    range: CommandRange,
    enabled: bool,
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
}

impl<SPI: SpiDevice, EN: OutputPin> Amplifier<SPI, EN> {
    /// Disables the amplifier, sets the range of its command and brings that to 0 V.
    ///
    /// # Errors
    ///
    /// [`AmplifierError`] where a chip does not answer; the enable output has been set low first.
    pub fn new(spi: SPI, mut enable: EN, range: CommandRange) -> Result<Self, AmplifierError> {
        enable.set_low().map_err(|_| AmplifierError::Enable)?;
        let mut amplifier = Self { dac: Ad57xxShared::new_ad57x4(spi), enable, range, enabled: false };
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
        let output = match range {
            CommandRange::FiveVolts => OutputRange::Unipolar5V,
            CommandRange::TenVolts => OutputRange::Unipolar10V,
        };
        self.dac.set_output_range(Channel::DacA, output).map_err(|_| AmplifierError::Bus)?;
        self.range = range;
        self.command(DacCode::ZERO)
    }

    /// Writes the amplifier's command.
    ///
    /// # Errors
    ///
    /// [`AmplifierError::Bus`]; call [`disable`](Self::disable) then.
    pub fn command(&mut self, code: DacCode) -> Result<(), AmplifierError> {
        self.dac.set_dac_output(Channel::DacA, code.0).map_err(|_| AmplifierError::Bus)
    }

    /// Range, 0 V, power: 0 V before power, so that the output never shows what the register held.
    fn start(&mut self) -> Result<(), AmplifierError> {
        self.set_range(self.range)?;
        self.dac.set_power(Channel::DacA, true).map_err(|_| AmplifierError::Bus)
    }

    /// Brings the command to 0 V and enables the amplifier. The DAC is started again before: it may have been without supply
    /// since it was started last.
    ///
    /// # Errors
    ///
    /// [`AmplifierError`]; it is not enabled then.
    pub fn enable(&mut self) -> Result<(), AmplifierError> {
        self.start()?;
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
        let command = self.command(DacCode::ZERO);
        enable.and(command)
    }

    /// Returns the bus and the enable output.
    pub fn destroy(self) -> (SPI, EN) {
        (self.dac.destroy(), self.enable)
    }
}
