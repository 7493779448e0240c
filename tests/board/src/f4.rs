//! The firmware's modules for an STM32F4, and its boards.

#[path = "../../../firmware/src/clock.rs"]
pub mod clock;
#[path = "../../../firmware/src/f4/mod.rs"]
pub mod family;
#[path = "../../../firmware/src/on_chip.rs"]
pub mod on_chip;
#[path = "../../../firmware/src/boards/stm32_h405.rs"]
pub mod stm32_h405;
#[path = "../../../firmware/src/boards/stm32f407_discovery.rs"]
pub mod stm32f407_discovery;
