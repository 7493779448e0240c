//! The STM32G474: clocks, converters, flash, resets and serial port beneath the application.

#[cfg(feature = "self-sensing")]
pub mod adc3;
pub mod converters;
pub mod flash;
pub mod reset;
pub mod serial;
pub mod tree;

pub use stm32_metapac as pac;
use stm32_metapac::flash::Flash;
use stm32_metapac::usart::Usart;

use crate::pin::Pin;
use tree::Timer;

/// Interrupts of the chip.
pub const INTERRUPTS: usize = 102;
/// Ticks that the flight recorder keeps: one second.
pub const FLIGHT_SLOTS: usize = 1024;

/// The clock control, with the frequency of the core, Hz. Timers and buses have the same one.
pub struct Rcc {
    pub core_hz: u32,
}

/// The peripherals that a board may use: it takes its pins by their names, and its converters are in [`converters`].
pub struct Parts(());

/// The chip's parts.
pub struct Chip {
    pub rcc: Rcc,
    pub timer: Timer,
    pub usart: Usart,
    pub flash: Flash,
    pub parts: Parts,
}

impl Chip {
    /// To be called once, by the start, on the internal oscillator.
    pub fn take() -> Self {
        let rcc = Rcc { core_hz: tree::INTERNAL_HZ };
        Self { rcc, timer: Timer(pac::TIM5), usart: pac::USART2, flash: pac::FLASH, parts: Parts(()) }
    }
}

/// The clock control, as it is after a reset.
pub fn constrain(rcc: Rcc) -> Rcc {
    rcc
}

/// Pin `number` of a port that has its clock.
pub const fn pin(port: char, number: u8) -> Pin {
    Pin::at(0x4800_0000 + 0x400 * (port as usize - 'A' as usize), number)
}

/// The frequency of the core, Hz.
pub fn core_hz(rcc: &Rcc) -> u32 {
    rcc.core_hz
}

/// Returns a number that differs from chip to chip.
pub fn id() -> u32 {
    // SAFETY: the words that the factory has written can be read at any time.
    let word = |index: usize| unsafe { (0x1fff_7590 as *const u32).add(index).read_volatile() };
    word(0) ^ word(1).rotate_left(16) ^ word(2).rotate_left(8)
}
