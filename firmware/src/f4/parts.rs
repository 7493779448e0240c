//! The peripherals that a board may use. Clocks, timer of the ticks, link, flash and watchdog belong to the application.

use stm32f4xx_hal::pac::{GPIOA, GPIOB, GPIOC, GPIOD, GPIOE, SPI1, SPI2};

/// Peripherals for the pins and the converters of a board. Those on the chip are in [`converters`](super::converters).
#[allow(dead_code)] // no board uses all of them
pub struct Parts {
    pub gpioa: GPIOA,
    pub gpiob: GPIOB,
    pub gpioc: GPIOC,
    pub gpiod: GPIOD,
    pub gpioe: GPIOE,
    pub spi1: SPI1,
    pub spi2: SPI2,
}
