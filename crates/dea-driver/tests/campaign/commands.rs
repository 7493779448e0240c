//! Random requests and readings against a reference machine that was written from the documentation ([`Reference`]).
//!
//! Explored: the [`Supervisor`] alone, and a `Device` with its `Controller`, under every request of a host with values inside and
//! outside the limits, NaN and infinite, and under readings that are healthy for a while, faulty for a while, or at random. Sensor
//! faults trip or are ridden through. In full, the supervisor is first ticked to 2.5·10⁷ ticks before the wrap of its tick counter, so that
//! the counter wraps in the middle of the random ticks.
//!
//! Pass: in every tick the same state, a cause that the reference names, the same answer to every request, the same tick numbers, enabled
//! exactly while armed or running; the supervisor's command within 0.01 V of the reference's, the controller's between 0 V and the limits
//! of voltage and field, no faster than the slew, and 0 V at the DAC while disabled.
//!
//! Cases: 1 000 000 ticks of the supervisor and 100 000 of the device in the sample, 10⁸ and 2·10⁶ in full, and 4.2·10⁹ before the wrap.

mod device;

use dea_driver::{Cause, DriverState, Limits, MonitorLimits, OnSensorFault, PlausibilityLimits, Readings, Supervisor};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

use crate::bench::readings;
use crate::reference::Reference;
use crate::scale::{cases, is_full};

const RATE_HZ: f32 = 1000.0;

/// Short times, so that every counter comes to its end often.
fn limits(on_sensor_fault: OnSensorFault) -> Limits {
    Limits {
        max_voltage_v: 4000.0,
        max_slew_v_per_s: 1e6,
        monitor: MonitorLimits { slew_v_per_s: 0.5e6, band_v: 60.0, band_share: 0.03, settle_s: 0.003 },
        sensor: PlausibilityLimits { low: -0.9e-3, high: 9e-3, jump: 0.4e-3, stuck_ticks: 25, stuck_band: 2e-6 },
        on_sensor_fault,
        heartbeat_s: 0.02,
        discharge_s: 0.01,
        ..Limits::bench(160e-6)
    }
}

/// How the readings are for a while.
#[derive(Clone, Copy, PartialEq)]
enum Mood {
    Healthy,
    /// One fault in about twenty ticks.
    Troubled,
    Chaos,
    /// The amplifier goes on although it is disabled.
    Live,
    /// The sensor shows the same value.
    FrozenSensor,
    /// The sensor shows noise while the model moves.
    StillSensor,
    /// The monitor falls to 0 V now and then.
    Arcs,
    /// The monitor leaves its band now and then, and falls by less than an arc.
    Glitches,
    SilentHost,
}

struct Source {
    random: Pcg64,
    mood: Mood,
    left: u32,
}

impl Source {
    fn new(seed: u64) -> Self {
        Self { random: Pcg64::seed_from_u64(seed), mood: Mood::Healthy, left: 100 }
    }

    fn one_in(&mut self, n: u32) -> bool {
        // 0 of n.
        (u64::from(self.random.next_u32()) * u64::from(n)) >> 32 == 0
    }

    fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.random.next_u32()) * u64::from(n)) >> 32) as u32
    }

    fn next_mood(&mut self) {
        self.left = self.left.saturating_sub(1);
        if self.left > 0 {
            return;
        }
        (self.mood, self.left) = match self.below(14) {
            0..=3 => (Mood::Healthy, 200),
            4..=6 => (Mood::Troubled, 200),
            7 => (Mood::Chaos, 50),
            8 => (Mood::Live, 40),
            9 => (Mood::FrozenSensor, 60),
            10 => (Mood::StillSensor, 60),
            11 => (Mood::Arcs, 60),
            12 => (Mood::Glitches, 60),
            _ => (Mood::SilentHost, 40),
        };
        self.left += self.below(50);
    }

    fn faulty(&mut self) -> bool {
        match self.mood {
            Mood::Troubled => self.one_in(60),
            Mood::Chaos => self.one_in(3),
            _ => false,
        }
    }

    /// A voltage for the monitor beside a command, away from the edge of its band.
    fn monitor_v(&mut self, reference: &Reference) -> f32 {
        let command_v = reference.command_v as f32;
        let value = if self.faulty() {
            match self.below(6) {
                0 => f32::NAN,
                1 => 0.0,
                2 => 7000.0,
                3 => -500.0,
                4 => f32::INFINITY,
                _ => self.below(4500) as f32,
            }
        } else if self.mood == Mood::Live && !reference.state.is_live() {
            if self.one_in(6) { f32::NAN } else { 1500.0 }
        } else if self.mood == Mood::Arcs && self.one_in(8) {
            0.0
        } else if self.mood == Mood::Glitches && self.one_in(8) {
            0.85 * command_v
        } else {
            command_v + self.below(10) as f32
        };
        if reference.is_on_the_edge(value) { command_v } else { value }
    }

    fn displacement_m(&mut self, before_m: f32) -> f32 {
        if self.faulty() {
            return match self.below(5) {
                0 => f32::NAN,
                1 => 0.5,
                2 => f32::NEG_INFINITY,
                3 => 5e-3,
                _ => before_m,
            };
        }
        match self.mood {
            Mood::FrozenSensor => before_m,
            // Within the band.
            Mood::StillSensor => 0.5e-6 * self.below(3) as f32,
            _ => 1e-6 * self.below(40) as f32,
        }
    }

    fn readings(&mut self, reference: &Reference) -> Readings {
        self.next_mood();
        let before_m = reference.readings.map_or(0.0, |readings| readings.displacement_m);
        let monitor_v = self.monitor_v(reference);
        let displacement_m = self.displacement_m(before_m);
        let odd = |source: &mut Self, usual: f32, most: f32| match source.faulty().then(|| source.below(3)) {
            None => usual,
            Some(0) => f32::NAN,
            Some(1) => most,
            Some(_) => -most,
        };
        let moving_m = 1e-6 * self.below(3) as f32;
        Readings {
            interlock_closed: !self.faulty(),
            monitor_v,
            displacement_m,
            predicted_m: odd(self, 0.0, 8.5e-3),
            open_loop_m: odd(self, moving_m, 8.5e-3),
            is_frozen: self.mood == Mood::StillSensor && self.left.is_multiple_of(64),
            disturbance_share: odd(self, 0.05, 0.2),
        }
    }
}

#[derive(Debug, Default)]
struct Counts {
    ticks: u64,
    requests: u64,
    refused: u64,
    running: u64,
    trips: u64,
    causes: std::collections::BTreeMap<String, u64>,
}

impl Counts {
    fn trip(&mut self, before: DriverState, after: DriverState) {
        if let DriverState::Tripped(cause) = after
            && before != after
        {
            self.trips += 1;
            *self.causes.entry(format!("{cause:?}")).or_default() += 1;
        }
    }
}

/// Asks the supervisor and the reference for the same; both must answer the same.
fn ask(supervisor: &mut Supervisor, reference: &mut Reference, source: &mut Source, counts: &mut Counts) {
    counts.requests += 1;
    let before = reference.state;
    let (done, expected) = match source.below(24) {
        0..=4 => (supervisor.arm(), reference.arm()),
        5..=9 => (supervisor.start(), reference.start()),
        10 if source.one_in(4) => (supervisor.stop(), reference.stop()),
        11 if source.one_in(4) => (supervisor.disarm(), reference.disarm()),
        12..=15 => (supervisor.acknowledge(), reference.acknowledge()),
        16 if source.one_in(16) => {
            let cause = [Cause::Overrun, Cause::Bus, Cause::Law][source.below(3) as usize];
            supervisor.trip(cause);
            reference.trip(cause);
            (Ok(()), Ok(()))
        }
        _ if source.mood == Mood::SilentHost => (Ok(()), Ok(())),
        _ => {
            supervisor.heartbeat();
            reference.heartbeat();
            (Ok(()), Ok(()))
        }
    };
    counts.refused += u64::from(done.is_err());
    reference.same(done, expected);
    assert_eq!(supervisor.state(), reference.state);
    counts.trip(before, reference.state);
}

fn run_supervisor(mut supervisor: Supervisor, mut reference: Reference, seed: u64, ticks: u64, counts: &mut Counts) {
    let mut source = Source::new(seed);
    for _ in 0..ticks {
        while source.one_in(3) {
            ask(&mut supervisor, &mut reference, &mut source, counts);
        }
        let readings = source.readings(&reference);
        let before = reference.state;
        let checked = supervisor.check(readings);
        reference.follow(readings, checked.state);
        let plausible = reference.sensor_faults.is_empty().then_some(readings.displacement_m);
        assert_eq!(checked.displacement_m, plausible, "tick {}", reference.ticks);
        let (wanted_v, thinning) = wanted(&mut source);
        let command_v = supervisor.command(wanted_v, thinning);
        let expected_v = reference.command(wanted_v, thinning);
        assert!((f64::from(command_v) - expected_v).abs() < 0.01, "{command_v} V instead of {expected_v} V");
        // What is rounded otherwise must not add up.
        reference.command_v = f64::from(command_v);
        assert_eq!(supervisor.enables(), reference.state.is_live());
        assert_eq!(supervisor.runs(), reference.state == DriverState::Running);
        assert_eq!(supervisor.ticks(), reference.ticks as u32);
        assert_eq!(supervisor.tripped_at(), reference.tripped_at as u32);
        counts.ticks += 1;
        counts.running += u64::from(supervisor.runs());
        counts.trip(before, reference.state);
    }
}

/// The wanted voltage, V, and how much thinner the film is.
fn wanted(source: &mut Source) -> (f32, f32) {
    let wanted_v = match source.below(64) {
        0 => f32::NAN,
        1 => f32::INFINITY,
        2 => f32::NEG_INFINITY,
        3 => -100.0,
        4..=20 => 3000.0,
        _ => source.below(5000) as f32,
    };
    let thinning = [0.5, 1.0, 1.0, 1.0, 1.0, 1.5, 2.5, f32::NAN][source.below(8) as usize];
    (wanted_v, thinning)
}

#[test]
fn the_supervisor_is_the_documented_machine() {
    let ticks = cases(1_000_000, 100_000_000);
    let mut counts = Counts::default();
    for (seed, on_sensor_fault) in [(1, OnSensorFault::Trip), (2, OnSensorFault::OpenLoop)] {
        let limits = limits(on_sensor_fault);
        let mut supervisor = Supervisor::new(&limits, RATE_HZ).expect("valid");
        let mut reference = Reference::new(&limits, RATE_HZ);
        if is_full() && on_sensor_fault == OnSensorFault::Trip {
            tick_before_the_wrap(&mut supervisor, &mut reference, ticks / 4);
        }
        run_supervisor(supervisor, reference, seed, ticks / 2, &mut counts);
    }
    println!("commands, supervisor: {counts:?}");
    // Everything that readings can cause, and what is tripped from outside: all but what a reset or the store causes.
    assert_eq!(counts.causes.len(), 15, "{:?}", counts.causes);
}

/// Ticks a disarmed supervisor until `before` ticks before its counter wraps. There is no other way there.
fn tick_before_the_wrap(supervisor: &mut Supervisor, reference: &mut Reference, before: u64) {
    let healthy = |k: u64| readings(0.0, if k.is_multiple_of(2) { 0.0 } else { 5e-6 }, 0.0);
    let until = (1 << 32) - before;
    for k in 1..=until {
        supervisor.check(healthy(k));
    }
    assert_eq!(u64::from(supervisor.ticks()), until);
    // The reference sees the last hundred: a healthy history leaves nothing else behind.
    reference.ticks = until - 100;
    for k in until - 99..=until {
        reference.check(healthy(k), DriverState::Disarmed).expect("it stays disarmed");
    }
    println!("commands, supervisor: {until} ticks before the random ones");
}
