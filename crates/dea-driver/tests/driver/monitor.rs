//! The amplifier's monitor: what it may show beside the command, what it must not, and a film that stays live.

use dea_driver::server::Denial;
use dea_driver::{
    Blob, Cause, Controller, Device, DriverState, Inputs, Monitor, MonitorLimits, Parameters, Readings, Refusal,
    Supervisor,
};

use crate::bench::{bench_limits, board_parameters, changed_parameters, readings};
use crate::supervisor_bench::{Bench, RATE_HZ};

/// The band around 0 V and the largest voltage belong to what is allowed: more than that does not.
#[test]
fn a_monitor_at_its_limit_is_within_it() {
    let limits = bench_limits();
    let shown = |monitor_v| readings(monitor_v, 1e-6, 0.0);
    let mut supervisor = Supervisor::new(&limits, RATE_HZ).expect("valid");
    assert_eq!((supervisor.ticks(), supervisor.tripped_at(), supervisor.command_v()), (0, 0, 0.0));
    // There are no readings yet.
    let refusals: Vec<Refusal> = supervisor.refusals().collect();
    assert_eq!(refusals, [Refusal::InterlockOpen, Refusal::LiveVoltage]);
    supervisor.check(shown(limits.monitor.band_v));
    assert!(!supervisor.is_film_live() && !supervisor.runs());
    supervisor.arm().expect("at 0 V");
    assert!(!supervisor.runs() && supervisor.enables());
    supervisor.start().expect("armed");
    assert!(supervisor.runs());
    // 6500 V, 3 % and 60 V.
    let most_v = limits.monitored_v();
    assert!((most_v - 6755.0).abs() < 0.01);
    assert_eq!(supervisor.check(shown(most_v)).state, DriverState::Running);
    assert_eq!(supervisor.check(shown(most_v.next_up())).state, DriverState::Tripped(Cause::Voltage));
    assert!(!supervisor.runs());
    supervisor.check(shown(limits.monitor.band_v.next_up()));
    assert!(supervisor.is_film_live());
}

/// More voltage than was commanded is as wrong as less, below the largest voltage as well: 4000 V with a band of 60 V and 3 %.
#[test]
fn a_monitor_above_its_band_disagrees() {
    for (monitor_v, agrees) in [(4170.0, true), (4190.0, false), (3830.0, true), (3810.0, false)] {
        let mut monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
        assert!((0..1000).all(|_| monitor.agrees(4000.0, 4000.0)));
        let all = (0..1000).fold(true, |all, _| monitor.agrees(4000.0, monitor_v) && all);
        assert_eq!(all, agrees, "{monitor_v} V");
    }
    let mut monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
    assert!((0..1000).all(|_| monitor.agrees(0.0, 50.0)), "within the band around 0 V");
}

/// However often it differs in between, sixteen ticks of agreement cancel one of difference, and fifteen do not.
#[test]
fn sixteen_ticks_of_agreement_cancel_one_of_difference() {
    for (inside, agrees) in [(16, true), (15, false)] {
        let mut monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
        assert!((0..1000).all(|_| monitor.agrees(4000.0, 4000.0)));
        // Beyond the band of 60 V and 3 %, and no fall.
        let shown_v = |tick: u32| if tick.is_multiple_of(inside + 1) { 4190.0 } else { 4000.0 };
        let all = (0..20_000).all(|tick| monitor.agrees(4000.0, shown_v(tick)));
        assert_eq!(all, agrees, "{inside} ticks");
    }
}

/// Falls of a tick, by more than the band of 60 V and 3 %: more than six for which ten seconds each have not made up, or more than 30.
#[test]
fn falls_that_are_too_often_trip() {
    // Every 5 s: the twelfth is the first that leaves more than 60 s.
    for (period_s, falls) in [(5, 12), (10, 31)] {
        let mut monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
        assert!((0..1000).all(|_| monitor.agrees(4000.0, 4000.0)));
        let disagrees = |monitor: &mut Monitor| {
            let agrees = monitor.agrees(4000.0, 3810.0);
            !((1..1000 * period_s).fold(agrees, |agrees, _| monitor.agrees(4000.0, 4000.0) && agrees))
        };
        let first = (1..100).find(|_| disagrees(&mut monitor));
        assert_eq!(first, Some(falls), "every {period_s} s");
        assert!(monitor.falls_too_often() && monitor.falls() == falls);
        monitor.reset();
        assert!(!monitor.falls_too_often() && monitor.falls() == 0);
    }
}

/// Whatever it has seen, a monitor that is reset is as a new one.
#[test]
fn a_monitor_that_is_reset_is_a_new_one() {
    let new = Monitor::new(bench_limits().monitor, RATE_HZ);
    let mut used = new;
    for tick in 0..2000 {
        // Arcs until one is too many, and voltage that was not commanded.
        let _ = used.agrees(4000.0, if tick % 300 == 299 { 0.0 } else { 4200.0 });
    }
    assert!(used.falls() > 0 && !used.agrees(4000.0, 4000.0));
    used.reset();
    assert_eq!(format!("{used:?}"), format!("{new:?}"));
}

/// The settling time is rounded to the nearest tick.
#[test]
fn the_settling_time_is_the_nearest_ticks() {
    for (settle_s, ticks) in [(0.02, 20), (0.020_45, 20), (0.020_55, 21)] {
        let mut monitor = Monitor::new(MonitorLimits { settle_s, ..bench_limits().monitor }, RATE_HZ);
        assert!((0..1000).all(|_| monitor.agrees(4000.0, 4000.0)));
        assert_eq!((0..100).find(|_| !monitor.agrees(4000.0, 4190.0)), Some(ticks), "{settle_s} s");
    }
}

/// An amplifier slower than the command is not a fault; one that lags for longer than the settling time is.
#[test]
fn the_monitor_s_band_knows_the_amplifier_s_slew() {
    let mut limits = bench_limits();
    limits.max_slew_v_per_s = 1e6;
    limits.monitor.slew_v_per_s = 20e3;
    let trips_at = |slew_v_per_tick: f32| {
        let mut bench = Bench::started(&limits);
        let mut monitor_v = 0.0f32;
        for tick in 0..1000 {
            bench.supervisor.heartbeat();
            let command_v = bench.supervisor.command_v();
            monitor_v += (command_v - monitor_v).clamp(-slew_v_per_tick, slew_v_per_tick);
            let displacement_m = 2e-3 * (monitor_v / 6000.0).powi(2) + 1e-6 * (tick % 7) as f32;
            let state = bench.supervisor.check(readings(monitor_v, displacement_m, displacement_m)).state;
            if let DriverState::Tripped(cause) = state {
                return Some(cause);
            }
            bench.supervisor.command(6000.0, 1.0);
        }
        None
    };
    assert_eq!(trips_at(20.0), None, "as fast as it should be");
    assert_eq!(trips_at(19.6), None, "a little slower, within the band");
    assert_eq!(trips_at(8.0), Some(Cause::Monitor), "much slower");
}

/// A film that was live for a minute is acknowledged once it has been at 0 V for as long as a discharge takes, stays so, and is reported
/// again when it is live again. Nothing is armed before.
#[test]
fn a_film_that_was_live_for_long_is_acknowledged_once() {
    let live = |r: &mut Readings| r.monitor_v = 4211.0;
    let mut bench = Bench::new(&bench_limits());
    bench.ticks(60_000, live);
    assert_eq!(bench.supervisor.state(), DriverState::Tripped(Cause::LiveFilm));
    // A second at 1 kHz, in one piece.
    for ticks in [999, 1000] {
        bench.tick(live);
        bench.ticks(ticks, |_| ());
        let acknowledged = bench.supervisor.acknowledge();
        assert_eq!(acknowledged, if ticks < 1000 { Err(Refusal::LiveVoltage) } else { Ok(()) }, "{ticks} ticks");
    }
    assert_eq!(bench.supervisor.state(), DriverState::Disarmed);
    let reported = (1..2000).find(|_| bench.tick(live) == DriverState::Tripped(Cause::LiveFilm));
    assert_eq!(reported, Some(1001));
    // Before and after it was armed are two times: 0.9 s and 0.5 s with a second between.
    let mut bench = Bench::new(&bench_limits());
    bench.ticks(900, live);
    bench.ticks(1000, |_| ());
    bench.supervisor.arm().expect("at 0 V");
    bench.supervisor.disarm().expect("armed");
    bench.ticks(500, live);
    assert_eq!(bench.supervisor.state(), DriverState::Disarmed);
}

/// Voltage that is there when the supervisor starts is no discharge: the film has to be at 0 V for a second before it is armed.
#[test]
fn a_film_that_is_live_at_the_start_is_not_discharging() {
    let mut supervisor = Supervisor::new(&bench_limits(), RATE_HZ).expect("valid");
    for monitor_v in [3000.0, 0.0] {
        supervisor.check(readings(monitor_v, 1e-6, 0.0));
    }
    for tick in 1..1000u16 {
        assert_eq!(supervisor.arm(), Err(Refusal::LiveVoltage), "tick {tick}");
        supervisor.check(readings(0.0, 1e-6 * f32::from(tick % 3), 0.0));
    }
    assert_eq!(supervisor.arm(), Ok(()));
}

/// The time without a host and the time of a discharge are rounded to the nearest tick.
#[test]
fn times_of_a_supervisor_are_the_nearest_ticks() {
    for (part_s, part) in [(0.0, 0), (0.45e-3, 0), (0.55e-3, 1)] {
        let mut limits = bench_limits();
        (limits.heartbeat_s, limits.discharge_s) = (0.1 + part_s, 1.0 + part_s);
        let mut supervisor = Supervisor::new(&limits, RATE_HZ).expect("valid");
        let trips = |supervisor: &mut Supervisor, monitor_v: f32, cause: Cause| {
            let states = (1..2000).map(|_| supervisor.check(readings(monitor_v, 1e-6, 0.0)).state);
            states.take_while(|state| *state != DriverState::Tripped(cause)).count()
        };
        assert_eq!(trips(&mut supervisor, 3000.0, Cause::LiveFilm), 1000 + part, "{part_s} s");
        let mut supervisor = Supervisor::new(&limits, RATE_HZ).expect("valid");
        supervisor.check(readings(0.0, 1e-6, 0.0));
        supervisor.arm().expect("at 0 V");
        supervisor.start().expect("armed");
        assert_eq!(trips(&mut supervisor, 0.0, Cause::Heartbeat), 100 + part, "{part_s} s");
    }
}

/// A disabled amplifier that gives voltage now and then is reported within a minute if it does so for more than a fifth of the time, and is
/// not armed in between, however rarely it does.
#[test]
fn an_amplifier_that_is_live_now_and_then_is_noticed() {
    let periods =
        [(499, 1000, true), (5, 10, true), (999, 2000, true), (22, 100, true), (19, 100, false), (1, 10, false)];
    for ((live, period, reported), after_a_run) in periods.into_iter().flat_map(|case| [(case, false), (case, true)]) {
        let mut bench = if after_a_run { Bench::run(&bench_limits()) } else { Bench::new(&bench_limits()) };
        bench.supervisor.disarm().expect("not tripped");
        assert_eq!(bench.supervisor.command_v(), 0.0);
        for tick in 0..60_000u32 {
            let state = bench.tick(|readings| readings.monitor_v = if tick % period < live { 6000.0 } else { 0.0 });
            if state == DriverState::Disarmed && period - live < 1000 {
                assert_eq!(bench.supervisor.arm(), Err(Refusal::LiveVoltage), "{live} of {period}, tick {tick}");
            }
        }
        let tripped = bench.supervisor.state() == DriverState::Tripped(Cause::LiveFilm);
        assert_eq!(tripped, reported, "{live} of {period}");
    }
}

/// A disabled amplifier that stays live: reported after the time that a film has to discharge, in every state and after every cause, and
/// not acknowledged as long as it lasts.
#[test]
fn a_film_that_stays_live_is_noticed() {
    let live = |r: &mut Readings| r.monitor_v = 4211.0;
    type End = fn(&mut Supervisor);
    let ends: [(&str, End); 4] = [
        ("switched on", |_| ()),
        ("disarmed", |s| s.disarm().expect("running")),
        ("tripped", |s| s.trip(Cause::Heartbeat)),
        ("acknowledged", |s| {
            s.trip(Cause::Heartbeat);
            s.acknowledge().expect("tripped");
        }),
    ];
    for (name, end) in ends {
        let mut bench = if name == "switched on" { Bench::new(&bench_limits()) } else { Bench::run(&bench_limits()) };
        end(&mut bench.supervisor);
        // A second at 1 kHz.
        bench.ticks(1000, live);
        assert_ne!(bench.supervisor.state(), DriverState::Tripped(Cause::LiveFilm), "{name}");
        bench.tick(live);
        assert_eq!(bench.supervisor.state(), DriverState::Tripped(Cause::LiveFilm), "{name}");
        assert_eq!((bench.supervisor.monitor_v(), bench.supervisor.is_film_live()), (4211.0, true));
        // And until it has been at 0 V for a second, after a run as well.
        for ticks in [0, 1, 998] {
            bench.ticks(ticks, |_| ());
            assert_eq!(bench.supervisor.acknowledge(), Err(Refusal::LiveVoltage), "{name}, {ticks} more at 0 V");
        }
        bench.tick(|_| ());
        bench.is_safe(Cause::LiveFilm);
    }
    // One that arcs, and a monitor that does not answer now and then, hide nothing; nor does one that never answers again.
    let mut bench = Bench::run(&bench_limits());
    bench.supervisor.disarm().expect("running");
    let mut tick = 0;
    while bench.supervisor.state() == DriverState::Disarmed {
        tick += 1;
        assert!(tick < 3000, "never noticed");
        bench.tick(|r| {
            r.monitor_v = match tick % 20 {
                0 => 0.0,
                1 => f32::NAN,
                _ => 4211.0,
            };
        });
    }
    assert_eq!(bench.supervisor.state(), DriverState::Tripped(Cause::LiveFilm));
    bench.tick(|r| r.monitor_v = f32::NAN);
    assert_eq!(bench.supervisor.acknowledge(), Err(Refusal::LiveVoltage));
    // A film that discharges in time is not live, nor is one that is driven.
    let mut bench = Bench::run(&bench_limits());
    (0..5000).for_each(|_| {
        bench.supervisor.heartbeat();
        bench.tick(|_| ());
    });
    assert_eq!(bench.supervisor.state(), DriverState::Running);
    bench.supervisor.disarm().expect("running");
    for tick in 0..3000u16 {
        bench.tick(|r| r.monitor_v = 4000.0 * (-f32::from(tick) / 200.0).exp());
    }
    assert_eq!(bench.supervisor.state(), DriverState::Disarmed);
}

/// An upload shortens no time at 0 V, and forgets no time with voltage: a film that was live was acknowledged and armed in the second tick after it, and
/// one that was live all the time was never reported with an upload every 0.9 s.
#[test]
fn an_upload_does_not_hide_a_film_that_is_live() {
    let upload = |device: &mut Device, parameters: Parameters| {
        device.install(Controller::new(Blob::new(parameters).expect("valid"))).expect("off");
    };
    let run = |device: &mut Device, ticks: u16, monitor_v: f32| {
        for tick in 0..ticks {
            let sensor_adc_v = Some(1.0 + 1e-3 * f32::from(tick % 3));
            device.tick(Inputs { interlock_closed: true, monitor_adc_v: Some(monitor_v / 1000.0), sensor_adc_v });
        }
        device.state()
    };
    let live_film = DriverState::Tripped(Cause::LiveFilm);
    for (live_ticks, state) in [(3000, live_film), (500, DriverState::Disarmed)] {
        let mut device = Device::new(None);
        upload(&mut device, board_parameters());
        run(&mut device, 10, 0.0);
        assert_eq!(run(&mut device, live_ticks, 3000.0), state);
        run(&mut device, 1, 0.0);
        upload(&mut device, board_parameters());
        let release = |device: &mut Device| match device.state() {
            DriverState::Tripped(_) => device.acknowledge(),
            _ => device.arm(),
        };
        // A second at 1 kHz.
        run(&mut device, 999, 0.0);
        assert_eq!(release(&mut device), Err(Denial::Refused(Refusal::LiveVoltage)), "live for {live_ticks} ticks");
        run(&mut device, 1, 0.0);
        assert_eq!(release(&mut device), Ok(()), "live for {live_ticks} ticks");
    }
    // A tick before the second is over it begins again.
    let mut device = Device::new(None);
    upload(&mut device, board_parameters());
    run(&mut device, 500, 3000.0);
    run(&mut device, 999, 0.0);
    upload(&mut device, board_parameters());
    run(&mut device, 999, 0.0);
    assert_eq!(device.arm(), Err(Denial::Refused(Refusal::LiveVoltage)));
    // A discharge that takes no tick.
    for _ in 0..2 {
        upload(&mut device, changed_parameters(|p| p.limits.discharge_s = 1e-4));
        run(&mut device, 2, 0.0);
    }
    // Nine tenths of the time stay that, of a time with twice as many ticks as well.
    for (share, within, then) in [(1.0, 99, 2), (2.0, 190, 12)] {
        let mut device = Device::new(None);
        upload(&mut device, board_parameters());
        assert_eq!(run(&mut device, 900, 3000.0), DriverState::Disarmed);
        upload(&mut device, changed_parameters(|p| p.limits.discharge_s *= share));
        assert_eq!(run(&mut device, within, 3000.0), DriverState::Disarmed);
        assert_eq!(run(&mut device, then, 3000.0), live_film);
    }
}

/// A perfect amplifier, read by a converter that answers with the sample of the frame before, or by one that answers at once: a command
/// that goes up and down at its full slew agrees at every rate. A reading that is older does not.
#[test]
fn a_reading_may_be_a_tick_old() {
    let trips = |rate_hz: f32, age: usize| {
        let mut monitor = Monitor::new(bench_limits().monitor, rate_hz);
        let slew_v = bench_limits().max_slew_v_per_s / rate_hz;
        let mut applied_v = vec![0.0f32; age + 1];
        (0..1000).any(|tick| {
            let wanted_v = if tick / 200 % 2 == 0 { 6000.0 } else { 0.0 };
            let last_v = *applied_v.last().expect("one");
            applied_v.push(last_v + (wanted_v - last_v).clamp(-slew_v, slew_v));
            // The command of the last tick, and the voltage when the reading was taken.
            !monitor.agrees(*applied_v.last().expect("one"), applied_v[applied_v.len() - 1 - age])
        })
    };
    for rate_hz in [100.0, 200.0, 500.0, 1000.0, 5000.0] {
        assert!(!trips(rate_hz, 0), "{rate_hz} Hz, at once");
        assert!(!trips(rate_hz, 1), "{rate_hz} Hz, a tick old");
    }
    for rate_hz in [100.0, 200.0, 500.0] {
        assert!(trips(rate_hz, 2), "{rate_hz} Hz, two ticks old");
    }
}
