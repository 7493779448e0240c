//! A host that plays a voltage: it knows only what comes over the line.

use std::f64::consts::TAU;

use dea_driver::wire::{Answer, Command, Message, Mode, Receiver, Request};
use dea_driver::{DriverState, Telemetry};

use crate::board::frame;

/// A repeatable request is sent again after this time without an answer, and twice as long the next time; any other is given up, ms.
const CALL_MS: u32 = 100;
const GIVE_UP_MS: u32 = 300;

/// A request whose answer is waited for.
struct Asked {
    command: Command,
    sequences: Vec<u32>,
    since: u32,
    patience: u32,
}

#[derive(Default)]
pub struct Player {
    receiver: Receiver,
    sequence: u32,
    token: u16,
    asked: Option<Asked>,
    next: Option<Command>,
    plays: bool,
    /// States that the board reported.
    pub states: Vec<DriverState>,
    pub records: Vec<Telemetry>,
    pub damaged: u32,
}

impl Player {
    pub fn new() -> Self {
        Self { next: Some(Command::Status), ..Self::default() }
    }

    /// Whether it plays, as far as it knows.
    pub fn plays(&self) -> bool {
        self.plays
    }

    /// The request to send in millisecond `now`.
    pub fn send(&mut self, now: u32, mut line: impl FnMut(&[u8])) {
        let mut emit = |host: &mut Self, command: Command| {
            host.sequence = host.sequence.wrapping_add(1).max(1);
            line(&frame(&Request { sequence: host.sequence, token: host.token, command }));
            host.sequence
        };
        if self.plays && now.is_multiple_of(10) {
            emit(self, Command::SetVoltage(profile_v(now)));
        }
        if self.token != 0 && now % 100 == 3 {
            emit(self, Command::Heartbeat);
        }
        if self.plays && now % 500 == 7 {
            self.next.get_or_insert(Command::Status);
        }
        match self.asked.take() {
            Some(asked) if now - asked.since < asked.patience => self.asked = Some(asked),
            Some(mut asked) if is_repeatable(&asked.command) => {
                asked.sequences.push(emit(self, asked.command.clone()));
                self.asked = Some(Asked { since: now, patience: (2 * asked.patience).min(1000), ..asked });
            }
            // Whether it was obeyed is not known.
            Some(_) => self.next = Some(Command::Status),
            None => {
                if let Some(command) = self.next.take() {
                    let patience = if is_repeatable(&command) { CALL_MS } else { GIVE_UP_MS };
                    let sequences = vec![emit(self, command.clone())];
                    self.asked = Some(Asked { command, sequences, since: now, patience });
                }
            }
        }
    }

    pub fn receive(&mut self, byte: u8) {
        match self.receiver.push::<Message>(byte) {
            None => {}
            Some(Err(_)) => self.damaged += 1,
            Some(Ok(Message::Telemetry(record))) => self.records.push(record),
            Some(Ok(Message::Answer { sequence, answer })) => {
                if let Some(asked) = self.asked.take_if(|asked| asked.sequences.contains(&sequence)) {
                    self.go_on(&asked.command, &answer);
                } else if let (Answer::Refused(_), true) = (&answer, self.plays) {
                    // A set-point that was not taken: it has tripped.
                    self.plays = false;
                    self.next = Some(Command::Status);
                }
            }
        }
    }

    fn go_on(&mut self, command: &Command, answer: &Answer) {
        self.next = match (command, answer) {
            (Command::Status, Answer::Status(status)) => {
                self.states.push(status.state);
                self.plays &= status.state == DriverState::Running;
                match status.state {
                    DriverState::Disarmed => Some(Command::Arm),
                    DriverState::Tripped(_) => Some(Command::Acknowledge),
                    // It was armed, and the token is lost.
                    _ if self.token == 0 => Some(Command::Disarm),
                    DriverState::Armed => Some(Command::Start(Mode::Voltage)),
                    DriverState::Running => {
                        self.plays = true;
                        None
                    }
                }
            }
            (Command::Arm, &Answer::Armed { token }) => {
                self.token = token;
                Some(Command::Start(Mode::Voltage))
            }
            (Command::Start(_), Answer::Done) => {
                self.plays = true;
                None
            }
            (Command::Acknowledge | Command::Disarm, _) => {
                self.token = 0;
                Some(Command::Status)
            }
            _ => Some(Command::Status),
        };
    }
}

/// As doc/link.md has it, of what this host sends.
fn is_repeatable(command: &Command) -> bool {
    matches!(command, Command::Status | Command::Disarm)
}

/// 0.5 to 3 kV.
pub fn profile_v(now: u32) -> f32 {
    (1750.0 - 1250.0 * (TAU * 0.2 * f64::from(now) / 1000.0).cos()) as f32
}
