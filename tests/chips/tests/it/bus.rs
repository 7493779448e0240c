//! The bus: times and slow pads, and what embedded-hal promises.

use std::cell::RefCell;
use std::rc::Rc;

use converter_chips::{Ad5754, Ads868x, Clock, SpiBus, SpiTiming, SpiWire, Variant};
use embedded_hal::spi::{MODE_0, MODE_1, Operation, SpiDevice};

/// Half a period of 50 ns; 500 ns between calls, 20 ns to the clock, 30 ns after it, 100 ns between bytes.
const TIMING: SpiTiming = SpiTiming {
    sck_hz: 10_000_000,
    between_bytes_ns: 100,
    lead_ns: 20,
    lag_ns: 30,
    between_transactions_ns: 500,
    slow_pad: false,
};

struct Board {
    clock: Clock,
    bus: SpiBus,
    dac: Rc<RefCell<Ad5754>>,
    adc: Rc<RefCell<Ads868x>>,
    to_dac: SpiWire,
    to_adc: SpiWire,
}

fn board(timing: SpiTiming) -> Board {
    let clock = Clock::new();
    let bus = SpiBus::new(&clock, timing);
    let dac = Rc::new(RefCell::new(Ad5754::new()));
    let adc = Rc::new(RefCell::new(Ads868x::new(Variant::Ads8681)));
    let (to_dac, to_adc) = (bus.connect(&dac, MODE_1), bus.connect(&adc, MODE_0));
    Board { clock, bus, dac, adc, to_dac, to_adc }
}

#[test]
fn a_transaction_takes_its_time() {
    let mut board = board(TIMING);
    board.to_dac.write(&[0x18, 0, 0]).unwrap();
    // 500 + 20, then 8 × 100 − 50 for each byte, 50 + 100 between them, and 30.
    assert_eq!(board.clock.now(), 520 + 3 * 750 + 2 * 150 + 30);
    let before = board.clock.now();
    board.to_dac.write(&[]).unwrap();
    assert_eq!(board.clock.now() - before, 550);
    assert_eq!(board.dac.borrow().violations().len(), 1, "a frame without bits");
    // A delay keeps the chip selected.
    let before = board.clock.now();
    let mut operations = [Operation::Write(&[0, 0]), Operation::DelayNs(10_000), Operation::Write(&[0, 0])];
    board.to_adc.transaction(&mut operations).unwrap();
    assert_eq!(board.clock.now() - before, 520 + 4 * 750 + 3 * 150 + 10_000 + 30);
    assert_eq!(board.adc.borrow().violations(), [], "one frame of 32 bits");
    board.clock.advance_to(5);
    assert_eq!(board.clock.now() - before, 520 + 4 * 750 + 3 * 150 + 10_000 + 30, "not back");
}

#[test]
fn the_time_between_calls_counts_at_the_chips() {
    let unseen = |between_transactions_ns: u64, to_the_other: bool| {
        let mut board = board(SpiTiming { between_transactions_ns, ..TIMING });
        board.clock.advance(10_000);
        board.to_adc.write(&[0; 4]).unwrap();
        if to_the_other {
            board.to_dac.write(&[0x18, 0, 0]).unwrap();
        }
        board.to_adc.write(&[0; 4]).unwrap();
        board.adc.borrow().violations().len()
    };
    assert_eq!([unseen(664, false), unseen(665, false)], [1, 0]);
    assert_eq!(unseen(300, true), 0, "the other device's transactions pass the time as well");
}

#[test]
fn a_slow_pad_spoils_the_last_bit_of_each_received_byte() {
    let read = |slow_pad: bool, code: u16| {
        let mut board = board(SpiTiming { slow_pad, ..TIMING });
        // What is sent is not spoiled.
        board.to_dac.write(&[0x08, 0x00, 0x05]).unwrap();
        assert_eq!(board.dac.borrow().range(), 5);
        // ±12.288 V
        board.adc.borrow_mut().set_input(f64::from(code) * 375e-6 - 12.288);
        board.to_adc.write(&[0; 4]).unwrap();
        // The byte before ends with a 0.
        board.bus.absent(false).write(&[0]).unwrap();
        board.clock.advance(10_000);
        let mut word = [0; 4];
        board.to_adc.read(&mut word).unwrap();
        [word[0], word[1]]
    };
    assert_eq!(read(false, 0xa713), [0xa7, 0x13]);
    // The last bit of the byte before: 0, then that of the first byte.
    assert_eq!(read(true, 0xa713), [0xa6, 0x13]);
    assert_eq!(read(true, 0xa610), [0xa6, 0x10]);
    assert_eq!(read(true, 0xa710), [0xa6, 0x11]);
}
