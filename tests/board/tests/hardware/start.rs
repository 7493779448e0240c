//! The firmware's start, from the clocks on, in its order.

use board_on_host::board::Board;
use board_on_host::clock::CORE_HZ;
use board_on_host::hal::pac::Peripherals;
use board_on_host::hal::prelude::*;
use board_on_host::hal::rcc::Config;
use board_on_host::parts::Parts;
use board_on_host::serial;
use board_on_host::stm32_h405::{self, Bench};

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
    let (_, (tx, rx), pins) = stm32_h405::start(parts(board.peripherals()), &mut rcc);
    let bench = Bench::new(pins, Box::leak(Box::new(None)), &mut rcc);
    let link = serial::open(chip.USART2, tx, rx, &mut rcc);
    assert!(link.is_ok(), "the clock is too slow for the link");
    bench
}

/// What a board may use of the chip.
fn parts(chip: Peripherals) -> Parts {
    Parts {
        gpioa: chip.GPIOA,
        gpiob: chip.GPIOB,
        gpioc: chip.GPIOC,
        gpiod: chip.GPIOD,
        gpioe: chip.GPIOE,
        spi1: chip.SPI1,
        spi2: chip.SPI2,
        adc1: chip.ADC1,
        adc2: chip.ADC2,
        adc_common: chip.ADC_COMMON,
        dac: chip.DAC,
    }
}
