//! Boards that this repository has firmware for: the number in [`Identity::board`](crate::wire::Identity::board) and in the header of a blob.

/// The STM32F405 with an AD5754 and two ADS868x: `firmware/src/boards/stm32_h405.rs`.
pub const STM32F405: u16 = 0x0405;

/// ST's STM32F4DISCOVERY with the converters on its chip: `firmware/src/boards/stm32f407_discovery.rs`.
pub const STM32F407_DISCOVERY: u16 = 0x0407;

/// ST's NUCLEO-G474RE with the converters on its chip: `firmware/src/boards/nucleo_g474re.rs`.
pub const NUCLEO_G474RE: u16 = 0x0474;
