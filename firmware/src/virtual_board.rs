//! The virtual board: the firmware in QEMU with a simulated film, and faults on request. `cargo xtask board` starts it.
#![no_std]
#![no_main]

use defmt_semihosting as _;

mod app;
mod background;
#[path = "virtual_bench.rs"]
mod bench;
#[allow(dead_code)] // its converters are not there
#[path = "boards/stm32_h405.rs"]
mod board;
mod clock;
#[cfg(feature = "self-sensing")]
mod current;
#[path = "f4/mod.rs"]
mod family;
mod film;
#[path = "emulated.rs"]
mod machine;
mod panic;
mod pin;
mod watchdog;
