//! `firmware/src/f4/reset.rs`: which cause is latched after which reset, and what the option bytes leave out.

use board_on_host::board::Board;
use board_on_host::chip::memory::Memory;
use board_on_host::chip::rcc::{Oscillators, reset_flag};
use board_on_host::f4::family::reset;
use board_on_host::log::Level;
use board_on_host::panic::Message;
use dea_driver::Cause;

/// The cause after a reset with these flags, and the flags that are left.
fn cause_after(flags: u32, message: &str) -> (Option<Cause>, u32) {
    let board = Board::new(Oscillators::default());
    board.chip(|chip| chip.rcc.set_reset_flags(flags));
    let cause = reset::cause(&board.peripherals().RCC, &Message(message.to_owned()));
    (cause, board.chip(|chip| chip.rcc.reset_flags()))
}

#[test]
fn every_reset_has_its_cause() {
    use reset_flag::{BROWN_OUT, INDEPENDENT_WATCHDOG, LOW_POWER, PIN, POWER, SOFTWARE, WINDOW_WATCHDOG};
    // RM0090 section 7.1.1: every source but a brown-out pulls the pin low, and power-up sets the brown-out's flag as well.
    let table = [
        ("power-up", POWER | PIN | BROWN_OUT, None),
        ("an emulator", 0, None),
        ("pin", PIN, Some(Cause::Reset)),
        ("software", SOFTWARE | PIN, Some(Cause::Reset)),
        ("standby", LOW_POWER | PIN, Some(Cause::Reset)),
        ("independent watchdog", INDEPENDENT_WATCHDOG | PIN, Some(Cause::Watchdog)),
        ("window watchdog", WINDOW_WATCHDOG | PIN, Some(Cause::Watchdog)),
        ("brown-out", BROWN_OUT | PIN, Some(Cause::BrownOut)),
        ("watchdog while the supply dips", INDEPENDENT_WATCHDOG | BROWN_OUT | PIN, Some(Cause::Watchdog)),
    ];
    for (what, flags, wanted) in table {
        assert_eq!(cause_after(flags, ""), (wanted, 0), "{what}");
    }
}

#[test]
fn only_switching_on_starts_without_a_cause() {
    for flags in (0..128).map(|flags| flags << 25) {
        let (cause, left) = cause_after(flags, "");
        assert_eq!(left, 0, "{flags:#x} is left for the next start");
        let switched_on = flags & reset_flag::POWER != 0 || flags == 0;
        let watchdog = flags & (reset_flag::INDEPENDENT_WATCHDOG | reset_flag::WINDOW_WATCHDOG) != 0;
        assert_eq!(cause == Some(Cause::Watchdog), watchdog, "{flags:#x}");
        assert_eq!(cause.is_none(), switched_on && !watchdog, "{flags:#x}");
    }
}

#[test]
fn a_panic_is_the_cause_and_its_message_is_logged() {
    let board = Board::new(Oscillators::default());
    board.chip(|chip| chip.rcc.set_reset_flags(reset_flag::SOFTWARE | reset_flag::PIN));
    let message = Message(String::from("clock: the crystal has stopped"));
    assert_eq!(reset::cause(&board.peripherals().RCC, &message), Some(Cause::Panic));
    assert_eq!(board.chip(|chip| chip.rcc.reset_flags()), 0);
    let log = board.log();
    assert!(matches!(&log[..], [(Level::Error, text)] if text.contains("the crystal has stopped")), "{log:?}");
}

#[test]
fn option_bytes_that_protect_nothing_are_latched() {
    let watchdog = (Memory::WATCHDOG_BY_SOFTWARE, "WDG_SW");
    let brown_out = (Memory::BROWN_OUT_OFF, "BOR_LEV");
    for set in [vec![], vec![watchdog], vec![brown_out], vec![watchdog, brown_out], vec![(0b01 << 2, "BOR_LEV")]] {
        let board = Board::new(Oscillators::default());
        if set.len() == 2 {
            assert_eq!(board.chip(|chip| chip.flash.registers[Memory::OPTCR]) & 0x2c, 0x2c, "as delivered");
        }
        board.chip(|chip| {
            chip.flash.registers[Memory::OPTCR] &= !(Memory::WATCHDOG_BY_SOFTWARE | Memory::BROWN_OUT_OFF);
            chip.flash.registers[Memory::OPTCR] |= set.iter().fold(0, |bits, (bit, _)| bits | bit);
        });
        let cause = reset::check_option_bytes(&board.peripherals().FLASH);
        assert_eq!(cause, (!set.is_empty()).then_some(Cause::OptionBytes));
        let log = board.log();
        assert_eq!(log.len(), set.len());
        for ((level, text), (_, name)) in log.iter().zip(&set) {
            assert!(*level == Level::Warning && text.contains(name), "{text}");
        }
    }
}
