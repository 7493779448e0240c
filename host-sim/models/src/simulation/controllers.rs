//! Controllers to compare: those of `springpot` as a board runs them, and simpler ones.

use std::collections::VecDeque;

use clap::ValueEnum;
use springpot::{
    Actuator, Applied, CommandLimits, Compressed, Feedforward, FeedforwardState, Learning, LearningOptions,
    LearningState, Limited, Memory, Observer, ObserverOptions, Preload, Real, SensorSample, Tracking, TrackingState,
};

use crate::error::Result;
use crate::files::parameters::Parameters;
use crate::replay::memory::{Precision, VecWindow, window_law, window_length};
use crate::replay::observer::refused;

/// Which controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, ValueEnum)]
pub enum ControllerKind {
    /// No compensation: V² in proportion to the reference, scaled on its peak.
    None,
    /// Static inverse: Eq. 1 with one spring.
    Static,
    /// The inverse of the law with a plain window of 10 s.
    Window,
    /// Proportional–integral feedback alone.
    Pi,
    /// The inverse of the law.
    Feedforward,
    /// Feedforward and observer.
    Tracking,
}

impl ControllerKind {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Static => "static",
            Self::Window => "window",
            Self::Pi => "pi",
            Self::Feedforward => "feedforward",
            Self::Tracking => "tracking",
        }
    }
}

/// The output of a controller in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControllerOutput {
    /// The voltage, V.
    pub voltage_v: f64,
    /// The shaped reference at the end of the tick, where the controller shapes it, m.
    pub reference_m: Option<f64>,
    /// Limits that were met.
    pub limited: Limited,
    /// Estimated displacement, m.
    pub estimate_m: Option<f64>,
    /// Estimated disturbance force, N.
    pub disturbance_n: Option<f64>,
    /// Estimated force scale.
    pub force_scale: Option<f64>,
}

/// A controller, ticked once a step.
pub trait Controller {
    /// From the voltage since the last tick, a sample of the sensor if one has arrived, and the
    /// reference for the end of this tick (m).
    fn tick(&mut self, applied: Applied<f64>, sample: Option<SensorSample<f64>>, reference_m: f64) -> ControllerOutput;
}

/// Settings of every controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerSettings {
    /// Steps per second.
    pub rate_hz: f64,
    /// Limits of the command.
    pub limits: CommandLimits,
    /// The observer of `Tracking`; `Pi` takes its bandwidth as well.
    pub observer: ObserverOptions,
    /// Learning of periodic references, of `Feedforward` and `Tracking`.
    pub learning: Option<LearningOptions>,
    /// Highest displacement of the reference, m: `None` is scaled on it.
    pub peak_m: f64,
}

/// Default bandwidth of `Pi`, Hz: the best on the simulated films' sines.
pub const PI_HZ: f64 = 0.8;

/// References that `Pi` keeps, to compare a late sample with the reference of its time.
const KEPT_REFERENCES: usize = 1024;
/// Length of the plain window, s.
const WINDOW_S: f64 = 10.0;
/// Where the one spring of the static inverse is as stiff as the model, Hz: within the band of usual fits.
const STATIC_HZ: f64 = 1.0 / 7.0;

/// The controller of `kind` for `parameters`, in the arithmetic of `precision`.
///
/// # Errors
///
/// [`Error`](crate::error::Error) where a law is refused.
pub fn build(
    kind: ControllerKind,
    parameters: &Parameters,
    settings: &ControllerSettings,
    precision: Precision,
) -> Result<Box<dyn Controller + Send>> {
    match precision {
        Precision::F32 => build_in::<f32>(kind, parameters, settings),
        Precision::F64 => build_in::<f64>(kind, parameters, settings),
    }
}

fn build_in<T: Real + Send + 'static>(
    kind: ControllerKind,
    parameters: &Parameters,
    settings: &ControllerSettings,
) -> Result<Box<dyn Controller + Send>> {
    let law = parameters.film().compressed_law::<T>(settings.rate_hz)?;
    let (actuator, limits) = (parameters.actuator, settings.limits);
    let spring = law.frequency_response(STATIC_HZ).inv().re;
    let one_spring = StaticInverse::new(&actuator, limits, spring);
    let learner = |law: &springpot::Law<T>| -> Result<Option<Learner<T>>> {
        let learning = settings.learning.map(|options| Learning::new(law, &actuator, limits.max_voltage_v, options));
        Ok(learning.transpose()?.map(|learning| Learner { state: learning.state(T::ZERO), learning, is_free: true }))
    };
    Ok(match kind {
        ControllerKind::None => {
            let peak_v = one_spring.voltage(settings.peak_m).0;
            Box::new(Proportional { peak_v, peak_m: settings.peak_m })
        }
        ControllerKind::Static => Box::new(one_spring),
        ControllerKind::Window => {
            let length = window_length(WINDOW_S, settings.rate_hz);
            let (law, rest) = window_law::<T>(parameters.film(), law.step_s(), length)?;
            let feedforward = Feedforward::new(law, &actuator, limits)?;
            let state = feedforward.state(rest);
            Box::new(FeedforwardController::<T, VecWindow<T>> { feedforward, state, learner: None })
        }
        ControllerKind::Pi => {
            let gains =
                Observer::<T>::new(law, &actuator, limits.max_voltage_v, settings.observer).map_err(refused)?.gains();
            Box::new(ProportionalIntegral::new(one_spring, gains, settings.rate_hz))
        }
        ControllerKind::Feedforward => {
            let (rest, learner) = (law.state(), learner(&law)?);
            let feedforward = Feedforward::new(law, &actuator, limits)?;
            let state = feedforward.state(rest);
            Box::new(FeedforwardController::<T, Compressed<T>> { feedforward, state, learner })
        }
        ControllerKind::Tracking => {
            let (rest, learner) = (law.state(), learner(&law)?);
            let tracking: Tracking<T> = Tracking::new(law, &actuator, limits, settings.observer).map_err(refused)?;
            let state = tracking.state(rest);
            Box::new(TrackingController { tracking, state, learner })
        }
    })
}

/// `None`: V² in proportion to the reference.
struct Proportional {
    peak_v: f64,
    peak_m: f64,
}

impl Controller for Proportional {
    fn tick(&mut self, _: Applied<f64>, _: Option<SensorSample<f64>>, reference_m: f64) -> ControllerOutput {
        let share = if self.peak_m > 0.0 { reference_m / self.peak_m } else { 0.0 };
        let limited = if share < 0.0 { Limited::BELOW_ZERO } else { Limited::NONE };
        ControllerOutput {
            voltage_v: self.peak_v * share.clamp(0.0, 1.0).sqrt(),
            limited,
            ..ControllerOutput::default()
        }
    }
}

/// `Static`: Eq. 1 with one spring.
#[derive(Clone, Copy)]
struct StaticInverse {
    /// Without the weight: the spring gives the electrostatic force.
    actuator: Actuator,
    limits: CommandLimits,
    /// N/m.
    spring: f64,
}

impl StaticInverse {
    fn new(actuator: &Actuator, limits: CommandLimits, spring: f64) -> Self {
        Self { actuator: Actuator { preload: Preload::Settled, ..*actuator }, limits, spring }
    }

    /// The voltage (V) that exerts the electrostatic force `force_n` (N) at `displacement_m` (m), within the largest voltage.
    fn of_force(&self, force_n: f64, displacement_m: f64) -> (f64, Limited) {
        let square = self.actuator.squared_voltage(force_n, displacement_m);
        let largest = self.limits.max_voltage_v;
        let limited = match square {
            _ if square < 0.0 => Limited::BELOW_ZERO,
            _ if square > largest * largest => Limited::MAX_VOLTAGE,
            _ => Limited::NONE,
        };
        (square.max(0.0).sqrt().min(largest), limited)
    }

    fn voltage(&self, reference_m: f64) -> (f64, Limited) {
        self.of_force(self.spring * reference_m, reference_m)
    }
}

impl Controller for StaticInverse {
    fn tick(&mut self, _: Applied<f64>, _: Option<SensorSample<f64>>, reference_m: f64) -> ControllerOutput {
        let (voltage_v, limited) = self.voltage(reference_m);
        ControllerOutput { voltage_v, limited, ..ControllerOutput::default() }
    }
}

/// `Pi`: proportional–integral feedback to the force, which Eq. 1 turns into a voltage.
struct ProportionalIntegral {
    inverse: StaticInverse,
    /// N/m and N/(m·s).
    gains: [f64; 2],
    step_s: f64,
    integral_n: f64,
    error_m: f64,
    /// Time since the last sample, s.
    since_s: f64,
    /// References of the last ticks, the newest last.
    references_m: VecDeque<f64>,
}

impl ProportionalIntegral {
    fn new(inverse: StaticInverse, gains: [f64; 2], rate_hz: f64) -> Self {
        Self {
            inverse,
            gains,
            step_s: 1.0 / rate_hz,
            integral_n: 0.0,
            error_m: 0.0,
            since_s: 0.0,
            references_m: VecDeque::new(),
        }
    }
}

impl Controller for ProportionalIntegral {
    fn tick(&mut self, _: Applied<f64>, sample: Option<SensorSample<f64>>, reference_m: f64) -> ControllerOutput {
        self.since_s += self.step_s;
        if let Some(sample) = sample {
            // A late sample is compared with the reference of its time.
            let then = self.references_m.iter().rev().nth(sample.age_ticks).copied().unwrap_or(0.0);
            self.error_m = then - sample.displacement_m;
            self.integral_n = (self.integral_n + self.gains[1] * self.since_s * self.error_m).max(0.0);
            self.since_s = 0.0;
        }
        self.references_m.push_back(reference_m);
        if self.references_m.len() > KEPT_REFERENCES {
            self.references_m.pop_front();
        }
        let (voltage_v, limited) =
            self.inverse.of_force(self.gains[0] * self.error_m + self.integral_n, reference_m.max(0.0));
        ControllerOutput { voltage_v, limited, ..ControllerOutput::default() }
    }
}

fn of_type<T: Real>(applied: Applied<f64>) -> Applied<T> {
    Applied { commanded_v: T::from_f64(applied.commanded_v), reading_v: applied.reading_v.map(T::from_f64) }
}

fn in_type<T: Real>(sample: SensorSample<f64>) -> SensorSample<T> {
    SensorSample { displacement_m: T::from_f64(sample.displacement_m), age_ticks: sample.age_ticks }
}

/// Learning in front of a law of control.
struct Learner<T: Real> {
    learning: Learning<T>,
    state: LearningState<T>,
    /// Whether the last command met no limit.
    is_free: bool,
}

impl<T: Real> Learner<T> {
    fn advance(&mut self, reference: T, sample: Option<SensorSample<T>>) -> T {
        self.learning.advance(&mut self.state, reference, sample, self.is_free)
    }
}

/// `Feedforward`, and `Window` with another memory.
struct FeedforwardController<T: Real, M: Memory<T>> {
    feedforward: Feedforward<T, M>,
    state: FeedforwardState<T, M>,
    learner: Option<Learner<T>>,
}

impl<T: Real, M: Memory<T>> Controller for FeedforwardController<T, M> {
    fn tick(&mut self, applied: Applied<f64>, sample: Option<SensorSample<f64>>, reference_m: f64) -> ControllerOutput {
        let estimate = self.feedforward.apply(&mut self.state, of_type(applied));
        let target = T::from_f64(reference_m);
        let target = self.learner.as_mut().map_or(target, |learner| learner.advance(target, sample.map(in_type)));
        let command = self.feedforward.command(&mut self.state, target);
        let shaped = if let Some(learner) = &mut self.learner {
            learner.is_free = command.limited.is_none();
            None
        } else {
            Some(command.reference_m.to_f64())
        };
        ControllerOutput {
            voltage_v: command.voltage_v.to_f64(),
            reference_m: shaped,
            limited: command.limited,
            estimate_m: Some(estimate.to_f64()),
            ..ControllerOutput::default()
        }
    }
}

/// `Tracking`.
struct TrackingController<T: Real> {
    tracking: Tracking<T>,
    state: TrackingState<T>,
    learner: Option<Learner<T>>,
}

impl<T: Real> Controller for TrackingController<T> {
    fn tick(&mut self, applied: Applied<f64>, sample: Option<SensorSample<f64>>, reference_m: f64) -> ControllerOutput {
        let sample = sample.map(in_type);
        let estimate = self.tracking.observe(&mut self.state, of_type(applied), sample);
        let target = T::from_f64(reference_m);
        let target = self.learner.as_mut().map_or(target, |learner| learner.advance(target, sample));
        let command = self.tracking.command(&mut self.state, target);
        let shaped = if let Some(learner) = &mut self.learner {
            learner.is_free = command.limited.is_none();
            self.state.leave_cycles(learner.state.has_learned());
            None
        } else {
            Some(command.reference_m.to_f64())
        };
        ControllerOutput {
            voltage_v: command.voltage_v.to_f64(),
            reference_m: shaped,
            limited: command.limited,
            estimate_m: Some(estimate.to_f64()),
            disturbance_n: Some(self.state.observer().disturbance().to_f64()),
            force_scale: Some(self.state.observer().force_scale().to_f64()),
        }
    }
}
