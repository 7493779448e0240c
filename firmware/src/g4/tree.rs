//! Clocks of an STM32G4: 170 MHz from a crystal, or 16 MHz from the internal oscillator; and the timer that captures the slow oscillator.

use cortex_m::asm;
use stm32_metapac::flash::vals::Latency;
use stm32_metapac::rcc::vals::{Hpre, Pllm, Plln, Pllr, Pllsrc, Sw};
use stm32_metapac::timer::TimGp32;
use stm32_metapac::timer::regs::{CcmrInput2ch, SrGp16};
use stm32_metapac::{FLASH, PWR, RCC};

use super::Rcc;

/// The core, Hz.
const CORE_HZ: u32 = 170_000_000;
/// The internal oscillator, Hz.
pub const INTERNAL_HZ: u32 = 16_000_000;
/// Polls of a ready bit: some 20 ms on the internal oscillator, ten times the start of a crystal.
pub const PATIENCE: u32 = 50_000;
/// The regulator's mode up to 150 MHz, in PWR_CR5. The library (21.0.0) has it in another place.
const NORMAL_MODE: u32 = 1 << 8;
/// Cycles of the core, more than a microsecond at half its clock.
const MICROSECOND: u32 = 100;

/// Whether the crystal oscillates, once it is switched on.
pub fn crystal_starts(_: &Rcc) -> bool {
    RCC.cr().modify(|w| w.set_hseon(true));
    comes(|| RCC.cr().read().hserdy())
}

/// The core on the crystal of `crystal_hz`, up to 30 MHz, without the loop.
pub fn on_crystal(_: Rcc, crystal_hz: u32) -> Rcc {
    switch(Sw::HSE);
    Rcc { core_hz: crystal_hz }
}

/// Whether the loop locks: a crystal of 24 MHz / 6 × 85 / 2 = 170 MHz, where it needs 2.66 to 16 MHz and makes 96 to 344. Stays on if it does.
pub fn loop_locks(_: &Rcc, crystal_hz: u32) -> bool {
    RCC.pllcfgr().write(|w| {
        w.set_pllsrc(Pllsrc::HSE);
        w.set_pllm(Pllm::from_bits((crystal_hz / 4_000_000 - 1) as u8));
        w.set_plln(Plln::from_bits(85));
        w.set_pllr(Pllr::DIV2);
        w.set_pllren(true);
    });
    RCC.cr().modify(|w| w.set_pllon(true));
    let locks = comes(|| RCC.cr().read().pllrdy());
    if !locks {
        RCC.cr().modify(|w| w.set_pllon(false));
    }
    locks
}

/// The core on the loop, which [locks](loop_locks): its regulator for more than 150 MHz, the flash with four wait states, and for a microsecond
/// half of the clock, as the reference manual asks.
pub fn on_loop(_: Rcc, _: u32) -> Rcc {
    RCC.apb1enr1().modify(|w| w.set_pwren(true));
    PWR.cr5().modify(|w| w.0 &= !NORMAL_MODE);
    FLASH.acr().modify(|w| w.set_latency(Latency::WS4));
    comes(|| FLASH.acr().read().latency() == Latency::WS4);
    RCC.cfgr().modify(|w| w.set_hpre(Hpre::DIV2));
    switch(Sw::PLL1_R);
    asm::delay(MICROSECOND);
    RCC.cfgr().modify(|w| w.set_hpre(Hpre::DIV1));
    Rcc { core_hz: CORE_HZ }
}

/// The core on the internal oscillator, and the crystal's off.
pub fn on_internal(_: Rcc) -> Rcc {
    switch(Sw::HSI);
    RCC.cr().modify(|w| {
        w.set_pllon(false);
        w.set_hseon(false);
    });
    Rcc { core_hz: INTERNAL_HZ }
}

/// From now on a crystal that stops ends in a non-maskable interrupt.
pub fn watch_crystal(_: &Rcc) {
    RCC.cr().modify(|w| w.set_csson(true));
}

/// Whether the slow oscillator runs, once it is switched on.
pub fn slow_starts(_: &Rcc) -> bool {
    RCC.csr().modify(|w| w.set_lsion(true));
    comes(|| RCC.csr().read().lsirdy())
}

/// The core on a source that is ready.
fn switch(source: Sw) {
    RCC.cfgr().modify(|w| w.set_sw(source));
    comes(|| RCC.cfgr().read().sws() == source);
}

fn comes(ready: impl Fn() -> bool) -> bool {
    (0..PATIENCE).any(|_| ready())
}

/// Clock of the timer, Hz.
pub fn timer_hz(rcc: &Rcc) -> f32 {
    rcc.core_hz as f32
}

/// Switches the clock of the timer.
pub fn clock_timer(_: &Rcc, on: bool) {
    RCC.apb1enr1().modify(|w| w.set_tim5en(on));
}

/// The timer, whose channel 1 captures the slow oscillator.
pub struct Timer(pub TimGp32);

impl Timer {
    /// Captures every eighth edge of the slow oscillator from now on.
    pub fn listen(&self) {
        self.0.tisel().write(|w| w.set_tisel(0, 1));
        self.0.arr().write_value(u32::MAX);
        self.0.ccmr_input(0).write_value(CcmrInput2ch(0b11 << 2 | 0b01));
        self.0.ccer().write(|w| w.set_cce(0, true));
        self.0.egr().write(|w| w.set_ug(true));
        self.0.cr1().write(|w| w.set_cen(true));
    }

    pub fn stop(&self) {
        self.0.cr1().write(|w| w.set_cen(false));
    }

    /// An interrupt for every capture.
    pub fn interrupt(&self) {
        self.0.dier().write(|w| w.set_ccie(0, true));
    }

    pub fn has_captured(&self) -> bool {
        self.0.sr().read().ccif(0)
    }

    /// Whether a capture was overwritten since the last question.
    pub fn has_missed(&self) -> bool {
        let missed = self.0.sr().read().ccof(0);
        if missed {
            // Writing zeros clears flags.
            let mut others = SrGp16(u32::MAX);
            others.set_ccof(0, false);
            self.0.sr().write_value(others);
        }
        missed
    }

    /// The last capture, which is taken.
    pub fn captured(&self) -> u32 {
        // Reading it clears its flag.
        self.0.ccr(0).read()
    }
}
