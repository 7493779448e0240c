//! ST's STM32F4DISCOVERY (STM32F407G-DISC1): the DAC and the ADCs on the chip, at 3 V. `docs/boards.md` shows the bench on its pins.
//!
//! The STM32F407 is an STM32F405 with Ethernet and a camera interface, which nothing here uses.

use dea_driver::chips::{Ceilings, Converters};
use dea_driver::wire::{InjectedFault, Inspection, Part, boards};
use dea_driver::{AdcError, AmplifierError, Controller, Drive, Inputs};
use stm32f4xx_hal::gpio::{Input, Output, PA2, PA3, PC6, PC8, PD12, PinState};
use stm32f4xx_hal::pac::{ADC_COMMON, ADC1, ADC2, DAC, GPIOC};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;

use crate::on_chip::{Adcs, Amplifier, Sample};
use crate::parts::Parts;

/// Its number.
pub const ID: u16 = boards::STM32F407_DISCOVERY;

/// Its crystal, Hz.
pub const CRYSTAL_HZ: u32 = 8_000_000;

/// Converters of the board, and its hard ceilings: no blob and no upload allows more. **Set them for the bench that this image is for**, from what its
/// film, its clamp and its people withstand; here they are those of the largest usual bench.
pub const CONVERTERS: Converters = Converters {
    ceilings: Ceilings { voltage_v: 10e3, field_v_per_m: 2e8, stroke_m: 20e-3 },
    ..Converters::STM32F4_ON_CHIP
};

/// Cycles from tick to tick at the least: on the internal oscillator, at 16 MHz, the fastest is slower. There the ADCs take 1 040 of their cycles of
/// two cycles of the core, at 168 MHz of eight; the controller and a part of the check of the memory take 7 200.
pub const CYCLES_PER_TICK: f32 = 15_500.0;

/// The green light hangs between pin and ground.
pub const DARK: PinState = PinState::Low;
pub type Light = PD12<Output>;

/// The link's pins: out, in.
pub type Link = (PA2, PA3);

/// Monitor at PB0, sensor at PB1.
const CHANNELS: [u8; 2] = [8, 9];

/// There is no bus.
pub type AdcBus = ();

/// Lowers the enable output by its register, for a panic.
pub fn disable() {
    // SAFETY: the register sets and clears single pins.
    unsafe { &*GPIOC::ptr() }.bsrr().write(|w| w.br6().set_bit());
}

/// The pins of the bench, the enable output low and those of the converters analog, and the converters.
pub struct Pins {
    enable: PC6<Output>,
    interlock: PC8,
    dac: DAC,
    adcs: (ADC1, ADC2, ADC_COMMON),
}

/// The amplifier's enable output, low, before anything else is set up, and then the light, dark. The accelerometer, which has the DAC's pin for its
/// clock, is kept off its SPI.
pub fn start(parts: Parts, rcc: &mut Rcc) -> (Light, Link, Pins) {
    let port_c = parts.gpioc.split(rcc);
    let enable = port_c.pc6.into_push_pull_output_in_state(PinState::Low);
    let light = parts.gpiod.split(rcc).pd12.into_push_pull_output_in_state(DARK);
    parts.gpioe.split(rcc).pe3.into_push_pull_output_in_state(PinState::High);
    let (port_a, port_b) = (parts.gpioa.split(rcc), parts.gpiob.split(rcc));
    port_a.pa5.into_analog();
    port_b.pb0.into_analog();
    port_b.pb1.into_analog();
    let adcs = (parts.adc1, parts.adc2, parts.adc_common);
    (light, (port_a.pa2, port_a.pa3), Pins { enable, interlock: port_c.pc8, dac: parts.dac, adcs })
}

/// Refuses to inject a fault: this bench is real.
pub fn inject_fault(_: InjectedFault) -> bool {
    false
}

/// The bench on the board's pins.
pub struct Bench {
    amplifier: Amplifier<'C', 6>,
    adcs: Adcs,
    sample: Option<Sample>,
    interlock: PC8<Input>,
    found: Inspection,
}

impl Bench {
    /// Brings the amplifier's command to 0 V.
    pub fn new(pins: Pins, _: &'static mut Option<AdcBus>, rcc: &mut Rcc) -> Self {
        let Pins { enable, interlock, dac, adcs: (adc1, adc2, common) } = pins;
        Self {
            amplifier: Amplifier::new(dac, enable, rcc),
            adcs: Adcs::new(adc1, adc2, common, CHANNELS, rcc),
            sample: None,
            interlock: interlock.into_pull_down_input(),
            found: Inspection {
                interlock_closed: false,
                enable_high: false,
                dac: Part::Starting,
                monitor: Part::Starting,
                sensor: Part::Starting,
                monitor_adc_v: f32::NAN,
                sensor_adc_v: f32::NAN,
            },
        }
    }

    /// The converters need nothing of the controller.
    pub fn prepare(&mut self, _: Option<&Controller>) {}

    /// State of the parts in the last tick.
    pub fn inspection(&self) -> Inspection {
        self.found
    }

    /// Samples interlock and sensors.
    pub fn sample(&mut self) -> Inputs {
        let sampled = self.adcs.sample();
        self.sample = sampled.ok();
        let [monitor, sensor] = [sampled.map(|s| s.monitor_v), sampled.map(|s| s.sensor_v)];
        let interlock_closed = self.interlock.is_high();
        let part = |read: Result<f32, AdcError>| Part::from(read);
        self.found = Inspection {
            interlock_closed,
            // SAFETY: the pin's level is only read.
            enable_high: unsafe { &*GPIOC::PTR }.idr().read().idr6().bit_is_set(),
            dac: self.found.dac,
            monitor: part(monitor),
            sensor: part(sensor),
            monitor_adc_v: monitor.unwrap_or(f32::NAN),
            sensor_adc_v: sensor.unwrap_or(f32::NAN),
        };
        Inputs { interlock_closed, monitor_adc_v: monitor.ok(), sensor_adc_v: sensor.ok() }
    }

    /// Applies the drive of a tick to the amplifier.
    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        // What was sampled shows the command before this one: the next tick has its own sample.
        let applied = self.amplifier.apply(drive, self.sample.take());
        self.found.dac = applied.into();
        applied
    }
}
