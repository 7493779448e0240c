//! `firmware/src/clock.rs`: the clocks that it makes, and what it does where it cannot.

use board_on_host::board::Board;
use board_on_host::chip::clocks::Source;
use board_on_host::chip::family::Family;
use board_on_host::chip::rcc::{CSSON, HSEON, Loop, Oscillators, PLLON};
use board_on_host::f4::clock::{self, ClockFault, Clocks};
use board_on_host::f4::family::tree::Timer;
use board_on_host::f4::stm32_h405::CRYSTAL_HZ;
use board_on_host::g4::family::Chip;
use board_on_host::g4::{clock as g4, nucleo_g474re};
use board_on_host::hal::rcc::RccExt;
use dea_driver::Cause;

const GOOD: Oscillators =
    Oscillators { crystal_hz: Some(8_000_000), internal_hz: 16_000_000, slow_hz: Some(32_000), pll: Loop::Locks };

/// Sets the clocks: the fault and the core's frequency as the firmware has it, Hz.
fn start(board: &Board, avoid: bool) -> Result<(Option<ClockFault>, u32), String> {
    board.run(move |chip| {
        let clocks = clock::start(chip.RCC.constrain(), Timer(chip.TIM5), CRYSTAL_HZ, avoid);
        (clocks.fault, clocks.rcc.clocks.sysclk().raw())
    })
}

#[test]
fn the_crystal_makes_168_mhz() {
    let board = Board::new(GOOD);
    let (fault, core_hz) = start(&board, false).expect("no panic");
    assert!(fault.is_none());
    let clocks = board.chip(|chip| chip.clocks());
    let (m, n, p) = board.chip(|chip| chip.rcc.loop_factors());
    let pll = clocks.pll.expect("the loop is on");
    let wait_states = board.chip(|chip| chip.flash.wait_states());
    // What, as found, as wanted, where from.
    let table = [
        ("core, as the firmware has it, Hz", core_hz, 168_000_000, "data sheet, features: up to 168 MHz"),
        ("M", m, 4, "RM0090 7.3.2: 1 to 2 MHz at the loop, 2 MHz to limit its jitter"),
        ("N", n, 168, "RM0090 7.3.2: 50 to 432"),
        ("P", p, 2, "RM0090 7.3.2: 2, 4, 6 or 8"),
        ("input of the loop, Hz", pll.input_hz, 2_000_000, "8 MHz / 4"),
        ("oscillator of the loop, Hz", pll.vco_hz, 336_000_000, "RM0090 7.3.2: 100 to 432 MHz"),
        ("core, Hz", clocks.sysclk_hz, 168_000_000, "336 MHz / 2"),
        ("AHB, Hz", clocks.hclk_hz, 168_000_000, "data sheet, general operating conditions: up to 168 MHz"),
        ("APB1, Hz", clocks.pclk1_hz, 42_000_000, "data sheet, general operating conditions: up to 42 MHz"),
        ("APB2, Hz", clocks.pclk2_hz, 84_000_000, "data sheet, general operating conditions: up to 84 MHz"),
        ("wait states", wait_states, 5, "RM0090 3.5.1: 150 to 168 MHz at 2.7 to 3.6 V"),
    ];
    for (what, found, wanted, source) in table {
        assert_eq!(found, wanted, "{what}: {source}");
    }
    assert_eq!(board.chip(|chip| chip.rcc.source()), Source::Loop);
    assert_ne!(board.chip(|chip| chip.rcc.cr()) & CSSON, 0, "nothing watches the crystal");
    assert_eq!(board.log(), []);
    // Nothing was outside its limits at any moment.
    assert_eq!(board.violations(), []);
}

#[test]
fn without_the_crystal_the_internal_oscillator_serves() {
    let dead = Oscillators { crystal_hz: None, ..GOOD };
    let no_loop = Oscillators { pll: Loop::Dead, ..GOOD };
    for (oscillators, avoid, wanted) in
        [(dead, false, ClockFault::Crystal), (no_loop, false, ClockFault::Loop), (GOOD, true, ClockFault::LastRun)]
    {
        let board = Board::new(oscillators);
        let (fault, core_hz) = start(&board, avoid).expect("no panic");
        assert!(fault == Some(wanted), "{oscillators:?}");
        assert_eq!(core_hz, 16_000_000, "{oscillators:?}");
        let (clocks, source, cr) = board.chip(|chip| (chip.clocks(), chip.rcc.source(), chip.rcc.cr()));
        assert_eq!(source, Source::Internal, "{oscillators:?}");
        let found = [clocks.hclk_hz, clocks.pclk1_hz, clocks.pclk2_hz, clocks.timers1_hz];
        assert_eq!(found, [16_000_000; 4], "{oscillators:?}");
        assert_eq!(cr & (CSSON | PLLON), 0, "{oscillators:?}: the crystal is watched, or the loop runs");
        assert_eq!(cr & HSEON, 0, "{oscillators:?}: the crystal's oscillator is left on");
        assert_eq!(board.violations(), [], "{oscillators:?}");
    }
}

/// It is noticed before the loop multiplies it: nothing is beyond its limits on the way.
#[test]
fn another_crystal_ends_in_a_panic_that_the_next_start_knows() {
    for crystal_hz in [4_000_000, 12_000_000, 25_000_000] {
        let board = Board::new(Oscillators { crystal_hz: Some(crystal_hz), ..GOOD });
        let Err(message) = start(&board, false) else { panic!("{crystal_hz} Hz was taken for 8 MHz") };
        assert_eq!(message, "clock: another crystal than 8 MHz", "{crystal_hz} Hz");
        assert!(message.starts_with(clock::PANIC));
        assert_eq!(board.violations(), [], "{crystal_hz} Hz");
    }
}

#[test]
fn the_start_returns_where_the_loop_does_not_lock_on_another_crystal() {
    for crystal_hz in [12_000_000, 16_000_000] {
        let pll = Loop::LocksWithinLimits;
        let board = Board::new(Oscillators { crystal_hz: Some(crystal_hz), pll, ..GOOD });
        match start(&board, false) {
            Ok((fault, core_hz)) => {
                assert!(fault == Some(ClockFault::Loop), "{crystal_hz} Hz");
                assert_eq!(core_hz, 16_000_000, "{crystal_hz} Hz");
            }
            Err(message) => assert_eq!(message, "clock: another crystal than 8 MHz", "{crystal_hz} Hz"),
        }
    }
}

#[test]
fn the_right_crystal_passes_with_every_oscillator_that_the_data_sheet_allows() {
    // The internal oscillator is off by 8 % at the most over its temperatures, the slow one has 17 to 47 kHz.
    for (internal_hz, slow_hz) in [(14_720_000, 47_000), (17_280_000, 47_000), (16_000_000, 17_000)] {
        let board = Board::new(Oscillators { internal_hz, slow_hz: Some(slow_hz), ..GOOD });
        let (fault, _) = start(&board, false).expect("no panic");
        assert!(fault.is_none(), "{internal_hz} Hz, {slow_hz} Hz");
        assert_eq!(board.log(), [], "{internal_hz} Hz, {slow_hz} Hz");
    }
}

#[test]
fn a_crystal_that_nothing_was_compared_with_is_reported() {
    let board = Board::new(Oscillators { slow_hz: None, ..GOOD });
    let (fault, core_hz) = start(&board, false).expect("no panic");
    assert!(fault == Some(ClockFault::Slow));
    assert_eq!(core_hz, 168_000_000);
    assert_ne!(board.chip(|chip| chip.rcc.cr()) & CSSON, 0);
}

/// A firmware that runs at 1 kHz after its start: the interrupt takes captures as soon as there are any, the tick compares.
struct Running<'a> {
    board: &'a Board,
    clocks: Clocks,
    /// Faults that were reported.
    faults: std::cell::RefCell<Vec<ClockFault>>,
}

impl<'a> Running<'a> {
    fn new(board: &'a Board, avoid: bool) -> Self {
        let clocks = board
            .run(|chip| clock::start(chip.RCC.constrain(), Timer(chip.TIM5), CRYSTAL_HZ, avoid))
            .expect("no panic");
        Self { board, clocks, faults: std::cell::RefCell::default() }
    }

    /// Ticks for `ms` of the core's clock as it should be; the milliseconds in which nothing could be enabled.
    fn ticks(&mut self, ms: u32) -> Vec<u32> {
        (0..ms).filter(|_| self.tick().is_some()).collect()
    }

    fn tick(&mut self) -> Option<Cause> {
        let cycles = self.clocks.rcc.clocks.hclk().raw() / 1000;
        // The interrupt comes within a tenth of a tick; a capture takes 170 us at least.
        for _ in 0..10 {
            self.board.chip(|chip| chip.wait_cycles(cycles / 10));
            if self.is_pending() {
                self.clocks.captures.take();
            }
        }
        self.clocks.watch.check(1000.0, |fault| {
            self.faults.borrow_mut().push(fault);
            Some(Cause::Clock)
        })
    }

    /// CC4IF and CC4IE.
    fn is_pending(&self) -> bool {
        self.board.chip(|chip| chip.peek(0x4000_0c10) & chip.peek(0x4000_0c0c) & 1 << 4 != 0)
    }
}

#[test]
fn clocks_that_drift_or_stop_while_they_run_are_noticed() {
    let board = Board::new(GOOD);
    let mut running = Running::new(&board, false);
    for (crystal_hz, slow_hz, wanted) in [
        (10_000_000, Some(32_000), Some(ClockFault::Drift)),
        (6_000_000, Some(32_000), Some(ClockFault::Drift)),
        (8_000_000, Some(42_000), Some(ClockFault::Drift)),
        (8_000_000, Some(24_000), Some(ClockFault::Drift)),
        (8_000_000, None, Some(ClockFault::Slow)),
        // As a slow oscillator of a sister family drifts between 0 and 85 degrees, and the crystal by more than any does.
        (8_000_000, Some(28_800), None),
        (8_000_000, Some(35_200), None),
        (8_001_000, Some(32_000), None),
    ] {
        let case = format!("{crystal_hz} Hz, {slow_hz:?} Hz");
        let change = |crystal_hz, slow_hz| {
            board.chip(|chip| {
                chip.rcc.oscillators.crystal_hz = Some(crystal_hz);
                chip.change_slow(slow_hz);
            });
        };
        // What is latched stays; what the clocks do now is another thing.
        change(8_000_000, Some(32_000));
        running.ticks(50);
        assert_eq!(running.ticks(150), [], "{case}: healthy before");
        running.faults.take();
        change(crystal_hz, slow_hz);
        let refused = running.ticks(200);
        let faults = running.faults.take();
        match (wanted, refused.first()) {
            // Within a tenth of a second, and from then on.
            (Some(fault), Some(&first)) => {
                assert!(first <= 101, "{case}: only after {first} ms");
                assert!(refused.len() as u32 == 200 - first && faults == [fault], "{case}");
            }
            (None, None) => {}
            _ => panic!("{case}: refused in {} ticks", refused.len()),
        }
    }
}

#[test]
fn a_slow_oscillator_is_watched_on_the_internal_one_as_well() {
    let board = Board::new(Oscillators { crystal_hz: None, slow_hz: Some(17_000), ..GOOD });
    let mut running = Running::new(&board, false);
    assert_eq!(running.ticks(200), []);
    board.chip(|chip| chip.change_slow(None));
    // A tenth of a second after the last measurement, which takes 7.5 ms.
    assert!((99..=108).contains(&running.ticks(200).len()));
}

#[test]
fn without_a_slow_oscillator_there_is_no_watchdog_and_nothing_is_enabled() {
    let board = Board::new(Oscillators { slow_hz: None, ..GOOD });
    let mut running = Running::new(&board, false);
    assert_eq!(running.ticks(50).len(), 50);
}

/// Erasing the flash holds up ticks and interrupts for a second; the captures that were missed are no drift.
#[test]
fn captures_that_are_missed_are_no_drift() {
    let board = Board::new(GOOD);
    let mut running = Running::new(&board, false);
    for pause_ns in [200_000, 700_000, 3_000_000, 800_000_000] {
        assert_eq!(running.ticks(37), []);
        board.chip(|chip| chip.wait_ns(pause_ns));
        assert_eq!(running.ticks(120), [], "{pause_ns} ns");
    }
}

/// The clocks of an STM32G4, whose crystal has 24 MHz: the fault, and the core as the firmware has it, Hz.
fn start_g4(board: &Board, avoid: bool) -> Result<(Option<g4::ClockFault>, u32), String> {
    board.run(|_| {
        let chip = Chip::take();
        let clocks = g4::start(chip.rcc, chip.timer, nucleo_g474re::CRYSTAL_HZ, avoid);
        (clocks.fault, clocks.rcc.core_hz)
    })
}

const GOOD_G4: Oscillators = Oscillators { crystal_hz: Some(24_000_000), ..GOOD };

#[test]
fn the_crystal_of_the_other_chip_makes_170_mhz() {
    // The internal oscillator is off by 1 % at the most, the slow one has 29 to 34 kHz; they pass by far more.
    for (internal_hz, slow_hz) in [(16_000_000, 32_000), (15_000_000, 34_000), (17_000_000, 29_000)] {
        let board = Board::with(Family::G4, Oscillators { internal_hz, slow_hz: Some(slow_hz), ..GOOD_G4 });
        let (fault, core_hz) = start_g4(&board, false).expect("no panic");
        assert!(fault.is_none() && core_hz == 170_000_000);
        let (clocks, factors) = board.chip(|chip| (chip.clocks(), chip.rcc.loop_factors()));
        // RM0440 7.4.4: 4 MHz at the loop, where it needs 2.66 to 16, and 340 MHz, where it makes 96 to 344.
        assert_eq!(factors, (6, 85, 2));
        assert_eq!([clocks.hclk_hz, clocks.pclk1_hz, clocks.pclk2_hz, clocks.timers1_hz], [170_000_000; 4]);
        assert_eq!(board.chip(|chip| chip.flash_g4.wait_states()), 4);
        assert_ne!(board.chip(|chip| chip.rcc.cr()) & CSSON, 0, "nothing watches the crystal");
        assert_eq!((board.log(), board.violations()), (vec![], vec![]));
    }
}

#[test]
fn without_its_crystal_the_other_chip_runs_on_its_internal_oscillator() {
    let dead = Oscillators { crystal_hz: None, ..GOOD_G4 };
    let no_loop = Oscillators { pll: Loop::Dead, ..GOOD_G4 };
    for (oscillators, avoid, wanted) in [
        (dead, false, g4::ClockFault::Crystal),
        (no_loop, false, g4::ClockFault::Loop),
        (GOOD_G4, true, g4::ClockFault::LastRun),
    ] {
        let board = Board::with(Family::G4, oscillators);
        let (fault, core_hz) = start_g4(&board, avoid).expect("no panic");
        assert!(fault == Some(wanted) && core_hz == 16_000_000, "{oscillators:?}");
        let (clocks, source, cr) = board.chip(|chip| (chip.clocks(), chip.rcc.source(), chip.rcc.cr()));
        assert_eq!((source, clocks.hclk_hz), (Source::Internal, 16_000_000), "{oscillators:?}");
        assert_eq!(cr & (CSSON | PLLON | HSEON), 0, "{oscillators:?}");
        assert_eq!(board.violations(), [], "{oscillators:?}");
    }
    for crystal_hz in [8_000_000, 16_000_000, 48_000_000] {
        let board = Board::with(Family::G4, Oscillators { crystal_hz: Some(crystal_hz), ..GOOD_G4 });
        let Err(message) = start_g4(&board, false) else { panic!("{crystal_hz} Hz was taken for 24 MHz") };
        assert_eq!(message, "clock: another crystal than 24 MHz", "{crystal_hz} Hz");
    }
}

/// Its timer captures on another channel.
#[test]
fn clocks_of_the_other_chip_that_drift_or_stop_are_noticed() {
    for (slow_hz, wanted) in [(Some(42_000), Some("Drift")), (None, Some("Slow")), (Some(33_000), None)] {
        let board = Board::with(Family::G4, GOOD_G4);
        let chip = Chip::take();
        let mut clocks = g4::start(chip.rcc, chip.timer, nucleo_g474re::CRYSTAL_HZ, false);
        let refused = std::cell::RefCell::new(None);
        let mut ticks = |ms: u32| {
            (0..ms)
                .filter(|_| {
                    for _ in 0..10 {
                        board.chip(|chip| chip.wait_ns(100_000));
                        // CC1IF and CC1IE.
                        if board.chip(|chip| chip.peek(0x4000_0c10) & chip.peek(0x4000_0c0c) & 1 << 1 != 0) {
                            clocks.captures.take();
                        }
                    }
                    let cause = clocks.watch.check(1000.0, |fault| {
                        refused.replace(Some(format!("{fault:?}")));
                        Some(Cause::Clock)
                    });
                    cause.is_some()
                })
                .count()
        };
        assert_eq!(ticks(150), 0, "healthy before");
        board.chip(|chip| chip.change_slow(slow_hz));
        let found = ticks(200);
        assert_eq!(refused.take().as_deref(), wanted, "{slow_hz:?}");
        assert!(found >= 99 || wanted.is_none(), "{slow_hz:?}: {found} ticks");
    }
}
