//! `firmware/src/bench.rs`: frames that reach the converters, and answers that come back. How the converters behave is not shown here.

use board_on_host::board::Board;
use board_on_host::chip::gpio::Pin;
use board_on_host::chip::rcc::Oscillators;
use dea_driver::chips::CommandRange;
use dea_driver::{AmplifierError, Drive};

use super::slaves::{Frame, Frames, adc, adc_wiring, dac, dac_wiring};
use super::start::start;

const ENABLE: Pin = Pin::new('C', 6);
const INTERLOCK: Pin = Pin::new('C', 7);
const DRIVE: Drive = Drive { enable: true, dac_v: 3.0, range: CommandRange::TenVolts };

fn frames(frames: &Frames) -> Vec<Frame> {
    frames.lock().map(|mut frames| std::mem::take(&mut *frames)).unwrap_or_default()
}

fn sent(record: &Frames) -> Vec<Vec<u8>> {
    frames(record).iter().map(Frame::sent).collect()
}

#[test]
fn a_tick_moves_its_frames_and_nothing_else() {
    let board = Board::new(Oscillators::default());
    let ((dac, to_dac), (monitor, to_monitor), (sensor, to_sensor)) = (dac(), adc(0x4000), adc(0x8000));
    board.chip(|chip| {
        chip.wire(dac_wiring(), dac);
        chip.wire(adc_wiring(0), monitor);
        chip.wire(adc_wiring(1), sensor);
    });
    let mut bench = start(&board);
    assert!(sent(&to_dac).contains(&vec![0, 0, 0]), "0 V was not written");
    assert!(sent(&to_monitor).is_empty() && sent(&to_sensor).is_empty());

    bench.sample();
    let (monitor, sensor) = (frames(&to_monitor), frames(&to_sensor));
    assert_eq!((monitor.len(), sensor.len(), frames(&to_dac).len()), (1, 1, 0));
    for (frame, mode) in [(&monitor[0], 0), (&sensor[0], 0)] {
        check(frame, 4, mode);
    }
    assert_eq!(bench.apply(Drive::OFF), Ok(()));
    for frame in frames(&to_dac) {
        check(&frame, 3, 1);
    }
    assert!(sent(&to_monitor).is_empty() && sent(&to_sensor).is_empty());
    assert_eq!(board.violations(), []);
}

/// A frame has its bytes between the edges of its select, one after another, in the mode of its chip.
fn check(frame: &Frame, bytes: usize, mode: u8) {
    assert_eq!(frame.bytes.len(), bytes);
    let mut free_ns = frame.selected_ns;
    for byte in &frame.bytes {
        assert_eq!(byte.mode, mode);
        assert!(byte.start_ns >= free_ns, "{frame:?}");
        free_ns = byte.start_ns + 8_000_000_000 / u64::from(byte.sck_hz);
    }
    assert!(frame.deselected_ns >= free_ns, "{frame:?}");
}

#[test]
fn readings_come_back_whole() {
    let board = Board::new(Oscillators::default());
    let ((monitor, _), (sensor, _)) = (adc(0x1235), adc(0xfffe));
    board.chip(|chip| {
        chip.wire(adc_wiring(0), monitor);
        chip.wire(adc_wiring(1), sensor);
    });
    let mut bench = start(&board);
    let readings: Vec<_> = (0..8).map(|_| bench.sample()).collect();
    // Setting a converter up takes some ticks.
    let volts = |code: u16| Some(f32::from(code) * (10.24 / 65536.0));
    let last = readings[7];
    assert_eq!((last.monitor_adc_v, last.sensor_adc_v), (volts(0x1235), volts(0xfffe)));
}

#[test]
fn the_amplifier_is_enabled_by_a_dac_that_answers() {
    let board = Board::new(Oscillators::default());
    let (dac, to_dac) = dac();
    board.chip(|chip| chip.wire(dac_wiring(), dac));
    let mut bench = start(&board);
    assert_eq!(bench.apply(Drive { enable: false, ..DRIVE }), Ok(()));
    assert!(!board.chip(|chip| chip.level(ENABLE)));
    assert_eq!(bench.apply(DRIVE), Ok(()));
    assert!(board.chip(|chip| chip.level(ENABLE)));
    // 3 V of 10 V.
    let [high, low] = ((0.3 * 65536.0_f64).round() as u16).to_be_bytes();
    assert_eq!(sent(&to_dac).last(), Some(&vec![0, high, low]));
    assert_eq!(bench.apply(Drive::OFF), Ok(()));
    assert!(!board.chip(|chip| chip.level(ENABLE)));
    let levels: Vec<_> = board.chip(|chip| chip.history(ENABLE)).iter().map(|change| change.driven).collect();
    assert_eq!(levels, [Some(false), Some(true), Some(false)]);
}

#[test]
fn without_converters_nothing_is_enabled_and_nothing_is_read() {
    let board = Board::new(Oscillators::default());
    let mut bench = start(&board);
    for _ in 0..12 {
        let inputs = bench.sample();
        assert_eq!((inputs.monitor_adc_v, inputs.sensor_adc_v), (None, None));
        assert!(matches!(bench.apply(DRIVE), Err(AmplifierError::Readback { .. })));
        assert!(!board.chip(|chip| chip.level(ENABLE)));
    }
}

#[test]
fn the_interlock_is_read_at_its_pin() {
    let board = Board::new(Oscillators::default());
    let mut bench = start(&board);
    for (level, closed) in [(None, false), (Some(true), true), (Some(false), false)] {
        board.chip(|chip| chip.connect(INTERLOCK, level));
        assert_eq!(bench.sample().interlock_closed, closed, "{level:?}");
    }
}

#[test]
fn a_converter_on_the_pins_of_another_bus_hears_nothing() {
    let board = Board::new(Oscillators::default());
    let (dac, to_dac) = dac();
    let elsewhere = board_on_host::wires::Wiring { sck: Pin::new('B', 10), ..dac_wiring() };
    board.chip(|chip| chip.wire(elsewhere, dac));
    let mut bench = start(&board);
    assert!(bench.apply(DRIVE).is_err());
    let frames = frames(&to_dac);
    assert!(!frames.is_empty() && frames.iter().all(|frame| frame.bytes.is_empty()));
}
