//! Clocks of an STM32F4: 168 MHz from a crystal, or 16 MHz from the internal oscillator; and the timer that captures the slow oscillator.

use stm32f4xx_hal::pac::{RCC, TIM5, rcc};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{BusTimerClock, Config, Rcc};

/// The core, Hz.
pub const CORE_HZ: u32 = 168_000_000;
/// Polls of a ready bit: some 20 ms on the internal oscillator, ten times the start of a crystal.
pub const PATIENCE: u32 = 50_000;

/// Whether the crystal oscillates, once it is switched on.
pub fn crystal_starts(rcc: &RCC) -> bool {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    comes(rcc, |cr| cr.hserdy().bit_is_set())
}

/// The core on the crystal of `crystal_hz`, without the loop.
pub fn on_crystal(rcc: Rcc, crystal_hz: u32) -> Rcc {
    rcc.freeze(Config::hse(crystal_hz.Hz()))
}

/// The core on the loop, which [locks](loop_locks).
pub fn on_loop(rcc: Rcc, crystal_hz: u32) -> Rcc {
    rcc.freeze(Config::hse(crystal_hz.Hz()).sysclk(CORE_HZ.Hz()))
}

/// The core on the internal oscillator, and the crystal's off.
pub fn on_internal(rcc: Rcc) -> Rcc {
    let rcc = rcc.freeze(Config::hsi());
    rcc.cr().modify(|_, w| w.hseon().clear_bit());
    rcc
}

/// From now on a crystal that stops ends in a non-maskable interrupt.
pub fn watch_crystal(rcc: &RCC) {
    rcc.cr().modify(|_, w| w.csson().set_bit());
}

/// Whether the loop locks as it will run: a crystal of 8 MHz / 4 × 168 / 2 = 168 MHz. At its reset values it would have 0.5 MHz where it needs
/// 1 to 2, and make 96 MHz where it makes 100 at least. It is off again afterwards.
pub fn loop_locks(rcc: &RCC, crystal_hz: u32) -> bool {
    rcc.pllcfgr().modify(|_, w| {
        w.pllsrc().hse();
        // SAFETY: the crystal by this is 2 MHz, by 168 336 MHz, and by 7 48 MHz: within what the reference manual allows.
        unsafe { w.pllm().bits((crystal_hz / 2_000_000) as u8).plln().bits(168).pllq().bits(7) };
        w.pllp().div2()
    });
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    let locks = comes(rcc, |cr| cr.pllrdy().bit_is_set());
    rcc.cr().modify(|_, w| w.pllon().clear_bit());
    locks && comes(rcc, |cr| cr.pllrdy().bit_is_clear())
}

fn comes(rcc: &RCC, ready: impl Fn(&rcc::cr::R) -> bool) -> bool {
    (0..PATIENCE).any(|_| ready(&rcc.cr().read()))
}

/// Whether the slow oscillator runs, once it is switched on.
pub fn slow_starts(rcc: &RCC) -> bool {
    rcc.csr().modify(|_, w| w.lsion().set_bit());
    (0..PATIENCE).any(|_| rcc.csr().read().lsirdy().bit_is_set())
}

/// Clock of the timer, Hz.
pub fn timer_hz(rcc: &Rcc) -> f32 {
    TIM5::timer_clock(&rcc.clocks).raw() as f32
}

/// Switches the clock of the timer.
pub fn clock_timer(rcc: &RCC, on: bool) {
    rcc.apb1enr().modify(|_, w| w.tim5en().bit(on));
}

/// The timer, whose channel 4 captures the slow oscillator.
pub struct Timer(pub TIM5);

impl Timer {
    /// Captures every eighth edge of the slow oscillator from now on.
    pub fn listen(&self) {
        // SAFETY: 1 is the slow oscillator, one of the four inputs that the channel has.
        self.0.or().write(|w| unsafe { w.it4_rmp().bits(1) });
        self.0.arr().write(|w| w.arr().set(u32::MAX));
        self.0.ccmr2_input().write(|w| w.cc4s().ti4().ic4psc().set(0b11));
        self.0.ccer().write(|w| w.cc4e().set_bit());
        self.0.egr().write(|w| w.ug().set_bit());
        self.0.cr1().write(|w| w.cen().set_bit());
    }

    pub fn stop(&self) {
        self.0.cr1().write(|w| w.cen().clear_bit());
    }

    /// An interrupt for every capture.
    pub fn interrupt(&self) {
        self.0.dier().write(|w| w.cc4ie().set_bit());
    }

    pub fn has_captured(&self) -> bool {
        self.0.sr().read().cc4if().bit_is_set()
    }

    /// Whether a capture was overwritten since the last question.
    pub fn has_missed(&self) -> bool {
        let missed = self.0.sr().read().cc4of().bit_is_set();
        if missed {
            self.0.sr().modify(|_, w| w.cc4of().clear_bit());
        }
        missed
    }

    /// The last capture, which is taken.
    pub fn captured(&self) -> u32 {
        // Reading it clears its flag.
        self.0.ccr4().read().bits()
    }
}
