//! The control tick, and what a host can ask of it.

use springpot::{Compressed, Law, Memory, State as FilmState, VoltageDrive};

use crate::blob::{Blob, Parameters};
use crate::convert::{AdcCode, DacCode};
use crate::link::{Answer, Command, Mode, Reject, Sample, Step};
use crate::supervisor::{Cause, Readings, Refusal, Supervisor};

type History = <Compressed<f32> as Memory<f32>>::History;

/// What was sampled at the beginning of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Inputs {
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// The voltage monitor, if its converter answered.
    pub monitor: Option<AdcCode>,
    /// The displacement sensor, if its converter answered.
    pub displacement: Option<AdcCode>,
}

/// What is put out at the end of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs {
    /// Whether the amplifier is enabled. If not, disable it before anything else.
    pub enable: bool,
    /// The amplifier's command.
    pub command: DacCode,
    /// The tick, for the host's log.
    pub sample: Sample,
}

/// A model, its actuator and their supervisor, ticked at a fixed rate.
///
/// A tick takes the same number of operations every time, and cannot fail.
#[derive(Clone, Debug)]
pub struct Controller {
    parameters: Parameters,
    supervisor: Supervisor,
    law: Law<f32>,
    drive: VoltageDrive<f32>,
    /// The film as the ticks know it.
    film: FilmState<f32, History>,
    /// Another one, which a loop test steps.
    test_film: FilmState<f32, History>,
    mode: Mode,
    voltage_v: f32,
    reference_m: f32,
}

impl Controller {
    /// The controller of `blob`, disarmed, its film at rest.
    #[must_use]
    pub fn new(blob: Blob) -> Self {
        let Blob { parameters, law, drive, supervisor } = blob;
        let (film, test_film) = (law.state(), law.state());
        Self {
            parameters,
            supervisor,
            law,
            drive,
            film,
            test_film,
            mode: Mode::Voltage,
            voltage_v: 0.0,
            reference_m: 0.0,
        }
    }

    /// The supervisor.
    #[must_use]
    pub fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    /// The supervisor, to trip it or to let it know that the host is alive.
    pub fn supervisor_mut(&mut self) -> &mut Supervisor {
        &mut self.supervisor
    }

    /// The parameters.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// One tick: sample, check, estimate, command, log.
    pub fn tick(&mut self, inputs: Inputs) -> Outputs {
        // Sample: codes become volts and metres. A converter that did not answer reads as no number.
        let answered = inputs.monitor.is_some() && inputs.displacement.is_some();
        let monitor_v = inputs.monitor.map_or(f32::NAN, |code| self.parameters.monitor.apply(code.volts()));
        let sensor_m = inputs.displacement.map_or(f32::NAN, |code| self.parameters.sensor.apply(code.volts()));
        let displacement_m = sensor_m - self.parameters.sensor_offset_m;

        // Check: sensors, limits, heartbeat.
        if !answered && self.supervisor.enables() {
            self.supervisor.trip(Cause::Bus);
        }
        self.supervisor.check(Readings { interlock_closed: inputs.interlock_closed, monitor_v, displacement_m });

        // Estimate: where the model is under the voltage that stood since the last tick.
        let load = self.drive.load(self.supervisor.command_v());
        let predicted_m = self.law.displacement_under(&mut self.film, load);
        if !predicted_m.is_finite() {
            self.supervisor.trip(Cause::Law);
        }

        // Command: what the mode asks for, within the limits.
        let wanted_v = match self.mode {
            Mode::Voltage => self.voltage_v,
            Mode::Feedforward => {
                let force = self.law.force_to(&self.film, self.reference_m);
                self.drive.voltage(force, self.reference_m)
            }
        };
        let command_v = self.supervisor.command(wanted_v);
        let range = self.parameters.command_range;
        let command = if self.supervisor.enables() {
            DacCode::from_volts(self.parameters.amplifier.invert(command_v), range)
        } else {
            DacCode::ZERO
        };

        // Log.
        let tick = self.supervisor.ticks();
        let sample = Sample { tick, dropped: 0, command_v, monitor_v, displacement_m, predicted_m };
        Outputs { enable: self.supervisor.enables(), command, sample }
    }

    /// Does as a host asks, and answers; nothing for what is not the controller's (identity, upload, stream).
    pub fn obey(&mut self, command: &Command) -> Option<Answer> {
        self.supervisor.heartbeat();
        let supervisor = &mut self.supervisor;
        let done = match command {
            Command::Heartbeat => Ok(()),
            Command::Arm => supervisor.arm(),
            Command::Start(mode) => supervisor.start().map(|()| self.mode = *mode),
            Command::Stop => supervisor.stop(),
            Command::Disarm => supervisor.disarm(),
            Command::Acknowledge => supervisor.acknowledge(),
            Command::SetVoltage(volts) => {
                if !(0.0..=self.parameters.limits.max_voltage_v).contains(volts) {
                    return Some(Answer::Rejected(Reject::Value));
                }
                self.voltage_v = *volts;
                Ok(())
            }
            Command::SetReference(metres) => {
                if metres.is_nan() || metres.abs() > self.parameters.limits.max_displacement_m {
                    return Some(Answer::Rejected(Reject::Value));
                }
                self.reference_m = *metres;
                Ok(())
            }
            Command::Rest => self.disarmed().map(|()| self.test_film = self.law.state()),
            Command::Step(voltages) => match self.disarmed() {
                Ok(()) => {
                    let steps = voltages.iter().map(|&volts| self.step(volts)).collect();
                    return Some(Answer::Steps { steps, cycles: 0 });
                }
                Err(refusal) => Err(refusal),
            },
            Command::Query => return Some(Answer::Name(self.parameters.name.clone())),
            _ => return None,
        };
        Some(match done {
            Ok(()) => Answer::Done,
            Err(refusal) => Answer::Refused(refusal),
        })
    }

    /// Whether the model may be stepped by hand: 0 V, amplifier disabled.
    fn disarmed(&self) -> Result<(), Refusal> {
        if self.supervisor.enables() { Err(Refusal::State(self.supervisor.state())) } else { Ok(()) }
    }

    /// A model of its own under `volts` for a step, and back: what a loop test compares bit by bit.
    pub fn step(&mut self, volts: f32) -> Step {
        let load = self.drive.load(volts);
        let displacement_m = self.law.displacement_under(&mut self.test_film, load);
        let force_n = load.force + load.slope * displacement_m;
        let voltage_v = self.drive.voltage(force_n, displacement_m);
        Step { displacement_m, force_n: self.test_film.base_force(), voltage_v }
    }
}
