//! `firmware/src/bench.rs`: frames on the buses, and pins. With the converters' models: `converters.rs`.

use board_on_host::board::Board;
use board_on_host::chip::gpio::Pin;
use board_on_host::chip::rcc::Oscillators;
use board_on_host::wires::Wiring;
use dea_driver::chips::CommandRange;
use dea_driver::{AmplifierError, Drive};

use super::slaves::{Frame, Recorder, adc_wiring, dac_wiring};
use super::start::start;

const ENABLE: Pin = Pin::new('C', 6);
const INTERLOCK: Pin = Pin::new('C', 7);
const DRIVE: Drive = Drive { enable: true, dac_v: 3.0, range: CommandRange::TenVolts };

#[test]
fn a_tick_moves_its_frames_and_nothing_else() {
    let board = Board::new(Oscillators::default());
    let ((dac, to_dac), (monitor, to_monitor), (sensor, to_sensor)) =
        (Recorder::new(&[]), Recorder::new(&[]), Recorder::new(&[]));
    board.chip(|chip| {
        chip.wire(dac_wiring(), dac);
        chip.wire(adc_wiring(0), monitor);
        chip.wire(adc_wiring(1), sensor);
    });
    let mut bench = start(&board);
    let to_adcs = || (to_monitor.take(), to_sensor.take());
    let begun = to_dac.take();
    assert!(begun.iter().any(|frame| frame.sent() == [0, 0, 0]), "0 V was not written");
    assert!(begun.iter().all(|frame| is_whole(frame, 3, 1)), "{begun:?}");
    let (monitor, sensor) = to_adcs();
    assert!(monitor.is_empty() && sensor.is_empty());

    bench.sample();
    let (monitor, sensor) = to_adcs();
    assert_eq!((monitor.len(), sensor.len(), to_dac.take().len()), (1, 1, 0));
    assert!(is_whole(&monitor[0], 4, 0) && is_whole(&sensor[0], 4, 0), "{monitor:?}, {sensor:?}");
    // Zeros are not what it was sent.
    assert!(matches!(bench.apply(Drive::OFF), Err(AmplifierError::Readback { found: 0, .. })));
    let command = to_dac.take();
    assert!(!command.is_empty() && command.iter().all(|frame| is_whole(frame, 3, 1)), "{command:?}");
    let (monitor, sensor) = to_adcs();
    assert!(monitor.is_empty() && sensor.is_empty());
    assert_eq!(board.violations(), []);
}

/// Whether a frame has its bytes between the edges of its select, one after another, in the mode of its chip.
fn is_whole(frame: &Frame, bytes: usize, mode: u8) -> bool {
    let mut free_ns = frame.selected_ns;
    let mut in_order = true;
    for byte in &frame.bytes {
        in_order &= byte.mode == mode && byte.start_ns >= free_ns;
        // The last edge of its clock.
        free_ns = byte.edges_ns(7).1;
    }
    frame.bytes.len() == bytes && in_order && frame.deselected_ns >= free_ns
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
    let (dac, to_dac) = Recorder::new(&[]);
    let elsewhere = Wiring { sck: Pin::new('B', 10), ..dac_wiring() };
    board.chip(|chip| chip.wire(elsewhere, dac));
    let mut bench = start(&board);
    assert!(bench.apply(DRIVE).is_err());
    let frames = to_dac.take();
    assert!(!frames.is_empty() && frames.iter().all(|frame| frame.bytes.is_empty()));
}
