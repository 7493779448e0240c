//! The firmware in QEMU, as a board that nothing is connected to. `springpot pil` starts it.
#![no_std]
#![no_main]

use defmt_semihosting as _;

mod app;
mod background;
#[path = "absent.rs"]
mod bench;
#[allow(dead_code)] // its converters are not there
#[path = "boards/stm32_h405.rs"]
mod board;
mod clock;
#[path = "f4/mod.rs"]
mod family;
#[path = "emulated.rs"]
mod machine;
mod panic;
mod pin;
mod watchdog;
