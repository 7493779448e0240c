//! Every fault: each ends at 0 V with the amplifier disabled and its first cause latched.

use dea_driver::{Cause, Limits, Readings, SensorFault};

use crate::bench::bench_limits;
use crate::supervisor_bench::{Bench, Spoil};

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

#[test]
fn a_film_that_moves_too_far_trips() {
    let limits = Limits { max_displacement_m: 0.8e-3, ..bench_limits() };
    let mut bench = Bench::started(&limits);
    bench.spoil_until_tripped(|_| (), true);
    bench.is_safe(Cause::Displacement);
}

#[test]
fn a_host_timeout_trips() {
    let mut bench = Bench::run(&bench_limits());
    assert_eq!(bench.spoil_until_tripped(|_| (), false), 500);
    bench.is_safe(Cause::Heartbeat);
}

/// However long it was disarmed before.
#[test]
fn the_hosts_timeout_begins_when_it_arms() {
    let mut bench = Bench::new(&bench_limits());
    bench.ticks(2000, |_| ());
    bench.supervisor.arm().expect("healthy");
    assert_eq!(bench.spoil_until_tripped(|_| (), false), 501);
    bench.is_safe(Cause::Heartbeat);
}

/// The first good value after it is enough to arm again: what the sensor was before is forgotten.
#[test]
fn a_sensor_fault_is_forgotten_when_it_is_acknowledged() {
    let mut bench = Bench::run(&bench_limits());
    bench.tick(|readings| readings.displacement_m = f32::NAN);
    // The film discharges; the sensor still shows nothing.
    bench.ticks(1001, |readings| readings.displacement_m = f32::NAN);
    bench.supervisor.acknowledge().expect("tripped");
    bench.tick(|_| ());
    assert_eq!(bench.supervisor.arm(), Ok(()));
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
