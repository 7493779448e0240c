//! The converters' models on the chip's pins.

use std::cell::RefCell;
use std::rc::Rc;

use board_on_host::board::Board;
use board_on_host::chip::gpio::Pin;
use board_on_host::wires::{SpiByte, SpiSlave, Wiring};
use converter_chips::{Ad5754, Ads868x, Bit, SerialChip, Variant, clock_bit};
use embedded_hal::spi::{MODE_0, MODE_1, MODE_2, MODE_3};

use super::slaves::{adc_wiring, dac_wiring};

pub const ENABLE: Pin = Pin::new('C', 6);

/// The converters of `docs/wiring.md`.
pub struct Converters {
    pub dac: Rc<RefCell<Ad5754>>,
    pub monitor: Rc<RefCell<Ads868x>>,
    pub sensor: Rc<RefCell<Ads868x>>,
}

impl Converters {
    /// Wires them to a board: straight binary, LDAC to ground, CLR to the enable output; RST high.
    pub fn on(board: &Board, variant: Variant) -> Self {
        let dac = Rc::new(RefCell::new(Ad5754::new()));
        dac.borrow_mut().set_ldac(false, 0);
        let adc = || Rc::new(RefCell::new(Ads868x::new(variant)));
        let (monitor, sensor) = (adc(), adc());
        // They had power long before the chip has.
        board.chip(|chip| {
            chip.wait_ns(50_000_000);
            let wiring = Wiring { inputs: vec![ENABLE], ..dac_wiring() };
            chip.wire(wiring, OnPins::boxed(&dac, |dac, high, now| dac.set_clr(high, now)));
            chip.wire(adc_wiring(0), OnPins::boxed(&monitor, |_, _, _| {}));
            chip.wire(adc_wiring(1), OnPins::boxed(&sensor, |_, _, _| {}));
        });
        Self { dac, monitor, sensor }
    }
}

/// A chip, edge by edge.
struct OnPins<C> {
    chip: Rc<RefCell<C>>,
    /// Sets the pin that is connected to the one input of its wiring.
    input: fn(&mut C, bool, u64),
    /// Level of MOSI before.
    mosi: bool,
}

impl<C: SerialChip + 'static> OnPins<C> {
    fn boxed(chip: &Rc<RefCell<C>>, input: fn(&mut C, bool, u64)) -> Box<dyn SpiSlave> {
        Box::new(Self { chip: Rc::clone(chip), input, mosi: false })
    }
}

impl<C: SerialChip> SpiSlave for OnPins<C> {
    fn select(&mut self, at_ns: u64) {
        self.chip.borrow_mut().select(at_ns);
    }

    fn exchange(&mut self, byte: &SpiByte) -> u8 {
        let mode = [MODE_0, MODE_1, MODE_2, MODE_3][usize::from(byte.mode)];
        let sent = |bit: u64| byte.sent >> (7 - bit) & 1 != 0;
        (0..8).fold(0, |received, bit| {
            let (leading_ns, trailing_ns) = byte.edges_ns(bit);
            let next = (bit < 7).then(|| sent(bit + 1));
            let on_wires = Bit { value: sent(bit), previous: self.mosi, next, leading_ns, trailing_ns };
            self.mosi = sent(bit);
            let level = clock_bit(&mut *self.chip.borrow_mut(), mode, on_wires).unwrap_or(byte.idle);
            received << 1 | u8::from(level)
        })
    }

    fn deselect(&mut self, at_ns: u64) {
        self.chip.borrow_mut().deselect(at_ns);
    }

    fn input(&mut self, _: Pin, high: bool, at_ns: u64) {
        (self.input)(&mut self.chip.borrow_mut(), high, at_ns);
    }
}
