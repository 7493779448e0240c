//! The bus: times, modes, floating lines, slow pads, and what embedded-hal promises.

use std::cell::RefCell;
use std::rc::Rc;

use converter_chips::{Ad5754, Ads868x, Clock, Line, SpiBus, SpiTiming, SpiWire, Variant};
use embedded_hal::digital::OutputPin;
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
fn transfers_of_unequal_lengths() {
    let mut board = board(SpiTiming { between_transactions_ns: 1_000, ..TIMING });
    board.adc.borrow_mut().set_input(3.75);
    board.to_adc.write(&[0; 4]).unwrap();
    let mut two = [0; 2];
    board.to_adc.transfer(&mut two, &[0xd0, 0x14, 0, 1]).unwrap();
    assert_eq!(two, [0xa7, 0x10]);
    assert_eq!(board.adc.borrow().range_sel(), 1);
    let mut four = [0; 4];
    board.to_adc.transfer(&mut four, &[0xc8, 0x14]).unwrap();
    assert_eq!(four, [0xa7, 0x10, 0, 0]);
    board.to_adc.read(&mut four).unwrap();
    assert_eq!(four, [0, 1, 0, 0]);
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
fn lines_that_no_chip_drives_read_one_level() {
    let mut board = board(SpiTiming { between_transactions_ns: 400, ..TIMING });
    for (level, byte) in [(true, 0xff), (false, 0x00)] {
        let mut word = [0x5a; 4];
        board.bus.absent(level).transfer_in_place(&mut word).unwrap();
        assert_eq!(word, [byte; 4]);
    }
    // A frame in a conversion, which is not answered.
    board.to_adc.write(&[0; 4]).unwrap();
    let mut word = [0x5a; 4];
    board.to_adc.transfer_in_place(&mut word).unwrap();
    assert_eq!(word, [0; 4]);
}

#[test]
fn a_master_in_the_wrong_mode_reads_and_writes_wrong() {
    let board = board(TIMING);
    let mut dac = board.bus.connect(&board.dac, MODE_0);
    let mut adc = board.bus.connect(&board.adc, MODE_1);
    dac.write(&[0x08, 0x00, 0x01]).unwrap();
    assert_eq!(board.dac.borrow().range(), 0);
    board.adc.borrow_mut().set_input(3.75);
    adc.write(&[0xd0, 0x14, 0, 1]).unwrap();
    assert_eq!(board.adc.borrow().range_sel(), 0);
    let mut word = [0; 4];
    adc.read(&mut word).unwrap();
    assert_ne!(word[..2], [0xa7, 0x10]);
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

#[test]
fn read_back_of_the_dac_needs_a_slow_clock() {
    // Half a period of 40 ns is 12.5 MHz. Above it 0x5afffd comes one place too low, after the last bit of 0x080005.
    let late = [0xad, 0x7f, 0xfe];
    for (sck_hz, expected) in [(12_500_000, [0x5a, 0xff, 0xfd]), (13_125_000, late), (21_000_000, late)] {
        let mut board = board(SpiTiming { sck_hz, ..TIMING });
        board.to_dac.write(&[0x08, 0x00, 0x05]).unwrap();
        board.to_dac.write(&[0x88, 0, 0]).unwrap();
        let mut answer = [0x18, 0, 0];
        board.to_dac.transfer_in_place(&mut answer).unwrap();
        assert_eq!(answer, expected, "{sck_hz} Hz");
    }
}

/// Both chips on one bus, LDAC at a pin of embedded-hal: the ADC measures what the DAC puts out.
#[test]
fn an_adc_can_measure_what_the_dac_puts_out() {
    let mut board = board(TIMING);
    let dac = Rc::clone(&board.dac);
    board.adc.borrow_mut().set_input_fn(move |now| dac.borrow().volts(now));
    let ldac = Rc::clone(&board.dac);
    let mut ldac = Line::new(&board.clock, 60, move |level, now| ldac.borrow_mut().set_ldac(level, now));
    for frame in [[0x08, 0, 1], [0x10, 0, 1]] {
        board.to_dac.write(&frame).unwrap();
    }
    board.clock.advance(10_000);
    board.to_dac.write(&[0x00, 0x60, 0x00]).unwrap();
    let before = board.clock.now();
    ldac.set_low().unwrap();
    ldac.set_high().unwrap();
    assert_eq!(board.clock.now() - before, 120);
    board.clock.advance(10_000);
    board.to_adc.write(&[0; 4]).unwrap();
    board.to_dac.write(&[0x88, 0x00, 0x00]).unwrap();
    let mut word = [0; 4];
    board.to_adc.read(&mut word).unwrap();
    // 3.75 V
    assert_eq!(word, [0xa7, 0x10, 0, 0]);
    let mut answer = [0x18, 0, 0];
    board.to_dac.transfer_in_place(&mut answer).unwrap();
    assert_eq!(answer, [0x5a, 0xff, 0xf9]);
    assert_eq!(board.adc.borrow().violations(), []);
    assert_eq!(board.dac.borrow().violations(), []);
}
