//! ST's STM32F4DISCOVERY (STM32F407G-DISC1): the DAC and the ADCs on the chip, at 3 V. `docs/boards.md` shows the bench on its pins.
//!
//! The STM32F407 is an STM32F405 with Ethernet and a camera interface, which nothing here uses.

use dea_driver::chips::{Ceilings, Converters};
use dea_driver::wire::{InjectedFault, boards};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;

use super::family::parts::Parts;
use super::family::{pin, serial};
pub use super::on_chip::{AdcBus, Bench, Pins};
use crate::pin::Pin;

/// Its number.
pub const ID: u16 = boards::STM32F407_DISCOVERY;

/// Its crystal, Hz.
pub const CRYSTAL_HZ: u32 = 8_000_000;

/// Converters of the board, and its ceilings, which no blob and no upload exceeds. **Set them to what clamp, film and amplifier of your
/// bench withstand**; these are for the largest usual bench.
pub const CONVERTERS: Converters = Converters {
    ceilings: Ceilings { voltage_v: 10e3, field_v_per_m: 2e8, stroke_m: 20e-3 },
    ..Converters::STM32F4_ON_CHIP
};

/// Cycles from tick to tick at the least: on the internal oscillator, at 16 MHz, the fastest is slower. There the ADCs take 1 040 of their cycles of
/// two cycles of the core, at 168 MHz of eight; the controller and a part of the check of the memory take 7 200.
pub const CYCLES_PER_TICK: f32 = 15_500.0;

/// The green light is between pin and ground.
pub const DARK: bool = false;

/// Largest output of the current monitor, V: that of the voltage monitor. It is at PC1.
#[cfg(feature = "self-sensing")]
pub const CURRENT_V: f32 = CONVERTERS.monitor_v;
#[cfg(feature = "self-sensing")]
const CURRENT: u8 = 11;

/// Monitor at PB0, sensor at PB1.
const CHANNELS: [u8; 2] = [8, 9];

/// Its enable output.
const ENABLE: Pin = pin('C', 6);

/// Lowers the enable output, for a panic.
pub fn disable() {
    ENABLE.set(false);
}

/// The amplifier's enable output, low, before anything else is set up, and then the light, dark. The accelerometer, which has the DAC's pin for its
/// clock, is kept off its SPI.
pub fn start(parts: Parts, rcc: &mut Rcc) -> (Pin, serial::Pins, Pins) {
    parts.gpioc.split(rcc);
    let enable = ENABLE.output(false);
    parts.gpiod.split(rcc);
    let light = pin('D', 12).output(DARK);
    parts.gpioe.split(rcc);
    pin('E', 3).output(true);
    let port_a = parts.gpioa.split(rcc);
    parts.gpiob.split(rcc);
    [pin('A', 5), pin('B', 0), pin('B', 1)].into_iter().for_each(Pin::analog);
    #[cfg(feature = "self-sensing")]
    pin('C', 1).analog();
    let supply_v = Converters::STM32F4_SUPPLY_V;
    let pins = Pins {
        enable,
        interlock: pin('C', 8),
        channels: CHANNELS,
        #[cfg(feature = "self-sensing")]
        current: CURRENT,
        supply_v,
    };
    (light, (port_a.pa2, port_a.pa3), pins)
}

/// Refuses to inject a fault: this bench is real.
pub fn inject_fault(_: InjectedFault) -> bool {
    false
}
