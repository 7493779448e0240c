//! The firmware's benches with the models of their converters: registers, pads, buses and chips together, tick by tick.

use board_on_host::board::Board;
use board_on_host::chip::rcc::Oscillators;
use converter_chips::Variant;
use dea_driver::AmplifierError;

use super::kinds::{
    Discovery, H405, Kind, Nucleo, SET_UP, Ticks, assert_near, board_of, is_enabled, on_every_board, run, tick,
};
use super::start::{CLOCKS, Core, start_h405};

#[test]
fn sensors_are_read_at_both_clocks_of_the_core_with_every_converter() {
    fn on<K: Kind>(core: Core, volts: [f64; 2]) {
        let (board, converters) = board_of::<K>();
        reads(&board, &converters, &mut K::start(&board, core), volts);
    }
    for core in CLOCKS {
        for variant in [Variant::Ads8681, Variant::Ads8685, Variant::Ads8689] {
            let board = Board::new(Oscillators::default());
            let converters = H405::with(&board, variant);
            reads(&board, &converters, &mut start_h405(&board, core), [1.2345, 9.8765]);
        }
        on::<Discovery>(core, [0.12345, 2.65432]);
        on::<Nucleo>(core, [0.12345, 2.96543]);
    }
}

fn reads<K: Kind>(board: &Board, converters: &K, bench: &mut K::Bench, [monitor_v, sensor_v]: [f64; 2]) {
    converters.set_monitor(board, monitor_v);
    converters.set_sensor(board, sensor_v);
    run::<K>(board, bench, [K::OFF; SET_UP]);
    let (inputs, applied) = tick(board, bench, K::OFF);
    assert_near::<K>(inputs.monitor_adc_v, monitor_v);
    assert_near::<K>(inputs.sensor_adc_v, sensor_v);
    assert_eq!(applied, Ok(()));
    converters.assert_no_violations(board);
}

fn the_command_reaches_the_output_and_the_enable_takes_it_back<K: Kind>() {
    for core in CLOCKS {
        let (board, converters) = board_of::<K>();
        let mut bench = K::start(&board, core);
        for _ in 0..SET_UP {
            assert_eq!(tick(&board, &mut bench, K::OFF).1, Ok(()), "{}", K::NAME);
            assert_eq!(converters.command_v(&board), 0.0, "{}", K::NAME);
        }
        run::<K>(&board, &mut bench, [K::ON; 3]);
        assert!(is_enabled::<K>(&board));
        let (found, wanted) = (converters.command_v(&board), f64::from(K::ON.dac_v) * K::LOADED);
        assert!((found - wanted).abs() < K::STEP_V, "{}: {found} V instead of {wanted} V", K::NAME);
        assert_eq!(tick(&board, &mut bench, K::OFF).1, Ok(()), "{}", K::NAME);
        assert!(!is_enabled::<K>(&board));
        assert_eq!(converters.command_v(&board), 0.0, "{}", K::NAME);
        converters.assert_no_violations(&board);
    }
}

fn a_dac_that_loses_its_supply_disables_the_amplifier<K: Kind>() {
    let (board, converters) = board_of::<K>();
    let mut bench = K::start(&board, Core::Crystal);
    run::<K>(&board, &mut bench, [K::OFF, K::OFF, K::ON, K::ON]);
    assert!(is_enabled::<K>(&board));
    converters.fail_dac(&board);
    assert!(matches!(tick(&board, &mut bench, K::ON).1, Err(AmplifierError::Readback { .. })), "{}", K::NAME);
    assert!(!is_enabled::<K>(&board));
    // And it is not enabled again.
    assert!(tick(&board, &mut bench, K::ON).1.is_err());
    assert!(!is_enabled::<K>(&board));
    assert_eq!(board.violations(), []);
}

fn an_adc_that_loses_its_supply_is_not_believed_and_comes_back<K: Kind>() {
    let (board, converters) = board_of::<K>();
    converters.set_monitor(&board, 2.0);
    let mut bench = K::start(&board, Core::Crystal);
    run::<K>(&board, &mut bench, [K::OFF; SET_UP]);
    assert_near::<K>(tick(&board, &mut bench, K::OFF).0.monitor_adc_v, 2.0);
    converters.fail_monitor(&board, true);
    assert_eq!(tick(&board, &mut bench, K::OFF).0.monitor_adc_v, None, "{}", K::NAME);
    converters.fail_monitor(&board, false);
    let readings: Vec<_> = (0..40).map(|_| tick(&board, &mut bench, K::OFF).0.monitor_adc_v).collect();
    // Never a wrong one on the way.
    for reading in readings.iter().flatten() {
        assert_near::<K>(Some(*reading), 2.0);
    }
    assert_near::<K>(readings[39], 2.0);
}

/// By the watchdog, the pin, a panic or a brown-out: the pins float, and resistors hold them.
fn a_reset_ends_at_0_v_with_the_enable_output_low<K: Kind>() {
    for core in CLOCKS {
        let (board, converters) = board_of::<K>();
        let mut bench = K::start(&board, core);
        run::<K>(&board, &mut bench, [K::OFF, K::OFF, K::ON, K::ON]);
        assert!(is_enabled::<K>(&board) && converters.command_v(&board) > 1.0);
        board.chip(|chip| {
            chip.reset();
            // Until the output has settled.
            chip.wait_ns(20_000);
        });
        assert!(!is_enabled::<K>(&board), "{}", K::NAME);
        assert_eq!(converters.command_v(&board), 0.0, "{}", K::NAME);
        // Nor does the start after it move them.
        let mut bench = K::start(&board, core);
        for _ in 0..SET_UP {
            bench.sample();
            assert_eq!(bench.apply(K::OFF), Ok(()), "{}", K::NAME);
            assert!(!is_enabled::<K>(&board), "{}", K::NAME);
            assert_eq!(converters.command_v(&board), 0.0, "{}", K::NAME);
            board.chip(|chip| chip.wait_ns(1_000_000));
        }
    }
}

on_every_board!(
    the_command_reaches_the_output_and_the_enable_takes_it_back,
    a_dac_that_loses_its_supply_disables_the_amplifier,
    an_adc_that_loses_its_supply_is_not_believed_and_comes_back,
    a_reset_ends_at_0_v_with_the_enable_output_low
);
