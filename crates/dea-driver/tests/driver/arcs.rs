//! Films that arc: again and again, once, and amplifiers that only look like it.

use std::f32::consts::TAU;

use dea_driver::wire::Command;
use dea_driver::{Cause, DriverState, Inputs, Mode, Monitor};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::arcing::Arcing;
use crate::bench::bench_limits;
use crate::host::Host;
use crate::supervisor_bench::{Bench, RATE_HZ};

/// The band at 4000 V: 60 V and 3 %.
const BAND_V: f32 = 180.0;

/// Ticks from the first reading outside the band until it trips.
fn ticks_of_arcing(dwell_ms: f64, recharge_ms: f64, seed: u64) -> u32 {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut bench = Bench::run(&bench_limits());
    let mut film = Arcing { dwell_ms, recharge_ms, film_v: 4000.0, wait_ms: Some(dwell_ms * random.random::<f64>()) };
    let mut shown_at = None;
    for tick in 0..60_000 {
        let film_v = film.step(4000.0, &mut random) as f32;
        if film_v < 4000.0 - BAND_V {
            shown_at.get_or_insert(tick);
        }
        bench.supervisor.heartbeat();
        if let DriverState::Tripped(cause) = bench.tick(|readings| readings.monitor_v = film_v) {
            assert!(matches!(cause, Cause::Monitor | Cause::Arcs), "{cause:?}");
            return tick - shown_at.expect("within the band");
        }
    }
    panic!("a minute of arcs, {dwell_ms} ms apart, and no trip");
}

/// A film that breaks down again and again, whatever time it takes to be charged (600 pF on 1 mA: 2.4 ms) and stays so. Arcs are not distinguished
/// from glitches by how long they show: a film that is charged within a tick hardly shows them.
#[test]
fn a_film_that_arcs_again_and_again_trips() {
    for dwell_ms in [0.1, 1.0, 5.0, 20.0, 100.0] {
        for recharge_ms in [0.5, 2.4, 20.0] {
            let mut ticks: Vec<u32> = (1..=20).map(|seed| ticks_of_arcing(dwell_ms, recharge_ms, seed)).collect();
            ticks.sort_unstable();
            let (median, latest) = (ticks[10], ticks[19]);
            println!("dwell {dwell_ms} ms, charged within {recharge_ms} ms: {median} ms, {latest} ms at the latest");
            assert!(median <= 500, "{dwell_ms} ms, {recharge_ms} ms: {ticks:?}");
            // At 100 ms the next arc itself may come later than that, and a third of those of half a millisecond are seen.
            let bound = if dwell_ms < 100.0 { 500 } else { 3000 };
            assert!(latest <= bound, "{dwell_ms} ms, {recharge_ms} ms: {ticks:?}");
        }
    }
}

/// Runs at 4 kV, with `monitor_v` of the tick at the monitor; the tick in which it trips.
fn trips_at(ticks: u32, monitor_v: impl Fn(u32) -> f32) -> Option<u32> {
    let mut bench = Bench::run(&bench_limits());
    (0..ticks).find(|&tick| {
        bench.supervisor.heartbeat();
        let state = bench.tick(|readings| readings.monitor_v = monitor_v(tick));
        let of_arcs = DriverState::Tripped(Cause::Monitor) == state || DriverState::Tripped(Cause::Arcs) == state;
        assert!(of_arcs || state == DriverState::Running, "{state:?}");
        state != DriverState::Running
    })
}

/// An arc that clears itself may come back within the settling time of 20 ms. The next one within half a second after that trips.
#[test]
fn an_arc_may_heal_and_the_next_one_trips() {
    for apart in [2, 19, 20, 21, 300, 520, 521, 600] {
        let expected = (21..=520).contains(&apart).then_some(10 + apart);
        let arcs = |tick| if tick == 10 || tick == 10 + apart { 0.0 } else { 4000.0 };
        assert_eq!(trips_at(2000, arcs), expected, "{apart} ticks apart");
    }
    // Several discharges each time, and all healed for the half second after: one arc every 0.52 s, until the seventh.
    let seventh = Some(6 * 521);
    let dips = |is_at: bool| if is_at { 0.0 } else { 4000.0 };
    assert_eq!(trips_at(600_000, |tick| dips([0, 7, 19].contains(&(tick % 521)))), seventh);
    // What fell within the settling time does not begin another one.
    assert_eq!(trips_at(2000, |tick| dips([0, 20, 521].contains(&tick))), None);
    // An arc that shows for long is still one.
    let slow = |tick| if tick % 521 < 15 { 300.0 * (tick % 521) as f32 } else { 4000.0 };
    assert_eq!(trips_at(600_000, slow), seventh);
}

/// Dips of any depth that are too many within a minute or in a run trip, at any time apart and in any order; fewer do not. Expected is what the page
/// states: more than 30, or more than six of which ten seconds each make up for one.
#[test]
fn falls_that_are_too_many_trip() {
    let mut random = Pcg64::seed_from_u64(7);
    for mean_s in [0.6, 2.0, 6.0, 9.0, 20.0, 60.0, 200.0] {
        for depth in [0.0, 0.5, 0.78, 0.85] {
            let (mut falls, mut level_s, mut at) = (Vec::new(), 0.0f64, 0u32);
            let expected = loop {
                let apart = (1000.0 * mean_s * random.random_range(0.9..1.1)) as u32;
                level_s = (level_s - f64::from(apart) / 1000.0).max(0.0) + 10.0;
                at += apart;
                falls.push(at);
                if level_s > 60.0 || falls.len() > 30 {
                    break at;
                }
            };
            let shown = |tick| if falls.binary_search(&tick).is_ok() { depth * 4000.0 } else { 4000.0 };
            assert_eq!(trips_at(expected + 1, shown), Some(expected), "{mean_s} s apart, to {depth}");
        }
    }
    let limits = bench_limits();
    let mut monitor = Monitor::new(limits.monitor, RATE_HZ);
    assert!((0..61_000 * 30).all(|tick| monitor.agrees(4000.0, if tick % 61_000 == 60_999 { 3000.0 } else { 4000.0 })));
    assert_eq!((monitor.falls(), monitor.falls_too_often()), (30, false));
    assert!((0..20).all(|_| monitor.agrees(4000.0, 4000.0)) && !monitor.agrees(4000.0, 3000.0));
    monitor.reset();
    assert_eq!((monitor.falls(), monitor.falls_too_often()), (0, false));
}

/// Once it has arced again, a monitor does not agree until it is started again, and then it remembers nothing.
#[test]
fn a_film_that_arced_again_stays_unbelieved() {
    let mut monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
    for until_reset in [10_000, 10, 0, 10_000] {
        monitor.reset();
        assert!((0..100).all(|_| monitor.agrees(4000.0, 4000.0)));
        assert!(monitor.agrees(4000.0, 0.0) && (0..50).all(|_| monitor.agrees(4000.0, 4000.0)));
        assert!(!monitor.agrees(4000.0, 0.0) && !(0..until_reset).any(|_| monitor.agrees(4000.0, 4000.0)));
    }
}

/// A fall that is less deep, or not at once, is no arc.
#[test]
fn only_a_steep_and_deep_fall_is_an_arc() {
    let every_100 = |shown_v: f32| trips_at(100_000, move |tick| if tick % 100 == 50 { shown_v } else { 4000.0 });
    // Three quarters of 4000 V, less the band.
    assert_eq!(every_100(2820.5), Some(650));
    assert_eq!(every_100(2819.5), Some(150));
    // What stays within the band does not count.
    assert_eq!(every_100(4000.0 - BAND_V + 0.5), None);
    // In steps of up to 2660 V, and back at once.
    let falls = |step_v: f32| {
        trips_at(100_000, move |tick| if tick % 200 < 9 { 4000.0 - step_v * (tick % 200) as f32 } else { 4000.0 })
    };
    assert_eq!(falls(BAND_V - 0.5), None);
    assert_eq!(falls(BAND_V + 0.5), Some(207));
    // A reading that is missing does not hide an arc.
    let mut monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
    let mut agrees = |monitor_v| monitor.agrees(4000.0, monitor_v);
    assert!((0..100).all(|_| agrees(4000.0)));
    assert!(agrees(f32::NAN) && agrees(100.0) && (0..100).all(|_| agrees(4000.0)));
    assert!(agrees(f32::NAN) && !agrees(100.0));
}

/// Levels of a command at random, for as long each, and moved to at 50 V a tick.
fn moves(between_v: [f32; 2], hold: u32, seed: u64) -> impl FnMut(u32) -> f32 {
    let mut random = Pcg64::seed_from_u64(seed);
    let (mut target_v, mut command_v) = (between_v[0], between_v[0]);
    move |tick| {
        if tick % hold == 0 {
            target_v = random.random_range(between_v[0]..between_v[1]);
        }
        command_v += (target_v - command_v).clamp(-50.0, 50.0);
        command_v
    }
}

/// An amplifier that answers 8 ms late is far below the command at each edge, and falls only where the command has fallen: no arc.
#[test]
fn an_amplifier_that_lags_does_not_arc() {
    let mut monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
    let mut noise = Pcg64::seed_from_u64(1);
    let (mut course, mut late) = (moves([300.0, 1000.0], 400, 2), [300.0f32; 9]);
    let mut deepest = 0.0f32;
    assert!((0..20).all(|_| monitor.agrees(300.0, 300.0)));
    for tick in 0..100_000 {
        let command_v = course(tick);
        late.rotate_right(1);
        late[0] = command_v;
        deepest = deepest.max(0.75 * command_v - late[8]);
        assert!(monitor.agrees(command_v, late[8] + noise.random_range(-9.0..9.0)), "tick {tick}");
    }
    // As deep as an arc.
    assert!(deepest > 90.0 + 9.0, "{deepest} V");
}

/// An amplifier that rings with a damping of 0.25 at 40 Hz undershoots by less than an arc.
#[test]
fn an_amplifier_that_rings_does_not_arc() {
    let mut monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
    let mut course = moves([1000.0, 6000.0], 500, 3);
    let (mut film_v, mut rate_v, mut outside) = (0.0f32, 0.0f32, 0);
    for tick in 0..100_000 {
        let command_v = course(tick);
        for _ in 0..20 {
            let omega = TAU * 40.0;
            rate_v += 0.05e-3 * (omega * omega * (command_v - film_v) - 2.0 * 0.25 * omega * rate_v);
            film_v += 0.05e-3 * rate_v;
        }
        outside += u32::from((film_v - command_v).abs() > 60.0 + 0.03 * command_v);
        assert!(monitor.agrees(command_v, film_v), "tick {tick}");
    }
    assert!(outside > 500, "it rings: {outside}");
}

/// A host learns how often the reading fell in this run, or in the last one.
#[test]
fn falls_are_reported() {
    let mut host = Host::with_parameters();
    for arcs in [3, 0, 1] {
        host.arm();
        assert_eq!(host.status().falls, 0);
        host.done(Command::Start(Mode::Voltage));
        // Once it is at 2 kV, an arc every 0.6 s.
        for tick in 0..300 + 600 * u32::from(arcs) {
            if tick % 100 == 0 {
                host.done(Command::SetVoltage(2000.0));
            }
            let inputs = host.bench.inputs();
            let monitor_adc_v = if tick % 600 == 299 && tick > 299 { Some(0.0) } else { inputs.monitor_adc_v };
            host.bench.tick(Inputs { monitor_adc_v, ..inputs });
        }
        assert_eq!(host.status().falls, arcs);
        host.done(Command::Disarm);
        host.ticks(1001);
        assert_eq!((host.state(), host.status().falls), (DriverState::Disarmed, arcs));
    }
}
