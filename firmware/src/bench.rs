//! The bench on the board's pins: amplifier, sensors, interlock, light. `docs/wiring.md` shows it.

use dea_driver::chips::{AdcRange, CommandRange};
use dea_driver::{Ads868x, Amplifier, AmplifierError, Drive, Inputs};
use embedded_hal_bus::spi::{AtomicDevice, ExclusiveDevice, NoDelay};
use embedded_hal_bus::util::AtomicCell;
use stm32f4xx_hal::gpio::{Input, Output, PB0, PB1, PB12, PC6, PC7, PinState, gpiob, gpioc};
use stm32f4xx_hal::hal::digital::OutputPin;
use stm32f4xx_hal::hal::spi::{MODE_0, MODE_1};
use stm32f4xx_hal::pac::{SPI2, SPI3};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::spi::Spi;

/// Clock of both buses, Hz, at the most; the chips take 30 MHz and more, but so may the wires not.
const BUS_HZ: u32 = 10_000_000;
/// Ticks between two attempts to configure an ADC that does not answer.
const RETRY_TICKS: u32 = 256;

/// The bus that both ADCs share.
pub type AdcBus = AtomicCell<Spi<SPI3>>;
type Adc<CS> = Ads868x<AtomicDevice<'static, Spi<SPI3>, CS, NoDelay>>;
type Dac = ExclusiveDevice<Spi<SPI2>, PB12<Output>, NoDelay>;

/// What is connected to the board.
pub struct Bench {
    amplifier: Option<Amplifier<Dac, PC6<Output>>>,
    monitor: Option<Adc<PB0<Output>>>,
    displacement: Option<Adc<PB1<Output>>>,
    interlock: PC7<Input>,
    ticks: u32,
}

impl Bench {
    /// Disables the amplifier before anything else, and brings its command to 0 V.
    pub fn new(
        spi2: SPI2,
        spi3: SPI3,
        gpiob: gpiob::Parts,
        enable: PC6<Output>,
        (interlock, sck, miso): (gpioc::PC7, gpioc::PC10, gpioc::PC11),
        adc_bus: &'static mut Option<AdcBus>,
        rcc: &mut Rcc,
    ) -> Self {
        let pins = (Some(gpiob.pb13), Some(gpiob.pb14), Some(gpiob.pb15));
        let bus = Spi::new(spi2, pins, MODE_1, BUS_HZ.Hz(), rcc);
        let select = gpiob.pb12.into_push_pull_output_in_state(PinState::High);
        let device = ExclusiveDevice::new_no_delay(bus, select).ok();
        // The range of the parameters comes with the first tick that has some.
        let amplifier = device.and_then(|device| Amplifier::new(device, enable, CommandRange::FiveVolts).ok());

        let bus = Spi::new(spi3, (Some(sck), Some(miso), Some(gpiob.pb5)), MODE_0, BUS_HZ.Hz(), rcc);
        let bus: &'static AdcBus = adc_bus.insert(AtomicCell::new(bus));
        let monitor = AtomicDevice::new_no_delay(bus, gpiob.pb0.into_push_pull_output()).ok();
        let displacement = AtomicDevice::new_no_delay(bus, gpiob.pb1.into_push_pull_output()).ok();
        Self {
            amplifier,
            monitor: monitor.map(|bus| Ads868x::new(bus, AdcRange::UpTo10V24)),
            displacement: displacement.map(|bus| Ads868x::new(bus, AdcRange::UpTo10V24)),
            interlock: interlock.into_pull_down_input(),
            ticks: 0,
        }
    }

    /// What interlock and sensors say. While `idle` the ADCs are asked for their range in every tick; one that does not answer, or has
    /// lost its range, is configured again from time to time.
    pub fn sample(&mut self, idle: bool) -> Inputs {
        self.ticks = self.ticks.wrapping_add(1);
        let retry = idle && self.ticks.is_multiple_of(RETRY_TICKS);
        Inputs {
            interlock_closed: self.interlock.is_high(),
            monitor_adc_v: self.monitor.as_mut().and_then(|adc| volts(adc, idle, retry)),
            sensor_adc_v: self.displacement.as_mut().and_then(|adc| volts(adc, idle, retry)),
        }
    }

    /// Applies the drive of a tick to the amplifier.
    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        match &mut self.amplifier {
            Some(amplifier) => {
                let applied = amplifier.apply(drive);
                if applied.is_err() {
                    // The fault that counts is the first one.
                    let _ = amplifier.disable();
                }
                applied
            }
            // There is nothing that could be enabled.
            None if drive.enable => Err(AmplifierError::Bus),
            None => Ok(()),
        }
    }
}

fn volts<CS: OutputPin>(adc: &mut Adc<CS>, idle: bool, retry: bool) -> Option<f32> {
    if !adc.is_configured() && retry {
        // It says so by not reading.
        let _ = adc.configure();
    }
    if idle { adc.volts_checked().ok() } else { adc.volts().ok() }
}
