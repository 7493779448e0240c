//! The firmware's start, from the clocks on, in its order.

use board_on_host::board::Board;
use board_on_host::clock::CORE_HZ;
use board_on_host::hal::gpio::{PA2, PA3};
use board_on_host::hal::pac::Peripherals;
use board_on_host::hal::prelude::*;
use board_on_host::hal::rcc::{Config, Rcc};
use board_on_host::parts::Parts;
use board_on_host::serial;
use board_on_host::stm32_h405::{self, Bench};
use board_on_host::stm32f407_discovery;

/// The crystal's clocks, set without a look at the crystal, which takes 60 000 accesses.
pub fn crystal() -> Config {
    Config::hse(8.MHz()).sysclk(CORE_HZ.Hz())
}

/// Starts on the crystal's clocks, up to the bench and the link.
pub fn start(board: &Board) -> Bench {
    start_on(board, crystal())
}

pub fn start_on(board: &Board, clocks: Config) -> Bench {
    let mut rcc = board.peripherals().RCC.freeze(clocks);
    let (_, link, pins) = stm32_h405::start(parts(board.peripherals()), &mut rcc);
    let bench = Bench::new(pins, Box::leak(Box::new(None)), &mut rcc);
    open(board, link, &mut rcc);
    bench
}

/// The same on ST's STM32F4DISCOVERY.
pub fn start_discovery(board: &Board, clocks: Config) -> stm32f407_discovery::Bench {
    let mut rcc = board.peripherals().RCC.freeze(clocks);
    let (_, link, pins) = stm32f407_discovery::start(parts(board.peripherals()), &mut rcc);
    let bench = stm32f407_discovery::Bench::new(pins, Box::leak(Box::new(None)), &mut rcc);
    open(board, link, &mut rcc);
    bench
}

fn open(board: &Board, (tx, rx): (PA2, PA3), rcc: &mut Rcc) {
    let link = serial::open(board.peripherals().USART2, tx, rx, rcc);
    assert!(link.is_ok(), "the clock is too slow for the link");
}

/// The peripherals that a board may use.
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
