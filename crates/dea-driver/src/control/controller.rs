//! The control tick, and what a host can ask of it.

use springpot::{Applied, Limited, Sample as SensorSample, State, Tracking, TrackingState};

use crate::chips::{AdcCode, DacCode};
use crate::parameters::{Blob, Parameters};
use crate::safety::{Cause, Readings, Refusal, Supervisor};
use crate::wire::{Answer, Command, Followed, Mode, Reject, Sample, Step, Target};

/// Time in which a new target is reached at the most, s.
const RAMP_S: f32 = 0.05;

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

/// A film's law, its control and its supervisor, ticked at a fixed rate.
///
/// A tick cannot fail, and takes the same number of operations every time but for the sensor's samples, which may come more
/// slowly.
#[derive(Clone, Debug)]
pub struct Controller {
    parameters: Parameters,
    supervisor: Supervisor,
    tracking: Tracking<f32>,
    /// The film as the ticks know it, and where it is led.
    course: TrackingState<f32>,
    sampler: Sampler,
    mode: Mode,
    /// Whether the law commanded the voltage in the last tick, or has been started since.
    ran: bool,
    /// What was set, V; nothing until it is set again after a run.
    voltage: Ramp,
    /// The same for the reference, m.
    reference: Ramp,
    test: LoopTest,
}

/// Films of their own that a host steps, without hardware.
#[derive(Clone, Debug)]
struct LoopTest {
    film: State<f32>,
    course: TrackingState<f32>,
    /// The voltage that was commanded last, V.
    voltage_v: f32,
}

/// Takes a sample of the sensor from time to time.
#[derive(Clone, Copy, Debug)]
struct Sampler {
    every: u32,
    since: u32,
    age_ticks: usize,
}

impl Controller {
    /// The controller of `blob`, disarmed, its film at rest.
    #[must_use]
    pub fn new(blob: Blob) -> Self {
        let Blob { parameters, tracking, supervisor } = blob;
        let rest = tracking.observer().law().state();
        let course = tracking.state(rest.clone());
        let test = LoopTest { film: rest, course: course.clone(), voltage_v: 0.0 };
        let sampler = Sampler::new(&parameters);
        Self {
            parameters,
            supervisor,
            tracking,
            course,
            sampler,
            mode: Mode::Voltage,
            ran: false,
            voltage: Ramp::NONE,
            reference: Ramp::NONE,
            test,
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
        let monitor_v = inputs.monitor.map_or(f32::NAN, |code| self.parameters.monitor.apply(code.volts()));
        let sensor_m = inputs.displacement.map_or(f32::NAN, |code| self.parameters.sensor.apply(code.volts()));
        let displacement_m = sensor_m - self.parameters.sensor_offset_m;

        // Check: sensors, limits, heartbeat. Without the monitor nobody knows what is on the film; without the displacement
        // sensor the parameters say what to do.
        let stood_v = self.supervisor.command_v();
        if inputs.monitor.is_none() && self.supervisor.enables() {
            self.supervisor.trip(Cause::Bus);
        }
        let predicted_m = self.course.observer().displacement();
        let interlock_closed = inputs.interlock_closed;
        let checked = self.supervisor.check(Readings { interlock_closed, monitor_v, displacement_m, predicted_m });

        // Estimate: where the film is under the voltage that stood since the last tick, and what a sample says to that.
        // Nothing is learned from a film that is not driven.
        let listens = self.supervisor.runs() && self.mode != Mode::Feedforward;
        let sample = self.sampler.take(checked.displacement_m.filter(|_| listens));
        let applied = Applied::as_commanded(stood_v);
        let predicted_m = self.tracking.observe(&mut self.course, applied, sample);
        if !predicted_m.is_finite() {
            self.supervisor.trip(Cause::Law);
        }

        // Command: what the mode asks for, within the limits. A reference that is not followed yet stays with the film, so
        // that following begins without a jump. What was set does not outlive the run.
        // It may have been tripped since the last tick as well.
        let runs = self.supervisor.runs();
        if self.ran && !runs {
            self.forget_targets();
        }
        self.ran = runs;
        let follows = self.supervisor.runs() && self.mode != Mode::Voltage;
        let reference_m = self.reference.next().filter(|_| follows).unwrap_or(predicted_m);
        let wanted = self.tracking.command(&mut self.course, reference_m);
        let set_v = self.voltage.next().unwrap_or(0.0);
        let wanted_v = if self.mode == Mode::Voltage { set_v } else { wanted.voltage };
        let furthest_m = checked.displacement_m.filter(|&measured_m| measured_m > predicted_m).unwrap_or(predicted_m);
        let command_v = self.supervisor.command(wanted_v, 1.0 + self.coupling() * furthest_m);
        let range = self.parameters.command_range;
        let command = if self.supervisor.enables() {
            DacCode::from_volts(self.parameters.amplifier.invert(command_v), range)
        } else {
            DacCode::ZERO
        };

        // Log.
        let observer = self.course.observer();
        let sample = Sample {
            tick: self.supervisor.ticks(),
            dropped: 0,
            command_v,
            monitor_v,
            displacement_m,
            predicted_m,
            reference_m: wanted.reference,
            disturbance_n: observer.disturbance(),
            force_scale: observer.force_scale(),
            innovation_m: observer.innovation(),
            limited: if follows { wanted.limited.bits() } else { Limited::NONE.bits() },
        };
        Outputs { enable: self.supervisor.enables(), command, sample }
    }

    /// Does as a host asks, and answers; nothing for what is not the controller's (identity, upload, stream).
    pub fn obey(&mut self, command: &Command) -> Option<Answer> {
        self.supervisor.heartbeat();
        let supervisor = &mut self.supervisor;
        let done = match command {
            Command::Heartbeat => Ok(()),
            Command::Arm => supervisor.arm(),
            Command::Start(mode) => supervisor.start().map(|()| self.begin(*mode)),
            Command::Stop => supervisor.stop().map(|()| self.forget_targets()),
            Command::Disarm => supervisor.disarm().map(|()| self.forget_targets()),
            Command::Acknowledge => self.acknowledge(),
            Command::SetVoltage(volts) => {
                // A recording shows the limit with its monitor's noise. What is beyond the limit is not commanded.
                if !(0.0..=self.parameters.limits.monitored_v()).contains(volts) {
                    return Some(Answer::Rejected(Reject::Value));
                }
                self.voltage.set(*volts, self.ramp_ticks());
                Ok(())
            }
            Command::SetReference(metres) => {
                if metres.is_nan() || metres.abs() > self.parameters.limits.max_displacement_m {
                    return Some(Answer::Rejected(Reject::Value));
                }
                self.reference.set(*metres, self.ramp_ticks());
                Ok(())
            }
            Command::Rest => self.disarmed().map(|()| self.rest()),
            Command::Step(voltages) => match self.disarmed() {
                Ok(()) => {
                    let steps = voltages.iter().map(|&volts| self.step(volts)).collect();
                    return Some(Answer::Steps { steps, cycles: 0 });
                }
                Err(refusal) => Err(refusal),
            },
            Command::Follow { mode, targets } => match self.disarmed() {
                Ok(()) => {
                    let ticks = targets.iter().map(|&target| self.follow(*mode, target)).collect();
                    return Some(Answer::Followed { ticks, cycles: 0 });
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

    /// A run begins. Feedforward goes by the model as it was fitted, not by what was learned in other runs.
    fn begin(&mut self, mode: Mode) {
        self.mode = mode;
        self.ran = true;
        if mode == Mode::Feedforward {
            self.course.forget();
        }
    }

    /// A trip is taken note of. A film that has become no number begins anew.
    fn acknowledge(&mut self) -> Result<(), Refusal> {
        self.supervisor.acknowledge()?;
        if !self.course.observer().displacement().is_finite() {
            self.course = self.tracking.state(self.tracking.observer().law().state());
        }
        Ok(())
    }

    fn forget_targets(&mut self) {
        self.voltage = Ramp::NONE;
        self.reference = Ramp::NONE;
    }

    /// Ticks over which a new target is approached at the most.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    fn ramp_ticks(&self) -> u16 {
        (RAMP_S * self.parameters.rate_hz) as u16
    }

    /// How the force grows with the stroke, 1/m.
    #[allow(clippy::cast_possible_truncation)] // as the laws have it
    fn coupling(&self) -> f32 {
        self.parameters.actuator.stretch_coupling as f32
    }

    /// Whether the model may be stepped by hand: 0 V, amplifier disabled.
    fn disarmed(&self) -> Result<(), Refusal> {
        if self.supervisor.enables() { Err(Refusal::State(self.supervisor.state())) } else { Ok(()) }
    }

    /// Brings the loop tests to rest at x = 0.
    pub fn rest(&mut self) {
        let rest = self.tracking.observer().law().state();
        self.test = LoopTest { film: rest.clone(), course: self.tracking.state(rest), voltage_v: 0.0 };
    }

    /// A model of its own under `volts` for a step, and back: what a loop test compares bit by bit.
    pub fn step(&mut self, volts: f32) -> Step {
        let (law, drive) = (self.tracking.observer().law(), self.tracking.observer().drive());
        let load = drive.load(volts);
        let displacement_m = law.displacement_under(&mut self.test.film, load);
        let force_n = load.force + load.slope * displacement_m;
        let voltage_v = drive.voltage(force_n, displacement_m);
        Step { displacement_m, force_n: self.test.film.base_force(), voltage_v }
    }

    /// A tick of the control on a film of its own: what a loop test compares bit by bit.
    pub fn follow(&mut self, mode: Mode, target: Target) -> Followed {
        let LoopTest { course, voltage_v, .. } = &mut self.test;
        if mode == Mode::Voltage {
            *voltage_v = target.value;
        }
        let age_ticks = self.sampler.age_ticks;
        let displacement = target.sample_m.filter(|_| mode != Mode::Feedforward);
        let sample = displacement.map(|displacement| SensorSample { displacement, age_ticks });
        let displacement_m = self.tracking.observe(course, Applied::as_commanded(*voltage_v), sample);
        let command = self.tracking.command(course, if mode == Mode::Voltage { displacement_m } else { target.value });
        if mode != Mode::Voltage {
            *voltage_v = command.voltage;
        }
        Followed { voltage_v: *voltage_v, displacement_m, disturbance_n: course.observer().disturbance() }
    }
}

/// A value that a host sets from time to time: reached in a straight line, in the time that has passed since the one before.
#[derive(Clone, Copy, Debug)]
struct Ramp {
    value: Option<f32>,
    increment: f32,
    target: f32,
    ticks: u16,
    since_set: u16,
}

impl Ramp {
    /// Nothing was set.
    const NONE: Self = Self { value: None, increment: 0.0, target: 0.0, ticks: 0, since_set: u16::MAX };

    /// Sets a new target, to be reached within `most` ticks.
    fn set(&mut self, target: f32, most: u16) {
        let ticks = self.since_set.clamp(1, most.max(1));
        self.since_set = 0;
        self.target = target;
        let from = self.value.unwrap_or(target);
        self.value = Some(from);
        self.ticks = ticks;
        self.increment = (target - from) / f32::from(ticks);
    }

    /// The value of this tick.
    fn next(&mut self) -> Option<f32> {
        self.since_set = self.since_set.saturating_add(1);
        if self.ticks > 1 {
            self.ticks -= 1;
            self.value = self.value.map(|value| value + self.increment);
        } else {
            // The last step ends exactly there.
            self.value = self.value.map(|_| self.target);
        }
        self.value
    }
}

impl Sampler {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    fn new(parameters: &Parameters) -> Self {
        let ticks = |seconds: f32| (seconds * parameters.rate_hz + 0.5) as u32;
        let every = ticks(parameters.control.sample_interval_s).max(1);
        Self { every, since: every, age_ticks: ticks(parameters.control.delay_s) as usize }
    }

    /// The sample of this tick, if one is due and the sensor can be believed.
    fn take(&mut self, displacement_m: Option<f32>) -> Option<SensorSample<f32>> {
        self.since = self.since.saturating_add(1);
        if self.since < self.every {
            return None;
        }
        self.since = 0;
        displacement_m.map(|displacement| SensorSample { displacement, age_ticks: self.age_ticks })
    }
}
