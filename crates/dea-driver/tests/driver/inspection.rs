//! The requests of a host before it enables anything, and whole ticks for the processor in the loop.

use dea_driver::chips::{AdcCode, AdcRange, CommandRange, DacCode};
use dea_driver::wire::{Answer, Command, Inspection, Mode, Part, Reject, TickCodes, Ticked};
use dea_driver::{AdcError, AmplifierError, Blob, Cause, Controller, Device, Drive, DriverState, Inputs, Refusal};

use crate::board::{BOARD, inspection};
use crate::host::{Host, blob};

#[test]
fn a_host_asks_what_the_board_finds_of_its_parts() {
    let mut host = Host::new(None);
    let found = Inspection {
        dac: Err(AmplifierError::Readback { wanted: 1, found: 0 }).into(),
        monitor: Ok::<AdcCode, AdcError>(AdcCode(0)).into(),
        sensor: Err::<AdcCode, _>(AdcError::Range { wanted: 9, found: 8 }).into(),
        monitor_adc_v: 0.25,
        ..inspection(true, false)
    };
    assert_eq!(found.dac, Part::Wrong { wanted: 1, found: 0 });
    assert_eq!((found.monitor, found.sensor), (Part::Answers, Part::Wrong { wanted: 9, found: 8 }));
    let others = [Part::from(Err(AmplifierError::Bus)), Err(AmplifierError::Enable).into()];
    assert_eq!(others, [Part::Bus, Part::Pin]);
    assert_eq!(Part::from(Err(AmplifierError::NoReference)), Part::NoReference);
    let others = [AdcError::Bus, AdcError::Starting].map(|error| Part::from(Err::<AdcCode, _>(error)));
    assert_eq!(others, [Part::Bus, Part::Starting]);
    host.bench.device.report(found);
    assert_eq!(host.ask(Command::Inspect), Answer::Inspection(found));
}

/// A pin that is not as the tick before has set it trips and stays latched, high or low, in every state; as it is set it never does. It lags a tick,
/// since it is read with the inputs.
#[test]
fn an_enable_output_that_is_not_as_it_was_set_is_latched() {
    let tripped = DriverState::Tripped(Cause::Enable);
    for state in [DriverState::Disarmed, DriverState::Armed, DriverState::Running] {
        for is_wrong in [false, true] {
            let mut host = Host::with_parameters();
            let mut pin = false;
            for tick in 0..40 {
                if tick == 5 && state.is_live() {
                    host.arm();
                }
                if tick == 10 && state == DriverState::Running {
                    host.done(Command::Start(Mode::Voltage));
                }
                host.tick();
                let enable_high = pin != (is_wrong && tick == 20);
                pin = host.bench.drive.enable;
                host.bench.device.report(inspection(true, enable_high));
                assert_eq!(host.state() == tripped, is_wrong && tick >= 20, "{state:?}, tick {tick}");
            }
            assert_eq!(host.state(), if is_wrong { tripped } else { state });
            assert!(!is_wrong || !host.bench.drive.enable);
        }
    }
    // Without parameters nothing is enabled: the pin is low.
    let mut device = Device::new(None);
    let inputs = Inputs { interlock_closed: true, monitor_adc_v: Some(0.0), sensor_adc_v: Some(1.0) };
    (0..2).for_each(|_| assert_eq!(device.tick(inputs), Drive::OFF));
    device.report(inspection(true, false));
    assert_eq!(device.state(), DriverState::Disarmed);
    device.report(inspection(true, true));
    assert_eq!(device.state(), tripped);
}

/// A board that resets itself would drop what it holds.
#[test]
fn the_watchdog_is_starved_only_while_the_amplifier_is_disabled() {
    let mut host = Host::with_parameters();
    host.arm();
    assert_eq!(host.ask(Command::StopFeedingWatchdog), Answer::Refused(Refusal::State(DriverState::Armed)));
    assert!(!host.bench.watchdog_expires);
    host.done(Command::Disarm);
    host.done(Command::StopFeedingWatchdog);
    assert!(host.bench.watchdog_expires);
}

/// A film at 1 V of its sensor with the noise of two codes, whose monitor follows a tick late, towards 2 kV.
fn codes(tick: u16, monitor: u16) -> TickCodes {
    TickCodes { interlock_closed: tick < 400, monitor, sensor: 6400 + tick % 3, target: 2000.0 }
}

/// Codes in and codes out: what a controller of the same parameters does that is asked by hand, until the interlock opens.
#[test]
fn whole_ticks_are_those_of_a_controller() {
    let mut host = Host::new(None);
    let inputs = |codes: &[TickCodes]| Command::Tick { mode: Mode::Voltage, inputs: codes.iter().copied().collect() };
    assert_eq!(host.ask(inputs(&[codes(0, 0)])), Answer::Rejected(Reject::NoParameters));
    let mut host = Host::with_parameters();
    assert_eq!(host.ask(inputs(&[codes(0, 0)])), Answer::Rejected(Reject::NoParameters), "before it is at rest");
    for run in 0..2 {
        host.done(Command::Rest);
        let mut controller = Controller::new(Blob::decode(&blob(), BOARD).expect("valid"));
        let (mut applied, mut sampled) = (0u16, 0u16);
        let mut highest = 0;
        for tick in 0..500 {
            let given = codes(tick, sampled);
            let there = match host.ask(inputs(&[given])) {
                Answer::Ticked { ticks, .. } => ticks[0],
                other => panic!("{other:?}"),
            };
            match controller.supervisor().state() {
                DriverState::Disarmed => drop(controller.arm()),
                DriverState::Armed => drop(controller.start(Mode::Voltage)),
                _ => {}
            }
            let _ = controller.set_voltage(given.target);
            controller.heartbeat();
            let volts = |code| Some(AdcCode(code).volts(AdcRange::UpTo10V24));
            let outputs = controller.tick(Inputs {
                interlock_closed: given.interlock_closed,
                monitor_adc_v: volts(given.monitor),
                sensor_adc_v: volts(given.sensor),
            });
            let command = DacCode::from_volts(outputs.dac_v, CommandRange::TenVolts).0;
            let state = controller.supervisor().state();
            let here = Ticked { enable: outputs.enable, command, state, predicted_m: outputs.telemetry.predicted_m };
            assert_eq!(there, here, "run {run}, tick {tick}");
            highest = highest.max(command);
            sampled = applied;
            applied = (DacCode(command).volts(CommandRange::TenVolts) / 10.24 * 65_536.0) as u16;
        }
        assert_eq!(highest, DacCode::from_volts(2.0, CommandRange::TenVolts).0, "it has reached 2 kV");
    }
    host.arm();
    assert_eq!(host.ask(inputs(&[codes(0, 0)])), Answer::Refused(Refusal::State(DriverState::Armed)));
}
