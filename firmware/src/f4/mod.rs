//! The STM32F405 and STM32F407: clocks, converters, flash, resets and serial port beneath the application.

#[cfg(feature = "self-sensing")]
pub mod adc3;
#[allow(dead_code)] // not every board has its converters on the chip
pub mod converters;
pub mod flash;
pub mod parts;
pub mod reset;
pub mod serial;
pub mod tree;

pub use stm32f4xx_hal::pac;
use stm32f4xx_hal::pac::{FLASH, Peripherals, RCC, USART2};
pub use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::rcc::RccExt;
use stm32f4xx_hal::signature::Uid;

use crate::pin::Pin;
use parts::Parts;
use tree::Timer;

/// Interrupts of the chip.
pub const INTERRUPTS: usize = 82;
/// Ticks that the flight recorder keeps: two seconds.
pub const FLIGHT_SLOTS: usize = 2048;

/// The chip's parts.
pub struct Chip {
    pub rcc: RCC,
    pub timer: Timer,
    pub usart: USART2,
    pub flash: FLASH,
    pub parts: Parts,
}

impl Chip {
    /// To be called once, by the start.
    pub fn take() -> Self {
        // SAFETY: the start alone has the peripherals.
        let chip = unsafe { Peripherals::steal() };
        let parts = Parts {
            gpioa: chip.GPIOA,
            gpiob: chip.GPIOB,
            gpioc: chip.GPIOC,
            gpiod: chip.GPIOD,
            gpioe: chip.GPIOE,
            spi1: chip.SPI1,
            spi2: chip.SPI2,
        };
        Self { rcc: chip.RCC, timer: Timer(chip.TIM5), usart: chip.USART2, flash: chip.FLASH, parts }
    }
}

/// The clock control, as it is after a reset.
pub fn constrain(rcc: RCC) -> Rcc {
    rcc.constrain()
}

/// Pin `number` of a port that has its clock.
pub const fn pin(port: char, number: u8) -> Pin {
    Pin::at(0x4002_0000 + 0x400 * (port as usize - 'A' as usize), number)
}

/// The frequency of the core, Hz.
#[allow(dead_code)] // QEMU has another
pub fn core_hz(rcc: &Rcc) -> u32 {
    rcc.clocks.hclk().raw()
}

/// Returns a number that differs from chip to chip.
#[allow(dead_code)] // QEMU has none
pub fn id() -> u32 {
    let id = Uid::get();
    u32::from(id.x()) ^ u32::from(id.y()).rotate_left(16) ^ u32::from(id.waf_num()).rotate_left(8)
}
