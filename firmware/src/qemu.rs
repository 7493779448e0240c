//! The firmware in QEMU, as a board that nothing is connected to. `springpot pil` starts it.
#![no_std]
#![no_main]

use defmt_semihosting as _;

mod app;
#[path = "absent.rs"]
mod bench;
mod board;
mod clock;
mod flash;
#[path = "emulated.rs"]
mod machine;
mod outputs;
mod panic;
mod reset;
mod serial;
