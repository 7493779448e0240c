//! Requests between two ticks.

use springpot::{Adapted, Adapting, ControlError};

use crate::control::setpoint::{Ramp, SetpointError};
use crate::control::{AdaptationOrder, AdaptationStatus, Controller, LearningOrder, Mode};
use crate::parameters::ControllerMemory;
use crate::safety::{Cause, Refusal};

/// Longest time in which a new target is approached, s.
const RAMP_S: f32 = 0.05;

#[allow(clippy::missing_errors_doc)] // of requests: as the supervisor's
impl<M: ControllerMemory> Controller<M> {
    /// The host that armed is alive: its timeout starts again.
    pub fn heartbeat(&mut self) {
        self.supervisor.heartbeat();
    }

    /// Notes the mean current since the last tick by its monitor, V at the ADC, for the next tick; `None`, or no call, if the converter did
    /// not answer.
    #[cfg(feature = "self-sensing")]
    pub fn note_current(&mut self, adc_v: Option<f32>) {
        if let Some(sensor) = &self.parameters.self_sensing {
            self.film_sensor.read(sensor.current(), adc_v);
        }
    }

    /// Trips in every state: 0 V, amplifier disabled from the next tick on, targets cleared. The first cause stays.
    pub fn trip(&mut self, cause: Cause) {
        self.supervisor.trip(cause);
        self.clear_target();
    }

    /// Enables the amplifier at 0 V.
    pub fn arm(&mut self) -> Result<(), Refusal> {
        self.supervisor.arm()?;
        self.clear_target();
        Ok(())
    }

    /// Enables the amplifier at 0 V for a self-test, with a voltage of [`Supervisor::SELF_TEST_V`](crate::safety::Supervisor::SELF_TEST_V) at the most.
    pub fn arm_for_self_test(&mut self) -> Result<(), Refusal> {
        self.supervisor.arm_for_self_test()?;
        self.clear_target();
        Ok(())
    }

    /// Notes that a self-test of the bench has passed since the start.
    pub fn note_self_test(&mut self) {
        self.supervisor.note_self_test();
    }

    /// Begins a run in `mode` at 0 V, where it stays until a target is set. Feedforward uses the model as it was fitted, unless the law
    /// [adapts](Self::order_adaptation); learned cycles start again, unless they are [carried over](Self::order_learning).
    pub fn start(&mut self, mode: Mode) -> Result<(), Refusal> {
        self.supervisor.start()?;
        self.clear_target();
        self.mode = mode;
        self.motion.begin_run();
        self.presume_softer();
        if self.is_history_assumed && self.motion.is_shown() {
            (self.open_loop, self.is_history_assumed) = (self.watched.state(), false);
        }
        self.ran = true;
        self.course.set_feedback(mode != Mode::Feedforward);
        if mode == Mode::Feedforward && self.course.compensator().adapting() == Adapting::Off {
            self.course.forget_correction();
        }
        Ok(())
    }

    /// Ends the run: 0 V, amplifier enabled, targets cleared.
    pub fn stop(&mut self) -> Result<(), Refusal> {
        self.supervisor.stop()?;
        self.clear_target();
        Ok(())
    }

    /// 0 V, amplifier disabled, targets cleared.
    pub fn disarm(&mut self) -> Result<(), Refusal> {
        self.supervisor.disarm()?;
        self.clear_target();
        Ok(())
    }

    /// Acknowledges a trip: disarmed from now on. What was learned from the sensor is reset, since it may stem from the fault; a film whose
    /// state is not finite starts again at rest.
    pub fn acknowledge(&mut self) -> Result<(), Refusal> {
        self.supervisor.acknowledge()?;
        self.clear_target();
        self.motion.reset();
        self.course.forget_correction();
        self.course.forget_cycles();
        if !self.course.displacement().is_finite() {
            self.course = self.follower.state(M::at_rest(self.follower.compensator().observer().law()));
        }
        if !self.open_loop.position().is_finite() {
            self.open_loop = self.watched.state();
        }
        Ok(())
    }

    /// Sets the voltage of [`Mode::Voltage`] (V at the film): approached in a straight line in the time since the value
    /// before, 50 ms at most. One that is set while armed is only checked against the limits; [`start`](Self::start) clears it.
    ///
    /// # Errors
    ///
    /// [`SetpointError`] for NaN, beyond the largest voltage that the monitor may show, and unless the amplifier is enabled. Between the
    /// largest voltage and the largest reading, as in recordings with monitor noise, the largest voltage is commanded.
    pub fn set_voltage(&mut self, volts: f32) -> Result<(), SetpointError> {
        if !(0.0..=self.parameters.limits.monitored_v()).contains(&volts) {
            return Err(SetpointError::OutOfRange);
        }
        self.is_live()?;
        self.aim_at(volts, self.mode == Mode::Voltage);
        Ok(())
    }

    /// Sets the reference of [`Mode::Feedforward`] and [`Mode::Tracking`] (m), approached as a
    /// [voltage](Self::set_voltage) is.
    ///
    /// # Errors
    ///
    /// [`SetpointError`] for NaN and beyond the largest displacement, and unless the amplifier is enabled.
    pub fn set_reference(&mut self, metres: f32) -> Result<(), SetpointError> {
        if metres.is_nan() || metres.abs() > self.parameters.limits.max_displacement_m {
            return Err(SetpointError::OutOfRange);
        }
        self.is_live()?;
        self.aim_at(metres, self.mode != Mode::Voltage);
        Ok(())
    }

    /// A set-point that is taken while nothing can follow it would act in a later run.
    fn is_live(&self) -> Result<(), SetpointError> {
        match self.supervisor.state() {
            state if state.is_live() => Ok(()),
            state => Err(SetpointError::NotLive(state)),
        }
    }

    /// Takes a target over if a run follows it: any other would be forgotten before it could act.
    fn aim_at(&mut self, target: f32, is_followed: bool) {
        if is_followed && self.supervisor.runs() {
            self.target.set(target, self.ramp_ticks());
        }
    }

    pub(super) fn clear_target(&mut self) {
        self.target = Ramp::NONE;
        self.course.end_run();
        self.film_sensor.end_run();
    }

    /// Resets or carries over the learned correction of a periodic reference. In any state.
    pub fn order_learning(&mut self, order: LearningOrder) {
        match order {
            LearningOrder::Forget => self.course.forget_cycles(),
            LearningOrder::CarryOver => self.course.carry_over(),
        }
    }

    /// Orders how the law adapts to a film that changes. In any state; off in a new controller. The model that limits the stroke does not
    /// adapt.
    ///
    /// # Errors
    ///
    /// [`ControlError::OutOfRange`] for a [temperature](AdaptationOrder::Temperature) out of range.
    pub fn order_adaptation(&mut self, order: AdaptationOrder) -> Result<(), ControlError> {
        match order {
            AdaptationOrder::Learn { trip_at } => {
                self.max_ageing = trip_at;
                self.course.set_adapting(Adapting::Learn);
            }
            AdaptationOrder::Hold => self.course.set_adapting(Adapting::Hold),
            AdaptationOrder::Off => self.course.set_adapting(Adapting::Off),
            AdaptationOrder::Forget => self.course.forget_changes(),
            AdaptationOrder::Keep => self.parameters.adapted = self.learned(),
            AdaptationOrder::Temperature { stiffness, time } => {
                self.course.set_temperature_factors(stiffness, time)?;
                if self.supervisor.runs() {
                    self.presume_softer();
                }
            }
        }
        Ok(())
    }

    /// A film whose law is not the one that was fitted counts as softer, until its sensor has shown it in this run.
    fn presume_softer(&mut self) {
        if self.course.compensator().is_as_fitted() {
            return;
        }
        if self.mode == Mode::Tracking && self.film_sensor.replaces() {
            self.motion.presume_softer_now();
        } else {
            self.motion.presume_softer();
        }
    }

    /// The changes that are in use; none for the law as it was fitted.
    fn learned(&self) -> Option<Adapted<f32>> {
        let course = self.course.compensator();
        (course.adapting() != Adapting::Off && course.has_learned()).then(|| course.adapted())
    }

    /// The learned changes of the film.
    #[must_use]
    pub fn adaptation(&self) -> AdaptationStatus {
        let course = self.course.compensator();
        let [stiffness, time] = course.temperature_factors();
        AdaptationStatus {
            adapting: course.adapting(),
            adapted: course.adapted(),
            stiffness_change: course.stiffness_change(),
            trip_at: self.max_ageing,
            stiffness,
            time,
        }
    }

    /// Most ticks over which a new target is approached.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    fn ramp_ticks(&self) -> u16 {
        (RAMP_S * self.parameters.rate_hz) as u16
    }
}
