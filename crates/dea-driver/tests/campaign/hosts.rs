//! Every reachable state of a board between two hosts: a session, its device, and who may keep the amplifier enabled.
//!
//! Explored: frames of two hosts, each with the token that it got when it armed last, and of one without a token: arm, start, heartbeat,
//! set-points within and beyond the limits, stop, disarm, acknowledge, reload, and damaged bytes; and ticks with healthy readings, an open
//! interlock, silent converters, and a film that is live. Every state is reached again from the start, since a session cannot be
//! copied. Two states are the same if state and cause, the supervisor's counters up to where they act, the sign of the command, what the
//! last readings allow, the owner of the token and the independent count of the owner's silence are.
//!
//! Pass, in every transition: an enabled amplifier implies that this tick's interlock is closed and that a request of the host that armed came
//! within its timeout, as a count has it that knows only answers; more than 0 V while running only; while the amplifier is enabled, what
//! another host asks for is `Rejected(Token)` and changes nothing in the supervisor; a trip ends by `Acknowledge` alone. The search finds
//! a host that uses the other one's token.
//!
//! Cases: all states; with timeouts of 2 ticks and without reload, silent sensors and live films in the sample, of 3 ticks in full.

use std::collections::{HashSet, VecDeque};

use dea_driver::server::Session;
use dea_driver::wire::{Answer, Command, Mode, Reject};
use dea_driver::{Blob, Cause, Controller, Drive, DriverState, Store};

use crate::bench::board_parameters;
use crate::board::{self, BOARD, Bench, encoded};
use crate::nor_flash::{SECTOR, TornFlash};
use crate::scale::{grouped, is_full};

const RATE_HZ: f32 = 1000.0;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Class {
    Healthy,
    InterlockOpen,
    MonitorSilent,
    SensorSilent,
    Live,
}

/// A frame of host 0 or 1, or of one without a token, or a tick.
#[derive(Clone, Copy, Debug)]
enum Step {
    Arm(usize),
    Start(usize),
    Heartbeat(usize),
    Set(usize),
    SetBeyond(usize),
    Stop(usize),
    Disarm(usize),
    Acknowledge(usize),
    Reload,
    Damaged,
    Tick(Class),
}

/// A host that has never armed.
const STRANGER: usize = 2;

fn steps() -> Vec<Step> {
    let mut steps = vec![
        Step::Arm(0),
        Step::Arm(1),
        Step::Start(0),
        Step::Start(1),
        Step::Heartbeat(0),
        Step::Heartbeat(1),
        Step::Set(0),
        Step::Set(1),
        Step::Stop(1),
        Step::Disarm(1),
        Step::Acknowledge(1),
        Step::Start(STRANGER),
        Step::Heartbeat(STRANGER),
        Step::Set(STRANGER),
        Step::SetBeyond(0),
        Step::SetBeyond(1),
        Step::Stop(0),
        Step::Disarm(STRANGER),
        Step::Acknowledge(0),
        Step::Damaged,
        Step::Tick(Class::Healthy),
        Step::Tick(Class::InterlockOpen),
        Step::Tick(Class::MonitorSilent),
    ];
    if is_full() {
        // A silent sensor and a live film have counters of their own, in every combination with the others.
        steps.extend([Step::Reload, Step::Tick(Class::SensorSilent), Step::Tick(Class::Live)]);
    }
    steps
}

/// Start of every search.
struct Start {
    timeout_ticks: u32,
    controller: Controller,
    flash: Vec<u8>,
    /// Whether host 1 sends the token of host 0.
    steals: bool,
}

impl Start {
    fn new(timeout_ticks: u32, steals: bool) -> Self {
        let mut parameters = board_parameters();
        parameters.limits.heartbeat_s = timeout_ticks as f32 / RATE_HZ;
        parameters.limits.discharge_s = timeout_ticks as f32 / RATE_HZ;
        parameters.limits.max_slew_v_per_s = 1e6;
        parameters.limits.monitor.slew_v_per_s = 1e6;
        let mut store = Store::new(TornFlash::new(&[0xff; 2 * SECTOR], 1), BOARD).expect("two parts");
        store.save(&encoded(&parameters)).expect("valid");
        let controller = Controller::new(Blob::new(parameters).expect("valid"));
        Self { timeout_ticks, controller, flash: store.destroy().bytes(), steals }
    }
}

struct World<'a> {
    start: &'a Start,
    session: Session,
    bench: Bench<TornFlash>,
    tokens: [u16; 3],
    /// The host that armed last.
    owner: Option<usize>,
    silent_ticks: u32,
    interlock_closed: bool,
}

impl<'a> World<'a> {
    fn new(start: &'a Start) -> Self {
        let mut bench = Bench::new(TornFlash::new(&start.flash, 1), None);
        bench.device.install(start.controller.clone()).expect("off");
        let session = Session::new("1.2.3");
        Self { start, session, bench, tokens: [0; 3], owner: None, silent_ticks: 0, interlock_closed: false }
    }

    fn ask(&mut self, host: usize, command: Command) -> Answer {
        let token = self.tokens[if self.start.steals && host == 1 { 0 } else { host }];
        board::ask(&mut self.session, &mut self.bench, token, command)
    }

    fn step(&mut self, step: Step) -> Result<(), String> {
        let before = self.bench.device.state();
        match step {
            Step::Arm(host) => self.arm(host)?,
            Step::Start(host) => self.drive(host, Command::Start(Mode::Voltage))?,
            Step::Heartbeat(host) => self.drive(host, Command::Heartbeat)?,
            Step::Set(host) => self.drive(host, Command::SetVoltage(1500.0))?,
            Step::SetBeyond(host) => self.drive(host, Command::SetVoltage(f32::NAN))?,
            Step::Stop(host) => drop(self.ask(host, Command::Stop)),
            Step::Disarm(host) => drop(self.ask(host, Command::Disarm)),
            Step::Acknowledge(host) => drop(self.ask(host, Command::Acknowledge)),
            Step::Reload => drop(self.ask(STRANGER, Command::Reload)),
            Step::Damaged => {
                for byte in [1, 2, 3, 0] {
                    self.session.serve(byte, &mut self.bench);
                }
            }
            Step::Tick(class) => self.tick(class)?,
        }
        let after = self.bench.device.state();
        let allowed = match (before, after, step) {
            (DriverState::Tripped(_), DriverState::Disarmed, Step::Acknowledge(_)) => true,
            (DriverState::Tripped(old), DriverState::Tripped(new), _) => old == new || new == Cause::LiveFilm,
            (DriverState::Tripped(_), ..) => false,
            (_, DriverState::Tripped(_), Step::Tick(_)) => true,
            (_, DriverState::Tripped(_), _) => false,
            (DriverState::Disarmed, DriverState::Armed, Step::Arm(_)) => true,
            (DriverState::Armed, DriverState::Running, Step::Start(_)) => true,
            (DriverState::Running, DriverState::Armed, Step::Stop(_)) => true,
            (_, DriverState::Disarmed, Step::Disarm(_)) => true,
            (before, after, _) => before == after,
        };
        if allowed { Ok(()) } else { Err(format!("{step:?} leads from {before:?} to {after:?}")) }
    }

    fn arm(&mut self, host: usize) -> Result<(), String> {
        if let Answer::Armed { token } = self.ask(host, Command::Arm) {
            if token == 0 || self.tokens.contains(&token) {
                return Err(format!("token {token} again"));
            }
            self.tokens[host] = token;
            self.owner = Some(host);
            self.silent_ticks = 0;
        }
        Ok(())
    }

    /// Sends a command that only the host that armed may send, and that keeps the amplifier enabled.
    fn drive(&mut self, host: usize, command: Command) -> Result<(), String> {
        let owns = self.owner == Some(host);
        let live = self.bench.device.state().is_live();
        let before = self.supervisor();
        let answer = self.ask(host, command.clone());
        if owns && answer == Answer::Done {
            self.silent_ticks = 0;
        }
        if live && !owns && !self.start.steals {
            if answer != Answer::Rejected(Reject::Token) {
                return Err(format!("{command:?} of another host is answered by {answer:?}"));
            }
            if self.supervisor() != before {
                return Err(format!("{command:?} of another host changes the supervisor"));
            }
        }
        Ok(())
    }

    fn supervisor(&self) -> String {
        let controller = self.bench.device.controller().expect("installed");
        format!("{:?}", controller.supervisor())
    }

    fn tick(&mut self, class: Class) -> Result<(), String> {
        let bench = &mut self.bench;
        let mut inputs = bench.inputs();
        match class {
            Class::InterlockOpen => inputs.interlock_closed = false,
            Class::MonitorSilent => inputs.monitor_adc_v = None,
            Class::SensorSilent => inputs.sensor_adc_v = None,
            Class::Live if !bench.drive.enable => inputs.monitor_adc_v = Some(1.5),
            Class::Healthy | Class::Live => {}
        }
        bench.tick(inputs);
        self.interlock_closed = inputs.interlock_closed;
        self.silent_ticks = (self.silent_ticks + 1).min(self.start.timeout_ticks + 1);
        let Drive { enable, dac_v, .. } = self.bench.drive;
        let state = self.bench.device.state();
        for (holds, what) in [
            (enable == state.is_live(), "enabled in a state that is not live, or not in one that is"),
            (!enable || inputs.interlock_closed, "enabled although the interlock is open"),
            (!enable || inputs.monitor_adc_v.is_some(), "enabled without a monitor"),
            (!enable || self.owner.is_some(), "enabled although no host has armed"),
            (
                !enable || self.silent_ticks <= self.start.timeout_ticks,
                "enabled although the host that armed is silent",
            ),
            (dac_v == 0.0 || state == DriverState::Running, "more than 0 V although it does not run"),
        ] {
            if !holds {
                return Err(format!("{what}: {state:?}"));
            }
        }
        Ok(())
    }

    fn key(&self) -> String {
        let text = self.supervisor();
        let value = |name: &str| {
            let start = text.find(name).expect("a field") + name.len();
            text[start..].split([',', ' ', '}']).next().unwrap_or_default().to_owned()
        };
        let counter = |name: &str, most: u32| value(name).parse::<u32>().expect("a counter").min(most);
        let state = self.bench.device.state();
        let timeout = self.start.timeout_ticks;
        let live = state.is_live();
        format!(
            "{state:?} {} {} {} {} {:?} {} {:?} {} {} {} {:?}",
            if live { counter("ticks_since_heartbeat: ", timeout + 1) } else { 0 },
            counter("live_ticks: ", timeout + 1),
            if live { counter("excess: ", u32::MAX) } else { 0 },
            counter("missing: ", 20),
            value("last_fault: "),
            value(" command_v: "),
            self.interlock_closed,
            value(" monitor_v: "),
            if live { self.silent_ticks } else { 0 },
            self.bench.drive.dac_v,
            // Whose token is in force, and who has ever had one.
            (self.owner, self.tokens.map(|token| token != 0)),
        )
    }
}

struct Found {
    states: u64,
    transitions: u64,
    enabled: u64,
    longest: usize,
}

/// Visits every state once; a violation with the steps that lead to it.
fn explore(start: &Start) -> Result<Found, (String, Vec<Step>)> {
    let steps = steps();
    let mut seen = HashSet::from([World::new(start).key()]);
    let mut queue: VecDeque<Vec<Step>> = VecDeque::from([vec![]]);
    let mut found = Found { states: 0, transitions: 0, enabled: 0, longest: 0 };
    while let Some(path) = queue.pop_front() {
        found.states += 1;
        found.longest = found.longest.max(path.len());
        for &step in &steps {
            found.transitions += 1;
            let mut world = World::new(start);
            for &step in &path {
                world.step(step).expect("it was visited");
            }
            let longer = || path.iter().copied().chain([step]).collect();
            world.step(step).map_err(|violation| (violation, longer()))?;
            if seen.insert(world.key()) {
                found.enabled += u64::from(world.bench.device.state().is_live());
                queue.push_back(longer());
            }
        }
    }
    Ok(found)
}

#[test]
fn only_the_host_that_armed_keeps_the_amplifier_enabled() {
    let start = Start::new(if is_full() { 3 } else { 2 }, false);
    match explore(&start) {
        Ok(found) => {
            println!(
                "hosts: {} states ({} enabled), {} transitions, the farthest {} steps away",
                grouped(found.states),
                grouped(found.enabled),
                grouped(found.transitions),
                found.longest
            );
            assert!(found.enabled > 20);
        }
        Err((violation, path)) => panic!("{violation}: {path:?}"),
    }
}

#[test]
fn the_search_finds_a_stolen_token() {
    let (violation, path) = explore(&Start::new(2, true)).err().expect("host 1 speaks for host 0");
    println!("hosts, with a stolen token: {violation}, after {} steps", path.len());
    assert!(violation.starts_with("enabled although the host that armed is silent"), "{violation}");
}
