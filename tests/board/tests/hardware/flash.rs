//! `firmware/src/g4/flash.rs`: erasing and writing the slots of the parameters, beneath their store.

use board_on_host::board::Board;
use board_on_host::chip::family::Family;
use board_on_host::chip::flash::{Flash, START};
use board_on_host::chip::rcc::Oscillators;
use board_on_host::chip::violation::Violation;
use board_on_host::g4::family::flash::{ParameterFlash, forgives};
use board_on_host::g4::family::pac::FLASH;
use board_on_host::g4::nucleo_g474re::{CONVERTERS, ID};
use dea_driver::{BLOB_LEN, Blob, Store, StoreError};

use super::kinds::Nucleo;
use super::promises::parameters;

fn board() -> Board {
    Board::with(Family::G4, Oscillators::default())
}

fn store() -> Store<ParameterFlash> {
    Store::with_converters(ParameterFlash::new(FLASH), ID, CONVERTERS).expect("room for two slots")
}

#[test]
fn parameters_are_kept_and_their_words_are_written_once() {
    let board = board();
    assert!(matches!(store().load(), Err(StoreError::Empty(None))));
    let mut bytes = [0; BLOB_LEN];
    for max_voltage_v in [5000.0, 4000.0, 3000.0] {
        let mut parameters = parameters::<Nucleo>();
        parameters.limits.max_voltage_v = max_voltage_v;
        let length = parameters.encode(ID, &mut bytes).expect("kept by these converters");
        board.chip(|_| ());
        store().save(&bytes[..length]).expect("a flash in order");
        board.chip(|_| ());
        let stored = store().load().expect("saved");
        assert_eq!((stored.blob.parameters(), stored.newer_lost), (&parameters, false));
    }
    // The first save writes both slots, the others one each: locked afterwards, no word written twice, nothing in a wrong order.
    assert_eq!(board.violations(), []);
    assert_eq!(board.chip(|chip| chip.peek(0x4002_2014) >> 31), 1);
}

#[test]
fn a_flash_that_fails_is_noticed() {
    let mut bytes = [0; BLOB_LEN];
    let length = parameters::<Nucleo>().encode(ID, &mut bytes).expect("kept by these converters");
    assert!(Blob::decode(&bytes[..length], ID).is_ok());
    let spoils: [fn(&mut Flash); 2] =
        [|flash| flash.is_worn = true, |flash| flash.registers[Flash::OPTR] &= !Flash::TWO_BANKS];
    for spoil in spoils {
        let board = board();
        board.chip(|chip| spoil(&mut chip.flash_g4));
        assert!(matches!(store().save(&bytes[..length]), Err(StoreError::Flash(_))));
    }
}

/// A word that was cut off while it was written is one of the second bank, and the crystal is in order.
#[test]
fn only_a_word_of_the_parameters_is_forgiven() {
    const ECCR: u32 = 0x4002_2018;
    for (errors, stopped, forgiven) in
        [(1 << 31 | 1 << 21, 0, true), (1 << 31, 0, false), (1 << 31 | 1 << 21, 1 << 8, false), (0, 1 << 8, false)]
    {
        let board = board();
        board.chip(|chip| {
            chip.flash_g4.registers[0x18] = errors;
            // CIFR.
            chip.write(0x4002_101c, stopped);
        });
        assert_eq!(forgives(), forgiven, "{errors:#x}, {stopped:#x}");
        assert_eq!(board.chip(|chip| chip.peek(ECCR)) >> 31 == 0, forgiven || errors == 0);
    }
}

/// The model finds what it is there to find: a locked flash, a word that is written again.
#[test]
fn the_model_keeps_the_order() {
    let board = board();
    let write = |address: u32, value: u32| board.chip(|chip| chip.write(address, value));
    write(START, 1);
    write(0x4002_2014, 1);
    assert_eq!(board.violations(), [START, 0x4002_2014].map(|address| Violation::FlashOrder { address }));
    write(0x4002_2008, 0x4567_0123);
    write(0x4002_2008, 0xcdef_89ab);
    write(0x4002_2014, 1);
    for _ in 0..2 {
        board.chip(|chip| chip.wait_ns(1_000_000));
        write(START, 1);
        write(START + 4, 2);
    }
    // PROGERR.
    assert_eq!(board.chip(|chip| chip.peek(0x4002_2010)) & 1 << 3, 1 << 3);
}
