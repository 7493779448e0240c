//! `firmware/src/boards`: frames on the buses, and pins. With the converters' models: `converters.rs`.

use board_on_host::board::Board;
use board_on_host::chip::gpio::Pin;
use board_on_host::chip::rcc::Oscillators;
use board_on_host::wires::Wiring;
use dea_driver::{AmplifierError, Drive};

use super::kinds::{H405, Kind, Ticks, board_of, on_every_board, run};
use super::slaves::{Recorder, adc_wiring, dac_wiring};
use super::start::{Core, start_h405};

const ENABLE: Pin = H405::ENABLE;
const DRIVE: Drive = H405::ON;

#[test]
fn a_tick_moves_its_frames_and_nothing_else() {
    let board = Board::new(Oscillators::default());
    let [dac, monitor, sensor] = [(); 3].map(|()| Recorder::new(&[]));
    board.chip(|chip| {
        chip.wire(dac_wiring(), dac.clone());
        chip.wire(adc_wiring(0), monitor.clone());
        chip.wire(adc_wiring(1), sensor.clone());
    });
    let mut bench = start_h405(&board, Core::Crystal);
    let frames = || [&dac, &monitor, &sensor].map(|chip| Recorder::take(chip));
    let only_to_the_dac = || {
        let [dac, monitor, sensor] = frames();
        assert!(!dac.is_empty() && dac.iter().all(|clocks| *clocks == 24), "{dac:?}");
        assert!(monitor.is_empty() && sensor.is_empty());
    };
    only_to_the_dac();
    bench.sample();
    assert_eq!(frames(), [vec![], vec![32], vec![32]]);
    // Zeros are not what it was sent.
    assert!(matches!(bench.apply(Drive::OFF), Err(AmplifierError::Readback { found: 0, .. })));
    only_to_the_dac();
    assert_eq!(board.violations(), []);
}

#[test]
fn without_converters_nothing_is_enabled_and_nothing_is_read() {
    let board = Board::new(Oscillators::default());
    let mut bench = start_h405(&board, Core::Crystal);
    for _ in 0..12 {
        let inputs = bench.sample();
        assert_eq!((inputs.monitor_adc_v, inputs.sensor_adc_v), (None, None));
        assert!(matches!(bench.apply(DRIVE), Err(AmplifierError::Readback { .. })));
        assert!(!board.chip(|chip| chip.level(ENABLE)));
    }
}

fn the_interlock_is_read_at_its_pin<K: Kind>() {
    let (board, _) = board_of::<K>();
    let mut bench = K::start(&board, Core::Crystal);
    for (level, closed) in [(None, false), (Some(true), true), (Some(false), false)] {
        board.chip(|chip| chip.connect(K::INTERLOCK, level));
        assert_eq!(bench.sample().interlock_closed, closed, "{}: {level:?}", K::NAME);
    }
}

/// The pin is read, not what it was set to.
fn an_enable_output_that_is_held_is_seen<K: Kind>() {
    let (board, _) = board_of::<K>();
    let mut bench = K::start(&board, Core::Crystal);
    run::<K>(&board, &mut bench, [K::OFF, K::OFF, K::ON]);
    bench.sample();
    assert!(bench.inspection().enable_high, "{}", K::NAME);
    assert_eq!(bench.apply(K::OFF), Ok(()), "{}", K::NAME);
    bench.sample();
    assert!(!bench.inspection().enable_high, "{}", K::NAME);
}

#[test]
fn a_converter_on_the_pins_of_another_bus_hears_nothing() {
    let board = Board::new(Oscillators::default());
    let dac = Recorder::new(&[]);
    let elsewhere = Wiring { sck: Pin::new('B', 10), ..dac_wiring() };
    board.chip(|chip| chip.wire(elsewhere, dac.clone()));
    let mut bench = start_h405(&board, Core::Crystal);
    assert!(bench.apply(DRIVE).is_err());
    let frames = Recorder::take(&dac);
    assert!(!frames.is_empty() && frames.iter().all(|clocks| *clocks == 0));
}

on_every_board!(the_interlock_is_read_at_its_pin, an_enable_output_that_is_held_is_seen);
