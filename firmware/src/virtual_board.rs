//! The virtual board: the firmware in QEMU with a simulated film, and faults on request. `cargo xtask board` starts it.
#![no_std]
#![no_main]

use defmt_semihosting as _;

mod app;
#[path = "virtual_bench.rs"]
mod bench;
mod board;
mod clock;
mod film;
mod flash;
#[path = "emulated.rs"]
mod machine;
mod outputs;
mod panic;
mod reset;
mod serial;
