//! The clocks: 168 MHz from the crystal, or 16 MHz from the internal oscillator where the crystal does not start, stops, or is
//! another one. While the firmware runs, the slow oscillator of the watchdog is compared with the core's clock.

use core::sync::atomic::{AtomicU32, Ordering};

use dea_driver::Cause;
use stm32f4xx_hal::pac::{RCC, TIM5, rcc};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{BusTimerClock, Config, Rcc};

/// The core, Hz.
pub const CORE_HZ: u32 = 168_000_000;
/// The internal oscillator, Hz.
const INTERNAL_HZ: f32 = 16e6;
/// How often a ready bit is asked for: some 20 ms on the internal oscillator, ten times what a crystal takes.
const PATIENCE: u32 = 50_000;
/// How a panic over the clock begins. The run after it is on the internal oscillator.
pub const PANIC: &str = "clock";
/// Largest difference of the two clocks: the internal oscillator is off by 8 % at the most.
const TOLERANCE: f32 = 0.12;
/// Largest change of the slow oscillator against the core's clock while both run: more than the slow one drifts as the chip warms.
const MAX_DRIFT: f32 = 0.2;
/// For so long no period of the slow oscillator may be missing, s: some ten measurements of 128 of its periods.
const MAX_SILENCE_S: f32 = 0.1;
/// Captures of a measurement, each of eight periods.
const CAPTURES: u32 = 16;

/// The last measurement: counts of the timer over 128 periods of the slow oscillator; 0 once the tick has taken it.
static MEASURED: AtomicU32 = AtomicU32::new(0);

/// A fault of the clocks.
#[derive(Clone, Copy, PartialEq, Eq, defmt::Format)]
pub enum ClockFault {
    /// The crystal does not oscillate: the core runs on its internal oscillator.
    Crystal,
    /// The phase-locked loop does not lock: likewise.
    Loop,
    /// The last run ended because of the clock: likewise.
    LastRun,
    /// The slow oscillator does not run: there is no watchdog, and the crystal is compared with nothing.
    Slow,
    /// The core's clock or the slow oscillator has another frequency than at the start.
    Drift,
}

/// The clocks as [`start`] has set them.
pub struct Clocks {
    pub rcc: Rcc,
    /// Fault that the start has found.
    pub fault: Option<ClockFault>,
    /// For the interrupt of the timer.
    pub captures: Captures,
    /// For the tick.
    pub watch: Watch,
}

/// Sets the clocks for a crystal of `crystal_hz`, a multiple of 2 MHz, and says if they are not what they should be. `avoid`: the crystal was at fault
/// in the last run.
///
/// The waits of the library have no end, so what it will wait for is seen to come first. The crystal is compared with the internal
/// oscillator before the loop multiplies it: a loop on another one is beyond its limits, and the core with it.
pub fn start(rcc: RCC, timer: TIM5, crystal_hz: u32, avoid: bool) -> Clocks {
    let (rcc, fault, expected) = set(rcc.constrain(), &timer, crystal_hz, avoid);
    MEASURED.store(0, Ordering::Relaxed);
    if expected.is_some() {
        rcc.apb1enr().modify(|_, w| w.tim5en().set_bit());
        listen(&timer);
        timer.dier().write(|w| w.cc4ie().set_bit());
    }
    let watch = Watch { expected, silent_s: 0.0, fault: None, cause: None };
    Clocks { rcc, fault, captures: Captures { timer, first: 0, missing: CAPTURES + 1 }, watch }
}

/// Sets the clocks: with what is wrong, and the counts of the timer over 128 periods of the slow oscillator as they will be.
fn set(rcc: Rcc, timer: &TIM5, crystal_hz: u32, avoid: bool) -> (Rcc, Option<ClockFault>, Option<f32>) {
    if avoid {
        return on_internal(rcc, timer, ClockFault::LastRun);
    }
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    if !comes(&rcc, |cr| cr.hserdy().bit_is_set()) {
        return on_internal(rcc, timer, ClockFault::Crystal);
    }
    let before = slow_period(&rcc, timer);
    let rcc = rcc.freeze(Config::hse(crystal_hz.Hz()));
    let after = slow_period(&rcc, timer);
    let hz = |rcc: &Rcc| TIM5::timer_clock(&rcc.clocks).raw() as f32;
    let timer_hz = hz(&rcc);
    // A crystal of another frequency would stretch every time that the limits state.
    let mut fault = Some(ClockFault::Slow);
    if let (Some(before), Some(after)) = (before, after) {
        let expected = before as f32 * (timer_hz / INTERNAL_HZ);
        let off = (after as f32 / expected - 1.0).abs();
        assert!(off <= TOLERANCE, "{PANIC}: another crystal than {} MHz", crystal_hz / 1_000_000);
        fault = None;
    }
    if !loop_locks(&rcc, crystal_hz) {
        return on_internal(rcc, timer, ClockFault::Loop);
    }
    let rcc = rcc.freeze(Config::hse(crystal_hz.Hz()).sysclk(CORE_HZ.Hz()));
    // From now on a crystal that stops ends in a non-maskable interrupt.
    rcc.cr().modify(|_, w| w.csson().set_bit());
    let expected = after.map(|after| after as f32 * (hz(&rcc) / timer_hz));
    (rcc, fault, expected)
}

/// The core on the internal oscillator, and the crystal's off, because of a `fault`.
fn on_internal(rcc: Rcc, timer: &TIM5, fault: ClockFault) -> (Rcc, Option<ClockFault>, Option<f32>) {
    let rcc = rcc.freeze(Config::hsi());
    rcc.cr().modify(|_, w| w.hseon().clear_bit());
    let expected = slow_period(&rcc, timer).map(|counts| counts as f32);
    (rcc, Some(fault), expected)
}

/// Whether the loop locks as it will run: a crystal of 8 MHz / 4 × 168 / 2 = 168 MHz. At its reset values it would have 0.5 MHz where it needs
/// 1 to 2, and make 96 MHz where it makes 100 at least. It is off again afterwards.
fn loop_locks(rcc: &RCC, crystal_hz: u32) -> bool {
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

/// Counts of `timer` over 128 periods of the watchdog's own oscillator, 4 ms; none if it does not run. Its frequency is known to
/// half of it only, but it does not change within a few milliseconds, and little while the chip warms.
fn slow_period(rcc: &RCC, timer: &TIM5) -> Option<u32> {
    rcc.csr().modify(|_, w| w.lsion().set_bit());
    if !(0..PATIENCE).any(|_| rcc.csr().read().lsirdy().bit_is_set()) {
        return None;
    }
    rcc.apb1enr().modify(|_, w| w.tim5en().set_bit());
    let captures = capture(timer);
    timer.cr1().write(|w| w.cen().clear_bit());
    rcc.apb1enr().modify(|_, w| w.tim5en().clear_bit());
    captures
}

/// Channel 4 of the timer captures every eighth edge of the slow oscillator from now on.
fn listen(timer: &TIM5) {
    // SAFETY: 1 is the slow oscillator, one of the four inputs that the channel has.
    timer.or().write(|w| unsafe { w.it4_rmp().bits(1) });
    timer.arr().write(|w| w.arr().set(u32::MAX));
    timer.ccmr2_input().write(|w| w.cc4s().ti4().ic4psc().set(0b11));
    timer.ccer().write(|w| w.cc4e().set_bit());
    timer.egr().write(|w| w.ug().set_bit());
    timer.cr1().write(|w| w.cen().set_bit());
}

fn capture(timer: &TIM5) -> Option<u32> {
    listen(timer);
    let next = || {
        (0..PATIENCE).find(|_| timer.sr().read().cc4if().bit_is_set())?;
        // Reading it clears the flag.
        Some(timer.ccr4().read().bits())
    };
    // The first one may have been on its way.
    next()?;
    let first = next()?;
    let mut last = first;
    for _ in 0..CAPTURES {
        last = next()?;
    }
    Some(last.wrapping_sub(first))
}

/// The timer that captures edges of the slow oscillator while the firmware runs.
pub struct Captures {
    timer: TIM5,
    first: u32,
    /// Captures that are missing until a measurement is complete.
    missing: u32,
}

impl Captures {
    /// Takes a capture over: to be called from the interrupt of the timer, below the tick. A measurement begins again where captures were missed,
    /// as while the flash is erased.
    pub fn take(&mut self) {
        let missed = self.timer.sr().read().cc4of().bit_is_set();
        // Reading it clears the flag.
        let at = self.timer.ccr4().read().bits();
        if missed {
            self.timer.sr().modify(|_, w| w.cc4of().clear_bit());
            self.missing = CAPTURES + 1;
        }
        self.missing -= 1;
        if self.missing == 0 {
            MEASURED.store(at.wrapping_sub(self.first).max(1), Ordering::Relaxed);
        }
        if self.missing == 0 || self.missing == CAPTURES {
            (self.first, self.missing) = (at, CAPTURES);
        }
    }
}

/// Compares the clocks in every tick.
pub struct Watch {
    /// Counts of a measurement as they should be; none where the slow oscillator did not run at the start.
    expected: Option<f32>,
    /// Time since the last measurement, by the core's clock, s.
    silent_s: f32,
    fault: Option<ClockFault>,
    cause: Option<Cause>,
}

impl Watch {
    /// Returns the cause for which nothing may be enabled in this tick, one of `rate_hz` a second, for as long as it lasts. A fault is passed to
    /// `report` when it comes.
    pub fn check(&mut self, rate_hz: f32, report: impl Fn(ClockFault) -> Option<Cause>) -> Option<Cause> {
        let before = self.fault;
        self.silent_s += 1.0 / rate_hz;
        match (self.expected, MEASURED.swap(0, Ordering::Relaxed)) {
            (None, _) => self.fault = Some(ClockFault::Slow),
            (_, 0) if self.silent_s > MAX_SILENCE_S => self.fault = Some(ClockFault::Slow),
            (_, 0) => {}
            (Some(expected), counts) => {
                self.silent_s = 0.0;
                let off = (counts as f32 / expected - 1.0).abs();
                self.fault = (off > MAX_DRIFT).then_some(ClockFault::Drift);
            }
        }
        if self.fault != before {
            self.cause = self.fault.and_then(report);
        }
        self.cause
    }
}
