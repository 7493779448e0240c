//! Which pin carries which signal with which alternate function: the data sheet's table, as far as the firmware and its tests go.

use crate::chip::gpio::Pin;

/// Signals of the modelled blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// A signal of SPI 1 or 2.
    Sck(u8),
    Miso(u8),
    Mosi(u8),
    /// A signal of USART2.
    Transmit,
    Receive,
}

const TABLE: [(Pin, u8, Signal); 9] = [
    (Pin::new('A', 2), 7, Signal::Transmit),
    (Pin::new('A', 3), 7, Signal::Receive),
    (Pin::new('A', 5), 5, Signal::Sck(1)),
    (Pin::new('A', 6), 5, Signal::Miso(1)),
    (Pin::new('A', 7), 5, Signal::Mosi(1)),
    (Pin::new('B', 10), 5, Signal::Sck(2)),
    (Pin::new('B', 13), 5, Signal::Sck(2)),
    (Pin::new('B', 14), 5, Signal::Miso(2)),
    (Pin::new('B', 15), 5, Signal::Mosi(2)),
];

/// Signal of a pin with an alternate function.
pub fn signal(pin: Pin, function: u8) -> Option<Signal> {
    TABLE.iter().find(|(at, number, _)| (*at, *number) == (pin, function)).map(|&(_, _, signal)| signal)
}

/// Pins that can carry a signal.
pub fn pins(signal: Signal) -> impl Iterator<Item = Pin> {
    TABLE.iter().filter(move |(_, _, carried)| *carried == signal).map(|&(pin, ..)| pin)
}
