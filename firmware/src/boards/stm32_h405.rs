//! Olimex STM32-H405, and other boards with an STM32F405RG and a crystal of 8 MHz: an AD5754 and two ADS868x on SPI. `docs/boards.md` shows
//! the bench on its pins.

use dea_driver::chips::{AdcRange, Ceilings, CommandRange, Converters, Reference};
use dea_driver::wire::{InjectedFault, Inspection, boards};
use dea_driver::{AdcError, Ads868x, Amplifier, AmplifierError, Controller, Drive, Inputs};
use embedded_hal_bus::spi::{AtomicDevice, ExclusiveDevice, NoDelay};
use embedded_hal_bus::util::AtomicCell;
use stm32f4xx_hal::gpio::{Input, Output, PB0, PB1, PB12, PC6, PC7, PinState, Speed, gpioa, gpiob};
use stm32f4xx_hal::hal::spi::{MODE_0, MODE_1};
use stm32f4xx_hal::pac::{SPI1, SPI2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::spi::Spi;

#[cfg(feature = "self-sensing")]
use super::family::adc3::Adc3;
use super::family::parts::Parts;
use super::family::{pin, serial};
#[cfg(feature = "self-sensing")]
use crate::current::Current;
use crate::pin::Pin;

/// Its number.
pub const ID: u16 = boards::STM32F405;

/// Its crystal, Hz.
pub const CRYSTAL_HZ: u32 = 8_000_000;

/// Converters of the board, and its ceilings, which no blob and no upload exceeds. **Set them to what clamp, film and amplifier of your
/// bench withstand**; these are for the largest usual bench.
pub const CONVERTERS: Converters = Converters {
    ceilings: Ceilings { voltage_v: 10e3, field_v_per_m: 2e8, stroke_m: 20e-3 },
    ..Converters::AD5754_ADS868X
};

/// Cycles from tick to tick at the least: on the internal oscillator, at 16 MHz, the fastest is slower. There the controller takes some
/// 3 200 cycles and the 112 bits to and from the converters 450, at 168 MHz 3 600; the tick that enables reads back and takes 400 bits. A tick may wait for
/// a part of the check of the memory, some 4 000. The current takes 900 more.
pub const CYCLES_PER_TICK: f32 = 9600.0 + if cfg!(feature = "self-sensing") { 900.0 } else { 0.0 };

/// The light is between supply and pin.
pub const DARK: bool = true;

/// Clock of both buses, Hz: 42 MHz by 8, and 84 MHz by 16. The DAC reads back at up to 17 MHz; the wires are meant for 10 MHz, and the
/// next step is 10.5 MHz.
const BUS_HZ: u32 = 5_250_000;

/// The reference of the DAC: [`Reference::Internal`] for an AD5754R without another one at its pin.
const DAC_REFERENCE: Reference = Reference::External;

/// The supply of the chip, nominally, which is the reference of its ADC3, and the largest output of the current monitor, V.
#[cfg(feature = "self-sensing")]
const SUPPLY_V: f32 = 3.3;
#[cfg(feature = "self-sensing")]
pub const CURRENT_V: f32 = SUPPLY_V * (4095.0 / 4096.0);
/// The channel of the current monitor, PC1.
#[cfg(feature = "self-sensing")]
const CURRENT: u8 = 11;

/// The bus that both ADCs share.
pub type AdcBus = AtomicCell<Spi<SPI1>>;
type Adc<CS> = Ads868x<AtomicDevice<'static, Spi<SPI1>, CS, NoDelay>>;
type Dac = ExclusiveDevice<Spi<SPI2>, PB12<Output>, NoDelay>;

/// Lowers the enable output, for a panic.
pub fn disable() {
    pin('C', 6).set(false);
}

/// The pins of the bench, as they are after a reset, but for the enable output, which is low, and their peripherals.
pub struct Pins {
    enable: PC6<Output>,
    interlock: PC7,
    /// Clock, MISO and MOSI of the ADCs.
    adc: (gpioa::PA5, gpioa::PA6, gpioa::PA7),
    /// Chip selects, and the DAC's bus.
    port_b: gpiob::Parts,
    spi1: SPI1,
    spi2: SPI2,
}

/// The amplifier's enable output, low, before anything else is set up, and then the light, dark. The other pins stay as they are.
pub fn start(parts: Parts, rcc: &mut Rcc) -> (Pin, serial::Pins, Pins) {
    let port_c = parts.gpioc.split(rcc);
    let enable = port_c.pc6.into_push_pull_output_in_state(PinState::Low);
    let light = pin('C', 12).output(DARK);
    let port_a = parts.gpioa.split(rcc);
    #[cfg(feature = "self-sensing")]
    pin('C', 1).analog();
    let adc = (port_a.pa5, port_a.pa6, port_a.pa7);
    let port_b = parts.gpiob.split(rcc);
    let pins = Pins { enable, interlock: port_c.pc7, adc, port_b, spi1: parts.spi1, spi2: parts.spi2 };
    (light, (port_a.pa2, port_a.pa3), pins)
}

/// Refuses to inject a fault: this bench is real.
pub fn inject_fault(_: InjectedFault) -> bool {
    false
}

/// The bench on the board's pins.
pub struct Bench {
    amplifier: Option<Amplifier<Dac, PC6<Output>>>,
    monitor: Option<Adc<PB0<Output>>>,
    displacement: Option<Adc<PB1<Output>>>,
    #[cfg(feature = "self-sensing")]
    current: Current<Adc3>,
    /// The current of the tick before, V.
    #[cfg(feature = "self-sensing")]
    current_v: Option<f32>,
    interlock: PC7<Input>,
    found: Inspection,
}

impl Bench {
    /// Disables the amplifier before anything else, and brings its command to 0 V.
    ///
    /// Clock and data pads have the highest speed: at the lowest, which they come with, the clock that comes back from its pad is late for
    /// the last bit of every received byte. A line that no chip drives reads 0.
    pub fn new(pins: Pins, adc_bus: &'static mut Option<AdcBus>, rcc: &mut Rcc) -> Self {
        let Pins { enable, interlock, adc, port_b: gpiob, spi1, spi2 } = pins;
        let sck = gpiob.pb13.into_alternate().speed(Speed::VeryHigh);
        let miso = gpiob.pb14.into_alternate().speed(Speed::VeryHigh).internal_pull_down(true);
        let mosi = gpiob.pb15.into_alternate().speed(Speed::VeryHigh);
        let bus = Spi::new(spi2, (Some(sck), Some(miso), Some(mosi)), MODE_1, BUS_HZ.Hz(), rcc);
        let select = gpiob.pb12.into_push_pull_output_in_state(PinState::High);
        let device = ExclusiveDevice::new_no_delay(bus, select).ok();
        // The range of the parameters comes with the first tick that has some.
        let amplifier = device
            .and_then(|device| Amplifier::with_reference(device, enable, CommandRange::FiveVolts, DAC_REFERENCE).ok());

        let sck = adc.0.into_alternate().speed(Speed::VeryHigh);
        let miso = adc.1.into_alternate().speed(Speed::VeryHigh).internal_pull_down(true);
        let mosi = adc.2.into_alternate().speed(Speed::VeryHigh);
        let bus = Spi::new(spi1, (Some(sck), Some(miso), Some(mosi)), MODE_0, BUS_HZ.Hz(), rcc);
        let bus: &'static AdcBus = adc_bus.insert(AtomicCell::new(bus));
        let (monitor, displacement) = (
            gpiob.pb0.into_push_pull_output_in_state(PinState::High),
            gpiob.pb1.into_push_pull_output_in_state(PinState::High),
        );
        let monitor = AtomicDevice::new_no_delay(bus, monitor).ok();
        let displacement = AtomicDevice::new_no_delay(bus, displacement).ok();
        Self {
            amplifier,
            monitor: monitor.map(|bus| Ads868x::new(bus, AdcRange::UpTo10V24)),
            displacement: displacement.map(|bus| Ads868x::new(bus, AdcRange::UpTo10V24)),
            #[cfg(feature = "self-sensing")]
            current: Current::new(Adc3::new(CURRENT, rcc)),
            #[cfg(feature = "self-sensing")]
            current_v: None,
            interlock: interlock.into_pull_down_input(),
            found: Inspection::STARTING,
        }
    }

    /// The converters need nothing of the controller.
    pub fn prepare(&mut self, _: Option<&Controller>) {}

    /// State of the parts in the last tick.
    pub fn inspection(&self) -> Inspection {
        self.found
    }

    /// Samples interlock and sensors, with a frame for each converter. One that does not answer, or has lost its range, is set up again.
    pub fn sample(&mut self) -> Inputs {
        let monitor = self.monitor.as_mut().map_or(Err(AdcError::Bus), Adc::volts);
        let sensor = self.displacement.as_mut().map_or(Err(AdcError::Bus), Adc::volts);
        let interlock_closed = self.interlock.is_high();
        self.found = Inspection {
            interlock_closed,
            enable_high: pin('C', 6).is_high(),
            dac: self.found.dac,
            monitor: monitor.into(),
            sensor: sensor.into(),
            monitor_adc_v: monitor.unwrap_or(f32::NAN),
            sensor_adc_v: sensor.unwrap_or(f32::NAN),
        };
        Inputs { interlock_closed, monitor_adc_v: monitor.ok(), sensor_adc_v: sensor.ok() }
    }

    /// The mean current of the tick before the last, one of `rate_hz` (Hz), V at its pin: up to the moment of the reading of the voltage monitor, which
    /// is from there as well.
    #[cfg(feature = "self-sensing")]
    pub fn current_adc_v(&mut self, rate_hz: f32) -> Option<f32> {
        let newest_v = self.current.mean(rate_hz).map(|share| share * SUPPLY_V);
        core::mem::replace(&mut self.current_v, newest_v)
    }

    /// Applies the drive of a tick to the amplifier.
    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        let applied = match &mut self.amplifier {
            Some(amplifier) => {
                let applied = amplifier.apply(drive);
                if applied.is_err() {
                    // The fault that counts is the first one.
                    let _ = amplifier.disable();
                }
                applied
            }
            // There is nothing that could be enabled.
            None => Err(AmplifierError::Bus),
        };
        self.found.dac = applied.into();
        applied
    }
}
