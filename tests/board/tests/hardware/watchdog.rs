//! `firmware/src/watchdog.rs`: how long it waits, on both families of chips.

use board_on_host::board::Board;
use board_on_host::chip::family::Family;
use board_on_host::chip::rcc::Oscillators;
use board_on_host::chip::violation::Violation;
use board_on_host::watchdog::Watchdog;

/// Time until it expires, ns.
fn left_ns(board: &Board) -> Option<u64> {
    board.chip(|chip| Some(chip.watchdog.expires_ns()? - chip.now_ns()))
}

#[test]
fn it_waits_as_long_as_it_is_told_to() {
    for family in [Family::F4, Family::G4] {
        let board = Board::with(family, Oscillators::default());
        let mut watchdog = Watchdog::take();
        assert_eq!(left_ns(&board), None);
        // As the application does: from tick to tick, and for as long as the flash is written; to and fro at once.
        for ms in [50, 4000, 50, 1, 100, 10_000, 32_000, 50] {
            watchdog.wait_for(ms);
            let found_ms = left_ns(&board).expect("started") as f64 * 1e-6;
            // A count of the coarsest divider is 8 ms.
            assert!((f64::from(ms) - found_ms).abs() <= f64::from(ms) * 1e-3 + 0.1, "{ms} ms: {found_ms} ms");
        }
        board.chip(|chip| chip.wait_ns(40_000_000));
        assert!(left_ns(&board).is_some_and(|ns| ns < 11_000_000));
        watchdog.feed();
        assert!(left_ns(&board).is_some_and(|ns| (49_900_000..=50_000_000).contains(&ns)));
        assert_eq!(board.violations(), []);
    }
}

#[test]
fn its_model_takes_settings_only_when_it_is_open_and_has_time() {
    let board = Board::new(Oscillators::default());
    let write = |address: u32, value: u32| board.chip(|chip| chip.write(address, value));
    write(0x4000_3008, 99);
    assert_eq!(board.violations(), [Violation::WatchdogNotSet]);
    write(0x4000_3000, 0x5555);
    write(0x4000_3008, 99);
    assert_eq!(board.chip(|chip| (chip.peek(0x4000_3008), chip.peek(0x4000_300c))), (0xfff, 0b10));
    board.chip(|chip| chip.wait_ns(200_000));
    assert_eq!(board.chip(|chip| (chip.peek(0x4000_3008), chip.peek(0x4000_300c))), (99, 0));
}
