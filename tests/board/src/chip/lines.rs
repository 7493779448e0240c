//! Pins and what is wired to them: selects, inputs, and bytes on the SPI buses.

use crate::chip::Chip;
use crate::chip::gpio::{Mode, PINS, Pad, Pin, Pull, Speed};
use crate::chip::pads::{self, Signal};
use crate::chip::time::{self, NANOSECOND, Picoseconds, SECOND};
use crate::chip::violation::Violation;
use crate::wires::{SpiByte, SpiSlave, Wired, Wiring};

/// The fastest bus clock, Hz, with which an SPI whose clock pad is at the lowest speed still receives the last bit of a frame: its
/// own clock comes back too late from such a pad. Errata sheet ES0182, "Corrupted last bit of data and/or CRC, received in master
/// mode with delayed SCK feedback"; issue 564 of stm32f4xx-hal.
const SLOW_PAD_BUS_HZ: u32 = 25_000_000;

/// A pin drives something else than before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    pub at_ns: u64,
    pub pin: Pin,
    /// None: it has stopped to drive.
    pub driven: Option<bool>,
}

impl Chip {
    /// Wires a chip to its pins.
    pub fn wire(&mut self, wiring: Wiring, mut slave: Box<dyn SpiSlave>) {
        for &pin in &wiring.inputs {
            slave.input(pin, self.level(pin), self.now_ns());
        }
        let selected = self.port(wiring.select).driven(wiring.select.number.into()) == Some(false);
        if selected {
            slave.select(self.now_ns());
        }
        self.wired.push(Wired { wiring, slave, selected });
    }

    /// Connects a pin to a level from outside; none: nothing is connected.
    pub fn connect(&mut self, pin: Pin, level: Option<bool>) {
        self.ports[pin.index()].outside[usize::from(pin.number)] = level;
    }

    /// How a pin is set.
    pub fn pad(&self, pin: Pin) -> Pad {
        self.port(pin).pad(pin.number.into())
    }

    /// The level at a pin.
    pub fn level(&self, pin: Pin) -> bool {
        self.port(pin).level(pin.number.into())
    }

    /// Levels that a pin has driven since power-up.
    pub fn history(&self, pin: Pin) -> Vec<Change> {
        self.changes.iter().filter(|change| change.pin == pin).copied().collect()
    }

    /// Levels that pins drive, and the ones before, if they differ.
    pub(super) fn move_lines(&mut self) {
        let mut moved = Vec::new();
        for (index, port) in self.ports.iter().enumerate() {
            for number in 0..PINS {
                let driven = port.driven(number);
                if driven != self.driven[index][number] {
                    self.driven[index][number] = driven;
                    moved.push((Pin::new((b'A' + index as u8) as char, number as u8), driven));
                }
            }
        }
        for (pin, driven) in moved {
            self.changes.push(Change { at_ns: self.now_ns(), pin, driven });
            self.tell_slaves(pin, driven);
        }
    }

    fn tell_slaves(&mut self, pin: Pin, driven: Option<bool>) {
        let (now, at_ns, high) = (self.now, self.now_ns(), self.level(pin));
        let (mut violations, mut frame_ends) = (Vec::new(), false);
        let mut wired = std::mem::take(&mut self.wired);
        for Wired { wiring, slave, selected } in &mut wired {
            if wiring.inputs.contains(&pin) {
                slave.input(pin, high, at_ns);
            }
            // A select that nothing drives is high, by a resistor.
            let selects = driven == Some(false);
            if wiring.select != pin || selects == *selected {
                continue;
            }
            *selected = selects;
            if self.clocked_by(wiring.sck).is_some_and(|number| self.spi(number.into()).is_clocking(now)) {
                violations.push(Violation::SelectWithinByte { pin });
            }
            if selects {
                slave.select(at_ns);
            } else {
                slave.deselect(at_ns);
                frame_ends = true;
            }
        }
        self.wired = wired;
        if frame_ends {
            self.now += time::of_cycles(time::CYCLES_BETWEEN_FRAMES, self.clocks().hclk_hz);
        }
        for violation in violations {
            self.violations.add(now, violation);
        }
    }

    /// The SPI whose clock a pin carries.
    fn clocked_by(&self, sck: Pin) -> Option<u8> {
        match self.carried(sck)? {
            Signal::Sck(number) => Some(number),
            _ => None,
        }
    }

    /// The signal that a pin carries, as it is set.
    pub fn carried(&self, pin: Pin) -> Option<Signal> {
        match self.pad(pin).mode {
            Mode::Alternate(function) => pads::signal(pin, function),
            _ => None,
        }
    }

    /// The pin that carries a signal, as the pins are set.
    fn carrier(&self, signal: Signal) -> Option<Pin> {
        pads::pins(signal).map(|(pin, _)| pin).find(|&pin| self.carried(pin) == Some(signal))
    }

    pub(super) fn advance_spi(&mut self, number: u8, pclk_hz: u32) {
        let index = usize::from(number) - 1;
        while let Some((word, start)) = self.spi[index].advance(self.now) {
            let sck_hz = self.spi[index].sck_hz(pclk_hz);
            let bits = self.spi[index].bits();
            let byte_time = 8 * SECOND / u64::from(sck_hz.max(1));
            let mut received = 0;
            for byte in 0..bits / 8 {
                let sent = (word >> (bits - 8 - 8 * byte)) as u8;
                let start = start + u64::from(byte) * byte_time;
                received = received << 8 | u16::from(self.exchange(number, sent, start, sck_hz));
            }
            let slow = self.carrier(Signal::Sck(number)).is_some_and(|pin| self.pad(pin).speed == Speed::Low);
            if slow && pclk_hz > SLOW_PAD_BUS_HZ {
                received = received & !1 | self.spi[index].last_bit();
            }
            self.spi[index].begin(start, sck_hz, received);
        }
    }

    /// A byte on the wires of an SPI. Returns what comes back.
    fn exchange(&mut self, number: u8, sent: u8, start: Picoseconds, sck_hz: u32) -> u8 {
        for signal in [Signal::Sck(number), Signal::Mosi(number)] {
            if let Some(pin) = self.carrier(signal)
                && sck_hz > self.pad(pin).speed.limit_hz()
            {
                self.violations.once(start, Violation::SlowPad { pin, sck_hz });
            }
        }
        let spi = self.spi(number.into());
        let (mode, lsb_first) = (spi.mode(), spi.is_lsb_first());
        let order = |byte: u8| if lsb_first { byte.reverse_bits() } else { byte };
        let mut answer = None;
        let mut wired = std::mem::take(&mut self.wired);
        for Wired { wiring, slave, .. } in wired.iter_mut().filter(|wired| wired.selected) {
            if self.carried(wiring.sck) != Some(Signal::Sck(number)) {
                continue;
            }
            let arrives = self.carried(wiring.mosi) == Some(Signal::Mosi(number));
            let byte = SpiByte {
                sent: if arrives { order(sent) } else { self.idle_byte(wiring.mosi) },
                start_ns: start / NANOSECOND,
                sck_hz,
                mode,
                idle: self.idle(wiring.miso),
                sck_speed: self.pad(wiring.sck).speed,
                mosi_speed: self.pad(wiring.mosi).speed,
            };
            let given = slave.exchange(&byte);
            if self.carried(wiring.miso) == Some(Signal::Miso(number)) && answer.replace(order(given)).is_some() {
                self.violations.add(start, Violation::TwoSelected { pin: wiring.select });
            }
        }
        self.wired = wired;
        answer.unwrap_or_else(|| self.carrier(Signal::Miso(number)).map_or(0, |pin| self.idle_byte(pin)))
    }

    /// The level of a line that nothing drives: its pull's, otherwise high.
    fn idle(&self, pin: Pin) -> bool {
        self.pad(pin).pull != Pull::Down
    }

    fn idle_byte(&self, pin: Pin) -> u8 {
        if self.idle(pin) { 0xff } else { 0x00 }
    }
}
