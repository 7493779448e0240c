//! The firmware's modules for hardware, unchanged, on a computer: `stm32f4xx-hal` and all. What they write to the chip's registers ends
//! in models of the chip, which answer, keep time and judge.
//!
//! Every access of a register traps ([`trap`]), so none is missed and their order is the program's. Needs Linux on x86-64; elsewhere
//! the package is empty.
#![cfg(all(target_arch = "x86_64", target_os = "linux"))]

pub mod board;
pub mod chip;
mod cortex;
mod instruction;
pub mod log;
pub mod panic;
mod trap;
pub mod wires;

#[path = "../../../firmware/src/bench.rs"]
pub mod bench;
#[path = "../../../firmware/src/clock.rs"]
pub mod clock;
#[path = "../../../firmware/src/outputs.rs"]
pub mod outputs;
#[path = "../../../firmware/src/reset.rs"]
pub mod reset;
#[path = "../../../firmware/src/serial.rs"]
pub mod serial;

pub use stm32f4xx_hal as hal;
