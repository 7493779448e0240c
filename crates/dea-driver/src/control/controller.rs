//! The control tick.

#[cfg(feature = "link")]
mod intact;
mod orders;

use springpot::{AmplifierLag, Applied, Compressed, Follower, FollowerState, Law, LawState, Limited, Load, Tracking};

use crate::chips::Calibration;
use crate::control::film_sensor::FilmSensor;
#[cfg(feature = "loop-test")]
use crate::control::loop_test::{Followed, LoopTest, Step, Target};
use crate::control::sampler::Sampler;
use crate::control::setpoint::Ramp;
use crate::control::{Mode, Telemetry};
use crate::parameters::{Blob, ControllerMemory, Parameters, Watched};
use crate::safety::{Cause, Motion, Readings, Supervisor};

/// Largest correction that may be learned of a periodic reference, as a share of the largest displacement: more trips as a disturbance.
const MAX_LEARNED: f32 = 0.25;

/// Time for which a film has been held at the end of its stroke before a controller of which nothing else is known, s.
const ASSUMED_HELD_S: f64 = 3600.0;

/// Samples of the beginning of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Inputs {
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// Output of the voltage monitor at its ADC, V; `None` if the converter did not answer.
    pub monitor_adc_v: Option<f32>,
    /// Output of the displacement sensor at its ADC, V; `None` if the converter did not answer.
    pub sensor_adc_v: Option<f32>,
}

/// The result of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs {
    /// Whether the amplifier is enabled. If not, disable it before anything else.
    pub enable: bool,
    /// The amplifier's command, V at the DAC's output: 0 V to full scale.
    pub dac_v: f32,
    /// The record of the tick.
    pub telemetry: Telemetry,
}

/// A film's law, its control and its supervisor, ticked at a fixed rate.
///
/// `M` is the memory of its law, as of the [`Blob`].
///
/// A tick cannot fail, and takes a constant number of operations, apart from sensor samples, which may arrive more slowly, and from a law
/// that [adapts](Self::order_adaptation), which spreads its work over some thirty ticks. It converts between volts at the converters and
/// quantities; the caller converts codes.
///
/// Requests between two ticks go through the methods here, and are refused as by the [`Supervisor`], which can only be read:
/// [`start`](Self::start) takes a mode, every run begins at 0 V, and targets end with the state that they were set in.
///
/// ```
/// use dea_driver::{Blob, Controller, DriverState, Inputs, Mode, Parameters};
/// use springpot::{Actuator, Law, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let model = Preset::TABLE3_N2.model()?;
/// let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
/// let parameters = Parameters::bench(&law, Actuator::KARNER_2022);
/// let mut controller = Controller::new(Blob::new(parameters)?);
///
/// // In every tick: sample, tick, put out. Here a monitor that follows at once, and a sensor on a film at rest.
/// let mut dac_v = 0.0;
/// let mut tick = |controller: &mut Controller, k: u16| {
///     let noise_v = 1e-3 * f32::from(k % 3);
///     let inputs =
///         Inputs { interlock_closed: true, monitor_adc_v: Some(dac_v), sensor_adc_v: Some(1.0 + noise_v) };
///     dac_v = controller.tick(inputs).dac_v;
/// };
/// tick(&mut controller, 0);
/// controller.arm().expect("the readings are healthy");
/// controller.start(Mode::Voltage).expect("it is armed");
/// controller.set_voltage(2000.0)?;
/// (1..100).for_each(|k| tick(&mut controller, k));
/// assert_eq!(controller.supervisor().state(), DriverState::Running);
/// assert_eq!(dac_v, 2.0); // of 1000 V per volt
/// # Ok(())
/// # }
/// ```
///
/// The supervisor cannot be started past its controller:
///
/// ```compile_fail,E0596
/// # use dea_driver::Controller;
/// fn start_without_a_mode(controller: &mut Controller) {
///     let _ = controller.supervisor().start();
/// }
/// ```
#[derive(Clone, Debug)]
#[repr(C)] // what a tick needs first, within the reach of a load's offset
pub struct Controller<M: ControllerMemory = Compressed<f32>> {
    supervisor: Supervisor,
    /// How the film thins with the stroke, 1/m.
    thinning_per_m: f32,
    /// Shares of the force at the largest voltage per newton.
    shares_per_n: f32,
    /// The same per metre that is learned of cycles.
    shares_per_m: f32,
    /// Displacement per slow change of the load where the film is softest, m/N.
    compliance_m_per_n: f32,
    /// The displacement sensor, less its reading of a film at rest.
    sensor: Calibration,
    sampler: Sampler,
    motion: Motion,
    mode: Mode,
    /// Whether the law commanded the voltage in the last tick, or has been started since.
    ran: bool,
    /// Whether the amplifier lags: the estimate then uses its monitor.
    lags: bool,
    /// Whether the film's history is assumed: it was at the end of its stroke for an hour. No sensor has shown it at 0 V since the start.
    is_history_assumed: bool,
    /// The target of this run: a voltage (V) or a reference (m), depending on its mode; none until one is set.
    target: Ramp,
    open_loop: LawState<f32, Watched>,
    follower: Follower<f32, Tracking<f32, M>>,
    /// The film as the commanded voltage alone moves it, behind a lag the larger of that and the monitored one: no sensor corrects it. Its law
    /// has fewer modes.
    watched: Law<f32, Watched>,
    parameters: Parameters<M>,
    checksum: Option<u32>,
    /// [Ageing](springpot::Adapted::ageing) from which a run trips.
    max_ageing: f32,
    /// Digests of all that does not change, once it is sealed.
    #[cfg(feature = "link")]
    digests: Option<intact::Digests>,
    /// The estimated film, its reference, and its learned cycles.
    course: FollowerState<f32, Tracking<f32, M>>,
    /// The film as a sensor.
    film_sensor: FilmSensor,
    #[cfg(feature = "loop-test")]
    test: LoopTest<M>,
}

/// A copy that is written where it stays, without one on the stack of the caller.
#[inline(never)]
fn copied<M: ControllerMemory>(parameters: &Parameters<M>) -> Parameters<M> {
    parameters.clone()
}

/// Displacement per change of the load at `frequency_hz`, where the film of `law` is softest: at rest, or at its `stroke_m` (m).
#[inline(never)] // without the frame of its caller
#[allow(clippy::cast_possible_truncation)] // as the laws have it
fn slow_compliance<M: ControllerMemory>(law: &Law<f32, M>, frequency_hz: f32, stroke_m: f32) -> f32 {
    let at = |displacement_m: f32| law.frequency_response_about(frequency_hz.into(), displacement_m.into()).l1_norm();
    at(0.0).max(at(stroke_m)) as f32
}

/// As [`Controller::new`], of a blob that stays: a small chip has no room to move it.
impl<M: ControllerMemory> From<&Blob<M>> for Controller<M> {
    fn from(blob: &Blob<M>) -> Self {
        // Before the controller is on the stack.
        let law = blob.follower().compensator().observer().law();
        let watched = M::watched(law);
        let Parameters { control, limits, .. } = blob.parameters();
        let compliance_m_per_n = slow_compliance(law, control.bandwidth_hz, limits.max_displacement_m);
        Self::from_parts(
            blob.parameters(),
            blob.checksum(),
            blob.follower(),
            watched,
            (blob.supervisor(), blob.margin(), compliance_m_per_n),
        )
    }
}

impl<M: ControllerMemory> Controller<M> {
    /// The controller of `blob`, disarmed. For the limit of the stroke its film has been at the end of the stroke for an hour and relaxes
    /// by its law, until a plausible sensor shows the film when a run begins.
    #[must_use]
    #[allow(clippy::needless_pass_by_value)] // a blob is for one controller
    pub fn new(blob: Blob<M>) -> Self {
        Self::from(&blob)
    }

    // Of references, so that nothing large is moved on the stack of a small chip.
    #[allow(clippy::cast_possible_truncation)] // as the laws have it
    #[inline(never)]
    fn from_parts(
        parameters: &Parameters<M>,
        checksum: Option<u32>,
        follower: &Follower<f32, Tracking<f32, M>>,
        watched: Law<f32, Watched>,
        (supervisor, margin, compliance_m_per_n): (&Supervisor, f32, f32),
    ) -> Self {
        let law = follower.compensator().observer().law();
        let (actuator, limits) = (&parameters.actuator, &parameters.limits);
        let largest_n = actuator.electrostatic_force(f64::from(limits.max_voltage_v));
        let shares_per_m = limits.max_disturbance_share / (MAX_LEARNED * limits.max_displacement_m);
        // A film of constant volume is thinner by as much as it is longer, whether or not the model's force knows it; a coupling that was
        // fitted may be larger, since the film gets wider as well.
        let thinning_per_m = actuator.thinning_per_m().max(1.0 / actuator.length_m);
        let sampler =
            Sampler::new(parameters.rate_hz, parameters.control.sample_interval_s, parameters.control.delay_s);
        let motion = Motion::new(limits.sensor).beyond_by(margin);
        let lags = parameters.amplifier_lag != AmplifierLag::NONE;
        let (thinning_per_m, shares_per_n) = (thinning_per_m as f32, (1.0 / largest_n) as f32);
        let mut course = follower.state(M::at_rest(law));
        // A blob's have been checked.
        let _ = parameters.adapted.map(|adapted| course.restore(&adapted));
        Self {
            #[cfg(feature = "link")]
            digests: None,
            motion,
            #[cfg(feature = "loop-test")]
            test: LoopTest::at_rest(follower.compensator()),
            film_sensor: FilmSensor::new(parameters),
            parameters: copied(parameters),
            checksum,
            supervisor: *supervisor,
            follower: follower.clone(),
            course,
            open_loop: watched.held(limits.max_displacement_m, ASSUMED_HELD_S),
            is_history_assumed: true,
            watched,
            thinning_per_m,
            shares_per_n,
            shares_per_m,
            compliance_m_per_n,
            sensor: parameters.sensor.less(parameters.sensor_offset_m),
            max_ageing: f32::INFINITY,
            sampler,
            mode: Mode::Voltage,
            ran: false,
            lags,
            target: Ramp::NONE,
        }
    }

    /// Takes over film and amplifier of `before`: remaining creep counts for the stroke until a plausible sensor shows it at 0 V, and
    /// voltage while disabled counts as before.
    #[cfg(feature = "link")]
    pub(crate) fn take_film_of(&mut self, before: &Self) {
        self.supervisor.take_discharge_of(&before.supervisor);
        let left_m = before.motion.furthest(before.open_loop.position());
        let is_same_law =
            (&self.parameters.law, self.parameters.rate_hz) == (&before.parameters.law, before.parameters.rate_hz);
        if is_same_law && left_m.is_finite() {
            // Nothing that a faulty sensor shows at 0 V can replace it.
            self.motion = self.motion.with_film_of(&before.motion);
            (self.open_loop, self.is_history_assumed) = (before.open_loop.clone(), before.is_history_assumed);
        } else {
            self.motion = self.motion.offset_by(left_m);
            (self.open_loop, self.is_history_assumed) = (self.watched.state(), false);
        }
    }

    /// The supervisor, to read its state.
    #[must_use]
    pub fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    /// The parameters.
    #[must_use]
    pub fn parameters(&self) -> &Parameters<M> {
        &self.parameters
    }

    /// [`Blob::checksum`].
    #[must_use]
    pub fn checksum(&self) -> Option<u32> {
        self.checksum
    }

    /// One tick: sample, check, estimate, command, log.
    pub fn tick(&mut self, inputs: Inputs) -> Outputs {
        // Sample: volts at the converters become quantities. A converter that did not answer reads as NaN.
        let monitor_v = inputs.monitor_adc_v.map_or(f32::NAN, |volts| self.parameters.monitor.apply(volts));
        let sensor_m = inputs.sensor_adc_v.map_or(f32::NAN, |volts| self.sensor.apply(volts));
        let shown = self.film_sensor.sense(sensor_m, monitor_v, self.supervisor.falls());
        let displacement_m = shown.displacement_m;

        // Check: sensors, limits, heartbeat. Without the monitor the voltage at the film is unknown: trip at once. Without
        // the displacement sensor the parameters decide.
        let applied_v = self.supervisor.command_v();
        if inputs.monitor_adc_v.is_none() && self.supervisor.enables() {
            self.supervisor.trip(Cause::Bus);
        }
        let corrects = self.supervisor.runs() && self.mode == Mode::Tracking;
        let observer = self.course.observer();
        let must_move = self.mode != Mode::Voltage && self.target.is_set();
        let model_m = self.open_loop.position();
        let disturbance_share = if corrects { observer.disturbance() * self.shares_per_n } else { 0.0 };
        let checked = self.supervisor.check(Readings {
            interlock_closed: inputs.interlock_closed,
            monitor_v,
            displacement_m,
            predicted_m: observer.displacement(),
            open_loop_m: self.motion.furthest(model_m),
            is_frozen: self.motion.is_frozen(must_move),
            // Either may hide the other.
            disturbance_share: disturbance_share.abs() + (self.course.added() * self.shares_per_m).abs(),
        });

        if let Some(cause) = shown.fault
            && self.supervisor.enables()
        {
            self.supervisor.trip(cause);
        }
        let runs = self.supervisor.runs();
        // Beside a film at rest, as which it begins its first run if the sensor shows it.
        let beside_m = if self.is_history_assumed && !runs { 0.0 } else { model_m };
        let drive_m = || self.course.observer().load().force_n * self.compliance_m_per_n;
        self.motion.record(displacement_m, beside_m, drive_m, checked.displacement_m.is_some(), runs);

        // Estimate: step the film under the voltage applied since the last tick, and correct it with a sample if one is
        // due. Nothing is learned from a film that is not driven.
        let sample = self.sampler.next(checked.displacement_m.filter(|_| runs));
        let sample = self.film_sensor.choose(shown, sample, runs && checked.displacement_m.is_some());
        // The tone does not move the film.
        let commanded_v = applied_v - self.film_sensor.tone_v();
        let applied = Applied { commanded_v, reading_v: self.lags.then_some(monitor_v) };
        let predicted_m = self.follower.observe(&mut self.course, applied, sample);
        let mut load = self.course.observer().load();
        if self.lags {
            load = self.at_least_commanded(load);
        }
        let open_loop_m = self.watched.displacement_under(&mut self.open_loop, load);
        // Finite as long as both are.
        if !(predicted_m + open_loop_m).is_finite() {
            self.supervisor.trip(Cause::Law);
        }
        if self.course.compensator().is_adapted() {
            self.check_ageing();
        }

        // Command: what the mode asks for, within the limits. Until there is a reference it is 0 V, and the reference stays with
        // the film, so that following begins without a jump. Targets end with the run, which may have been tripped since the
        // last tick.
        let runs = self.supervisor.runs();
        if self.ran && !runs {
            self.clear_target();
        }
        self.ran = runs;
        let follows = runs && self.mode != Mode::Voltage;
        // NaN until one is set, which is 0 V.
        let target = self.target.next();
        let leads = follows && !target.is_nan();
        let wanted = if leads {
            self.follower.command(&mut self.course, target)
        } else {
            self.follower.standby(&mut self.course)
        };
        let wanted_v = if leads { wanted.voltage_v } else { target };
        let learned_m = self.course.added();
        let estimated_m = if open_loop_m > predicted_m { open_loop_m } else { predicted_m };
        let furthest_m = checked.displacement_m.filter(|&measured_m| measured_m > estimated_m).unwrap_or(estimated_m);
        let thinning = 1.0 + self.thinning_per_m * furthest_m;
        let senses = leads && self.mode == Mode::Tracking;
        let wanted_v = self.film_sensor.drive(senses, wanted_v, self.supervisor.most_v(thinning));
        let command_v = self.supervisor.command(wanted_v, thinning);
        let enable = self.supervisor.enables();
        // An amplifier that is above 0 V at a command of 0 V would need less than that, which a DAC of both signs would give.
        let inverse_v = self.parameters.amplifier.invert(command_v);
        let dac_v = if enable && inverse_v > 0.0 { inverse_v } else { 0.0 };

        // Log.
        let observer = self.course.observer();
        let telemetry = Telemetry {
            tick: self.supervisor.ticks(),
            dropped: 0,
            command_v,
            monitor_v,
            displacement_m,
            predicted_m,
            reference_m: wanted.reference_m - learned_m,
            learned_m,
            disturbance_n: observer.disturbance(),
            force_scale: observer.force_scale(),
            innovation_m: observer.innovation(),
            // Without a reference no limit is met, but the film may be beyond its curve.
            limited: wanted.limited.bits() & if follows { u8::MAX } else { Limited::BEYOND_CURVE.bits() },
        };
        Outputs { enable, dac_v, telemetry }
    }

    /// Trips where the film has moved too far from its law.
    #[inline(never)] // for laws that adapt
    fn check_ageing(&mut self) {
        // NaN is too far.
        let is_within = self.course.compensator().ageing() <= self.max_ageing;
        if !is_within && self.supervisor.runs() {
            self.supervisor.trip(Cause::Ageing);
        }
    }

    /// The larger of `load` and the commanded voltage's behind the stated lag: a monitor that reads too little must not hide the film's stroke.
    #[inline(never)] // for amplifiers that lag
    fn at_least_commanded(&self, load: Load<f32>) -> Load<f32> {
        let drive = self.follower.compensator().observer().drive();
        let commanded = drive.load(self.course.compensator().followed_voltage());
        if commanded.force_n > load.force_n { commanded } else { load }
    }
}

/// The loop test: a film apart from the one of the ticks, which a host steps and compares bit by bit.
#[cfg(feature = "loop-test")]
impl<M: ControllerMemory> Controller<M> {
    /// Resets the loop test to rest at x = 0.
    pub fn rest(&mut self) {
        self.test = LoopTest::at_rest(self.follower.compensator());
    }

    /// Another controller of the same parameters, disarmed, its film at rest.
    #[must_use]
    pub fn at_rest(&self) -> Self {
        // The limits were accepted when this controller was made.
        let Parameters { limits, rate_hz, amplifier_lag, .. } = &self.parameters;
        let supervisor = Supervisor::new(limits, *rate_hz).and_then(|made| made.behind(*amplifier_lag, *rate_hz));
        let supervisor = supervisor.unwrap_or(self.supervisor);
        let mut made = Self::from_parts(
            &self.parameters,
            self.checksum,
            &self.follower,
            self.watched.clone(),
            (&supervisor, self.motion.min_margin(), self.compliance_m_per_n),
        );
        (made.open_loop, made.is_history_assumed) = (made.watched.state(), false);
        made
    }

    /// Steps the model under `volts` (V), and Eq. 1 back from its force to the voltage.
    pub fn step(&mut self, volts: f32) -> Step {
        self.test.step(self.follower.compensator(), volts)
    }

    /// Ticks the control of `mode`.
    pub fn follow(&mut self, mode: Mode, target: Target) -> Followed {
        self.test.follow(self.follower.compensator(), mode, target, self.sampler.age_ticks)
    }
}
