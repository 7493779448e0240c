//! Every state and every fault: each ends at 0 V with the amplifier disabled and its first cause latched.

use dea_driver::{
    Cause, DriverState, Limits, LimitsError, Monitor, OnSensorFault, PlausibilityLimits, Readings, Refusal,
    SensorFault, Supervisor,
};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::bench::bench_limits;

const RATE_HZ: f32 = 1000.0;

/// A closed interlock, and a model that explains the film.
fn readings(monitor_v: f32, displacement_m: f32, predicted_m: f32) -> Readings {
    Readings {
        interlock_closed: true,
        monitor_v,
        displacement_m,
        predicted_m,
        open_loop_m: predicted_m,
        follows: true,
        disturbance_share: 0.0,
    }
}

/// A film on a bench: the amplifier follows its command within a tick, the film stretches with V².
struct Bench {
    supervisor: Supervisor,
    wanted_v: f32,
    noise: u32,
}

impl Bench {
    fn new(limits: &Limits) -> Self {
        let supervisor = Supervisor::new(limits, RATE_HZ).expect("valid");
        Self { supervisor, wanted_v: 4000.0, noise: 1 }
    }

    fn healthy(&mut self) -> Readings {
        // A working sensor: a few micrometres of noise.
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (self.noise >> 16) as f32 / 65_536.0 * 5e-6;
        let volts = self.supervisor.command_v();
        let predicted_m = 2e-3 * (volts / 6000.0).powi(2);
        readings(volts, predicted_m + noise, predicted_m)
    }

    /// A tick whose readings `spoil` may alter.
    fn tick(&mut self, spoil: impl FnOnce(&mut Readings)) -> DriverState {
        let mut readings = self.healthy();
        spoil(&mut readings);
        let state = self.supervisor.check(readings).state;
        self.supervisor.command(self.wanted_v, 1.0);
        state
    }

    fn run(limits: &Limits) -> Self {
        let mut bench = Self::new(limits);
        bench.tick(|_| ());
        bench.supervisor.arm().expect("healthy");
        bench.supervisor.start().expect("armed");
        for _ in 0..200 {
            bench.supervisor.heartbeat();
            bench.tick(|_| ());
        }
        assert_eq!(bench.supervisor.state(), DriverState::Running);
        assert_eq!(bench.supervisor.command_v(), 4000.0);
        bench
    }

    /// Spoils every tick until it trips; returns the ticks that took.
    fn spoil_until_tripped(&mut self, spoil: impl Fn(&mut Readings), heartbeat: bool) -> u32 {
        for ticks in 1..10_000 {
            if heartbeat {
                self.supervisor.heartbeat();
            }
            if let DriverState::Tripped(_) = self.tick(&spoil) {
                return ticks;
            }
        }
        panic!("never trips");
    }

    fn is_safe(&mut self, cause: Cause) {
        assert_eq!(self.supervisor.state(), DriverState::Tripped(cause));
        assert!(!self.supervisor.enables());
        assert_eq!(self.supervisor.command_v(), 0.0);
        // It stays so, whatever is asked for, and whatever happens next.
        self.wanted_v = 6000.0;
        self.tick(|readings| readings.interlock_closed = false);
        assert_eq!((self.supervisor.state(), self.supervisor.command_v()), (DriverState::Tripped(cause), 0.0));
        assert_eq!(self.supervisor.arm(), Err(Refusal::State(DriverState::Tripped(cause))));
        assert_eq!(self.supervisor.start(), Err(Refusal::State(DriverState::Tripped(cause))));
        assert_eq!(self.supervisor.disarm(), Err(Refusal::State(DriverState::Tripped(cause))));
        // Until it is acknowledged, and even then it has to be armed again.
        self.supervisor.acknowledge().expect("tripped");
        assert_eq!(self.supervisor.state(), DriverState::Disarmed);
        assert_eq!(self.supervisor.command(6000.0, 1.0), 0.0);
    }
}

type Spoil = fn(&mut Readings);

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
        // 500 equal values, the first of which is one. The model stands still.
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

/// What seems plausible and is not: the model alone, and what it cannot explain.
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

/// A film that breaks down again and again: 600 pF on 1 mA take 2.4 ms to 4 kV, and arc at random from there on. A single good
/// tick made up for all bad ones before it, so that no such film ever tripped.
#[test]
fn a_film_that_arcs_again_and_again_trips() {
    for dwell_ms in [2.0, 5.0, 20.0] {
        let mut ticks: Vec<u32> = (1..=20u64).map(|seed| ticks_of_arcing(dwell_ms, seed)).collect();
        ticks.sort_unstable();
        println!(
            "mean dwell {dwell_ms} ms: trips after {} ms in the median, {} ms at the latest",
            ticks[10], ticks[19]
        );
        assert!(ticks[10] <= 500, "{dwell_ms} ms: {ticks:?}");
    }
}

/// Ticks until it trips, of a film whose arcs are `dwell_ms` apart in the mean, for 10 min at the most.
fn ticks_of_arcing(dwell_ms: f64, seed: u64) -> u32 {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut bench = Bench::run(&bench_limits());
    let mut film_v = 4000.0f64;
    for tick in 0..600_000 {
        for _ in 0..100 {
            film_v = (film_v + 1e-3 / 600e-12 * 1e-5).min(4000.0);
            if film_v >= 4000.0 && random.random_bool(0.01 / dwell_ms) {
                film_v = 0.0;
            }
        }
        bench.supervisor.heartbeat();
        if let DriverState::Tripped(cause) = bench.tick(|readings| readings.monitor_v = film_v as f32) {
            assert_eq!(cause, Cause::Monitor);
            return tick;
        }
    }
    panic!("10 min of arcs, {dwell_ms} ms apart, and no trip");
}

/// Glitches of the monitor that are shorter than the settling time, or rarer than one tick in seventeen, do not trip.
#[test]
fn rare_glitches_of_the_monitor_do_not_trip() {
    let patterns: [fn(u32) -> bool; 2] = [|tick| tick % 340 < 20, |tick| tick % 17 == 0];
    for glitch in patterns {
        let mut bench = Bench::run(&bench_limits());
        for tick in 0..500_000 {
            bench.supervisor.heartbeat();
            bench.tick(|readings| {
                if glitch(tick) {
                    readings.monitor_v = 0.0;
                }
            });
            assert_eq!(bench.supervisor.state(), DriverState::Running, "tick {tick}");
        }
    }
}

/// A film that was live for a minute and is at 0 V now: acknowledged once, it stays so, and trips again as soon as it is live again.
#[test]
fn a_film_that_was_live_for_long_is_acknowledged_once() {
    let live = |r: &mut Readings| r.monitor_v = 4211.0;
    let mut bench = Bench::new(&bench_limits());
    for _ in 0..60_000 {
        bench.tick(live);
    }
    assert_eq!(bench.supervisor.state(), DriverState::Tripped(Cause::LiveFilm));
    bench.tick(|_| ());
    bench.supervisor.acknowledge().expect("at 0 V");
    assert_eq!(bench.tick(|_| ()), DriverState::Disarmed);
    bench.tick(live);
    bench.tick(live);
    assert_eq!(bench.tick(live), DriverState::Tripped(Cause::LiveFilm));
}

/// A disabled amplifier that goes on: told after the time that a film has to discharge, in every state and after every cause, and
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
        for _ in 0..1000 {
            bench.tick(live);
        }
        assert_ne!(bench.supervisor.state(), DriverState::Tripped(Cause::LiveFilm), "{name}");
        bench.tick(live);
        assert_eq!(bench.supervisor.state(), DriverState::Tripped(Cause::LiveFilm), "{name}");
        assert_eq!((bench.supervisor.monitor_v(), bench.supervisor.is_film_live()), (4211.0, true));
        assert_eq!(bench.supervisor.acknowledge(), Err(Refusal::LiveVoltage), "{name}");
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
    // A film that discharges in time is none; nor is one that is driven.
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
    // From disarmed as well: after a reset the cause is told before anything can be armed.
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

#[test]
fn commands_stay_within_voltage_field_and_slew() {
    let limits = bench_limits();
    let mut bench = Bench::run(&limits);
    let mut last = bench.supervisor.command_v();
    for wanted in [1e9, f32::INFINITY, -1e9, f32::NAN, 3000.0, f32::NEG_INFINITY, 6500.0] {
        for _ in 0..200 {
            let command = bench.supervisor.command(wanted, 1.0);
            assert!((0.0..=6500.0).contains(&command), "{wanted}: {command} V");
            // 50 kV/s at 1 kHz.
            assert!((command - last).abs() <= 50.001, "{wanted}: from {last} to {command} V");
            last = command;
        }
        let target = if wanted > 6500.0 {
            6500.0
        } else if wanted > 0.0 {
            wanted
        } else {
            0.0
        };
        assert_eq!(last, target, "{wanted}");
    }
    // 42 V/µm over 160 µm are 6720 V; over 100 µm 4200 V.
    let thin = Limits { thickness_m: 100e-6, ..limits };
    let mut bench = Bench::run(&thin);
    for _ in 0..200 {
        bench.supervisor.command(6500.0, 1.0);
    }
    assert!((bench.supervisor.command_v() - 4200.0).abs() < 0.1);
    // A film that is stretched is thinner: the field outranks the slew.
    assert!((bench.supervisor.command(6500.0, 1.05) - 4000.0).abs() < 0.1);
    assert!((bench.supervisor.command(6500.0, f32::NAN) - 4050.0).abs() < 0.1, "50 kV/s upwards");
}

/// Limits that would protect nothing are no limits.
#[test]
fn limits_without_an_end_are_refused() {
    for change in [
        |l: &mut Limits| l.heartbeat_s = 61.0,
        |l: &mut Limits| l.max_disturbance_share = 1.1,
        |l: &mut Limits| l.monitor.band_share = 0.6,
        |l: &mut Limits| l.monitor.settle_s = 1.5,
        |l: &mut Limits| l.monitor.band_v = 4000.0,
        |l: &mut Limits| l.max_voltage_v = 1e6,
        |l: &mut Limits| l.max_slew_v_per_s = 1e38,
        |l: &mut Limits| l.max_displacement_m = 1e30,
        |l: &mut Limits| l.max_displacement_m = 9.1e-3,
        |l: &mut Limits| l.max_field_v_per_m = 1e30,
        |l: &mut Limits| l.thickness_m = 0.1,
        |l: &mut Limits| l.discharge_s = 61.0,
        |l: &mut Limits| l.sensor.jump = 5e-3,
        |l: &mut Limits| l.sensor.stuck_band = 0.1e-3,
        |l: &mut Limits| l.sensor.stuck_ticks = 10_001,
    ] {
        let mut limits = bench_limits();
        change(&mut limits);
        let error = Supervisor::new(&limits, RATE_HZ).expect_err("refused");
        assert!(matches!(error, LimitsError::TooLarge(_)), "{error}");
    }
    // A monitor that may be as slow as this would be dead for 239 s before it shows.
    let mut limits = bench_limits();
    limits.monitor.slew_v_per_s = 1.0;
    assert_eq!(Supervisor::new(&limits, RATE_HZ).err(), Some(LimitsError::TooSmall("monitor.slew_v_per_s")));
}

/// An amplifier slower than the command is not a fault; one that lags for longer than the settling time is.
#[test]
fn the_monitor_s_band_knows_the_amplifier_s_slew() {
    let mut limits = bench_limits();
    limits.max_slew_v_per_s = 1e6;
    limits.monitor.slew_v_per_s = 20e3;
    let trips_at = |slew_v_per_tick: f32| {
        let mut bench = Bench::new(&limits);
        bench.wanted_v = 6000.0;
        bench.tick(|_| ());
        bench.supervisor.arm().expect("healthy");
        bench.supervisor.start().expect("armed");
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

/// A command that turns back while an amplifier is ahead of its slew: every voltage that an amplifier of that slew or a faster one may be at
/// agrees. The amplifier was expected where the slowest one stands, so that a faster one on its way back tripped.
#[test]
fn an_amplifier_that_is_faster_than_its_slew_may_turn_back() {
    let mut limits = bench_limits();
    limits.max_slew_v_per_s = 1e6;
    limits.monitor.slew_v_per_s = 20e3;
    for slew_v_per_tick in [20.0f32, 25.0, 40.0, 60.0, 100.0, 400.0, f32::INFINITY] {
        for half_period in [5, 30, 80, 200, 400] {
            let mut monitor = Monitor::new(limits.monitor, RATE_HZ);
            let mut film_v = 0.0f32;
            for tick in 0..20_000 {
                let command_v = if tick / half_period % 2 == 0 { 6000.0 } else { 500.0 };
                film_v += (command_v - film_v).clamp(-slew_v_per_tick, slew_v_per_tick);
                assert!(monitor.agrees(command_v, film_v), "{slew_v_per_tick} V, {half_period} ticks: tick {tick}");
            }
            // One that stays where it is trips once the command has stood for long enough.
            let stays = film_v;
            let command_v = if stays > 3000.0 { 0.0 } else { 6000.0 };
            let trips = (0..400).find(|_| !monitor.agrees(command_v, stays));
            assert!(trips.is_some_and(|ticks| ticks <= 300 + 21), "{slew_v_per_tick} V: {trips:?}");
        }
    }
}

#[test]
fn limits_that_cannot_be_kept_are_refused() {
    let good = bench_limits();
    let refused = |limits: Limits| Supervisor::new(&limits, RATE_HZ).err();
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let cases = [
            (Limits { max_voltage_v: bad, ..good }, "max_voltage_v"),
            (Limits { max_field_v_per_m: bad, ..good }, "max_field_v_per_m"),
            (Limits { thickness_m: bad, ..good }, "thickness_m"),
            (Limits { max_slew_v_per_s: bad, ..good }, "max_slew_v_per_s"),
            (Limits { max_displacement_m: bad, ..good }, "max_displacement_m"),
            (Limits { max_disturbance_share: bad, ..good }, "max_disturbance_share"),
            (Limits { heartbeat_s: bad, ..good }, "heartbeat_s"),
            (Limits { discharge_s: bad, ..good }, "discharge_s"),
        ];
        for (limits, name) in cases {
            assert_eq!(refused(limits), Some(LimitsError::NotPositive(name)));
        }
        assert_eq!(Supervisor::new(&good, bad).err(), Some(LimitsError::NotPositive("rate_hz")));
        let mut monitor = good;
        monitor.monitor.slew_v_per_s = bad;
        assert_eq!(refused(monitor), Some(LimitsError::Monitor));
    }
    for spoil in [
        |sensor: &mut PlausibilityLimits| sensor.low = sensor.high,
        |sensor: &mut PlausibilityLimits| sensor.jump = f32::NAN,
        |sensor: &mut PlausibilityLimits| sensor.jump = f32::INFINITY,
        |sensor: &mut PlausibilityLimits| sensor.stuck_ticks = 0,
        |sensor: &mut PlausibilityLimits| sensor.stuck_band = 0.0,
        |sensor: &mut PlausibilityLimits| sensor.stuck_band = f32::NAN,
    ] {
        let mut limits = good;
        spoil(&mut limits.sensor);
        assert_eq!(refused(limits), Some(LimitsError::Sensor));
    }
}
