//! A chip that counts what it sees, and the wires of all chips.

use std::cell::RefCell;
use std::rc::Rc;

use board_on_host::chip::gpio::Pin;
use board_on_host::wires::Wiring;
use converter_chips::{Sdi, SerialChip};

/// Counts the clocks of each frame, and answers every frame with the same bytes, then zeros.
#[derive(Default)]
pub struct Recorder {
    pub frames: Vec<usize>,
    answer: Vec<u8>,
    clocks: usize,
}

impl Recorder {
    pub fn new(answer: &[u8]) -> Rc<RefCell<Self>> {
        Rc::new(RefCell::new(Self { answer: answer.to_vec(), ..Self::default() }))
    }

    /// The clocks of the frames so far, which are forgotten.
    pub fn take(recorder: &RefCell<Self>) -> Vec<usize> {
        std::mem::take(&mut recorder.borrow_mut().frames)
    }
}

impl SerialChip for Recorder {
    fn select(&mut self, _: u64) {
        self.clocks = 0;
    }

    fn sclk(&mut self, level: bool, _: Sdi, _: u64) {
        self.clocks += usize::from(level);
    }

    fn sdo(&self, _: u64) -> Option<bool> {
        let bit = self.clocks - 1;
        Some(self.answer.get(bit / 8).is_some_and(|byte| byte >> (7 - bit % 8) & 1 != 0))
    }

    fn deselect(&mut self, _: u64) {
        self.frames.push(self.clocks);
    }
}

/// The DAC's pins: `docs/boards.md`.
pub fn dac_wiring() -> Wiring {
    let port_b = |number| Pin::new('B', number);
    Wiring { select: port_b(12), sck: port_b(13), miso: port_b(14), mosi: port_b(15) }
}

/// Where an ADC is, by its select.
pub fn adc_wiring(select: u8) -> Wiring {
    let port_a = |number| Pin::new('A', number);
    Wiring { select: Pin::new('B', select), sck: port_a(5), miso: port_a(6), mosi: port_a(7) }
}
