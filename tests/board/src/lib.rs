#![doc = include_str!("../README.md")]
#![cfg(all(target_arch = "x86_64", target_os = "linux"))]
// What the families share is there once for each.
#![allow(clippy::duplicate_mod)]

// The firmware logs by the name of defmt.
extern crate self as defmt;

pub mod board;
pub mod chip;
mod cortex;
pub mod f4;
pub mod g4;
mod instruction;
pub mod log;
pub mod panic;
mod trap;
pub mod wires;

#[path = "../../../firmware/src/current.rs"]
pub mod current;
#[cfg(feature = "self-sensing")]
#[path = "../../../firmware/src/film.rs"]
pub mod film;
#[path = "../../../firmware/src/pin.rs"]
pub mod pin;
#[path = "../../../firmware/src/watchdog.rs"]
pub mod watchdog;

pub use log::Format;
pub use stm32f4xx_hal as hal;
