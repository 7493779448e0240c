//! `firmware/src/clock.rs` on both families of chips: the clocks that it makes, and what it does where it cannot.

use std::cell::RefCell;

use board_on_host::board::Board;
use board_on_host::chip::clocks::Source;
use board_on_host::chip::family::Family;
use board_on_host::chip::rcc::{CSSON, HSEON, Loop, Oscillators, PLLON};
use board_on_host::f4::clock;
use board_on_host::f4::family::tree::Timer;
use board_on_host::f4::stm32_h405::CRYSTAL_HZ;
use board_on_host::g4::family::Chip;
use board_on_host::g4::{clock as g4, nucleo_g474re};
use board_on_host::hal::rcc::RccExt;
use dea_driver::Cause;

/// The clocks that were set, and what the firmware does with them while it runs.
struct Set {
    fault: Option<String>,
    /// The core's frequency as the firmware has it.
    core_hz: u32,
    /// The interrupt of the timer takes a capture.
    take: Box<dyn FnMut()>,
    /// A tick compares the clocks, and adds the faults that it reports: whether something may be enabled.
    check: Box<dyn FnMut(&Faults) -> bool>,
}

type Faults = RefCell<Vec<String>>;

/// The clocks as a family's module has set them, whose types are its own.
macro_rules! set {
    ($clocks:ident = $start:expr, $core_hz:expr) => {{
        let mut $clocks = $start;
        let (fault, core_hz) = ($clocks.fault.map(|fault| format!("{fault:?}")), $core_hz);
        let check = move |faults: &Faults| {
            let report = |fault| {
                faults.borrow_mut().push(format!("{fault:?}"));
                Some(Cause::Clock)
            };
            $clocks.watch.check(1000.0, report).is_none()
        };
        Set { fault, core_hz, take: Box::new(move || $clocks.captures.take()), check: Box::new(check) }
    }};
}

const FAMILIES: [Family; 2] = [Family::F4, Family::G4];

fn crystal_hz(family: Family) -> u32 {
    if family == Family::F4 { CRYSTAL_HZ } else { nucleo_g474re::CRYSTAL_HZ }
}

/// A board whose oscillators have a change.
fn board(family: Family, change: impl FnOnce(&mut Oscillators)) -> Board {
    let mut oscillators = Oscillators { crystal_hz: Some(crystal_hz(family)), ..Oscillators::default() };
    change(&mut oscillators);
    Board::with(family, oscillators)
}

fn start(family: Family, board: &Board, avoid: bool) -> Result<Set, String> {
    board.run(|chip| match family {
        Family::F4 => set!(
            clocks = clock::start(chip.RCC.constrain(), Timer(chip.TIM5), CRYSTAL_HZ, avoid),
            clocks.rcc.clocks.sysclk().raw()
        ),
        Family::G4 => {
            let chip = Chip::take();
            let hz = nucleo_g474re::CRYSTAL_HZ;
            set!(clocks = g4::start(chip.rcc, chip.timer, hz, avoid), clocks.rcc.core_hz)
        }
    })
}

/// The fault, and the core's frequency as the firmware has it, Hz.
fn starts(family: Family, board: &Board) -> (Option<String>, u32) {
    let Set { fault, core_hz, .. } = start(family, board, false).expect("no panic");
    (fault, core_hz)
}

#[test]
fn the_crystal_makes_168_mhz() {
    let board = board(Family::F4, |_| ());
    let (fault, core_hz) = starts(Family::F4, &board);
    assert_eq!(fault, None);
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
    type Spoil = fn(&mut Oscillators);
    let faults: [(&str, Spoil, bool); 3] = [
        ("Crystal", |oscillators| oscillators.crystal_hz = None, false),
        ("Loop", |oscillators| oscillators.pll = Loop::Dead, false),
        ("LastRun", |_| (), true),
    ];
    for (family, (wanted, spoil, avoid)) in FAMILIES.into_iter().flat_map(|family| faults.map(|fault| (family, fault)))
    {
        let case = format!("{family:?}, {wanted}");
        let board = board(family, spoil);
        let Set { fault, core_hz, .. } = start(family, &board, avoid).expect("no panic");
        assert_eq!((fault.as_deref(), core_hz), (Some(wanted), 16_000_000), "{case}");
        let (clocks, source, cr) = board.chip(|chip| (chip.clocks(), chip.rcc.source(), chip.rcc.cr()));
        assert_eq!(source, Source::Internal, "{case}");
        let found = [clocks.hclk_hz, clocks.pclk1_hz, clocks.pclk2_hz, clocks.timers1_hz];
        assert_eq!(found, [16_000_000; 4], "{case}");
        assert_eq!(cr & (CSSON | PLLON), 0, "{case}: the crystal is watched, or the loop runs");
        assert_eq!(cr & HSEON, 0, "{case}: the crystal's oscillator is left on");
        assert_eq!(board.violations(), [], "{case}");
    }
}

/// It is noticed before the loop multiplies it: nothing is beyond its limits on the way.
#[test]
fn another_crystal_ends_in_a_panic_that_the_next_start_knows() {
    for (family, others_mhz) in [(Family::F4, [4, 12, 25]), (Family::G4, [8, 16, 48])] {
        for mhz in others_mhz {
            let board = board(family, |oscillators| oscillators.crystal_hz = Some(mhz * 1_000_000));
            let Err(message) = start(family, &board, false) else { panic!("{mhz} MHz was taken for another") };
            assert_eq!(
                message,
                format!("clock: another crystal than {} MHz", crystal_hz(family) / 1_000_000),
                "{mhz} MHz"
            );
            assert!(message.starts_with(clock::PANIC));
            // The core itself is slow enough for its flash up to 34 MHz.
            assert!(board.violations().is_empty() || mhz > 34, "{mhz} MHz: {:?}", board.violations());
        }
    }
}

#[test]
fn the_start_returns_where_the_loop_does_not_lock_on_another_crystal() {
    for crystal_hz in [12_000_000, 16_000_000] {
        let board = board(Family::F4, |oscillators| {
            (oscillators.crystal_hz, oscillators.pll) = (Some(crystal_hz), Loop::LocksWithinLimits);
        });
        match start(Family::F4, &board, false) {
            Ok(Set { fault, core_hz, .. }) => {
                assert_eq!((fault.as_deref(), core_hz), (Some("Loop"), 16_000_000), "{crystal_hz} Hz");
            }
            Err(message) => assert_eq!(message, "clock: another crystal than 8 MHz", "{crystal_hz} Hz"),
        }
    }
}

#[test]
fn the_right_crystal_passes_with_every_oscillator_that_the_data_sheet_allows() {
    // The internal oscillator is off by 8 % at the most over its temperatures, the slow one has 17 to 47 kHz.
    for (internal_hz, slow_hz) in [(14_720_000, 47_000), (17_280_000, 47_000), (16_000_000, 17_000)] {
        let board = board(Family::F4, |oscillators| {
            (oscillators.internal_hz, oscillators.slow_hz) = (internal_hz, Some(slow_hz));
        });
        assert_eq!(starts(Family::F4, &board).0, None, "{internal_hz} Hz, {slow_hz} Hz");
        assert_eq!(board.log(), [], "{internal_hz} Hz, {slow_hz} Hz");
    }
}

#[test]
fn a_crystal_that_nothing_was_compared_with_is_reported() {
    let board = board(Family::F4, |oscillators| oscillators.slow_hz = None);
    assert_eq!(starts(Family::F4, &board), (Some("Slow".into()), 168_000_000));
    assert_ne!(board.chip(|chip| chip.rcc.cr()) & CSSON, 0);
}

/// A firmware that runs at 1 kHz after its start: the interrupt takes captures as soon as there are any, the tick compares.
struct Running<'a> {
    board: &'a Board,
    clocks: Set,
    /// Faults that were reported.
    faults: Faults,
}

impl<'a> Running<'a> {
    fn new(board: &'a Board, family: Family) -> Self {
        let clocks = start(family, board, false).expect("no panic");
        Self { board, clocks, faults: RefCell::default() }
    }

    /// Ticks for `ms` of the core's clock as it should be; the milliseconds in which nothing could be enabled.
    fn ticks(&mut self, ms: u32) -> Vec<u32> {
        (0..ms).filter(|_| !self.tick()).collect()
    }

    /// Whether something may be enabled.
    fn tick(&mut self) -> bool {
        // The interrupt comes within a tenth of a tick; a capture takes 170 us at least.
        for _ in 0..10 {
            self.board.chip(|chip| chip.wait_cycles(self.clocks.core_hz / 10_000));
            if self.is_pending() {
                (self.clocks.take)();
            }
        }
        (self.clocks.check)(&self.faults)
    }

    /// The flag of a capture, of any channel, and its interrupt.
    fn is_pending(&self) -> bool {
        self.board.chip(|chip| chip.peek(0x4000_0c10) & chip.peek(0x4000_0c0c) & 0b1_1110 != 0)
    }
}

#[test]
fn clocks_that_drift_or_stop_while_they_run_are_noticed() {
    for family in FAMILIES {
        let board = board(family, |_| ());
        let mut running = Running::new(&board, family);
        for (crystal, slow_hz, wanted) in [
            (1.25, Some(32_000), Some("Drift")),
            (0.75, Some(32_000), Some("Drift")),
            (1.0, Some(42_000), Some("Drift")),
            (1.0, Some(24_000), Some("Drift")),
            (1.0, None, Some("Slow")),
            // As a slow oscillator of a sister family drifts between 0 and 85 degrees, and the crystal by more than any does.
            (1.0, Some(28_800), None),
            (1.0, Some(33_000), None),
            (1.0, Some(35_200), None),
            (1.000_125, Some(32_000), None),
        ] {
            let case = format!("{family:?}, {crystal} of the crystal, {slow_hz:?} Hz");
            let change = |crystal: f64, slow_hz| {
                board.chip(|chip| {
                    chip.rcc.oscillators.crystal_hz = Some((crystal * f64::from(crystal_hz(family))) as u32);
                    chip.change_slow(slow_hz);
                });
            };
            // What is latched stays; what the clocks do now is another thing.
            change(1.0, Some(32_000));
            running.ticks(50);
            assert_eq!(running.ticks(150), [], "{case}: healthy before");
            running.faults.take();
            change(crystal, slow_hz);
            let refused = running.ticks(200);
            match (wanted, refused.first()) {
                // Within a tenth of a second, and from then on.
                (Some(fault), Some(&first)) => {
                    assert!(first <= 101, "{case}: only after {first} ms");
                    assert!(refused.len() as u32 == 200 - first && running.faults.take() == [fault], "{case}");
                }
                (None, None) => {}
                _ => panic!("{case}: refused in {} ticks", refused.len()),
            }
        }
    }
}

#[test]
fn a_slow_oscillator_is_watched_on_the_internal_one_as_well() {
    let board = board(Family::F4, |oscillators| (oscillators.crystal_hz, oscillators.slow_hz) = (None, Some(17_000)));
    let mut running = Running::new(&board, Family::F4);
    assert_eq!(running.ticks(200), []);
    board.chip(|chip| chip.change_slow(None));
    // A tenth of a second after the last measurement, which takes 7.5 ms.
    assert!((99..=108).contains(&running.ticks(200).len()));
}

#[test]
fn without_a_slow_oscillator_there_is_no_watchdog_and_nothing_is_enabled() {
    let board = board(Family::F4, |oscillators| oscillators.slow_hz = None);
    let mut running = Running::new(&board, Family::F4);
    assert_eq!(running.ticks(50).len(), 50);
}

/// Erasing the flash holds up ticks and interrupts for a second; the captures that were missed are no drift.
#[test]
fn captures_that_are_missed_are_no_drift() {
    let board = board(Family::F4, |_| ());
    let mut running = Running::new(&board, Family::F4);
    for pause_ns in [200_000, 700_000, 3_000_000, 800_000_000] {
        assert_eq!(running.ticks(37), []);
        board.chip(|chip| chip.wait_ns(pause_ns));
        assert_eq!(running.ticks(120), [], "{pause_ns} ns");
    }
}

#[test]
fn the_crystal_of_the_other_chip_makes_170_mhz() {
    // The internal oscillator is off by 1 % at the most, the slow one has 29 to 34 kHz; they pass by far more.
    for (internal_hz, slow_hz) in [(16_000_000, 32_000), (15_000_000, 34_000), (17_000_000, 29_000)] {
        let board = board(Family::G4, |oscillators| {
            (oscillators.internal_hz, oscillators.slow_hz) = (internal_hz, Some(slow_hz));
        });
        assert_eq!(starts(Family::G4, &board), (None, 170_000_000));
        let (clocks, factors) = board.chip(|chip| (chip.clocks(), chip.rcc.loop_factors()));
        // RM0440 7.4.4: 4 MHz at the loop, where it needs 2.66 to 16, and 340 MHz, where it makes 96 to 344.
        assert_eq!(factors, (6, 85, 2));
        assert_eq!([clocks.hclk_hz, clocks.pclk1_hz, clocks.pclk2_hz, clocks.timers1_hz], [170_000_000; 4]);
        assert_eq!(board.chip(|chip| chip.flash_g4.wait_states()), 4);
        assert_ne!(board.chip(|chip| chip.rcc.cr()) & CSSON, 0, "nothing watches the crystal");
        assert_eq!((board.log(), board.violations()), (vec![], vec![]));
    }
}
