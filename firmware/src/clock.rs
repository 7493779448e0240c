//! The clocks: the highest from the crystal, or 16 MHz from the internal oscillator where the crystal does not start, stops, or is
//! another one. While the firmware runs, the slow oscillator of the watchdog is compared with the core's clock.

use core::sync::atomic::{AtomicU32, Ordering};

use dea_driver::Cause;

use super::family::Rcc;
use super::family::tree::{self, PATIENCE, Timer};

/// The internal oscillator, Hz.
const INTERNAL_HZ: f32 = 16e6;
/// Beginning of a panic about the clock. The next run uses the internal oscillator.
pub const PANIC: &str = "clock";
/// Largest difference of the two clocks: the internal oscillator is off by 8 % at the most.
const TOLERANCE: f32 = 0.12;
/// Largest change of the slow oscillator against the core's clock while both run: more than the slow one drifts as the chip warms.
const MAX_DRIFT: f32 = 0.2;
/// Longest time without a measurement of the slow oscillator, s: some ten measurements of 128 periods.
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

/// Sets the clocks for a crystal of `crystal_hz`, a multiple of 2 MHz, and reports a fault. `avoid`: the crystal was at fault in the last
/// run.
///
/// The library waits without an end, so each condition is checked before. The crystal is compared with the internal oscillator before the
/// loop multiplies it: a loop on another one is beyond its limits, and the core with it.
pub fn start(rcc: Rcc, timer: Timer, crystal_hz: u32, avoid: bool) -> Clocks {
    let (rcc, fault, expected) = set(rcc, &timer, crystal_hz, avoid);
    MEASURED.store(0, Ordering::Relaxed);
    if expected.is_some() {
        tree::clock_timer(&rcc, true);
        timer.listen();
        timer.interrupt();
    }
    let watch = Watch { expected, silent_s: 0.0, fault: None, cause: None };
    Clocks { rcc, fault, captures: Captures { timer, first: 0, missing: CAPTURES + 1 }, watch }
}

/// Sets the clocks. Returns the fault, and the expected counts of the timer over 128 periods of the slow oscillator.
fn set(rcc: Rcc, timer: &Timer, crystal_hz: u32, avoid: bool) -> (Rcc, Option<ClockFault>, Option<f32>) {
    if avoid {
        return on_internal(rcc, timer, ClockFault::LastRun);
    }
    if !tree::crystal_starts(&rcc) {
        return on_internal(rcc, timer, ClockFault::Crystal);
    }
    let before = slow_period(&rcc, timer);
    let rcc = tree::on_crystal(rcc, crystal_hz);
    let after = slow_period(&rcc, timer);
    let timer_hz = tree::timer_hz(&rcc);
    // Another frequency would change every time in the limits.
    let mut fault = Some(ClockFault::Slow);
    if let (Some(before), Some(after)) = (before, after) {
        let expected = before as f32 * (timer_hz / INTERNAL_HZ);
        let off = (after as f32 / expected - 1.0).abs();
        assert!(off <= TOLERANCE, "{PANIC}: another crystal than {} MHz", crystal_hz / 1_000_000);
        fault = None;
    }
    if !tree::loop_locks(&rcc, crystal_hz) {
        return on_internal(rcc, timer, ClockFault::Loop);
    }
    let rcc = tree::on_loop(rcc, crystal_hz);
    tree::watch_crystal(&rcc);
    let expected = after.map(|after| after as f32 * (tree::timer_hz(&rcc) / timer_hz));
    (rcc, fault, expected)
}

/// The core on the internal oscillator, and the crystal's off, because of a `fault`.
fn on_internal(rcc: Rcc, timer: &Timer, fault: ClockFault) -> (Rcc, Option<ClockFault>, Option<f32>) {
    let rcc = tree::on_internal(rcc);
    let expected = slow_period(&rcc, timer).map(|counts| counts as f32);
    (rcc, Some(fault), expected)
}

/// Counts of `timer` over 128 periods of the watchdog's own oscillator, 4 ms; none if it does not run. Its frequency is known to
/// half of it only, but it does not change within a few milliseconds, and little while the chip warms.
fn slow_period(rcc: &Rcc, timer: &Timer) -> Option<u32> {
    if !tree::slow_starts(rcc) {
        return None;
    }
    tree::clock_timer(rcc, true);
    let captures = capture(timer);
    timer.stop();
    tree::clock_timer(rcc, false);
    captures
}

fn capture(timer: &Timer) -> Option<u32> {
    timer.listen();
    let next = || (0..PATIENCE).find(|_| timer.has_captured()).map(|_| timer.captured());
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
    timer: Timer,
    first: u32,
    /// Captures that are missing until a measurement is complete.
    missing: u32,
}

impl Captures {
    /// Takes a capture: to be called from the interrupt of the timer, below the tick. A measurement restarts after missed captures, as
    /// while the flash is erased.
    pub fn take(&mut self) {
        let missed = self.timer.has_missed();
        let at = self.timer.captured();
        if missed {
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
