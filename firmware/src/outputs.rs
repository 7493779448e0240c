//! The outputs that are set before anything else.

use stm32f4xx_hal::gpio::{Output, PC6, PC7, PC12, PinState};
use stm32f4xx_hal::pac::GPIOC;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;

/// The amplifier's enable output, low, and then the light, dark. The interlock's pin stays as it is.
pub fn start(gpioc: GPIOC, rcc: &mut Rcc) -> (PC6<Output>, PC12<Output>, PC7) {
    let pins = gpioc.split(rcc);
    let enable = pins.pc6.into_push_pull_output_in_state(PinState::Low);
    let led = pins.pc12.into_push_pull_output_in_state(PinState::High);
    (enable, led, pins.pc7)
}
