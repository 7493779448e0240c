//! The pins of the bench, and the outputs that are set before anything else.

use stm32f4xx_hal::gpio::{Output, PC6, PC7, PC12, PinState, gpioa, gpiob};
use stm32f4xx_hal::pac::GPIOC;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;

/// The pins of the bench, as they are after a reset, but for the enable output, which is low.
#[allow(dead_code)] // in QEMU nothing is connected to them
pub struct Pins {
    pub enable: PC6<Output>,
    pub interlock: PC7,
    /// Clock, MISO and MOSI of the ADCs.
    pub adc: (gpioa::PA5, gpioa::PA6, gpioa::PA7),
    /// Chip selects, and the DAC's bus.
    pub port_b: gpiob::Parts,
}

/// The amplifier's enable output, low, and then the light, dark. The interlock's pin stays as it is.
pub fn start(gpioc: GPIOC, rcc: &mut Rcc) -> (PC6<Output>, PC12<Output>, PC7) {
    let pins = gpioc.split(rcc);
    let enable = pins.pc6.into_push_pull_output_in_state(PinState::Low);
    let led = pins.pc12.into_push_pull_output_in_state(PinState::High);
    (enable, led, pins.pc7)
}
