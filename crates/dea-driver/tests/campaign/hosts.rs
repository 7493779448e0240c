//! Every reachable state of a board between two hosts, against the lines of docs/safety.md: a session, its device, and who may keep the amplifier
//! enabled.
//!
//! Explored: frames of two hosts, each with the token that it got when it armed last, and of one without a token: arm, start, heartbeat,
//! set-points within and beyond the limits, stop, disarm, acknowledge, reload, the last frame with a token again, and damaged bytes; and ticks with
//! healthy readings, an open interlock, silent converters, a film that is live, and an enable output that is not as it was set. Two states are the
//! same if state and cause, the supervisor's counters up to where they act, the sign of the command, what the last readings allow, the owner of
//! the token and the independent count of the owner's silence are.
//!
//! Pass: each [`Promise`], by a count that knows only answers. The search finds a host that uses the other one's token.
//!
//! Cases: all states; with timeouts of 2 ticks and without reload, silent sensors, live films and the enable output in the sample, of 3 ticks in
//! full.

use std::hash::{Hash, Hasher};

use dea_driver::server::Session;
use dea_driver::wire::{Answer, Command, Mode, Reject};
use dea_driver::{Blob, Controller, Drive, DriverState, RamFlash};
use stateright::{Checker, Model, Property};

use crate::bench::{changed_parameters, encoded};
use crate::board::{self, BOARD, Bench, inspection};
use crate::explore::{first_broken, is_tripped, keeps_cause, promises, searched};
use crate::scale::is_full;

const RATE_HZ: f32 = 1000.0;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Class {
    Healthy,
    InterlockOpen,
    MonitorSilent,
    SensorSilent,
    Live,
    /// The enable output is not as it was set.
    EnableHeld,
}

#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // some dozens of them
enum Step {
    /// A frame of host 0 or 1, or of one that has never armed.
    Ask(usize, Command),
    Again,
    Damaged,
    Tick(Class),
}

const STRANGER: usize = 2;

fn steps() -> Vec<Step> {
    use Command::{Acknowledge, Arm, Disarm, Heartbeat, Reload, SetVoltage, Start, Stop};
    let start = Start(Mode::Voltage);
    let of_all = [start, Heartbeat, SetVoltage(1500.0), SetVoltage(f32::INFINITY), Stop, Disarm, Acknowledge];
    let of_host = |host| of_all.clone().map(|command| Step::Ask(host, command));
    let mut steps: Vec<Step> = [0, 1, STRANGER].into_iter().flat_map(of_host).collect();
    steps.extend([Step::Ask(0, Arm), Step::Ask(1, Arm), Step::Again, Step::Damaged]);
    steps.extend([Class::Healthy, Class::InterlockOpen, Class::MonitorSilent].map(Step::Tick));
    if is_full() {
        // A silent sensor and a live film have counters of their own, in every combination with the others.
        steps.extend([Class::SensorSilent, Class::Live, Class::EnableHeld].map(Step::Tick));
        steps.push(Step::Ask(STRANGER, Reload));
    }
    steps
}

promises! {
    Enabled: "enabled while armed or running, and only then",
    Interlock: "an interlock that opens ends at 0 V, disabled, within the tick",
    Monitor: "a monitor that does not answer ends at 0 V, disabled, within the tick",
    Armed: "enabled only after a host has armed",
    Silent: "the host that armed is silent: 0 V after its timeout, whatever other hosts send",
    Token: "another host's request is refused, and neither moves nor keeps the voltage",
    NewToken: "every arm has a token of its own",
    Again: "a frame that comes again is not obeyed",
    Setpoint: "every run begins at 0 V: a set-point from before it does not outlive it",
    EnableOutput: "an enable output that is not as it was set is latched in the next tick, in every state",
    FirstCause: "a trip stays until it is acknowledged; a live film alone replaces it",
    Requests: "requests and ticks change states as the diagram has it",
}

/// A board, what its hosts and an independent count know, and what the step to it broke.
#[derive(Clone)]
struct Hosts {
    session: Session,
    bench: Bench,
    tokens: [u16; 3],
    /// The host that armed last.
    owner: Option<usize>,
    /// Number of the last request of any.
    sequence: u32,
    /// The last request of a host that was done because it had armed, with its number and token.
    last: Option<((u32, u16), Command)>,
    silent_ticks: u32,
    interlock_closed: bool,
    /// Whether a set-point was accepted since the run began.
    is_set: bool,
    broken: Option<Promise>,
}

impl std::fmt::Debug for Hosts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}, {:?}", self.supervisor(), self.broken)
    }
}

struct Search {
    timeout_ticks: u32,
    /// Whether host 1 sends the token of host 0.
    steals: bool,
}

impl Hosts {
    fn state(&self) -> DriverState {
        self.bench.device.state()
    }

    fn supervisor(&self) -> String {
        let controller = self.bench.device.controller().expect("installed");
        format!("{:?}", controller.supervisor())
    }

    fn again(&mut self) -> Result<(), Promise> {
        let Some((number, command)) = self.last.clone() else { return Ok(()) };
        let (before, state) = (self.supervisor(), self.state());
        let answer = board::ask(&mut self.session, &mut self.bench, number, command);
        first_broken(&[(!state.is_live() || answer != Answer::Done && self.supervisor() == before, Promise::Again)])
    }
}

impl Search {
    fn ask(&self, hosts: &mut Hosts, host: usize, command: Command) -> Result<(), Promise> {
        let live = hosts.state().is_live();
        let before = hosts.supervisor();
        let number = (hosts.sequence.wrapping_add(1), hosts.tokens[if self.steals && host == 1 { 0 } else { host }]);
        hosts.sequence = number.0;
        let answer = board::ask(&mut hosts.session, &mut hosts.bench, number, command.clone());
        if let Answer::Armed { token } = answer {
            first_broken(&[(token != 0 && !hosts.tokens.contains(&token), Promise::NewToken)])?;
            (hosts.tokens[host], hosts.owner, hosts.silent_ticks) = (token, Some(host), 0);
        }
        // What only the host that armed may send, and what keeps the amplifier enabled.
        if !matches!(command, Command::Start(_) | Command::Heartbeat | Command::SetVoltage(_)) {
            return Ok(());
        }
        let owns = hosts.owner == Some(host);
        if owns && answer == Answer::Done {
            hosts.silent_ticks = 0;
            hosts.is_set = matches!(command, Command::SetVoltage(_)) || hosts.is_set && command == Command::Heartbeat;
            hosts.last = Some((number, command));
        }
        let refused = answer == Answer::Rejected(Reject::Token) && hosts.supervisor() == before;
        first_broken(&[(!live || owns || self.steals || refused, Promise::Token)])
    }

    fn tick(&self, hosts: &mut Hosts, class: Class) -> Result<(), Promise> {
        let bench = &mut hosts.bench;
        let mut inputs = bench.inputs();
        match class {
            Class::InterlockOpen => inputs.interlock_closed = false,
            Class::MonitorSilent => inputs.monitor_adc_v = None,
            Class::SensorSilent => inputs.sensor_adc_v = None,
            Class::Live if !bench.drive.enable => inputs.monitor_adc_v = Some(1.5),
            Class::Healthy | Class::Live | Class::EnableHeld => {}
        }
        let enabled_before = bench.drive.enable;
        bench.tick(inputs);
        let held = class == Class::EnableHeld;
        bench.device.report(inspection(inputs.interlock_closed, enabled_before != held));
        hosts.interlock_closed = inputs.interlock_closed;
        hosts.silent_ticks = (hosts.silent_ticks + 1).min(self.timeout_ticks + 1);
        let Drive { enable, dac_v, .. } = hosts.bench.drive;
        let state = hosts.state();
        // The board withdraws the output of a tick whose report trips with the next one.
        let enable = enable && !held;
        hosts.is_set &= state == DriverState::Running;
        first_broken(&[
            (enable == state.is_live(), Promise::Enabled),
            (!enable || inputs.interlock_closed, Promise::Interlock),
            (!enable || inputs.monitor_adc_v.is_some(), Promise::Monitor),
            (!enable || hosts.owner.is_some(), Promise::Armed),
            (!enable || hosts.silent_ticks <= self.timeout_ticks, Promise::Silent),
            (!enable || dac_v == 0.0 || state == DriverState::Running, Promise::Requests),
            (!enable || dac_v == 0.0 || hosts.is_set, Promise::Setpoint),
            (!held || is_tripped(state), Promise::EnableOutput),
        ])
    }

    fn step(&self, hosts: &mut Hosts, step: Step) -> Result<(), Promise> {
        let before = hosts.state();
        match step.clone() {
            Step::Ask(host, command) => self.ask(hosts, host, command)?,
            Step::Again => hosts.again()?,
            Step::Damaged => {
                for byte in [1, 2, 3, 0] {
                    hosts.session.serve(byte, &mut hosts.bench);
                }
            }
            Step::Tick(class) => self.tick(hosts, class)?,
        }
        let after = hosts.state();
        let is_allowed = match (before, after, step) {
            (DriverState::Tripped(_), DriverState::Disarmed, Step::Ask(_, Command::Acknowledge)) => true,
            (DriverState::Tripped(_), ..) => is_tripped(after) && keeps_cause(before, after),
            (_, DriverState::Tripped(_), step) => matches!(step, Step::Tick(_)),
            (DriverState::Disarmed, DriverState::Armed, Step::Ask(_, Command::Arm)) => true,
            (DriverState::Armed, DriverState::Running, Step::Ask(_, Command::Start(_))) => true,
            (DriverState::Running, DriverState::Armed, Step::Ask(_, Command::Stop)) => true,
            (_, DriverState::Disarmed, Step::Ask(_, Command::Disarm)) => true,
            (before, after, _) => before == after,
        };
        first_broken(&[(is_allowed, if is_tripped(before) { Promise::FirstCause } else { Promise::Requests })])
    }
}

impl Hash for Hosts {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        let text = self.supervisor();
        let value = |name: &str| {
            let start = text.find(name).expect("a field") + name.len();
            text[start..].split([',', ' ', '}']).next().unwrap_or_default().to_owned()
        };
        let counter = |name: &str| value(name).parse::<u32>().expect("a counter");
        let state = self.state();
        let while_live = |count| if state.is_live() { count } else { 0 };
        format!("{state:?} {:?}", self.broken).hash(hasher);
        [
            while_live(counter("ticks_since_heartbeat: ")),
            counter("live_ticks: "),
            counter("missing_at_0_v: "),
            while_live(counter("excess: ")),
            counter("missing: "),
            while_live(self.silent_ticks),
        ]
        .hash(hasher);
        [value("last_fault: "), value(" command_v: "), value(" monitor_v: ")].hash(hasher);
        (self.interlock_closed, self.is_set, self.bench.drive.dac_v.to_bits()).hash(hasher);
        // Whose token is in force, and who has ever had one.
        (self.owner, self.tokens.map(|token| token != 0)).hash(hasher);
    }
}

impl PartialEq for Hosts {
    fn eq(&self, other: &Self) -> bool {
        format!("{self:?}") == format!("{other:?}")
    }
}

impl Model for Search {
    type State = Hosts;
    type Action = Step;

    fn init_states(&self) -> Vec<Hosts> {
        let timeout_s = self.timeout_ticks as f32 / RATE_HZ;
        let parameters = changed_parameters(|p| {
            (p.limits.heartbeat_s, p.limits.discharge_s) = (timeout_s, timeout_s);
            (p.limits.max_slew_v_per_s, p.limits.monitor.slew_v_per_s) = (1e6, 1e6);
        });
        let mut bench = Bench::new(RamFlash::default(), None);
        bench.store.save(&encoded(&parameters, BOARD)).expect("valid");
        bench.device.install(Controller::new(Blob::new(parameters).expect("valid"))).expect("off");
        vec![Hosts {
            session: Session::new("1.2.3"),
            bench,
            tokens: [0; 3],
            owner: None,
            sequence: 0,
            last: None,
            silent_ticks: 0,
            interlock_closed: false,
            is_set: false,
            broken: None,
        }]
    }

    fn actions(&self, hosts: &Hosts, all: &mut Vec<Step>) {
        if hosts.broken.is_none() {
            all.extend(steps());
        }
    }

    fn next_state(&self, before: &Hosts, step: Step) -> Option<Hosts> {
        let mut hosts = before.clone();
        hosts.broken = self.step(&mut hosts, step).err();
        Some(hosts)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        let mut properties = promises();
        properties.push(Property::sometimes("a host moves the film", |_, hosts: &Hosts| hosts.bench.drive.dac_v > 0.0));
        properties
    }
}

#[test]
fn only_the_host_that_armed_keeps_the_amplifier_enabled() {
    let found = searched(Search { timeout_ticks: if is_full() { 3 } else { 2 }, steals: false });
    println!("hosts: {} states, {} transitions", found.unique_state_count(), found.state_count());
    found.assert_properties();
}

#[test]
fn the_search_finds_a_stolen_token() {
    let found = searched(Search { timeout_ticks: 2, steals: true });
    let broken = found.discoveries().into_values().filter_map(|path| path.last_state().broken);
    assert!(broken.into_iter().any(|broken| broken == Promise::Silent), "host 1 speaks for host 0");
}
