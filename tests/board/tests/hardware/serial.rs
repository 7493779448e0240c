//! `firmware/src/f4/serial.rs`: the link's line, at both clocks of the core.

use board_on_host::board::Board;
use board_on_host::chip::rcc::Oscillators;
use board_on_host::chip::usart::flag;
use board_on_host::f4::family::serial::{open, received};
use board_on_host::g4::family::{Chip, serial as g4};
use board_on_host::g4::nucleo_g474re;
use board_on_host::hal::hal_02::serial::Write;
use board_on_host::hal::pac::USART2;
use board_on_host::hal::prelude::*;
use board_on_host::hal::rcc::Config;
use board_on_host::hal::serial::Serial;
use dea_driver::wire::BAUD;

use super::kinds::{Nucleo, board_of};
use super::start::{CLOCKS, crystal, set_g4};

fn port(board: &Board, config: Config) -> Serial<USART2> {
    let chip = board.peripherals();
    let mut rcc = chip.RCC.freeze(config);
    let port_a = chip.GPIOA.split(&mut rcc);
    match open(chip.USART2, (port_a.pa2, port_a.pa3), &mut rcc) {
        Ok(serial) => serial,
        Err(_) => panic!("the clock is too slow for the link"),
    }
}

#[test]
fn the_baud_rate_is_what_the_host_expects() {
    for config in [Config::hsi(), crystal()] {
        let board = Board::new(Oscillators::default());
        let _port = port(&board, config);
        let (baud, cr1) = board.chip(|chip| (chip.usart2.baud(chip.clocks().pclk1_hz), chip.usart2.cr1()));
        // Ten bits, sampled in their middles: both ends together may be off by 5 %; the adapter has 1 % of it, the oscillator more.
        let off = baud / f64::from(BAUD) - 1.0;
        assert!(off.abs() < 0.01, "{baud} baud");
        // RM0090 section 30.6.4: enabled, eight bits, no parity, an interrupt for every byte.
        let (enabled, nine_bits, parity, interrupt, both_ways) = (1 << 13, 1 << 12, 1 << 10, 1 << 5, 0b11 << 2);
        assert_eq!(cr1 & (enabled | nine_bits | parity | interrupt | both_ways), enabled | interrupt | both_ways);
    }
}

#[test]
fn bytes_come_and_go() {
    let board = Board::new(Oscillators::default());
    let mut port = port(&board, crystal());
    assert_eq!(received(&mut port), None);
    board.chip(|chip| chip.usart2.hear(0x5a, 0));
    assert_eq!([received(&mut port), received(&mut port)], [Some(0x5a), None]);
    for byte in 0..4 {
        while Write::write(&mut port, byte).is_err() {}
    }
    board.chip(|chip| chip.wait_ns(100_000));
    let sent = board.chip(|chip| chip.usart2.sent.clone());
    assert_eq!(sent.iter().map(|&(_, byte)| byte).collect::<Vec<_>>(), [0, 1, 2, 3]);
    // Ten bits to a byte.
    let byte_us = (sent[3].0 - sent[2].0) as f64 * 1e-6;
    assert!((byte_us / (10e6 / f64::from(BAUD)) - 1.0).abs() < 0.01, "{byte_us} µs");
    assert_eq!(board.violations(), []);
}

#[test]
fn a_byte_that_the_line_complains_of_is_left_to_the_checksum() {
    let board = Board::new(Oscillators::default());
    let mut port = port(&board, Config::hsi());
    for errors in [flag::NOISE, flag::FRAMING, flag::PARITY] {
        board.chip(|chip| chip.usart2.hear(0x17, errors));
        assert_eq!([received(&mut port), received(&mut port)], [Some(0x17), None], "{errors:#x}");
    }
    // Two bytes before the first was taken: the first stays.
    board.chip(|chip| [1, 2].into_iter().for_each(|byte| chip.usart2.hear(byte, 0)));
    assert_eq!([received(&mut port), received(&mut port)], [Some(1), None]);
}

#[test]
fn a_complaint_without_a_byte_does_not_come_again() {
    let board = Board::new(Oscillators::default());
    let mut port = port(&board, Config::hsi());
    for errors in [flag::OVERRUN, flag::NOISE, flag::FRAMING] {
        board.chip(|chip| chip.usart2.complain(errors));
        assert_eq!(received(&mut port), None);
        // A flag that stays would interrupt for ever.
        let status = board.peripherals().USART2.sr().read().bits();
        assert_eq!(u32::from(status) & errors, 0, "{errors:#x}");
        board.chip(|chip| chip.usart2.hear(0x17, 0));
        assert_eq!(received(&mut port), Some(0x17), "{errors:#x}");
    }
}

/// The other chip's port has one register for what came and one for what goes, and one that clears complaints.
#[test]
fn the_port_of_the_other_chip_does_the_same() {
    for core in CLOCKS {
        let board = board_of::<Nucleo>().0;
        let mut rcc = set_g4(core);
        let chip = Chip::take();
        let (_, link, _) = nucleo_g474re::start(chip.parts, &mut rcc);
        let Ok(mut port) = g4::open(chip.usart, link, &mut rcc) else { panic!("the clock is too slow for the link") };
        let (baud, cr1) = board.chip(|chip| (chip.usart2.baud(chip.clocks().pclk1_hz), chip.usart2.cr1()));
        assert!((baud / f64::from(BAUD) - 1.0).abs() < 0.01, "{baud} baud");
        // RM0440 section 37.8.1: enabled, both ways, an interrupt for every byte; eight bits, no parity.
        assert_eq!(cr1, 1 << 0 | 0b11 << 2 | 1 << 5);
        for errors in [0, flag::NOISE, flag::FRAMING, flag::PARITY] {
            board.chip(|chip| chip.usart2.hear(0x17, errors));
            assert_eq!([g4::received(&mut port), g4::received(&mut port)], [Some(0x17), None], "{errors:#x}");
        }
        board.chip(|chip| [1, 2].into_iter().for_each(|byte| chip.usart2.hear(byte, 0)));
        assert_eq!((g4::received(&mut port), g4::received(&mut port)), (Some(1), None));
        board.chip(|chip| chip.usart2.complain(flag::NOISE));
        assert_eq!(g4::received(&mut port), None);
        assert_eq!(board.chip(|chip| chip.peek(0x4000_441c)) & 0b1111, 0, "a flag that stays would interrupt for ever");
        for byte in 0..4 {
            g4::send(&mut port, || Some(byte));
            assert_ne!(board.chip(|chip| chip.usart2.cr1()) & 1 << 7, 0);
            board.chip(|chip| chip.wait_ns(30_000));
        }
        g4::send(&mut port, || None);
        assert_eq!(board.chip(|chip| chip.usart2.cr1()) & 1 << 7, 0);
        let sent = board.chip(|chip| chip.usart2.sent.clone());
        assert_eq!(sent.iter().map(|&(_, byte)| byte).collect::<Vec<_>>(), [0, 1, 2, 3]);
        assert_eq!(board.violations(), []);
    }
}
