//! Which pin carries which signal with which alternate function: the data sheet's table of alternate functions, as far as the
//! modelled blocks go, for the package of 64 pins.

use crate::chip::gpio::Pin;

/// Signals of the modelled blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// A signal of SPI 1 to 3.
    Sck(u8),
    Miso(u8),
    Mosi(u8),
    /// A signal of USART2.
    Transmit,
    Receive,
}

const TABLE: [(Pin, u8, Signal); 25] = [
    (Pin::new('A', 2), 7, Signal::Transmit),
    (Pin::new('A', 3), 7, Signal::Receive),
    (Pin::new('A', 5), 5, Signal::Sck(1)),
    (Pin::new('A', 6), 5, Signal::Miso(1)),
    (Pin::new('A', 7), 5, Signal::Mosi(1)),
    (Pin::new('B', 3), 5, Signal::Sck(1)),
    (Pin::new('B', 4), 5, Signal::Miso(1)),
    (Pin::new('B', 5), 5, Signal::Mosi(1)),
    (Pin::new('B', 3), 6, Signal::Sck(3)),
    (Pin::new('B', 4), 6, Signal::Miso(3)),
    (Pin::new('B', 5), 6, Signal::Mosi(3)),
    (Pin::new('B', 10), 5, Signal::Sck(2)),
    (Pin::new('B', 13), 5, Signal::Sck(2)),
    (Pin::new('B', 14), 5, Signal::Miso(2)),
    (Pin::new('B', 15), 5, Signal::Mosi(2)),
    (Pin::new('C', 2), 5, Signal::Miso(2)),
    (Pin::new('C', 3), 5, Signal::Mosi(2)),
    (Pin::new('C', 10), 6, Signal::Sck(3)),
    (Pin::new('C', 11), 6, Signal::Miso(3)),
    (Pin::new('C', 12), 6, Signal::Mosi(3)),
    (Pin::new('D', 5), 7, Signal::Transmit),
    (Pin::new('D', 6), 7, Signal::Receive),
    (Pin::new('I', 1), 5, Signal::Sck(2)),
    (Pin::new('I', 2), 5, Signal::Miso(2)),
    (Pin::new('I', 3), 5, Signal::Mosi(2)),
];

/// Signal of a pin with an alternate function.
pub fn signal(pin: Pin, function: u8) -> Option<Signal> {
    TABLE.iter().find(|(at, number, _)| (*at, *number) == (pin, function)).map(|&(_, _, signal)| signal)
}

/// Pins that can carry a signal, with the function that makes them.
pub fn pins(signal: Signal) -> impl Iterator<Item = (Pin, u8)> {
    TABLE.iter().filter(move |(_, _, carried)| *carried == signal).map(|&(pin, function, _)| (pin, function))
}
