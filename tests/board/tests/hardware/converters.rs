//! The firmware's bench with the converters' models on its pins: registers, pads, buses and chips together, tick by tick.

use std::cell::RefCell;
use std::rc::Rc;

use board_on_host::board::Board;
use board_on_host::chip::gpio::Pin;
use board_on_host::chip::rcc::Oscillators;
use board_on_host::hal::rcc::Config;
use board_on_host::stm32_h405::Bench;
use converter_chips::{Ad5754, Ads868x, Rule, Variant};
use dea_driver::chips::CommandRange;
use dea_driver::{AmplifierError, Drive, Inputs};

use super::slaves::{adc_wiring, dac_wiring};
use super::start::{crystal, start_on};

const ENABLE: Pin = Pin::new('C', 6);
const OFF: Drive = Drive { enable: false, dac_v: 0.0, range: CommandRange::TenVolts };
const ON: Drive = Drive { enable: true, dac_v: 3.0, range: CommandRange::TenVolts };
/// Ticks after which every converter is set up.
const SET_UP: usize = 8;

/// The converters of `docs/wiring.md`.
struct Converters {
    dac: Rc<RefCell<Ad5754>>,
    monitor: Rc<RefCell<Ads868x>>,
    sensor: Rc<RefCell<Ads868x>>,
}

impl Converters {
    /// Wires them to a board: straight binary, LDAC to ground, CLR to the enable output; RST high.
    fn on(board: &Board, variant: Variant) -> Self {
        let dac = Rc::new(RefCell::new(Ad5754::new()));
        dac.borrow_mut().set_ldac(false, 0);
        let [monitor, sensor] = [(); 2].map(|()| Rc::new(RefCell::new(Ads868x::new(variant))));
        let cleared = Rc::clone(&dac);
        board.chip(|chip| {
            // They had power long before the chip has.
            chip.wait_ns(50_000_000);
            chip.watch(ENABLE, move |high, now| cleared.borrow_mut().set_clr(high, now));
            chip.wire(dac_wiring(), dac.clone());
            chip.wire(adc_wiring(0), monitor.clone());
            chip.wire(adc_wiring(1), sensor.clone());
        });
        Self { dac, monitor, sensor }
    }
}

/// A tick, a thousand times a second.
fn tick(board: &Board, bench: &mut Bench, drive: Drive) -> (Inputs, Result<(), AmplifierError>) {
    let start = board.chip(|chip| chip.now_ns());
    let inputs = bench.sample();
    let applied = bench.apply(drive);
    board.chip(|chip| chip.wait_ns(1_000_000 - (chip.now_ns() - start)));
    (inputs, applied)
}

fn assert_near(found: Option<f32>, wanted: f32) {
    // A code of 10.24 V.
    assert!(found.is_some_and(|found| (found - wanted).abs() <= 10.24 / 65536.0), "{found:?} instead of {wanted} V");
}

/// Nothing was done to a converter that its data sheet forbids. 0 V is written to a DAC that is cleared, or has no power yet, on
/// purpose: it is at 0 V already, and takes no code.
fn assert_no_violations(board: &Board, converters: &Converters) {
    assert_eq!(board.violations(), []);
    let at_zero = |rule| matches!(rule, Rule::WriteWhilePoweredDown | Rule::LoadWhileClear);
    let dac = converters.dac.borrow();
    let found: Vec<_> = dac.violations().iter().filter(|violation| !at_zero(violation.rule)).collect();
    assert!(found.is_empty(), "{found:?}");
    assert_eq!(converters.monitor.borrow().violations(), []);
    assert_eq!(converters.sensor.borrow().violations(), []);
}

#[test]
fn sensors_are_read_at_both_clocks_of_the_core_with_every_converter() {
    for clocks in [crystal(), Config::hsi()] {
        for variant in [Variant::Ads8681, Variant::Ads8685, Variant::Ads8689] {
            let board = Board::new(Oscillators::default());
            let converters = Converters::on(&board, variant);
            converters.monitor.borrow_mut().set_input(1.2345);
            converters.sensor.borrow_mut().set_input(9.8765);
            let mut bench = start_on(&board, clocks);
            for _ in 0..SET_UP {
                assert_eq!(tick(&board, &mut bench, OFF).1, Ok(()));
            }
            let (inputs, applied) = tick(&board, &mut bench, OFF);
            assert_near(inputs.monitor_adc_v, 1.2345);
            assert_near(inputs.sensor_adc_v, 9.8765);
            assert_eq!(applied, Ok(()));
            assert_no_violations(&board, &converters);
        }
    }
}

#[test]
fn the_command_reaches_the_output_and_the_enable_takes_it_back() {
    for clocks in [crystal(), Config::hsi()] {
        let board = Board::new(Oscillators::default());
        let converters = Converters::on(&board, Variant::Ads8689);
        let volts = || converters.dac.borrow().volts(board.chip(|chip| chip.now_ns()));
        let mut bench = start_on(&board, clocks);
        for _ in 0..SET_UP {
            assert_eq!(tick(&board, &mut bench, OFF).1, Ok(()));
            assert_eq!(volts(), 0.0);
        }
        for _ in 0..3 {
            assert_eq!(tick(&board, &mut bench, ON).1, Ok(()));
        }
        assert!(board.chip(|chip| chip.level(ENABLE)));
        assert!((volts() - 3.0).abs() < 10.0 / 65536.0, "{} V", volts());
        assert_eq!(tick(&board, &mut bench, OFF).1, Ok(()));
        assert!(!board.chip(|chip| chip.level(ENABLE)));
        assert_eq!(volts(), 0.0);
        assert_no_violations(&board, &converters);
    }
}

#[test]
fn a_dac_that_loses_its_supply_disables_the_amplifier() {
    let board = Board::new(Oscillators::default());
    let converters = Converters::on(&board, Variant::Ads8689);
    let mut bench = start_on(&board, crystal());
    for drive in [OFF, OFF, ON, ON] {
        assert_eq!(tick(&board, &mut bench, drive).1, Ok(()));
    }
    assert!(board.chip(|chip| chip.level(ENABLE)));
    let now = board.chip(|chip| chip.now_ns());
    converters.dac.borrow_mut().set_dvcc(false, now);
    assert!(matches!(tick(&board, &mut bench, ON).1, Err(AmplifierError::Readback { .. })));
    assert!(!board.chip(|chip| chip.level(ENABLE)));
    assert_eq!(board.violations(), []);
}

#[test]
fn an_adc_that_loses_its_supply_is_not_believed_and_comes_back() {
    let board = Board::new(Oscillators::default());
    let converters = Converters::on(&board, Variant::Ads8689);
    converters.monitor.borrow_mut().set_input(2.0);
    let mut bench = start_on(&board, crystal());
    for _ in 0..SET_UP {
        assert_eq!(tick(&board, &mut bench, OFF).1, Ok(()));
    }
    assert_near(tick(&board, &mut bench, OFF).0.monitor_adc_v, 2.0);
    let now = board.chip(|chip| chip.now_ns());
    converters.monitor.borrow_mut().set_dvdd(false, now);
    assert_eq!(tick(&board, &mut bench, OFF).0.monitor_adc_v, None);
    let now = board.chip(|chip| chip.now_ns());
    converters.monitor.borrow_mut().set_dvdd(true, now);
    let readings: Vec<_> = (0..40).map(|_| tick(&board, &mut bench, OFF).0.monitor_adc_v).collect();
    // Never a wrong one on the way.
    for reading in readings.iter().flatten() {
        assert_near(Some(*reading), 2.0);
    }
    assert_near(readings[39], 2.0);
}
