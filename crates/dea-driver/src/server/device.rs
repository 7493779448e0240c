//! What a board ticks: a controller once there are parameters, and nothing before.

use heapless::Deque;

use crate::chips::Drive;
use crate::control::{Controller, Inputs};
use crate::safety::{Cause, Refusal, State, Supervisor};
use crate::wire::{Answer, Command, Reject, Sample, Status};

/// Samples that wait for the link.
const WAITING: usize = 16;

/// A controller, if there are parameters for one, with what outlives it: why the last run ended, and the stream to the host.
///
/// Shared by the tick, which must not wait, and the [`Session`](crate::server::Session) with the host.
#[derive(Debug, Default)]
pub struct Device {
    controller: Option<Controller>,
    /// Why the last run ended, until it is acknowledged.
    latched: Option<Cause>,
    stream: Stream,
}

impl Device {
    /// A device without parameters. `latched` is why the run before ended, if it was not switched off.
    #[must_use]
    pub const fn new(latched: Option<Cause>) -> Self {
        Self { controller: None, latched, stream: Stream::new() }
    }

    /// The controller, once there are parameters.
    #[must_use]
    pub fn controller(&self) -> Option<&Controller> {
        self.controller.as_ref()
    }

    /// Whether the amplifier is disabled, so that parameters may change.
    ///
    /// # Errors
    ///
    /// [`Refusal::State`] while it is enabled.
    pub fn is_off(&self) -> Result<(), Refusal> {
        match self.state() {
            state if state.is_live() => Err(Refusal::State(state)),
            _ => Ok(()),
        }
    }

    /// Ticks with `controller` from now on. A trip stays until it is acknowledged.
    ///
    /// # Errors
    ///
    /// [`Refusal::State`] while the amplifier is enabled; the old controller stays.
    pub fn install(&mut self, mut controller: Controller) -> Result<(), Refusal> {
        self.is_off()?;
        if let State::Tripped(cause) = self.state() {
            controller.supervisor_mut().trip(cause);
        }
        self.controller = Some(controller);
        Ok(())
    }

    /// The state; without a controller, disarmed or tripped by what ended the last run.
    #[must_use]
    pub fn state(&self) -> State {
        let before = self.latched.map_or(State::Disarmed, State::Tripped);
        self.controller.as_ref().map_or(before, |controller| controller.supervisor().state())
    }

    /// Trips what is armed or running.
    pub fn trip(&mut self, cause: Cause) {
        if let Some(controller) = self.controller.as_mut().filter(|controller| controller.supervisor().enables()) {
            controller.supervisor_mut().trip(cause);
        }
    }

    /// One tick.
    pub fn tick(&mut self, inputs: Inputs) -> Drive {
        let Some(controller) = &mut self.controller else {
            return Drive::OFF;
        };
        let outputs = controller.tick(inputs);
        self.stream.take(outputs.sample);
        Drive { enable: outputs.enable, command: outputs.command, range: controller.parameters().command_range }
    }

    /// The next sample that the host asked for.
    pub fn sample(&mut self) -> Option<Sample> {
        self.stream.waiting.pop_front()
    }

    /// Does as a host asks, and answers.
    pub fn obey(&mut self, command: &Command) -> Answer {
        match (command, &mut self.controller) {
            (Command::Stream { every }, _) => {
                self.stream = Stream { every: *every, ..Stream::new() };
                self.heartbeat();
                Answer::Done
            }
            (Command::Acknowledge, None) if self.latched.is_some() => {
                self.latched = None;
                Answer::Done
            }
            (Command::Heartbeat | Command::Disarm, None) => Answer::Done,
            (_, None) => Answer::Rejected(Reject::NoParameters),
            (_, Some(controller)) => {
                let answer = controller.obey(command).unwrap_or(Answer::Rejected(Reject::Unknown));
                if (command, &answer) == (&Command::Acknowledge, &Answer::Done) {
                    self.latched = None;
                }
                answer
            }
        }
    }

    /// The host is alive.
    pub fn heartbeat(&mut self) {
        if let Some(controller) = &mut self.controller {
            controller.supervisor_mut().heartbeat();
        }
    }

    /// How things are; the link adds its own counts.
    #[must_use]
    pub fn status(&self) -> Status {
        let supervisor = self.controller.as_ref().map(Controller::supervisor);
        Status {
            state: self.state(),
            rate_hz: self.controller.as_ref().map_or(0.0, |controller| controller.parameters().rate_hz),
            ticks: supervisor.map_or(0, Supervisor::ticks),
            tripped_at: supervisor.map_or(0, Supervisor::tripped_at),
            command_v: supervisor.map_or(0.0, Supervisor::command_v),
            damaged_frames: 0,
            unknown_frames: 0,
            stack_peak: 0,
        }
    }
}

/// Every so-many-th sample, for as long as there is room.
#[derive(Debug, Default)]
struct Stream {
    every: u16,
    since: u16,
    dropped: u32,
    waiting: Deque<Sample, WAITING>,
}

impl Stream {
    const fn new() -> Self {
        Self { every: 0, since: 0, dropped: 0, waiting: Deque::new() }
    }

    fn take(&mut self, sample: Sample) {
        if self.every == 0 {
            return;
        }
        self.since += 1;
        if self.since < self.every {
            return;
        }
        self.since = 0;
        let sample = Sample { dropped: self.dropped, ..sample };
        if self.waiting.push_back(sample).is_ok() {
            self.dropped = 0;
        } else {
            self.dropped = self.dropped.saturating_add(1);
        }
    }
}
