//! The firmware's modules for an STM32G4, and its board.

#[path = "../../../firmware/src/clock.rs"]
pub mod clock;
#[path = "../../../firmware/src/g4/mod.rs"]
pub mod family;
#[path = "../../../firmware/src/boards/nucleo_g474re.rs"]
pub mod nucleo_g474re;
#[path = "../../../firmware/src/on_chip.rs"]
pub mod on_chip;
