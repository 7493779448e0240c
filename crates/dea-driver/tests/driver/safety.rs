//! Every state and every fault: each ends at 0 V with the amplifier disabled and its first cause latched.

use dea_driver::{Cause, DriverState, Limits, OnSensorFault, Readings, Refusal, SensorFault, Supervisor};

use crate::bench::bench_limits;
use crate::supervisor_bench::{Bench, RATE_HZ, Spoil};

#[test]
fn every_fault_ends_at_0_v_with_its_cause() {
    let faults: [(Cause, u32, Spoil); 10] = [
        (Cause::Interlock, 1, |r| r.interlock_closed = false),
        (Cause::Voltage, 1, |r| r.monitor_v = 7000.0),
        // A stuck or dead monitor: after the settling time of 20 ticks.
        (Cause::Monitor, 21, |r| r.monitor_v = 1000.0),
        (Cause::Monitor, 21, |r| r.monitor_v = f32::NAN),
        (Cause::Sensor(SensorFault::Range), 1, |r| r.displacement_m = 0.5),
        (Cause::Sensor(SensorFault::Range), 1, |r| r.displacement_m = f32::NAN),
        (Cause::Sensor(SensorFault::Range), 1, |r| r.displacement_m = f32::NEG_INFINITY),
        (Cause::Sensor(SensorFault::Jump), 1, |r| r.displacement_m += 0.5e-3),
        // 500 equal values, the first of which is one. The model does not move.
        (Cause::Sensor(SensorFault::Stuck), 501, |r| r.displacement_m = 0.9e-3),
        (Cause::Interlock, 1, |r| {
            *r = Readings { interlock_closed: false, monitor_v: f32::NAN, displacement_m: f32::NAN, ..*r }
        }),
    ];
    for (cause, ticks, spoil) in faults {
        let mut bench = Bench::run(&bench_limits());
        assert_eq!(bench.spoil_until_tripped(spoil, true), ticks, "{cause:?}");
        bench.is_safe(cause);
    }
}

/// Values that seem plausible and are not: the model alone, and what it cannot explain.
#[test]
fn the_model_watches_the_sensor() {
    let faults: [(Cause, Spoil); 4] = [
        (Cause::ModelDisplacement, |r| r.open_loop_m = 8.1e-3),
        (Cause::Disturbance, |r| r.disturbance_share = 0.11),
        (Cause::Disturbance, |r| r.disturbance_share = -0.11),
        (Cause::Disturbance, |r| r.disturbance_share = f32::NAN),
    ];
    for (cause, spoil) in faults {
        let mut bench = Bench::run(&bench_limits());
        assert_eq!(bench.spoil_until_tripped(spoil, true), 1, "{cause:?}");
        bench.is_safe(cause);
    }
}

#[test]
fn a_film_that_moves_too_far_trips() {
    let limits = Limits { max_displacement_m: 0.8e-3, ..bench_limits() };
    let mut bench = Bench::new(&limits);
    bench.tick(|_| ());
    bench.supervisor.arm().expect("healthy");
    bench.supervisor.start().expect("armed");
    bench.spoil_until_tripped(|_| (), true);
    bench.is_safe(Cause::Displacement);
}

#[test]
fn a_host_timeout_trips() {
    let mut bench = Bench::run(&bench_limits());
    assert_eq!(bench.spoil_until_tripped(|_| (), false), 500);
    bench.is_safe(Cause::Heartbeat);
}

/// Faults found elsewhere: overrun, bus, law, watchdog, panic.
#[test]
fn trips_from_elsewhere_latch_the_first_cause() {
    for cause in [Cause::Overrun, Cause::Bus, Cause::Law, Cause::Watchdog, Cause::Panic] {
        let mut bench = Bench::run(&bench_limits());
        bench.supervisor.trip(cause);
        assert_eq!(bench.supervisor.tripped_at(), bench.supervisor.ticks());
        bench.supervisor.trip(Cause::Interlock);
        bench.is_safe(cause);
    }
    // From disarmed as well: after a reset the cause is reported before anything can be armed.
    let mut bench = Bench::new(&bench_limits());
    bench.supervisor.trip(Cause::Panic);
    bench.is_safe(Cause::Panic);
}

#[test]
fn transitions_are_the_documented_ones() {
    let limits = bench_limits();
    let fresh = || {
        let mut bench = Bench::new(&limits);
        bench.tick(|_| ());
        bench.supervisor
    };
    type Ask = fn(&mut Supervisor) -> Result<(), Refusal>;
    let asks: [(&str, Ask); 5] = [
        ("arm", Supervisor::arm),
        ("start", Supervisor::start),
        ("stop", Supervisor::stop),
        ("disarm", Supervisor::disarm),
        ("acknowledge", Supervisor::acknowledge),
    ];
    let tripped = DriverState::Tripped(Cause::Bus);
    let reach = |state: DriverState| {
        let mut supervisor = fresh();
        if state != DriverState::Disarmed {
            supervisor.arm().expect("healthy");
        }
        match state {
            DriverState::Running => supervisor.start().expect("armed"),
            DriverState::Tripped(cause) => supervisor.trip(cause),
            _ => {}
        }
        assert_eq!(supervisor.state(), state);
        supervisor
    };
    for from in [DriverState::Disarmed, DriverState::Armed, DriverState::Running, tripped] {
        for (name, ask) in asks {
            let mut supervisor = reach(from);
            let to = match (from, name) {
                (DriverState::Disarmed, "arm") | (DriverState::Running, "stop") => Some(DriverState::Armed),
                (DriverState::Armed, "start") => Some(DriverState::Running),
                (DriverState::Disarmed | DriverState::Armed | DriverState::Running, "disarm") => {
                    Some(DriverState::Disarmed)
                }
                (DriverState::Tripped(_), "acknowledge") => Some(DriverState::Disarmed),
                _ => None,
            };
            let answer = ask(&mut supervisor);
            assert_eq!(answer.is_ok(), to.is_some(), "{name} from {from:?}");
            assert_eq!(supervisor.state(), to.unwrap_or(from), "{name} from {from:?}");
            if supervisor.state() != DriverState::Running {
                assert_eq!(supervisor.command(5000.0, 1.0), 0.0, "{name} from {from:?}");
            }
        }
    }
}

#[test]
fn nothing_is_armed_while_it_is_not_safe() {
    let limits = bench_limits();
    let after = |spoil: Spoil| {
        let mut bench = Bench::new(&limits);
        bench.tick(spoil);
        bench.supervisor.arm()
    };
    assert_eq!(after(|r| r.interlock_closed = false), Err(Refusal::InterlockOpen));
    assert_eq!(after(|r| r.monitor_v = 500.0), Err(Refusal::LiveVoltage));
    assert_eq!(after(|r| r.monitor_v = f32::NAN), Err(Refusal::LiveVoltage));
    assert_eq!(after(|r| r.displacement_m = 1.0), Err(Refusal::Sensor(SensorFault::Range)));
    assert_eq!(after(|_| ()), Ok(()));
    // Before the first tick there are no readings.
    assert_eq!(Supervisor::new(&limits, RATE_HZ).expect("valid").arm(), Err(Refusal::InterlockOpen));
}

/// Without a sensor the film can go on by the model, where the bench allows it.
#[test]
fn open_loop_goes_on_without_the_sensor() {
    let limits = Limits { on_sensor_fault: OnSensorFault::OpenLoop, ..bench_limits() };
    let mut bench = Bench::run(&limits);
    for _ in 0..100 {
        bench.supervisor.heartbeat();
        let mut readings = bench.healthy();
        readings.displacement_m = f32::NAN;
        let tick = bench.supervisor.check(readings);
        assert_eq!((tick.state, tick.displacement_m), (DriverState::Running, None));
        bench.supervisor.command(4000.0, 1.0);
    }
    // It is plausible again after ten good values behind the first one.
    for tick in 1..=12 {
        let back = bench.healthy();
        let plausible = bench.supervisor.check(back).displacement_m;
        assert_eq!(plausible, (tick >= 11).then_some(back.displacement_m), "tick {tick}");
    }
    // One that has slipped is a jump once, and stays implausible however steady it is from then on.
    for _ in 0..1000 {
        bench.supervisor.heartbeat();
        let mut readings = bench.healthy();
        readings.displacement_m += 2e-3;
        assert_eq!(bench.supervisor.check(readings).displacement_m, None);
    }
    // The model's displacement keeps the limit of the stroke.
    let mut readings = bench.healthy();
    readings.displacement_m = f32::NAN;
    readings.predicted_m = 8.1e-3;
    assert_eq!(bench.supervisor.check(readings).state, DriverState::Tripped(Cause::Displacement));
}
