//! The firmware's start, from the clocks on, in its order.

use board_on_host::board::Board;
use board_on_host::f4::family::tree::CORE_HZ;
use board_on_host::f4::{self, stm32_h405, stm32f407_discovery};
use board_on_host::g4::{self, nucleo_g474re};
use board_on_host::hal::prelude::*;
use board_on_host::hal::rcc::{Config, Rcc};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Core {
    Crystal,
    Internal,
}

pub const CLOCKS: [Core; 2] = [Core::Crystal, Core::Internal];

/// The crystal's clocks of an STM32F4.
pub fn crystal() -> Config {
    Config::hse(8.MHz()).sysclk(CORE_HZ.Hz())
}

/// The clocks of an STM32F4, set without a look at the crystal, which takes 60 000 accesses.
fn set(board: &Board, core: Core) -> Rcc {
    board.peripherals().RCC.freeze(if core == Core::Crystal { crystal() } else { Config::hsi() })
}

/// The same of an STM32G4.
pub fn set_g4(core: Core) -> g4::family::Rcc {
    use g4::family::tree::{crystal_starts, loop_locks, on_crystal, on_loop};
    let rcc = g4::family::Chip::take().rcc;
    if core == Core::Internal {
        return rcc;
    }
    let hz = nucleo_g474re::CRYSTAL_HZ;
    assert!(crystal_starts(&rcc));
    let rcc = on_crystal(rcc, hz);
    assert!(loop_locks(&rcc, hz));
    on_loop(rcc, hz)
}

/// A board's start on these clocks, up to the bench and the link.
macro_rules! start {
    ($name:ident, $family:ident, $board:ident, $set:expr) => {
        pub fn $name(board: &Board, core: Core) -> $board::Bench {
            let (mut rcc, chip) = ($set(board, core), $family::family::Chip::take());
            let (_, link, pins) = $board::start(chip.parts, &mut rcc);
            let bench = $board::Bench::new(pins, Box::leak(Box::new(None)), &mut rcc);
            let link = $family::family::serial::open(chip.usart, link, &mut rcc);
            assert!(link.is_ok(), "the clock is too slow for the link");
            bench
        }
    };
}

start!(start_h405, f4, stm32_h405, set);
start!(start_discovery, f4, stm32f407_discovery, set);
start!(start_nucleo, g4, nucleo_g474re, |_, core| set_g4(core));
