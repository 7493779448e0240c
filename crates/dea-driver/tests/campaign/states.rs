//! Every reachable state of the supervisor, against the lines of docs/safety.md, by a search over the supervisor itself.
//!
//! Explored: from a new supervisor, every request (arm, start, stop, disarm, acknowledge, heartbeat, a trip from outside) and every
//! class of readings, in every state that was not seen before. Two states are the same if all fields of the supervisor are, but for its
//! tick numbers; counters that only grow are cut off above the last value that they are compared with. Limits of a few ticks make that
//! finite. Readings deviate from healthy ones in one way at a time, by some kinds of deviation, in the sample; by every kind in up to two
//! ways in full (by the first two kinds of each where sensor faults do not trip, but are ridden through on the model), and with longer discharges
//! in one way.
//!
//! Pass: each [`Promise`], by readings, commands and counts that are kept apart from the supervisor. The search finds what is wrong with
//! supervisors that are broken on purpose.
//!
//! Cases: all states; see docs/safety.md for their numbers.

use std::hash::{Hash, Hasher};

use dea_driver::{
    Cause, DriverState, Limits, MonitorLimits, OnSensorFault, PlausibilityLimits, Readings, Refusal, SensorFault,
    Supervisor,
};
use stateright::{Checker, Model, Property};

use crate::bench::readings;
use crate::explore::{first_broken, is_tripped, keeps_cause, promises, searched};
use crate::scale::is_full;

const RATE_HZ: f32 = 1000.0;
const MAX_V: f32 = 1000.0;
const SLEW_V: f32 = MAX_V / 2.0;
const BAND_V: f32 = 60.0;
const HEARTBEAT_TICKS: u32 = 2;
const SENSOR: PlausibilityLimits =
    PlausibilityLimits { low: -1e-3, high: 3e-3, jump: 0.5e-3, stuck_ticks: STUCK_TICKS, stuck_band: 2e-6 };
const MAX_DISPLACEMENT_M: f32 = 1e-3;
const MAX_DISTURBANCE_SHARE: f32 = 0.1;
const STUCK_TICKS: u32 = 5;

fn limits(on_sensor_fault: OnSensorFault, discharge_ticks: u32) -> Limits {
    Limits {
        max_voltage_v: MAX_V,
        // Two ticks from 0 V to the largest voltage.
        max_slew_v_per_s: SLEW_V * RATE_HZ,
        max_displacement_m: MAX_DISPLACEMENT_M,
        max_disturbance_share: MAX_DISTURBANCE_SHARE,
        // At once: a single tick outside the band trips.
        monitor: MonitorLimits { slew_v_per_s: MAX_V * RATE_HZ, band_v: BAND_V, band_share: 0.03, settle_s: 0.0 },
        sensor: SENSOR,
        on_sensor_fault,
        heartbeat_s: HEARTBEAT_TICKS as f32 / RATE_HZ,
        discharge_s: discharge_ticks as f32 / RATE_HZ,
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

/// Value of the sensor: another than in the last tick, the same, or that of the readings.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sensor {
    Moves,
    Stays,
    Shows,
}

/// A class of readings, with what is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Class {
    readings: Readings,
    /// Whether the monitor shows the command instead.
    follows: bool,
    sensor: Sensor,
    wanted_v: f32,
}

impl Class {
    fn monitor(&mut self, monitor_v: f32) {
        (self.follows, self.readings.monitor_v) = (false, monitor_v);
    }

    fn shows(&mut self, displacement_m: f32) {
        (self.sensor, self.readings.displacement_m) = (Sensor::Shows, displacement_m);
    }
}

type Deviation = fn(&mut Class);

/// Deviations from healthy readings, by what they concern.
const DEVIATIONS: [&[Deviation]; 8] = [
    &[|c| c.readings.interlock_closed = false],
    &[|c| c.monitor(0.3 * MAX_V), |c| c.monitor(0.0), |c| c.monitor(1.2 * MAX_V), |c| c.monitor(f32::NAN)],
    &[|c| c.shows(f32::NAN), |c| c.sensor = Sensor::Stays, |c| c.shows(0.5), |c| c.shows(2e-3)],
    &[|c| c.readings.open_loop_m = 2e-3, |c| c.readings.open_loop_m = f32::NAN],
    &[|c| c.readings.predicted_m = 2e-3],
    &[|c| c.readings.is_frozen = true],
    &[|c| c.readings.disturbance_share = -0.2],
    &[|c| c.wanted_v = 0.0, |c| c.wanted_v = f32::NAN],
];

/// Healthy readings and those that deviate in up to `most` ways, by the first `kinds` deviations of each.
fn classes(most: usize, kinds: usize) -> Vec<Class> {
    let healthy =
        Class { readings: readings(0.0, 0.0, 0.0), follows: true, sensor: Sensor::Moves, wanted_v: 2.0 * MAX_V };
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

promises! {
    Interlock: "an interlock that opens ends at 0 V, disabled, within the tick",
    MonitorTooHigh: "a monitor that is too high or silent ends at 0 V, disabled, within the tick",
    MonitorAgrees: "a monitor that does not follow the command ends at 0 V, disabled, within its settling time",
    Sensor: "a sensor that is unplugged, jumps or is stuck ends at 0 V, disabled, within the tick",
    Stroke: "a film beyond its stroke, by the sensor in its range or by the model, ends at 0 V, disabled, within the tick",
    Force: "more force than the model explains ends at 0 V, disabled, within the tick",
    Host: "a host that armed and is silent ends at 0 V, disabled, after its timeout",
    Armed: "enabled only after an arm since it was disarmed or tripped last",
    Safe: "armed only with the interlock closed, 0 V at the film, and a plausible sensor",
    FirstCause: "a trip stays, with its first cause, until it is acknowledged; a live film alone replaces it",
    Live: "a disabled amplifier that stays on is reported",
    Discharged: "a live film is acknowledged, and armed, only after 0 V for the time of a discharge",
    Begin: "every run begins at 0 V",
    Limits: "the command is above 0 V while running only, never above its limit, never faster than its slew",
    Requests: "requests and ticks change states as the diagram has it",
}

/// Record that the search keeps, apart from the supervisor. Counts end where they stop to matter.
#[derive(Clone, Copy, Debug, Default)]
struct Witness {
    armed: bool,
    /// Ticks since the host's last request.
    silent_ticks: u32,
    /// The value that the sensor showed last, m, and for how many ticks in a row; 0 after an acknowledge.
    shown_m: f32,
    shown_ticks: u32,
    interlock_closed: bool,
    /// Commands before and after the last tick, V.
    commands_v: [f32; 2],
    at_0_v: bool,
    /// Ticks in a row in which the disabled amplifier was live.
    live_ticks: u32,
    /// Ticks at 0 V since the film was live last.
    quiet_ticks: u32,
    /// Whether it has been live since it was disabled.
    live_off: bool,
}

/// A state: the supervisor, what is known apart from it, and what the step to it broke.
#[derive(Clone, Debug)]
struct Node {
    supervisor: Supervisor,
    witness: Witness,
    broken: Option<Promise>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Request(Request),
    Tick(Class),
}

/// The supervisor, or one that is broken on purpose.
struct Search {
    limits: Limits,
    discharge_ticks: u32,
    steps: Vec<Step>,
    request: fn(&mut Supervisor, Request) -> Result<(), Refusal>,
    tick: fn(&mut Supervisor, Readings, f32) -> f32,
}

impl Search {
    fn new(on_sensor_fault: OnSensorFault, discharge_ticks: u32, most: usize, kinds: usize) -> Self {
        use Request::*;
        let ticks = classes(most, kinds).into_iter().map(Step::Tick);
        let requests = [Arm, Start, Stop, Disarm, Acknowledge, Heartbeat, Trip].map(Step::Request);
        let steps = requests.into_iter().chain(ticks).collect();
        let limits = limits(on_sensor_fault, discharge_ticks);
        Self { limits, discharge_ticks, steps, request, tick }
    }

    fn trips(&self) -> bool {
        self.limits.on_sensor_fault == OnSensorFault::Trip
    }
}

fn request(supervisor: &mut Supervisor, request: Request) -> Result<(), Refusal> {
    match request {
        Request::Arm => supervisor.arm(),
        Request::Start => supervisor.start(),
        Request::Stop => supervisor.stop(),
        Request::Disarm => supervisor.disarm(),
        Request::Acknowledge => supervisor.acknowledge(),
        Request::Heartbeat => {
            supervisor.heartbeat();
            Ok(())
        }
        Request::Trip => {
            supervisor.trip(Cause::Overrun);
            Ok(())
        }
    }
}

fn tick(supervisor: &mut Supervisor, readings: Readings, wanted_v: f32) -> f32 {
    supervisor.check(readings);
    supervisor.command(wanted_v, 1.0)
}

impl Search {
    fn ask(&self, node: &mut Node, request: Request) -> Result<(), Promise> {
        let before = node.supervisor.state();
        let done = (self.request)(&mut node.supervisor, request).is_ok();
        let after = node.supervisor.state();
        let witness = &mut node.witness;
        let quiet = witness.at_0_v && witness.quiet_ticks >= self.discharge_ticks;
        let expected = match (request, before) {
            (Request::Arm, DriverState::Disarmed) if done => {
                let is_plausible = !self.trips() || (SENSOR.low..=SENSOR.high).contains(&witness.shown_m);
                first_broken(&[
                    (witness.interlock_closed && witness.at_0_v && is_plausible, Promise::Safe),
                    (quiet || !witness.live_off, Promise::Discharged),
                ])?;
                (witness.armed, witness.silent_ticks) = (true, 0);
                witness.live_off = false;
                DriverState::Armed
            }
            (Request::Start, DriverState::Armed) => DriverState::Running,
            (Request::Stop, DriverState::Running) => DriverState::Armed,
            (Request::Disarm, DriverState::Armed | DriverState::Running) => DriverState::Disarmed,
            (Request::Acknowledge, DriverState::Tripped(cause)) if done => {
                first_broken(&[(quiet || cause != Cause::LiveFilm, Promise::Discharged)])?;
                witness.shown_ticks = 0;
                DriverState::Disarmed
            }
            (Request::Trip, DriverState::Disarmed | DriverState::Armed | DriverState::Running) => {
                DriverState::Tripped(Cause::Overrun)
            }
            (_, before) => before,
        };
        if request == Request::Heartbeat {
            witness.silent_ticks = 0;
        }
        witness.armed &= expected.is_live();
        first_broken(&[
            (after == expected, if is_tripped(expected) { Promise::FirstCause } else { Promise::Requests }),
            (before == after || node.supervisor.command_v() == 0.0, Promise::Begin),
        ])
    }

    fn check(&self, node: &mut Node, class: &Class) -> Result<(), Promise> {
        let before = node.supervisor.state();
        let command_before_v = node.supervisor.command_v();
        let shown_m = node.witness.shown_m;
        let displacement_m = match class.sensor {
            Sensor::Moves if shown_m == 10e-6 => 20e-6,
            Sensor::Moves => 10e-6,
            Sensor::Stays => shown_m,
            Sensor::Shows => class.readings.displacement_m,
        };
        let monitor_v = if class.follows { command_before_v } else { class.readings.monitor_v };
        let readings = Readings { displacement_m, monitor_v, ..class.readings };
        let command_v = (self.tick)(&mut node.supervisor, readings, class.wanted_v);
        let (supervisor, witness) = (&node.supervisor, &mut node.witness);
        let after = supervisor.state();
        let Readings { open_loop_m, predicted_m, .. } = readings;
        let jumps = witness.shown_ticks > 0 && (displacement_m - shown_m).abs() > SENSOR.jump;
        let stays = witness.shown_ticks > 0 && displacement_m == shown_m;
        let live = monitor_v.abs() > BAND_V;
        // Anywhere between the commands since the tick before.
        let [lowest_v, highest_v] =
            [f32::min, f32::max].map(|end| witness.commands_v.into_iter().fold(command_before_v, end));
        let band_v = 0.03 * highest_v + BAND_V;
        witness.commands_v = [command_before_v, command_v];
        witness.silent_ticks = (witness.silent_ticks + 1).min(HEARTBEAT_TICKS + 1);
        witness.shown_ticks = if stays { (witness.shown_ticks + 1).min(STUCK_TICKS + 1) } else { 1 };
        witness.interlock_closed = readings.interlock_closed;
        witness.live_off |= live && !after.is_live();
        witness.at_0_v = monitor_v.abs() <= BAND_V;
        witness.shown_m = displacement_m;
        witness.armed &= after.is_live();
        witness.live_ticks =
            if live && !after.is_live() { (witness.live_ticks + 1).min(self.discharge_ticks + 1) } else { 0 };
        witness.quiet_ticks = match (live, witness.at_0_v) {
            (true, _) => 0,
            (_, true) => (witness.quiet_ticks + 1).min(self.discharge_ticks),
            _ => witness.quiet_ticks,
        };
        let off = !supervisor.enables();
        let in_range = (SENSOR.low..=SENSOR.high).contains(&displacement_m);
        let beyond = |value_m: f32| !(-MAX_DISPLACEMENT_M..=MAX_DISPLACEMENT_M).contains(&value_m);
        let is_faulty = !in_range || jumps || readings.is_frozen || witness.shown_ticks > STUCK_TICKS;
        let is_beyond = in_range && beyond(displacement_m) || beyond(open_loop_m) || !in_range && beyond(predicted_m);
        let most_v = if after == DriverState::Running { MAX_V.min(command_before_v + SLEW_V) } else { 0.0 };
        first_broken(&[
            (off || witness.interlock_closed, Promise::Interlock),
            (off || monitor_v <= MAX_V * 1.03 + BAND_V, Promise::MonitorTooHigh),
            (off || (lowest_v - band_v..=highest_v + band_v).contains(&monitor_v), Promise::MonitorAgrees),
            (off || !self.trips() || !is_faulty, Promise::Sensor),
            (off || !is_beyond, Promise::Stroke),
            (off || readings.disturbance_share.abs() <= MAX_DISTURBANCE_SHARE, Promise::Force),
            (off || witness.silent_ticks <= HEARTBEAT_TICKS, Promise::Host),
            (off || witness.armed, Promise::Armed),
            (off != after.is_live(), Promise::Armed),
            (keeps_cause(before, after), Promise::FirstCause),
            (
                witness.live_ticks <= self.discharge_ticks || after == DriverState::Tripped(Cause::LiveFilm),
                Promise::Live,
            ),
            ((0.0..=most_v).contains(&command_v) && command_v == supervisor.command_v(), Promise::Limits),
            (before == after || is_tripped(after), Promise::Requests),
        ])
    }
}

impl Hash for Node {
    fn hash<H: Hasher>(&self, key: &mut H) {
        let text = format!("{:?}", self.supervisor);
        let Witness { armed, shown_m, shown_ticks, interlock_closed, at_0_v, .. } = self.witness;
        let Witness { silent_ticks, live_ticks, quiet_ticks, live_off, commands_v, .. } = self.witness;
        let live = self.supervisor.state().is_live();
        // How long a host has been silent counts from `arm` on.
        let silent_ticks = if live { silent_ticks } else { 0 };
        (self.broken, armed, interlock_closed, at_0_v, silent_ticks, shown_m.to_bits(), shown_ticks).hash(key);
        (live_ticks, quiet_ticks, live_off, commands_v.map(f32::to_bits)).hash(key);
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
                Some(most) => value().min(most).hash(key),
                None => token.hash(key),
            }
            name = token;
        }
    }
}

impl PartialEq for Node {
    fn eq(&self, other: &Self) -> bool {
        format!("{self:?}") == format!("{other:?}")
    }
}

impl Model for Search {
    type State = Node;
    type Action = Step;

    fn init_states(&self) -> Vec<Node> {
        let supervisor = Supervisor::new(&self.limits, RATE_HZ).expect("valid");
        vec![Node { supervisor, witness: Witness::default(), broken: None }]
    }

    fn actions(&self, node: &Node, steps: &mut Vec<Step>) {
        if node.broken.is_none() {
            steps.extend(&self.steps);
        }
    }

    fn next_state(&self, before: &Node, step: Step) -> Option<Node> {
        let mut node = before.clone();
        let kept = match step {
            Step::Request(request) => self.ask(&mut node, request),
            Step::Tick(class) => self.check(&mut node, &class),
        };
        node.broken = kept.err();
        Some(node)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        let mut properties = promises();
        // What has to be reached, so that the promises say something.
        properties.extend([
            Property::sometimes("it runs at the limit", |_, node: &Node| node.supervisor.command_v() == MAX_V),
            Property::sometimes("it trips with Stuck", |search: &Search, node: &Node| {
                !search.trips() || node.is_in(Cause::Sensor(SensorFault::Stuck))
            }),
            Property::sometimes("it trips with Monitor", |_, node: &Node| node.is_in(Cause::Monitor)),
            Property::sometimes("it trips with ModelDisplacement", |_, node: &Node| {
                node.is_in(Cause::ModelDisplacement)
            }),
            Property::sometimes("it trips with Heartbeat", |_, node: &Node| node.is_in(Cause::Heartbeat)),
            Property::sometimes("it trips with LiveFilm", |_, node: &Node| node.is_in(Cause::LiveFilm)),
        ]);
        properties
    }
}

impl Node {
    fn is_in(&self, cause: Cause) -> bool {
        self.supervisor.state() == DriverState::Tripped(cause)
    }
}

#[test]
fn every_state_keeps_what_is_promised() {
    use OnSensorFault::{OpenLoop, Trip};
    // Ticks of a discharge, and how many ways and kinds of deviations. Riding through a sensor's faults has many more states.
    let sample = [(Trip, 1, 1, 2), (OpenLoop, 1, 1, 1)].as_slice();
    let full = [(Trip, 1, 2, usize::MAX), (Trip, 2, 1, usize::MAX), (OpenLoop, 1, 2, 2), (OpenLoop, 2, 1, usize::MAX)];
    for &(on_sensor_fault, discharge_ticks, most, kinds) in if is_full() { &full } else { sample } {
        let found = searched(Search::new(on_sensor_fault, discharge_ticks, most, kinds));
        let (states, transitions) = (found.unique_state_count(), found.state_count());
        println!("states, {on_sensor_fault:?}, {discharge_ticks}, {most}: {states} states, {transitions} transitions");
        found.assert_properties();
    }
}

/// Supervisors that are broken on purpose, each in one way.
#[test]
fn the_search_finds_what_is_broken() {
    let sound = || Search::new(OnSensorFault::Trip, 1, 1, 2);
    // A trip of the interlock is swallowed.
    let swallows = |supervisor: &mut Supervisor, readings, wanted_v| {
        let before = *supervisor;
        supervisor.check(readings);
        if supervisor.state() == DriverState::Tripped(Cause::Interlock) {
            *supervisor = before;
        }
        supervisor.command(wanted_v, 1.0)
    };
    // Every tick is a heartbeat.
    let stays_alive = |supervisor: &mut Supervisor, readings, wanted_v| {
        supervisor.heartbeat();
        tick(supervisor, readings, wanted_v)
    };
    // What is acknowledged is armed again.
    let arms_again = |supervisor: &mut Supervisor, asked| {
        let done = request(supervisor, asked);
        if asked == Request::Acknowledge {
            let _ = supervisor.arm();
        }
        done
    };
    // A healthy tick ends a trip.
    let forgets = |supervisor: &mut Supervisor, readings: Readings, wanted_v| {
        let was_tripped = is_tripped(supervisor.state());
        let command_v = tick(supervisor, readings, wanted_v);
        if was_tripped && readings.monitor_v == 0.0 {
            let _ = supervisor.acknowledge();
        }
        command_v
    };
    for (broken, promise) in [
        (Search { tick: swallows, ..sound() }, Promise::Interlock),
        (Search { tick: stays_alive, ..sound() }, Promise::Host),
        (Search { request: arms_again, ..sound() }, Promise::Requests),
        (Search { tick: forgets, ..sound() }, Promise::FirstCause),
    ] {
        let found = searched(broken);
        let broken: Vec<_> = found.discoveries().into_values().filter_map(|path| path.last_state().broken).collect();
        assert!(!broken.is_empty() && broken.iter().all(|&broken| broken == promise), "{broken:?}");
    }
}
