//! `firmware/src/f4/reset.rs`: which cause is latched after which reset, and what the option bytes leave out.

use board_on_host::board::Board;
use board_on_host::chip::family::Family;
use board_on_host::chip::flash::Flash;
use board_on_host::chip::memory::Memory;
use board_on_host::chip::rcc::{Oscillators, reset_flag};
use board_on_host::f4::family::reset;
use board_on_host::g4::family::{self as g4, Chip};
use board_on_host::log::{Level, Line};
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

/// Asserts that the firmware has warned of these option bytes, and of nothing else.
fn warns<'a>(board: &Board, names: impl Iterator<Item = &'a str>) {
    let (log, names): (_, Vec<&str>) = (board.log(), names.collect());
    let is_warning = |((level, text), name): (&Line, &&str)| *level == Level::Warning && text.contains(name);
    assert!(log.len() == names.len() && log.iter().zip(&names).all(is_warning), "{names:?}: {log:?}");
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
        warns(&board, set.iter().map(|(_, name)| *name));
    }
}

/// The same on an STM32G4, which has one flag for a supply that comes and one that dips.
#[test]
fn every_reset_of_the_other_chip_has_its_cause() {
    let (option_bytes, pin, supply) = (1 << 25, 1 << 26, 1 << 27);
    for flags in (0..128).map(|flags: u32| flags << 25) {
        let board = Board::with(Family::G4, Oscillators::default());
        board.chip(|chip| chip.rcc.set_reset_flags(flags));
        let cause = g4::reset::cause(&Chip::take().rcc, &Message(String::new()));
        let others = option_bytes | pin | reset_flag::SOFTWARE | reset_flag::LOW_POWER;
        let wanted = match flags {
            _ if flags & (reset_flag::INDEPENDENT_WATCHDOG | reset_flag::WINDOW_WATCHDOG) != 0 => Some(Cause::Watchdog),
            _ if flags & supply != 0 => None,
            _ => (flags & others != 0).then_some(Cause::Reset),
        };
        assert_eq!((cause, board.chip(|chip| chip.rcc.reset_flags())), (wanted, 0), "{flags:#x}");
    }
}

/// As delivered, and as the page asks for.
#[test]
fn option_bytes_of_the_other_chip_are_latched() {
    let safe = Flash::TWO_BANKS | 4 << 8;
    for (options, names) in [
        (safe, &[] as &[&str]),
        (safe | Flash::WATCHDOG_BY_SOFTWARE, &["IWDG_SW"]),
        (Flash::TWO_BANKS | 3 << 8, &["BOR_LEV"]),
        (4 << 8, &["DBANK"]),
        (0xffef_f8aa, &["IWDG_SW", "BOR_LEV"]),
    ] {
        let board = Board::with(Family::G4, Oscillators::default());
        board.chip(|chip| chip.flash_g4.registers[Flash::OPTR] = options);
        let cause = g4::reset::check_option_bytes(&g4::pac::FLASH);
        assert_eq!(cause, (!names.is_empty()).then_some(Cause::OptionBytes), "{options:#x}");
        warns(&board, names.iter().copied());
    }
}
