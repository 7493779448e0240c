//! Pins and what is wired to them: selects, inputs, and bytes on the SPI buses.

use std::cell::RefCell;
use std::rc::Rc;

use converter_chips::{Bits, SerialChip};
use embedded_hal::spi::{MODE_0, MODE_1, MODE_2, MODE_3};

use crate::chip::Chip;
use crate::chip::gpio::{Mode, PINS, Pad, Pin, Pull, Speed};
use crate::chip::pads::{self, Signal};
use crate::chip::time::{self, NANOSECOND, Picoseconds};
use crate::chip::violation::Violation;
use crate::wires::{Wired, Wiring};

/// The fastest bus clock, Hz, with which an SPI whose clock pad is at the lowest speed still receives the last bit of a frame: its
/// own clock comes back too late from such a pad. Errata sheet ES0182, "Corrupted last bit of data and/or CRC, received in master
/// mode with delayed SCK feedback"; issue 564 of stm32f4xx-hal.
const SLOW_PAD_BUS_HZ: u32 = 25_000_000;

const MODES: [embedded_hal::spi::Mode; 4] = [MODE_0, MODE_1, MODE_2, MODE_3];

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
    pub fn wire(&mut self, wiring: Wiring, chip: Rc<RefCell<dyn SerialChip>>) {
        let selected = self.port(wiring.select).driven(wiring.select.number.into()) == Some(false);
        if selected {
            chip.borrow_mut().select(self.now_ns());
        }
        self.wired.push(Wired { wiring, chip, selected, mosi: false });
    }

    /// Calls `see` with the level of a pin and the time in ns, now and whenever the pin drives something else. A pin that nothing drives is low, by
    /// a resistor.
    pub fn watch(&mut self, pin: Pin, mut see: impl FnMut(bool, u64) + 'static) {
        see(self.level(pin), self.now_ns());
        self.watches.push((pin, Box::new(see)));
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
            self.pass_on(pin, driven);
        }
    }

    fn pass_on(&mut self, pin: Pin, driven: Option<bool>) {
        let (now, at_ns, high) = (self.now, self.now_ns(), self.level(pin));
        self.watches.iter_mut().filter(|(watched, _)| *watched == pin).for_each(|(_, see)| see(high, at_ns));
        // A select that nothing drives is high, by a resistor.
        let selects = driven == Some(false);
        let mut wired = std::mem::take(&mut self.wired);
        for Wired { wiring, chip, selected, .. } in &mut wired {
            if wiring.select != pin || selects == *selected {
                continue;
            }
            *selected = selects;
            if self.clocked_by(wiring.sck).is_some_and(|number| self.spi(number.into()).is_clocking(now)) {
                self.note(Violation::SelectWithinByte { pin });
            }
            if selects {
                chip.borrow_mut().select(at_ns);
            } else {
                chip.borrow_mut().deselect(at_ns);
                self.now += time::of_cycles(time::CYCLES_BETWEEN_FRAMES, self.clocks().hclk_hz);
            }
        }
        self.wired = wired;
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
        pads::pins(signal).find(|&pin| self.carried(pin) == Some(signal))
    }

    pub(super) fn advance_spi(&mut self, number: u8, pclk_hz: u32) {
        let index = usize::from(number) - 1;
        while let Some((byte, start)) = self.spi[index].advance(self.now) {
            let sck_hz = self.spi[index].sck_hz(pclk_hz);
            let mut received = self.exchange(number, byte, start, sck_hz);
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
                self.note(Violation::SlowPad { pin, sck_hz });
            }
        }
        let mode = self.spi(number.into()).mode().map(usize::from);
        let mut answer = None;
        let mut wired = std::mem::take(&mut self.wired);
        for wired in wired.iter_mut().filter(|wired| wired.selected) {
            let Wiring { select, sck, miso, mosi } = wired.wiring;
            let Some(mode) = mode.filter(|_| self.carried(sck) == Some(Signal::Sck(number))) else { continue };
            let arrives = self.carried(mosi) == Some(Signal::Mosi(number));
            let sent = if arrives { sent } else { self.idle_byte(mosi) };
            // With CPHA = 0 the first edge comes half a period after the bit, with CPHA = 1 together with it.
            let late = if mode & 1 == 0 { 1 } else { 0 };
            let edge_ns = |halves: u64| start / NANOSECOND + (halves + late) * 500_000_000 / u64::from(sck_hz);
            let previous = std::mem::replace(&mut wired.mosi, sent & 1 == 1);
            let bits = Bits { value: sent.into(), count: 8, previous };
            let (given, _) = bits.clock(&mut *wired.chip.borrow_mut(), MODES[mode], edge_ns, self.idle(miso));
            if self.carried(miso) == Some(Signal::Miso(number)) && answer.replace(given as u8).is_some() {
                self.note(Violation::TwoSelected { pin: select });
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
