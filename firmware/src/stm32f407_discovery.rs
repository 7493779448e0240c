//! The firmware for ST's STM32F4DISCOVERY: as `main.rs`, with the converters on the chip.
#![no_std]
#![no_main]

use defmt_rtt as _;

use board as bench;

mod app;
mod background;
#[path = "boards/stm32f407_discovery.rs"]
mod board;
mod clock;
#[cfg(feature = "self-sensing")]
mod current;
#[path = "f4/mod.rs"]
mod family;
#[path = "chip.rs"]
mod machine;
mod on_chip;
mod panic;
mod pin;
mod watchdog;
