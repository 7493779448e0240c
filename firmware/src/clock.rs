//! The clocks: 168 MHz from the crystal, or 16 MHz from the internal oscillator where that does not start.

use stm32f4xx_hal::pac::{RCC, rcc};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Rcc};

/// The crystal, Hz.
const CRYSTAL_HZ: u32 = 8_000_000;
/// The core, Hz.
pub const CORE_HZ: u32 = 168_000_000;
/// How often a ready bit is asked for: some 20 ms on the internal oscillator, ten times what a crystal takes.
const PATIENCE: u32 = 50_000;

/// Why the core runs on its internal oscillator.
#[derive(Clone, Copy, PartialEq, Eq, defmt::Format)]
pub enum ClockFault {
    /// The crystal does not oscillate.
    Crystal,
    /// The phase-locked loop does not lock.
    Loop,
}

/// Sets the clocks, and says if they are not what they should be.
pub fn start(rcc: RCC) -> (Rcc, Option<ClockFault>) {
    // The waits of the library have no end, so what it will wait for is seen to come first.
    match rehearse(&rcc) {
        Ok(()) => (rcc.freeze(Config::hse(CRYSTAL_HZ.Hz()).sysclk(CORE_HZ.Hz())), None),
        Err(fault) => (rcc.freeze(Config::hsi()), Some(fault)),
    }
}

fn rehearse(rcc: &RCC) -> Result<(), ClockFault> {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    if !comes(rcc, |cr| cr.hserdy().bit_is_set()) {
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
        return Err(ClockFault::Crystal);
    }
    // The loop at its reset values makes 8 MHz / 16 × 192 / 2 = 48 MHz: enough to see it lock.
    rcc.pllcfgr().modify(|_, w| w.pllsrc().hse());
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    let locks = comes(rcc, |cr| cr.pllrdy().bit_is_set());
    rcc.cr().modify(|_, w| w.pllon().clear_bit());
    let ends = comes(rcc, |cr| cr.pllrdy().bit_is_clear());
    if locks && ends { Ok(()) } else { Err(ClockFault::Loop) }
}

fn comes(rcc: &RCC, ready: impl Fn(&rcc::cr::R) -> bool) -> bool {
    (0..PATIENCE).any(|_| ready(&rcc.cr().read()))
}
