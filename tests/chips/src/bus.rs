//! A bus of embedded-hal in virtual time.

use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::spi::{ErrorType, Mode, Operation, SpiDevice};

use crate::Clock;
use crate::pad::SlowPad;
use crate::serial::{Absent, Bit, SerialChip, clock_bit};

/// Level that a master reads where no chip drives the line.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Floating {
    /// The level that was driven last: a line without a resistor.
    #[default]
    Holds,
    /// Low: a pull-down.
    Low,
    /// High: a pull-up.
    High,
}

/// Times of a bus, and what its pins do.
#[derive(Clone, Copy, Debug)]
pub struct SpiTiming {
    /// Clock, Hz.
    pub sck_hz: u32,
    /// From one byte to the next beyond the half period that always lies between them, ns.
    pub between_bytes_ns: u64,
    /// From select to the first edge of the clock, ns.
    pub lead_ns: u64,
    /// From the last edge of the clock to deselect, ns.
    pub lag_ns: u64,
    /// From the end of a transaction to the select of the next, ns: what a CPU needs between two calls.
    pub between_transactions_ns: u64,
    /// The byte that is sent where the driver gives none, as in [`Operation::Read`].
    pub fill: u8,
    /// Level that is read where no chip drives.
    pub floating: Floating,
    /// ST's erratum, if SCK's pin has the lowest output speed.
    pub slow: Option<SlowPad>,
}

impl Default for SpiTiming {
    /// 84 MHz / 8, fast pins, a CPU that needs 300 ns between two calls.
    fn default() -> Self {
        Self {
            sck_hz: 10_500_000,
            between_bytes_ns: 0,
            lead_ns: 50,
            lag_ns: 50,
            between_transactions_ns: 300,
            fill: 0,
            floating: Floating::default(),
            slow: None,
        }
    }
}

struct State {
    clock: Clock,
    timing: SpiTiming,
    mosi: bool,
    miso: bool,
    /// The last byte as it was on the line.
    received: u8,
    transactions: u64,
}

/// A bus that carries devices. Clones share it.
#[derive(Clone)]
pub struct SpiBus(Rc<RefCell<State>>);

impl SpiBus {
    /// A bus that moves `clock`.
    #[must_use]
    pub fn new(clock: &Clock, timing: SpiTiming) -> Self {
        let clock = clock.clone();
        Self(Rc::new(RefCell::new(State { clock, timing, mosi: false, miso: false, received: 0, transactions: 0 })))
    }

    /// Puts a chip on the bus. `mode` is the master's mode while it talks to the chip; with one that is not the chip's,
    /// bits are shifted.
    #[must_use]
    pub fn connect<C: SerialChip + 'static>(&self, chip: &Rc<RefCell<C>>, mode: Mode) -> SpiWire {
        let chip: Rc<RefCell<dyn SerialChip>> = Rc::<RefCell<C>>::clone(chip);
        SpiWire { bus: self.clone(), chip, mode, timing: None }
    }

    /// A device that is not there: reads 0xff (`level` high) or 0x00.
    #[must_use]
    pub fn absent(&self, level: bool) -> SpiWire {
        self.connect(&Rc::new(RefCell::new(Absent { level })), embedded_hal::spi::MODE_0)
    }

    /// The bus's times.
    #[must_use]
    pub fn timing(&self) -> SpiTiming {
        self.0.borrow().timing
    }

    /// Changes the bus's times from the next transaction on.
    pub fn set_timing(&self, timing: SpiTiming) {
        self.0.borrow_mut().timing = timing;
    }

    /// Transactions so far, of all devices.
    #[must_use]
    pub fn transactions(&self) -> u64 {
        self.0.borrow().transactions
    }
}

/// One device on a bus, as a driver holds it.
#[derive(Clone)]
pub struct SpiWire {
    bus: SpiBus,
    chip: Rc<RefCell<dyn SerialChip>>,
    mode: Mode,
    timing: Option<SpiTiming>,
}

impl SpiWire {
    /// Times of its own for this device, such as a slower clock.
    #[must_use]
    pub fn with_timing(mut self, timing: SpiTiming) -> Self {
        self.timing = Some(timing);
        self
    }
}

impl ErrorType for SpiWire {
    type Error = Infallible;
}

impl SpiDevice for SpiWire {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let bus = &mut *self.bus.0.borrow_mut();
        let timing = self.timing.unwrap_or(bus.timing);
        bus.clock.advance(timing.between_transactions_ns);
        bus.transactions += 1;
        let chip = &mut *self.chip.borrow_mut();
        chip.select(bus.clock.now());
        bus.clock.advance(timing.lead_ns);
        let mut master = Master { bus, chip, mode: self.mode, timing, first: true };
        for operation in operations {
            match operation {
                Operation::Read(read) => read.iter_mut().for_each(|byte| *byte = master.exchange(timing.fill)),
                Operation::Write(write) => write.iter().for_each(|byte| {
                    master.exchange(*byte);
                }),
                Operation::Transfer(read, write) => {
                    for k in 0..read.len().max(write.len()) {
                        let received = master.exchange(write.get(k).copied().unwrap_or(timing.fill));
                        if let Some(byte) = read.get_mut(k) {
                            *byte = received;
                        }
                    }
                }
                Operation::TransferInPlace(bytes) => {
                    bytes.iter_mut().for_each(|byte| *byte = master.exchange(*byte));
                }
                Operation::DelayNs(ns) => master.bus.clock.advance(u64::from(*ns)),
            }
        }
        let Master { bus, chip, .. } = master;
        bus.clock.advance(timing.lag_ns);
        chip.deselect(bus.clock.now());
        Ok(())
    }
}

/// A transaction that is under way. The clock is at the last edge.
struct Master<'a> {
    bus: &'a mut State,
    chip: &'a mut dyn SerialChip,
    mode: Mode,
    timing: SpiTiming,
    first: bool,
}

impl Master<'_> {
    /// Sends a byte and returns what was received meanwhile.
    fn exchange(&mut self, byte: u8) -> u8 {
        let half_ps = 500_000_000_000 / u64::from(self.timing.sck_hz);
        let gap_ns = if self.first { 0 } else { half_ps / 1000 + self.timing.between_bytes_ns };
        self.first = false;
        self.bus.clock.advance(gap_ns);
        let begin = self.bus.clock.now();
        let edge = |k: u64| begin + k * half_ps / 1000;
        let sent = |k: u64| byte >> (7 - k) & 1 == 1;
        let mut received = 0;
        for k in 0..8 {
            let bit = Bit {
                value: sent(k),
                previous: self.bus.mosi,
                next: (k < 7).then(|| sent(k + 1)),
                leading_ns: edge(2 * k),
                trailing_ns: edge(2 * k + 1),
            };
            self.bus.mosi = bit.value;
            let level = match (clock_bit(self.chip, self.mode, bit), self.timing.floating) {
                (Some(level), _) => level,
                (None, Floating::Holds) => self.bus.miso,
                (None, floating) => floating == Floating::High,
            };
            self.bus.miso = level;
            received = received << 1 | u8::from(level);
        }
        self.bus.clock.advance_to(edge(15));
        let previous = std::mem::replace(&mut self.bus.received, received);
        match self.timing.slow {
            Some(slow) => slow.received(self.timing.sck_hz, received, previous),
            None => received,
        }
    }
}
