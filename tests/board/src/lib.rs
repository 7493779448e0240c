#![doc = include_str!("../README.md")]
#![cfg(all(target_arch = "x86_64", target_os = "linux"))]

// The firmware logs by the name of defmt.
extern crate self as defmt;

pub mod board;
pub mod chip;
mod cortex;
pub mod log;
pub mod panic;
mod trap;
pub mod wires;

#[path = "../../../firmware/src/clock.rs"]
pub mod clock;
#[path = "../../../firmware/src/on_chip.rs"]
pub mod on_chip;
#[path = "../../../firmware/src/parts.rs"]
pub mod parts;
#[path = "../../../firmware/src/reset.rs"]
pub mod reset;
#[path = "../../../firmware/src/serial.rs"]
pub mod serial;
#[path = "../../../firmware/src/boards/stm32_h405.rs"]
pub mod stm32_h405;
#[path = "../../../firmware/src/boards/stm32f407_discovery.rs"]
pub mod stm32f407_discovery;

pub use log::Format;
pub use stm32f4xx_hal as hal;
