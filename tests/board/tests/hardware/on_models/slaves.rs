//! Chips that write down what they see, and answer by a rule that says no more than these tests need.

use std::sync::{Arc, Mutex};

use board_on_host::chip::gpio::Pin;
use board_on_host::wires::{SpiByte, SpiSlave, Wiring};

/// What came between two edges of a select.
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
pub type Frames = Arc<Mutex<Vec<Frame>>>;

/// Takes the bytes of a frame and gives what the next one shall bring.
type Rule = Box<dyn FnMut(&[u8]) -> Vec<u8> + Send>;

pub struct Recorder {
    frame: Frame,
    frames: Frames,
    answer: Vec<u8>,
    rule: Rule,
}

impl Recorder {
    pub fn new(rule: impl FnMut(&[u8]) -> Vec<u8> + Send + 'static) -> (Box<Self>, Frames) {
        let frames = Frames::default();
        let recorder =
            Self { frame: Frame::default(), frames: frames.clone(), answer: Vec::new(), rule: Box::new(rule) };
        (Box::new(recorder), frames)
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
        self.answer = (self.rule)(&self.frame.sent());
        if let Ok(mut frames) = self.frames.lock() {
            frames.push(self.frame.clone());
        }
    }
}

/// Registers of 16 bits: a frame of three bytes writes one, or reads it into the next frame.
pub fn dac() -> (Box<Recorder>, Frames) {
    let mut registers = [0u16; 128];
    Recorder::new(move |frame| {
        let &[register, high, low] = frame else { return Vec::new() };
        if register & 0x80 != 0 {
            let [high, low] = registers[usize::from(register & 0x7f)].to_be_bytes();
            return vec![0, high, low];
        }
        registers[usize::from(register)] = u16::from_be_bytes([high, low]);
        Vec::new()
    })
}

/// Frames of four bytes that write a register, read one into the next frame, or bring a code and the range.
pub fn adc(code: u16) -> (Box<Recorder>, Frames) {
    let mut registers = [0u16; 128];
    Recorder::new(move |frame| {
        let &[command, register, high, low] = frame else { return Vec::new() };
        let register = usize::from(register & 0x7f);
        let [range_high, range_low] = registers[0x14].to_be_bytes();
        match command {
            0xd0 => registers[register] = u16::from_be_bytes([high, low]),
            0xc8 => return vec![range_high, range_low, 0, 0],
            _ => {}
        }
        let [high, low] = code.to_be_bytes();
        vec![high, low, range_low, 0]
    })
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
