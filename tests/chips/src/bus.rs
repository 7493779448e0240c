//! A bus of embedded-hal in virtual time.

use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_hal::spi::{ErrorType, Mode, Operation, SpiDevice};

use crate::Clock;
use crate::serial::{Absent, Bits, SerialChip};

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
    /// SCK's pin has the lowest output speed: the last bit of each received byte is that of the byte received before.
    ///
    /// ES0182 (STM32F405), section 2.5.2 in older revisions, "Corrupted last bit of data and/or CRC, received in master mode
    /// with delayed SCK feedback": the last bit is not captured when the feedback from the SCK pin is late, and its place
    /// keeps the value of the transfer before. What counts is the clock of the APB, the load on SCK, and its output speed;
    /// the SPI's own frequency has no influence. stm32f4xx-hal's issue 564 saw it at 2 MHz.
    pub slow_pad: bool,
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
            slow_pad: false,
        }
    }
}

struct State {
    clock: Clock,
    timing: SpiTiming,
    mosi: bool,
    /// The last byte as it was on the line.
    received: u8,
}

/// A bus that carries devices. Clones share it. A line that no chip drives is low, by a resistor.
#[derive(Clone)]
pub struct SpiBus(Rc<RefCell<State>>);

impl SpiBus {
    /// A bus that moves `clock`.
    #[must_use]
    pub fn new(clock: &Clock, timing: SpiTiming) -> Self {
        let clock = clock.clone();
        Self(Rc::new(RefCell::new(State { clock, timing, mosi: false, received: 0 })))
    }

    /// Puts a chip on the bus. `mode` is the master's mode while it talks to the chip; with one that is not the chip's,
    /// bits are shifted.
    #[must_use]
    pub fn connect<C: SerialChip + 'static>(&self, chip: &Rc<RefCell<C>>, mode: Mode) -> SpiWire {
        let chip: Rc<RefCell<dyn SerialChip>> = Rc::<RefCell<C>>::clone(chip);
        SpiWire { bus: self.clone(), chip, mode }
    }

    /// A device that is not there: reads 0xff (`level` high) or 0x00.
    #[must_use]
    pub fn absent(&self, level: bool) -> SpiWire {
        self.connect(&Rc::new(RefCell::new(Absent { level })), embedded_hal::spi::MODE_0)
    }
}

/// One device on a bus, as a driver holds it.
#[derive(Clone)]
pub struct SpiWire {
    bus: SpiBus,
    chip: Rc<RefCell<dyn SerialChip>>,
    mode: Mode,
}

impl ErrorType for SpiWire {
    type Error = Infallible;
}

impl SpiDevice for SpiWire {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let bus = &mut *self.bus.0.borrow_mut();
        bus.clock.advance(bus.timing.between_transactions_ns);
        let chip = &mut *self.chip.borrow_mut();
        chip.select(bus.clock.now());
        bus.clock.advance(bus.timing.lead_ns);
        let mut master = Master { bus, chip, mode: self.mode, first: true };
        for operation in operations {
            match operation {
                Operation::Read(read) => read.iter_mut().for_each(|byte| *byte = master.exchange(0)),
                Operation::Write(write) => write.iter().for_each(|byte| {
                    master.exchange(*byte);
                }),
                Operation::Transfer(read, write) => {
                    for k in 0..read.len().max(write.len()) {
                        let received = master.exchange(write.get(k).copied().unwrap_or(0));
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
        bus.clock.advance(bus.timing.lag_ns);
        chip.deselect(bus.clock.now());
        Ok(())
    }
}

/// A transaction that is under way. The clock is at the last edge.
struct Master<'a> {
    bus: &'a mut State,
    chip: &'a mut dyn SerialChip,
    mode: Mode,
    first: bool,
}

impl Master<'_> {
    /// Sends a byte and returns what was received meanwhile.
    fn exchange(&mut self, byte: u8) -> u8 {
        let half_ps = 500_000_000_000 / u64::from(self.bus.timing.sck_hz);
        let gap_ns = if self.first { 0 } else { half_ps / 1000 + self.bus.timing.between_bytes_ns };
        self.first = false;
        self.bus.clock.advance(gap_ns);
        let begin = self.bus.clock.now();
        let edge = |k: u64| begin + k * half_ps / 1000;
        let previous = std::mem::replace(&mut self.bus.mosi, byte & 1 == 1);
        let bits = Bits { value: byte.into(), count: 8, previous };
        let received = bits.clock(self.chip, self.mode, edge, false).0 as u8;
        self.bus.clock.advance_to(edge(15));
        let previous = std::mem::replace(&mut self.bus.received, received);
        if self.bus.timing.slow_pad { received & !1 | previous & 1 } else { received }
    }
}
