//! The firmware's start, from the clocks on, in its order.

use board_on_host::board::Board;
use board_on_host::f4::family::tree::CORE_HZ;
use board_on_host::f4::family::{Chip, serial};
use board_on_host::f4::stm32_h405::{self, Bench};
use board_on_host::f4::stm32f407_discovery;
use board_on_host::hal::prelude::*;
use board_on_host::hal::rcc::{Config, Rcc};

/// The crystal's clocks, set without a look at the crystal, which takes 60 000 accesses.
pub fn crystal() -> Config {
    Config::hse(8.MHz()).sysclk(CORE_HZ.Hz())
}

/// Starts on the crystal's clocks, up to the bench and the link.
pub fn start(board: &Board) -> Bench {
    start_on(board, crystal())
}

pub fn start_on(board: &Board, clocks: Config) -> Bench {
    let (mut rcc, chip) = on(board, clocks);
    let (_, link, pins) = stm32_h405::start(chip.parts, &mut rcc);
    let bench = Bench::new(pins, Box::leak(Box::new(None)), &mut rcc);
    assert!(serial::open(chip.usart, link, &mut rcc).is_ok(), "the clock is too slow for the link");
    bench
}

/// The same on ST's STM32F4DISCOVERY.
pub fn start_discovery(board: &Board, clocks: Config) -> stm32f407_discovery::Bench {
    let (mut rcc, chip) = on(board, clocks);
    let (_, link, pins) = stm32f407_discovery::start(chip.parts, &mut rcc);
    let bench = stm32f407_discovery::Bench::new(pins, Box::leak(Box::new(None)), &mut rcc);
    assert!(serial::open(chip.usart, link, &mut rcc).is_ok(), "the clock is too slow for the link");
    bench
}

/// The chip on these clocks.
fn on(board: &Board, clocks: Config) -> (Rcc, Chip) {
    (board.peripherals().RCC.freeze(clocks), Chip::take())
}
