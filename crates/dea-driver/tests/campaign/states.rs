//! Every reachable state of the supervisor, by a breadth-first search over the supervisor itself.
//!
//! Explored: from a new supervisor, every request (arm, start, stop, disarm, acknowledge, heartbeat, a trip from outside) and every
//! class of readings, in every state that was not seen before. Two states are the same if all fields of the supervisor are, but for its
//! tick numbers; counters that only grow are cut off above the last value that they are compared with. Limits of a few ticks make that
//! finite. Readings deviate from healthy ones in one way at a time, by some kinds of deviation, in the sample; by every kind in up to two
//! ways in full. Sensor faults trip, or are ridden through on the model (by the first two kinds of each deviation in full).
//!
//! Pass, in every transition: an enabled amplifier implies that this tick's interlock is closed, that nothing is latched, that the host
//! has armed since the last disarm or trip, and that its last request was within its timeout, as an independent counter has it; the command is
//! above 0 V while running only, and never above its limit; requests change states as the diagram at [`DriverState`] has it; a trip
//! ends by `acknowledge` only, and only [`Cause::LiveFilm`] replaces another cause. The search finds each of four faults that are put
//! into it on purpose.
//!
//! Cases: all states: 10 561 where sensor faults trip and 7 774 where they are ridden through in the sample, 282 786 and 192 954 in full.

mod broken;

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};

use dea_driver::{
    Cause, DriverState, Limits, MonitorLimits, OnSensorFault, PlausibilityLimits, Readings, Refusal, Supervisor,
};

use crate::explore::{World, explore};
use crate::scale::is_full;

const RATE_HZ: f32 = 1000.0;
const MAX_V: f32 = 1000.0;
const BAND_V: f32 = 60.0;
const HEARTBEAT_TICKS: u32 = 2;
const DISCHARGE_TICKS: u32 = 1;
const STUCK_TICKS: u32 = 5;

fn limits(on_sensor_fault: OnSensorFault) -> Limits {
    Limits {
        max_voltage_v: MAX_V,
        // Two ticks from 0 V to the largest voltage.
        max_slew_v_per_s: MAX_V / 2.0 * RATE_HZ,
        max_displacement_m: 1e-3,
        // At once: a single tick outside the band trips.
        monitor: MonitorLimits { slew_v_per_s: MAX_V * RATE_HZ, band_v: BAND_V, band_share: 0.03, settle_s: 0.0 },
        sensor: PlausibilityLimits { low: -1e-3, high: 3e-3, jump: 0.5e-3, stuck_ticks: STUCK_TICKS, stuck_band: 2e-6 },
        on_sensor_fault,
        heartbeat_s: HEARTBEAT_TICKS as f32 / RATE_HZ,
        discharge_s: DISCHARGE_TICKS as f32 / RATE_HZ,
        ..Limits::bench(160e-6)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Request {
    Arm,
    Start,
    Stop,
    Disarm,
    Acknowledge,
    Heartbeat,
    Trip,
}

const REQUESTS: [Request; 7] = [
    Request::Arm,
    Request::Start,
    Request::Stop,
    Request::Disarm,
    Request::Acknowledge,
    Request::Heartbeat,
    Request::Trip,
];

/// Subject of the search: the supervisor, or one that is broken on purpose.
trait Machine: Clone {
    fn with_supervisor(supervisor: Supervisor) -> Self;
    fn supervisor(&self) -> &Supervisor;
    fn request(&mut self, request: Request) -> Result<(), Refusal>;
    /// Checks, and returns the command, V.
    fn tick(&mut self, readings: Readings, wanted_v: f32) -> f32;
}

impl Machine for Supervisor {
    fn with_supervisor(supervisor: Supervisor) -> Self {
        supervisor
    }

    fn supervisor(&self) -> &Supervisor {
        self
    }

    fn request(&mut self, request: Request) -> Result<(), Refusal> {
        match request {
            Request::Arm => self.arm(),
            Request::Start => self.start(),
            Request::Stop => self.stop(),
            Request::Disarm => self.disarm(),
            Request::Acknowledge => self.acknowledge(),
            Request::Heartbeat => {
                self.heartbeat();
                Ok(())
            }
            Request::Trip => {
                self.trip(Cause::Overrun);
                Ok(())
            }
        }
    }

    fn tick(&mut self, readings: Readings, wanted_v: f32) -> f32 {
        self.check(readings);
        self.command(wanted_v, 1.0)
    }
}

/// Reading of the monitor.
#[derive(Clone, Copy, Debug, PartialEq)]
enum MonitorClass {
    FollowsCommand,
    Zero,
    Live,
    BeyondLimit,
    Silent,
}

/// Reading of the displacement sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
enum SensorClass {
    Moves,
    Stays,
    OutOfRange,
    Silent,
    Slipped,
}

/// A class of readings, with what is asked for.
#[derive(Clone, Copy, Debug)]
struct Class {
    interlock_closed: bool,
    monitor: MonitorClass,
    sensor: SensorClass,
    open_loop_m: f32,
    predicted_m: f32,
    is_frozen: bool,
    disturbance_share: f32,
    wanted_v: f32,
}

type Deviation = fn(&mut Class);

/// Deviations from healthy readings, by what they concern.
const DEVIATIONS: [&[Deviation]; 8] = [
    &[|c| c.interlock_closed = false],
    &[
        |c| c.monitor = MonitorClass::Live,
        |c| c.monitor = MonitorClass::Zero,
        |c| c.monitor = MonitorClass::BeyondLimit,
        |c| c.monitor = MonitorClass::Silent,
    ],
    &[
        |c| c.sensor = SensorClass::Silent,
        |c| c.sensor = SensorClass::Stays,
        |c| c.sensor = SensorClass::OutOfRange,
        |c| c.sensor = SensorClass::Slipped,
    ],
    &[|c| c.open_loop_m = 2e-3, |c| c.open_loop_m = f32::NAN],
    &[|c| c.predicted_m = 2e-3],
    &[|c| c.is_frozen = true],
    &[|c| c.disturbance_share = -0.2],
    &[|c| c.wanted_v = 0.0, |c| c.wanted_v = f32::NAN],
];

/// Healthy readings and those that deviate in up to `most` ways, by the first `kinds` deviations of each.
fn classes(most: usize, kinds: usize) -> Vec<Class> {
    let healthy = Class {
        interlock_closed: true,
        monitor: MonitorClass::FollowsCommand,
        sensor: SensorClass::Moves,
        open_loop_m: 0.0,
        predicted_m: 0.0,
        is_frozen: false,
        disturbance_share: 0.0,
        wanted_v: 2.0 * MAX_V,
    };
    let mut classes = vec![(healthy, 0)];
    for group in DEVIATIONS {
        let mut deviating = Vec::new();
        for &(class, count) in classes.iter().filter(|(_, count)| *count < most) {
            for deviate in group.iter().take(kinds) {
                let mut class = class;
                deviate(&mut class);
                deviating.push((class, count + 1));
            }
        }
        classes.extend(deviating);
    }
    classes.into_iter().map(|(class, _)| class).collect()
}

/// Record that the search keeps, apart from the supervisor.
#[derive(Clone, Copy)]
struct Witness {
    armed: bool,
    /// Ticks since the host's last request, at most one beyond its timeout.
    silent_ticks: u32,
    /// The value that the sensor showed last, m.
    shown_m: f32,
    interlock_closed: bool,
    at_0_v: bool,
}

#[derive(Clone)]
struct Node<M> {
    machine: M,
    witness: Witness,
}

#[derive(Clone, Copy, Debug)]
enum Step {
    Request(Request),
    Tick(Class),
}

impl<M: Machine> Node<M> {
    fn new(limits: &Limits) -> Self {
        let supervisor = Supervisor::new(limits, RATE_HZ).expect("valid");
        let witness = Witness { armed: false, silent_ticks: 0, shown_m: 0.0, interlock_closed: false, at_0_v: false };
        Self { machine: M::with_supervisor(supervisor), witness }
    }

    fn request(&mut self, request: Request) -> Result<(), String> {
        let before = self.machine.supervisor().state();
        let done = self.machine.request(request).is_ok();
        let after = self.machine.supervisor().state();
        let witness = &mut self.witness;
        let expected = match (request, before) {
            (Request::Arm, DriverState::Disarmed) if done => {
                if !(witness.interlock_closed && witness.at_0_v) {
                    return Err("armed although the readings are not safe".into());
                }
                witness.armed = true;
                witness.silent_ticks = 0;
                DriverState::Armed
            }
            (Request::Start, DriverState::Armed) => DriverState::Running,
            (Request::Stop, DriverState::Running) => DriverState::Armed,
            (Request::Disarm, DriverState::Armed | DriverState::Running) => DriverState::Disarmed,
            (Request::Acknowledge, DriverState::Tripped(_)) if done => DriverState::Disarmed,
            (Request::Trip, DriverState::Disarmed | DriverState::Armed | DriverState::Running) => {
                DriverState::Tripped(Cause::Overrun)
            }
            (_, before) => before,
        };
        if request == Request::Heartbeat {
            witness.silent_ticks = 0;
        }
        if !expected.is_live() {
            witness.armed = false;
        }
        if after == expected { Ok(()) } else { Err(format!("{request:?} leads from {before:?} to {after:?}")) }
    }

    fn tick(&mut self, class: &Class) -> Result<(), String> {
        let before = self.machine.supervisor().state();
        let readings = self.readings(class);
        let command_v = self.machine.tick(readings, class.wanted_v);
        let supervisor = self.machine.supervisor();
        let after = supervisor.state();
        let witness = &mut self.witness;
        witness.silent_ticks = (witness.silent_ticks + 1).min(HEARTBEAT_TICKS + 1);
        witness.shown_m = readings.displacement_m;
        witness.interlock_closed = readings.interlock_closed;
        witness.at_0_v = readings.monitor_v.abs() <= BAND_V;
        if let DriverState::Tripped(_) = after {
            witness.armed = false;
        }
        let allowed = match (before, after) {
            (DriverState::Tripped(old), DriverState::Tripped(new)) => old == new || new == Cause::LiveFilm,
            (_, DriverState::Tripped(_)) => true,
            (before, after) => before == after,
        };
        if !allowed {
            return Err(format!("a tick leads from {before:?} to {after:?}"));
        }
        if supervisor.enables() != after.is_live() {
            return Err(format!("enabled in {after:?}"));
        }
        if supervisor.enables() {
            for (holds, what) in [
                (witness.interlock_closed, "the interlock is open"),
                (witness.armed, "no host has armed"),
                (witness.silent_ticks <= HEARTBEAT_TICKS, "the host is silent"),
                (readings.monitor_v <= MAX_V * 1.03 + BAND_V, "the monitor shows more than the limit, or nothing"),
            ] {
                if !holds {
                    return Err(format!("enabled although {what}"));
                }
            }
        }
        let most_v = if after == DriverState::Running { MAX_V } else { 0.0 };
        if !(0.0..=most_v).contains(&command_v) || command_v != supervisor.command_v() {
            return Err(format!("{command_v} V in {after:?}"));
        }
        Ok(())
    }

    fn readings(&self, class: &Class) -> Readings {
        let shown_m = self.witness.shown_m;
        Readings {
            interlock_closed: class.interlock_closed,
            monitor_v: match class.monitor {
                MonitorClass::FollowsCommand => self.machine.supervisor().command_v(),
                MonitorClass::Zero => 0.0,
                MonitorClass::Live => 0.3 * MAX_V,
                MonitorClass::BeyondLimit => 1.2 * MAX_V,
                MonitorClass::Silent => f32::NAN,
            },
            displacement_m: match class.sensor {
                SensorClass::Moves if shown_m == 10e-6 => 20e-6,
                SensorClass::Moves => 10e-6,
                SensorClass::Stays => shown_m,
                SensorClass::OutOfRange => 0.5,
                SensorClass::Silent => f32::NAN,
                SensorClass::Slipped => 2e-3,
            },
            predicted_m: class.predicted_m,
            open_loop_m: class.open_loop_m,
            is_frozen: class.is_frozen,
            disturbance_share: class.disturbance_share,
        }
    }
}

impl<M: Machine> World for Node<M> {
    type Step = Step;

    fn step(&mut self, step: Step) -> Result<(), String> {
        match step {
            Step::Request(request) => self.request(request),
            Step::Tick(class) => self.tick(&class),
        }
    }

    fn key(&self) -> u64 {
        let supervisor = self.machine.supervisor();
        let text = format!("{supervisor:?}");
        let Witness { armed, silent_ticks, shown_m, interlock_closed, at_0_v } = self.witness;
        let live = supervisor.state().is_live();
        let mut key = DefaultHasher::new();
        // How long a host has been silent counts from `arm` on.
        let silent_ticks = if live { silent_ticks } else { 0 };
        (armed, interlock_closed, at_0_v, silent_ticks, shown_m.to_bits()).hash(&mut key);
        let mut name = "";
        for token in text.split(' ') {
            let value = || token.trim_end_matches([',', '}']).parse::<u32>().expect("a counter");
            // Where a counter is cut off: above the last value that it is compared with.
            let most = match name {
                "tripped_at:" | "ticks:" => Some(0),
                // Both start again when it is armed.
                "ticks_since_heartbeat:" => Some(if live { HEARTBEAT_TICKS + 1 } else { 0 }),
                "excess:" => Some(if live { 1 } else { 0 }),
                // A single tick outside the band trips: what follows an arc is never asked.
                "watched:" | "fallen:" | "fallen_last:" | "falls:" => Some(0),
                "same:" => Some(STUCK_TICKS),
                _ => None,
            };
            match most {
                Some(most) => value().min(most).hash(&mut key),
                None => token.hash(&mut key),
            }
            name = token;
        }
        key.finish()
    }
}

fn steps(classes: Vec<Class>) -> Vec<Step> {
    REQUESTS.map(Step::Request).into_iter().chain(classes.into_iter().map(Step::Tick)).collect()
}

#[test]
fn no_state_enables_what_it_must_not() {
    // Riding through a sensor's faults has many more states.
    for (on_sensor_fault, sample, full) in
        [(OnSensorFault::Trip, (1, 2), (2, usize::MAX)), (OnSensorFault::OpenLoop, (1, 1), (2, 2))]
    {
        let (most, kinds) = if is_full() { full } else { sample };
        let steps = steps(classes(most, kinds));
        let (mut enabled, mut causes) = (0u32, HashSet::new());
        let found = explore(Node::<Supervisor>::new(&limits(on_sensor_fault)), &steps, |node| {
            let state = node.machine.supervisor().state();
            enabled += u32::from(state.is_live());
            if let DriverState::Tripped(cause) = state {
                causes.insert(format!("{cause:?}"));
            }
        });
        let found = found.unwrap_or_else(|(violation, path)| panic!("{violation}: {path:?}"));
        println!(
            "states, sensor fault {on_sensor_fault:?}: {found} with {} steps, {enabled} enabled, causes {causes:?}",
            steps.len()
        );
        assert!(enabled > 0 && causes.len() >= 5, "{causes:?}");
    }
}
