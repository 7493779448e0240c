//! The bus: times, modes, floating lines, slow pads, and what embedded-hal promises.

use std::cell::RefCell;
use std::rc::Rc;

use converter_chips::{
    Ad5754, Ads868x, Channel, Clock, Coding, Floating, LastBit, Line, Rule, SlowPad, SpiBus, SpiTiming, SpiWire,
    Unspecified, Variant,
};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{MODE_0, MODE_1, Operation, SpiDevice};

/// Half a period of 50 ns; 500 ns between calls, 20 ns to the clock, 30 ns after it, 100 ns between bytes.
const TIMING: SpiTiming = SpiTiming {
    sck_hz: 10_000_000,
    between_bytes_ns: 100,
    lead_ns: 20,
    lag_ns: 30,
    between_transactions_ns: 500,
    fill: 0,
    floating: Floating::Low,
    slow: None,
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
    let dac = Rc::new(RefCell::new(Ad5754::with_unspecified(Coding::OffsetBinary, Unspecified::plain())));
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
    assert_eq!(board.bus.transactions(), 1);
    let before = board.clock.now();
    board.to_dac.write(&[]).unwrap();
    assert_eq!(board.clock.now() - before, 550);
    assert_eq!(board.bus.transactions(), 2);
    assert_eq!(board.dac.borrow().violations().len(), 1, "a frame without bits");
}

#[test]
fn delays_move_the_clock() {
    let board = board(TIMING);
    let mut delay = board.clock.delay();
    delay.delay_ns(7);
    delay.delay_us(3);
    delay.delay_ms(2);
    assert_eq!(board.clock.now(), 2_003_007);
    board.clock.advance_to(5);
    assert_eq!(board.clock.now(), 2_003_007, "not back");
}

#[test]
fn a_delay_in_a_transaction_keeps_the_chip_selected() {
    let mut board = board(TIMING);
    board.adc.borrow_mut().set_input_fn(|now| now as f64 * 1e-6);
    let mut operations = [Operation::Write(&[0, 0]), Operation::DelayNs(10_000), Operation::Write(&[0, 0])];
    board.to_adc.transaction(&mut operations).unwrap();
    assert_eq!(board.adc.borrow().frames(), 1);
    assert_eq!(board.clock.now(), 520 + 4 * 750 + 3 * 150 + 10_000 + 30);
}

#[test]
fn the_chips_answer_over_one_bus() {
    let mut board = board(TIMING);
    board.adc.borrow_mut().set_input(3.75);
    board.to_dac.write(&[0x0c, 0x00, 0x03]).unwrap();
    board.to_dac.write(&[0x88, 0x00, 0x00]).unwrap();
    board.to_adc.write(&[0; 4]).unwrap();
    let mut answer = [0x18, 0, 0];
    board.to_dac.transfer_in_place(&mut answer).unwrap();
    assert_eq!(answer, [0, 0, 3]);
    let mut word = [0; 4];
    board.to_adc.read(&mut word).unwrap();
    assert_eq!(word, [0xa7, 0x10, 0, 0]);
    assert_eq!(board.adc.borrow().violations(), []);
    assert_eq!(board.dac.borrow().violations(), []);
}

#[test]
fn transfers_of_unequal_lengths() {
    let mut board = board(SpiTiming { fill: 0xc8, between_transactions_ns: 1_000, ..TIMING });
    board.adc.borrow_mut().set_input(3.75);
    board.to_adc.write(&[0; 4]).unwrap();
    let mut two = [0; 2];
    board.to_adc.transfer(&mut two, &[0xd0, 0x24, 0x12, 0x34]).unwrap();
    assert_eq!(two, [0xa7, 0x10]);
    // Four bytes of 0xc8 read the half-word at 0x0c8.
    let mut four = [0; 4];
    board.to_adc.transfer(&mut four, &[]).unwrap();
    assert_eq!(four, [0xa7, 0x10, 0, 0]);
    board.to_adc.read(&mut four).unwrap();
    assert_eq!(four, [0; 4]);
    assert_eq!(board.adc.borrow().register(0x24), 0x34);
}

#[test]
fn the_time_between_calls_counts_at_the_chips() {
    for (between, seen) in [(664, 1), (665, 2)] {
        let mut board = board(SpiTiming { between_transactions_ns: between, ..TIMING });
        board.clock.advance(10_000);
        board.to_adc.write(&[0; 4]).unwrap();
        board.to_adc.write(&[0; 4]).unwrap();
        assert_eq!(board.adc.borrow().frames(), seen, "{between} ns");
    }
    // The other device's transactions pass the time as well.
    let mut board = board(SpiTiming { between_transactions_ns: 300, ..TIMING });
    board.clock.advance(10_000);
    board.to_adc.write(&[0; 4]).unwrap();
    board.to_dac.write(&[0x18, 0, 0]).unwrap();
    board.to_adc.write(&[0; 4]).unwrap();
    assert_eq!(board.adc.borrow().frames(), 2);
}

#[test]
fn devices_that_are_absent_read_one_level() {
    let board = board(TIMING);
    for (level, byte) in [(true, 0xff), (false, 0x00)] {
        let mut word = [0x5a; 4];
        board.bus.absent(level).transfer_in_place(&mut word).unwrap();
        assert_eq!(word, [byte; 4]);
    }
}

#[test]
fn a_floating_line_reads_as_chosen() {
    // A frame during a conversion, which no chip answers. The line keeps the last bit of 0xa711 or 0xa710.
    for (floating, code, expected) in [
        (Floating::Low, 0xa711_u16, 0x00),
        (Floating::High, 0xa710, 0xff),
        (Floating::Holds, 0xa711, 0xff),
        (Floating::Holds, 0xa710, 0x00),
    ] {
        let mut board = board(SpiTiming { floating, between_transactions_ns: 400, ..TIMING });
        board.adc.borrow_mut().set_input(f64::from(code) * 375e-6 - 12.288);
        board.to_adc.write(&[0; 4]).unwrap();
        board.clock.advance(1_000);
        // A frame of 16 bits, which ends with the code's last one.
        board.to_adc.write(&[0; 2]).unwrap();
        let mut word = [0x5a; 4];
        board.to_adc.transfer_in_place(&mut word).unwrap();
        assert_eq!(word, [expected; 4], "{floating:?} after {code:#06x}");
        assert_eq!(board.adc.borrow().unseen_frames(), 1);
    }
}

#[test]
fn a_master_in_the_wrong_mode_reads_and_writes_wrong() {
    let board = board(TIMING);
    let mut dac = board.bus.connect(&board.dac, MODE_0);
    let mut adc = board.bus.connect(&board.adc, MODE_1);
    dac.write(&[0x0c, 0x00, 0x01]).unwrap();
    assert_eq!(board.dac.borrow().range(Channel::A).bits(), 0);
    board.adc.borrow_mut().set_input(3.75);
    adc.write(&[0xd0, 0x24, 0x12, 0x34]).unwrap();
    assert_eq!(board.adc.borrow().register(0x24), 0xff);
    let mut word = [0; 4];
    adc.read(&mut word).unwrap();
    assert_ne!(word[..2], [0xa7, 0x10]);
}

#[test]
fn a_slow_pad_spoils_the_last_bit_of_each_received_byte() {
    let read = |slow: Option<SlowPad>, sck_hz: u32, code: u16| {
        let mut board = board(SpiTiming { slow, sck_hz, ..TIMING });
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
    let erratum = Some(SlowPad::default());
    let repeated = Some(SlowPad { above_hz: 8_000_000, last_bit: LastBit::Repeated });
    assert_eq!(read(None, 10_500_000, 0xa713), [0xa7, 0x13]);
    // The last bit of the byte before: 0, then that of 0xa7.
    assert_eq!(read(erratum, 10_500_000, 0xa713), [0xa6, 0x13]);
    assert_eq!(read(erratum, 10_500_000, 0xa610), [0xa6, 0x10]);
    assert_eq!(read(erratum, 10_500_000, 0xa710), [0xa6, 0x11]);
    assert_eq!(read(erratum, 1_000_000, 0xa713), [0xa6, 0x13], "at every frequency");
    // The bit before in the same byte.
    assert_eq!(read(repeated, 10_500_000, 0xa610), [0xa7, 0x10]);
    assert_eq!(read(repeated, 10_500_000, 0xa711), [0xa7, 0x10]);
    assert_eq!(read(repeated, 8_000_000, 0xa610), [0xa6, 0x10], "not above its limit");
}

#[test]
fn a_slow_pad_does_not_spoil_what_is_sent() {
    let mut board = board(SpiTiming { slow: Some(SlowPad::default()), ..TIMING });
    board.to_dac.write(&[0x0c, 0x00, 0x05]).unwrap();
    assert_eq!(board.dac.borrow().range(Channel::D).bits(), 5);
}

#[test]
fn read_back_of_the_dac_needs_a_slow_clock() {
    // Half a period of 40 ns is 12.5 MHz.
    // Above it all comes one place too low, after what SDO gave last: the last bit of 0x0c0005.
    for (sck_hz, expected) in [(12_500_000, [0, 0, 5]), (13_125_000, [0x80, 0, 2]), (21_000_000, [0x80, 0, 2])] {
        let mut board = board(SpiTiming { sck_hz, ..TIMING });
        board.to_dac.write(&[0x0c, 0x00, 0x05]).unwrap();
        board.to_dac.write(&[0x88, 0, 0]).unwrap();
        let mut answer = [0x18, 0, 0];
        board.to_dac.transfer_in_place(&mut answer).unwrap();
        assert_eq!(answer, expected, "{sck_hz} Hz");
    }
}

#[test]
fn one_device_may_have_its_own_times() {
    let mut board = board(TIMING);
    let mut slow = board.to_dac.clone().with_timing(SpiTiming { sck_hz: 1_000_000, ..TIMING });
    let before = board.clock.now();
    slow.write(&[0]).unwrap();
    assert_eq!(board.clock.now() - before, 500 + 20 + 7_500 + 30);
    board.bus.set_timing(SpiTiming { lag_ns: 0, ..board.bus.timing() });
    let before = board.clock.now();
    board.to_dac.write(&[0]).unwrap();
    assert_eq!(board.clock.now() - before, 500 + 20 + 750);
}

#[test]
fn lines_are_pins_of_embedded_hal() {
    let mut board = board(TIMING);
    let ldac = Rc::clone(&board.dac);
    let mut ldac = Line::new(&board.clock, 60, move |level, now| ldac.borrow_mut().set_ldac(level, now));
    for frame in [[0x0c, 0, 1], [0x10, 0, 0x0f]] {
        board.to_dac.write(&frame).unwrap();
    }
    board.clock.advance(10_000);
    board.to_dac.write(&[0x04, 0x80, 0x00]).unwrap();
    let before = board.clock.now();
    ldac.set_low().unwrap();
    ldac.set_high().unwrap();
    assert_eq!(board.clock.now() - before, 120);
    // 60 ns after SYNC is too soon for LDAC.
    assert_eq!(board.dac.borrow().violations()[0].rule, Rule::LdacAfterSync(60));
    board.clock.advance(100);
    ldac.set_low().unwrap();
    board.clock.advance(10_000);
    assert_eq!(board.dac.borrow().volts(Channel::B, board.clock.now()), 5.0);
}

#[test]
fn an_adc_can_measure_what_the_dac_puts_out() {
    let mut board = board(TIMING);
    let dac = Rc::clone(&board.dac);
    board.adc.borrow_mut().set_input_fn(move |now| dac.borrow().volts(Channel::A, now));
    for frame in [[0x0c, 0, 1], [0x10, 0, 0x0f]] {
        board.to_dac.write(&frame).unwrap();
    }
    board.clock.advance(10_000);
    for frame in [[0x00, 0x60, 0x00], [0x1d, 0, 0]] {
        board.to_dac.write(&frame).unwrap();
    }
    board.clock.advance(10_000);
    board.to_adc.write(&[0; 4]).unwrap();
    let mut word = [0; 4];
    board.clock.advance(1_000);
    board.to_adc.read(&mut word).unwrap();
    // 3.75 V
    assert_eq!(word, [0xa7, 0x10, 0, 0]);
}
