//! Every reachable state of a board between two hosts: a session, its device, and who may keep the amplifier enabled.
//!
//! Explored: frames of two hosts, each with the token that it got when it armed last, and of one without a token: arm, start, heartbeat,
//! set-points within and beyond the limits, stop, disarm, acknowledge, reload, and damaged bytes; and ticks with healthy readings, an open
//! interlock, silent converters, and a film that is live. Two states are the same if state and cause, the supervisor's counters up to where they act, the sign of the command, what the
//! last readings allow, the owner of the token and the independent count of the owner's silence are.
//!
//! Pass, in every transition: an enabled amplifier implies that this tick's interlock is closed and that a request of the host that armed came
//! within its timeout, as a count has it that knows only answers; more than 0 V while running only; while the amplifier is enabled, what
//! another host asks for is `Rejected(Token)` and changes nothing in the supervisor; a trip ends by `Acknowledge` alone. The search finds
//! a host that uses the other one's token.
//!
//! Cases: all states; with timeouts of 2 ticks and without reload, silent sensors and live films in the sample, of 3 ticks in full.

use std::hash::{DefaultHasher, Hash, Hasher};

use dea_driver::server::Session;
use dea_driver::wire::{Answer, Command, Mode, Reject};
use dea_driver::{Blob, Cause, Controller, Drive, DriverState, RamFlash};

use crate::bench::{board_parameters, encoded};
use crate::board::{self, BOARD, Bench};
use crate::explore::{World, explore};
use crate::scale::is_full;

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

/// A board, and what its hosts and an independent count know.
#[derive(Clone)]
struct Hosts {
    timeout_ticks: u32,
    /// Whether host 1 sends the token of host 0.
    steals: bool,
    session: Session,
    bench: Bench,
    tokens: [u16; 3],
    /// The host that armed last.
    owner: Option<usize>,
    /// Number of the last request of any.
    sequence: u16,
    silent_ticks: u32,
    interlock_closed: bool,
}

impl Hosts {
    fn new(timeout_ticks: u32, steals: bool) -> Self {
        let mut parameters = board_parameters();
        parameters.limits.heartbeat_s = timeout_ticks as f32 / RATE_HZ;
        parameters.limits.discharge_s = timeout_ticks as f32 / RATE_HZ;
        parameters.limits.max_slew_v_per_s = 1e6;
        parameters.limits.monitor.slew_v_per_s = 1e6;
        let mut bench = Bench::new(RamFlash::default(), None);
        bench.store.save(&encoded(&parameters, BOARD)).expect("valid");
        bench.device.install(Controller::new(Blob::new(parameters).expect("valid"))).expect("off");
        let (session, tokens, owner) = (Session::new("1.2.3"), [0; 3], None);
        Self {
            timeout_ticks,
            steals,
            session,
            bench,
            tokens,
            owner,
            sequence: 0,
            silent_ticks: 0,
            interlock_closed: false,
        }
    }

    fn ask(&mut self, host: usize, command: Command) -> Answer {
        let token = self.tokens[if self.steals && host == 1 { 0 } else { host }];
        self.sequence = self.sequence.wrapping_add(1);
        board::ask(&mut self.session, &mut self.bench, [self.sequence, token], command)
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
        if live && !owns && !self.steals {
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
        self.silent_ticks = (self.silent_ticks + 1).min(self.timeout_ticks + 1);
        let Drive { enable, dac_v, .. } = self.bench.drive;
        let state = self.bench.device.state();
        for (holds, what) in [
            (enable == state.is_live(), "enabled in a state that is not live, or not in one that is"),
            (!enable || inputs.interlock_closed, "enabled although the interlock is open"),
            (!enable || inputs.monitor_adc_v.is_some(), "enabled without a monitor"),
            (!enable || self.owner.is_some(), "enabled although no host has armed"),
            (!enable || self.silent_ticks <= self.timeout_ticks, "enabled although the host that armed is silent"),
            (dac_v == 0.0 || state == DriverState::Running, "more than 0 V although it does not run"),
        ] {
            if !holds {
                return Err(format!("{what}: {state:?}"));
            }
        }
        Ok(())
    }
}

impl World for Hosts {
    type Step = Step;

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

    fn key(&self) -> u64 {
        let text = self.supervisor();
        let value = |name: &str| {
            let start = text.find(name).expect("a field") + name.len();
            text[start..].split([',', ' ', '}']).next().unwrap_or_default().to_owned()
        };
        let counter = |name: &str, most: u32| value(name).parse::<u32>().expect("a counter").min(most);
        let state = self.bench.device.state();
        let timeout = self.timeout_ticks;
        let live = state.is_live();
        let key = format!(
            "{state:?} {} {:?} {} {} {} {:?} {} {:?} {} {} {} {:?}",
            if live { counter("ticks_since_heartbeat: ", timeout + 1) } else { 0 },
            [counter("live_ticks: ", u32::MAX), counter("missing_at_0_v: ", u32::MAX)],
            value("discharged: "),
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
        );
        let mut hasher = DefaultHasher::new();
        key.hash(&mut hasher);
        hasher.finish()
    }
}

#[test]
fn only_the_host_that_armed_keeps_the_amplifier_enabled() {
    let mut enabled = 0u32;
    let found = explore(Hosts::new(if is_full() { 3 } else { 2 }, false), &steps(), |hosts| {
        enabled += u32::from(hosts.bench.device.state().is_live());
    });
    let found = found.unwrap_or_else(|(violation, path)| panic!("{violation}: {path:?}"));
    println!("hosts: {found} states with {} steps, {enabled} enabled", steps().len());
    assert!(enabled > 20);
}

#[test]
fn the_search_finds_a_stolen_token() {
    let found = explore(Hosts::new(2, true), &steps(), |_| ());
    let (violation, path) = found.expect_err("host 1 speaks for host 0");
    println!("hosts, with a stolen token: {violation}, after {} steps", path.len());
    assert!(violation.starts_with("enabled although the host that armed is silent"), "{violation}");
}
