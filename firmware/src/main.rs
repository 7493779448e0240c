//! Creep compensation for a dielectric elastomer actuator, on an STM32F405.
//!
//! Every tick, by SysTick, 1000 times a second unless the parameters say otherwise:
//!
//! 1. sample: interlock, voltage monitor, displacement sensor;
//! 2. check: sensors, limits, the host's heartbeat;
//! 3. estimate: step the model under the voltage applied since the last tick;
//! 4. command: the voltage of the mode, within the limits;
//! 5. log: every n-th tick, for the host.
//!
//! 2 to 5 are [`dea_driver::Controller::tick`]. Bytes of the link (USART2, 460 800 baud) are received and sent by interrupt, above the
//! tick, since the chip keeps only one; requests are answered in the background, below it. Every fault ends with PC6 low, which disables
//! the amplifier: a trip at once, a panic before it resets the chip, a hanging tick by the watchdog after 50 ms, a hanging background
//! likewise half a second later, a reset by the resistor at the pin.
//!
//! This is the image for a board. `qemu.rs` and `virtual_board.rs` are the same firmware in QEMU, with other benches.
#![no_std]
#![no_main]

use defmt_rtt as _;

use board as bench;

mod app;
mod background;
#[path = "boards/stm32_h405.rs"]
mod board;
mod clock;
#[cfg(feature = "self-sensing")]
mod current;
#[path = "f4/mod.rs"]
mod family;
#[path = "chip.rs"]
mod machine;
mod panic;
mod pin;
mod watchdog;
