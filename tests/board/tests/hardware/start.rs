//! The firmware's start, from the clocks on, in its order.

use board_on_host::bench::{Bench, Pins};
use board_on_host::board::Board;
use board_on_host::clock::CORE_HZ;
use board_on_host::hal::prelude::*;
use board_on_host::hal::rcc::Config;
use board_on_host::{outputs, serial};

/// The crystal's clocks, set without a look at the crystal, which takes 60 000 accesses.
pub fn crystal() -> Config {
    Config::hse(8.MHz()).sysclk(CORE_HZ.Hz())
}

/// Starts on the crystal's clocks, up to the bench and the link.
pub fn start(board: &Board) -> Bench {
    start_on(board, crystal())
}

pub fn start_on(board: &Board, clocks: Config) -> Bench {
    let chip = board.peripherals();
    let mut rcc = chip.RCC.freeze(clocks);
    let (enable, _, interlock) = outputs::start(chip.GPIOC, &mut rcc);
    let port_a = chip.GPIOA.split(&mut rcc);
    let adc = (port_a.pa5, port_a.pa6, port_a.pa7);
    let pins = Pins { enable, interlock, adc, port_b: chip.GPIOB.split(&mut rcc) };
    let bench = Bench::new(chip.SPI1, chip.SPI2, pins, Box::leak(Box::new(None)), &mut rcc);
    let link = serial::open(chip.USART2, port_a.pa2, port_a.pa3, &mut rcc);
    assert!(link.is_ok(), "the clock is too slow for the link");
    bench
}
