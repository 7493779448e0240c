//! Chips that write down what they see, and the wires of all chips.

use std::cell::RefCell;
use std::rc::Rc;

use board_on_host::chip::gpio::Pin;
use board_on_host::wires::{SpiByte, SpiSlave, Wiring};

/// Bytes between two edges of a select.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    pub selected_ns: u64,
    pub deselected_ns: u64,
    pub bytes: Vec<SpiByte>,
}

impl Frame {
    pub fn sent(&self) -> Vec<u8> {
        self.bytes.iter().map(|byte| byte.sent).collect()
    }
}

/// The frames of a recorder.
pub type Frames = Rc<RefCell<Vec<Frame>>>;

/// Writes down what it sees, and answers every frame with the same bytes, then zeros.
#[derive(Default)]
pub struct Recorder {
    frame: Frame,
    frames: Frames,
    answer: Vec<u8>,
}

impl Recorder {
    pub fn new(answer: &[u8]) -> (Box<Self>, Frames) {
        let recorder = Box::new(Self { answer: answer.to_vec(), ..Self::default() });
        let frames = Rc::clone(&recorder.frames);
        (recorder, frames)
    }
}

impl SpiSlave for Recorder {
    fn select(&mut self, at_ns: u64) {
        self.frame = Frame { selected_ns: at_ns, ..Frame::default() };
    }

    fn exchange(&mut self, byte: &SpiByte) -> u8 {
        let answer = self.answer.get(self.frame.bytes.len()).copied().unwrap_or(0);
        self.frame.bytes.push(*byte);
        answer
    }

    fn deselect(&mut self, at_ns: u64) {
        self.frame.deselected_ns = at_ns;
        self.frames.borrow_mut().push(self.frame.clone());
    }
}

/// Where the DAC is: `docs/wiring.md`.
pub fn dac_wiring() -> Wiring {
    let port_b = |number| Pin::new('B', number);
    Wiring { select: port_b(12), sck: port_b(13), miso: port_b(14), mosi: port_b(15), inputs: Vec::new() }
}

/// Where an ADC is, by its select.
pub fn adc_wiring(select: u8) -> Wiring {
    let port_a = |number| Pin::new('A', number);
    Wiring { select: Pin::new('B', select), sck: port_a(5), miso: port_a(6), mosi: port_a(7), inputs: Vec::new() }
}
