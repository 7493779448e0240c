//! Every pin that the firmware's start sets, against the data sheet and `docs/boards.md`.

use board_on_host::board::Board;
use board_on_host::chip::gpio::{Mode, Pad, Pin, Pull, Speed};
use board_on_host::chip::pads::Signal;
use board_on_host::chip::rcc::Oscillators;

use super::kinds::{Discovery, H405, Kind, Nucleo, board_of, on_every_board};
use super::start::{CLOCKS, Core, start_h405};

const fn pin(port: char, number: u8) -> Pin {
    Pin::new(port, number)
}

/// Purpose and required setting of a pin.
struct Row {
    pin: Pin,
    what: &'static str,
    mode: Mode,
    signal: Option<Signal>,
    pull: Pull,
    /// The lowest that its pad may have.
    speed: Speed,
}

const fn output(pin: Pin, what: &'static str) -> Row {
    Row { pin, what, mode: Mode::Output, signal: None, pull: Pull::None, speed: Speed::Low }
}

/// An output of a block, with the number of its alternate function.
const fn drives(pin: Pin, what: &'static str, function: u8, signal: Signal, speed: Speed) -> Row {
    Row { pin, what, mode: Mode::Alternate(function), signal: Some(signal), pull: Pull::None, speed }
}

/// An input of a block.
const fn hears(pin: Pin, what: &'static str, function: u8, signal: Signal, pull: Pull) -> Row {
    Row { pin, what, mode: Mode::Alternate(function), signal: Some(signal), pull, speed: Speed::Low }
}

/// The pins of a board.
trait Pads: Kind {
    const PINS: &'static [Row];
    /// Outputs beside the enable output, and the levels with which they start.
    const STARTS: &'static [(Pin, bool)];
}

/// Alternate functions by the data sheet. Pads of SPI clocks have the highest speed: the clock comes back from them for the last bit of
/// a byte (errata sheet ES0182). Lines from chips that are not there read 0.
impl Pads for H405 {
    const PINS: &'static [Row] = &[
        output(pin('C', 6), "enable"),
        // A wire that breaks is an open interlock.
        Row { mode: Mode::Input, pull: Pull::Down, ..output(pin('C', 7), "interlock") },
        output(pin('C', 12), "light"),
        #[cfg(feature = "self-sensing")]
        Row { mode: Mode::Analog, ..output(pin('C', 1), "current") },
        output(pin('B', 12), "select of the DAC"),
        drives(pin('B', 13), "clock of the DAC", 5, Signal::Sck(2), Speed::VeryHigh),
        hears(pin('B', 14), "data from the DAC", 5, Signal::Miso(2), Pull::Down),
        drives(pin('B', 15), "data to the DAC", 5, Signal::Mosi(2), Speed::VeryHigh),
        output(pin('B', 0), "select of the monitor's ADC"),
        output(pin('B', 1), "select of the sensor's ADC"),
        drives(pin('A', 5), "clock of the ADCs", 5, Signal::Sck(1), Speed::VeryHigh),
        hears(pin('A', 6), "data from the ADCs", 5, Signal::Miso(1), Pull::Down),
        drives(pin('A', 7), "data to the ADCs", 5, Signal::Mosi(1), Speed::VeryHigh),
        drives(pin('A', 2), "link, out", 7, Signal::Transmit, Speed::Low),
        // A line that is not connected is quiet.
        hears(pin('A', 3), "link, in", 7, Signal::Receive, Pull::Up),
    ];
    const STARTS: &'static [(Pin, bool)] =
        &[(pin('B', 12), true), (pin('B', 0), true), (pin('B', 1), true), (pin('C', 12), true)];
}

/// Pins of the converters are analog, without a pull.
impl Pads for Discovery {
    const PINS: &'static [Row] = &[
        output(pin('C', 6), "enable"),
        Row { mode: Mode::Input, pull: Pull::Down, ..output(pin('C', 8), "interlock") },
        output(pin('D', 12), "light"),
        Row { mode: Mode::Analog, ..output(pin('A', 5), "command") },
        Row { mode: Mode::Analog, ..output(pin('B', 0), "monitor") },
        Row { mode: Mode::Analog, ..output(pin('B', 1), "sensor") },
        #[cfg(feature = "self-sensing")]
        Row { mode: Mode::Analog, ..output(pin('C', 1), "current") },
        output(pin('E', 3), "select of the accelerometer"),
        drives(pin('A', 2), "link, out", 7, Signal::Transmit, Speed::Low),
        hears(pin('A', 3), "link, in", 7, Signal::Receive, Pull::Up),
    ];
    const STARTS: &'static [(Pin, bool)] = &[(pin('D', 12), false), (pin('E', 3), true)];
}

impl Pads for Nucleo {
    const PINS: &'static [Row] = &[
        output(pin('C', 6), "enable"),
        Row { mode: Mode::Input, pull: Pull::Down, ..output(pin('C', 8), "interlock") },
        output(pin('A', 5), "light"),
        Row { mode: Mode::Analog, ..output(pin('A', 4), "command") },
        Row { mode: Mode::Analog, ..output(pin('A', 0), "monitor") },
        Row { mode: Mode::Analog, ..output(pin('A', 1), "sensor") },
        #[cfg(feature = "self-sensing")]
        Row { mode: Mode::Analog, ..output(pin('B', 1), "current") },
        drives(pin('A', 2), "link, out", 7, Signal::Transmit, Speed::Low),
        hears(pin('A', 3), "link, in", 7, Signal::Receive, Pull::Up),
    ];
    const STARTS: &'static [(Pin, bool)] = &[(pin('A', 5), false)];
}

fn every_pin_is_set_for_what_is_wired_to_it<K: Pads>() {
    let (board, _) = board_of::<K>();
    let _bench = K::start(&board, Core::Crystal);
    for &Row { pin, what, mode, signal, pull, speed } in K::PINS {
        let what = format!("{}: {pin:?}, {what}", K::NAME);
        let pad = board.chip(|chip| chip.pad(pin));
        assert_eq!(pad.mode, mode, "{what}");
        assert_eq!(board.chip(|chip| chip.carried(pin)), signal, "{what}");
        assert!(pad.speed >= speed, "{what}: {:?}", pad.speed);
        assert!(!pad.open_drain, "{what}");
        assert_eq!(pad.pull, pull, "{what}");
    }
}

/// The tables of `docs/boards.md`, which the drawings are made of, have these pins.
fn the_page_has_every_pin_of_every_board<K: Pads>() {
    let page = include_str!("../../../../docs/boards.md");
    let section =
        page.split("\n## ").find(|section| section.lines().next().is_some_and(|title| title.ends_with(K::NAME)));
    let rows = section.expect("a section").lines().filter_map(|line| line.strip_prefix("| P")?.split(' ').next());
    let mut listed: Vec<String> = rows.filter(|pin| pin.len() < 4).map(|pin| format!("P{pin}")).collect();
    let mut pins: Vec<String> =
        K::PINS.iter().map(|row| row.pin).chain([K::CURRENT]).map(|pin| format!("{pin:?}")).collect();
    listed.sort_unstable();
    listed.dedup();
    pins.sort_unstable();
    pins.dedup();
    assert_eq!(listed, pins, "{}", K::NAME);
}

fn other_pins_are_left_as_they_are<K: Pads>() {
    // Debug probe, USB with its pull-up at PC11, crystals, and what else a board may have.
    let (board, _) = board_of::<K>();
    let pins = || ('A'..='I').flat_map(|port| (0..16).map(move |number| pin(port, number)));
    let pads =
        |board: &Board| -> Vec<(Pin, Pad)> { board.chip(|chip| pins().map(|pin| (pin, chip.pad(pin))).collect()) };
    let before = pads(&board);
    let _bench = K::start(&board, Core::Crystal);
    for ((pin, before), (_, after)) in before.into_iter().zip(pads(&board)) {
        if !K::PINS.iter().any(|row| row.pin == pin) {
            assert_eq!(after, before, "{}: {pin:?}", K::NAME);
        }
    }
}

fn the_enable_output_is_the_first_to_be_driven_and_low<K: Pads>() {
    let (board, _) = board_of::<K>();
    let _bench = K::start(&board, Core::Crystal);
    let enable = board.chip(|chip| chip.history(K::ENABLE));
    assert_eq!(enable.iter().map(|change| change.driven).collect::<Vec<_>>(), [Some(false)], "{}", K::NAME);
    for &Row { pin, what, .. } in K::PINS {
        let others = board.chip(|chip| chip.history(pin));
        assert!(others.iter().all(|change| change.at_ns >= enable[0].at_ns), "{}: {pin:?}, {what}", K::NAME);
    }
}

/// Selects high, and the light dark.
fn selects_and_the_light_start_high<K: Pads>() {
    let (board, _) = board_of::<K>();
    let _bench = K::start(&board, Core::Crystal);
    for &(pin, high) in K::STARTS {
        let history = board.chip(|chip| chip.history(pin));
        let has_begun_so = history.first().is_some_and(|change| change.driven == Some(high));
        assert!(has_begun_so, "{}: {pin:?} has moved before: {history:?}", K::NAME);
        assert_eq!(board.chip(|chip| chip.level(pin)), high, "{}: {pin:?}", K::NAME);
    }
}

#[test]
fn the_buses_have_the_clock_and_the_mode_of_their_chips() {
    for core in CLOCKS {
        let board = Board::new(Oscillators::default());
        let _bench = start_h405(&board, core);
        for (number, mode) in [(2, 1), (1, 0)] {
            let (sck_hz, found) = board.chip(|chip| (chip.sck_hz(number), chip.spi(number.into()).mode()));
            assert!(sck_hz <= 10_000_000, "SPI{number}: {sck_hz} Hz, and the wires are for 10 MHz");
            assert_eq!(found, Some(mode), "SPI{number}");
        }
    }
}

on_every_board!(
    every_pin_is_set_for_what_is_wired_to_it,
    the_page_has_every_pin_of_every_board,
    other_pins_are_left_as_they_are,
    the_enable_output_is_the_first_to_be_driven_and_low,
    selects_and_the_light_start_high
);
