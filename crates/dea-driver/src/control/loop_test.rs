//! The loop test: a film and a course of its own that a host steps, without hardware.

use serde::{Deserialize, Serialize};
#[cfg(feature = "loop-test")]
use springpot::{Applied, LawState, SensorSample, Tracking, TrackingState};

#[cfg(feature = "loop-test")]
use crate::control::Mode;
#[cfg(feature = "loop-test")]
use crate::parameters::ControllerMemory;
use crate::safety::DriverState;

/// The input of a tick of a loop test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// The voltage (V) of `Mode::Voltage`, the reference (m) of the others.
    pub value: f32,
    /// A sample of the displacement sensor, m, if one has arrived.
    pub sample_m: Option<f32>,
}

/// A step of the model in a loop test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Step {
    /// Displacement under the voltage, m.
    pub displacement_m: f32,
    /// The force that holds the film there at the next step, N: it sums up the model's whole state.
    pub force_n: f32,
    /// The voltage that the inverse of Eq. 1 finds for the force of this step, V.
    pub voltage_v: f32,
}

/// A tick of the control in a loop test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Followed {
    /// The voltage that is commanded, V.
    pub voltage_v: f32,
    /// The estimated displacement, m.
    pub displacement_m: f32,
    /// The estimated disturbance, N.
    pub disturbance_n: f32,
}

/// The input of a whole tick of a loop test: codes of a board's converters on their full scales of 10.24 V.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TickCodes {
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// The voltage monitor.
    pub monitor: u16,
    /// The displacement sensor.
    pub sensor: u16,
    /// The voltage (V) of `Mode::Voltage`, the reference (m) of the others.
    pub target: f32,
}

/// A whole tick of a loop test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Ticked {
    /// Whether the amplifier would be enabled.
    pub enable: bool,
    /// The code of its command.
    pub command: u16,
    /// The state.
    pub state: DriverState,
    /// The estimated displacement, m.
    pub predicted_m: f32,
}

/// A film and a course apart from those of the tick.
#[cfg(feature = "loop-test")]
#[derive(Clone, Debug)]
pub(crate) struct LoopTest<M: ControllerMemory> {
    film: LawState<f32, M>,
    course: TrackingState<f32, M>,
    /// The voltage that was commanded last, V.
    voltage_v: f32,
}

#[cfg(feature = "loop-test")]
impl<M: ControllerMemory> LoopTest<M> {
    /// At rest at x = 0.
    pub(crate) fn at_rest(tracking: &Tracking<f32, M>) -> Self {
        let film = M::at_rest(tracking.observer().law());
        Self { course: tracking.state(film.clone()), film, voltage_v: 0.0 }
    }

    /// Steps the film under `volts`, and Eq. 1 back from its force to the voltage.
    pub(crate) fn step(&mut self, tracking: &Tracking<f32, M>, volts: f32) -> Step {
        let (law, drive) = (tracking.observer().law(), tracking.observer().drive());
        let load = drive.load(volts);
        let displacement_m = law.displacement_under(&mut self.film, load);
        let force_n = load.force_n + load.slope_n_per_m * displacement_m;
        let voltage_v = drive.voltage(force_n, displacement_m);
        Step { displacement_m, force_n: self.film.base_force(), voltage_v }
    }

    /// Ticks the control, with a sample that is `age_ticks` old.
    pub(crate) fn follow(
        &mut self,
        tracking: &Tracking<f32, M>,
        mode: Mode,
        target: Target,
        age_ticks: usize,
    ) -> Followed {
        let Self { course, voltage_v, .. } = self;
        if mode == Mode::Voltage {
            *voltage_v = target.value;
        }
        let displacement = target.sample_m.filter(|_| mode != Mode::Feedforward);
        let sample = displacement.map(|displacement| SensorSample { displacement_m: displacement, age_ticks });
        let displacement_m = tracking.observe(course, Applied::as_commanded(*voltage_v), sample);
        let command = tracking.command(course, if mode == Mode::Voltage { displacement_m } else { target.value });
        if mode != Mode::Voltage {
            *voltage_v = command.voltage_v;
        }
        Followed { voltage_v: *voltage_v, displacement_m, disturbance_n: course.observer().disturbance() }
    }
}
