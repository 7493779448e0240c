//! ST's NUCLEO-G474RE: the DAC and the ADCs on the chip, at 3.3 V. `docs/boards.md` shows the bench on its pins.

use dea_driver::chips::{Ceilings, Converters};
use dea_driver::wire::{InjectedFault, boards};
use stm32_metapac::RCC;

use super::family::{Parts, Rcc, pin, serial};
pub use super::on_chip::{AdcBus, Bench, Pins};
use crate::pin::Pin;

/// Its number.
pub const ID: u16 = boards::NUCLEO_G474RE;

/// Its crystal, Hz.
pub const CRYSTAL_HZ: u32 = 24_000_000;

/// Converters of the board, and its ceilings, which no blob and no upload exceeds. **Set them to what clamp, film and amplifier of your
/// bench withstand**; these are for the largest usual bench.
pub const CONVERTERS: Converters = Converters {
    ceilings: Ceilings { voltage_v: 10e3, field_v_per_m: 2e8, stroke_m: 20e-3 },
    ..Converters::STM32G4_ON_CHIP
};

/// Cycles from tick to tick at the least: on the internal oscillator, at 16 MHz, the fastest is slower. There the ADCs take 1 200 of their cycles of
/// two cycles of the core, at 170 MHz of four; the controller and a part of the check of the memory take 7 200.
pub const CYCLES_PER_TICK: f32 = 15_500.0;

/// The green light is between pin and ground.
pub const DARK: bool = false;

/// Largest output of the current monitor, V: that of the voltage monitor. It is at PB1.
#[cfg(feature = "self-sensing")]
pub const CURRENT_V: f32 = CONVERTERS.monitor_v;
#[cfg(feature = "self-sensing")]
const CURRENT: u8 = 1;

/// Monitor at PA0, sensor at PA1.
const CHANNELS: [u8; 2] = [1, 2];

/// Its enable output.
const ENABLE: Pin = pin('C', 6);

/// Lowers the enable output, for a panic.
pub fn disable() {
    ENABLE.set(false);
}

/// The amplifier's enable output, low, before anything else is set up, and then the light, dark.
pub fn start(_: Parts, _: &mut Rcc) -> (Pin, serial::Pins, Pins) {
    RCC.ahb2enr().modify(|w| {
        w.set_gpioaen(true);
        #[cfg(feature = "self-sensing")]
        w.set_gpioben(true);
        w.set_gpiocen(true);
    });
    let enable = ENABLE.output(false);
    let light = pin('A', 5).output(DARK);
    [pin('A', 0), pin('A', 1), pin('A', 4)].into_iter().for_each(Pin::analog);
    #[cfg(feature = "self-sensing")]
    pin('B', 1).analog();
    let supply_v = Converters::STM32G4_SUPPLY_V;
    let pins = Pins {
        enable,
        interlock: pin('C', 8),
        channels: CHANNELS,
        #[cfg(feature = "self-sensing")]
        current: CURRENT,
        supply_v,
    };
    (light, serial::Pins, pins)
}

/// Refuses to inject a fault: this bench is real.
pub fn inject_fault(_: InjectedFault) -> bool {
    false
}
