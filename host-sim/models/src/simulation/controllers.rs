//! Controllers to compare: those of `springpot` as a board runs them, and simpler ones.

use std::collections::VecDeque;

use host_io::choice;
use springpot::{
    Actuator, Adapting, Applied, CommandLimits, Compensator, Feedforward, Follower, FollowerState, Learning,
    LearningOptions, Limited, ObserverOptions, Preload, Real, SensorSample, Tracking,
};

use crate::error::Result;
use crate::files::parameters::Parameters;
use crate::replay::memory::{Precision, window_law, window_length};
use crate::replay::observer::refused;

choice! {
    /// Which controller.
    pub enum ControllerKind {
        /// No compensation: V² in proportion to the reference, scaled on its peak.
        None = "none",
        /// Static inverse: Eq. 1 with one spring.
        Static = "static",
        /// The inverse of the law with a plain window of 10 s.
        Window = "window",
        /// Proportional–integral feedback alone.
        Pi = "pi",
        /// The inverse of the law.
        Feedforward = "feedforward",
        /// Feedforward and observer.
        Tracking = "tracking",
        /// Tracking whose law follows the film: without a sensor it goes on with what the film has shown.
        Adaptive = "adaptive",
    }
}

impl ControllerKind {
    /// Whether an observer gives it its gains.
    pub fn has_observer(self) -> bool {
        matches!(self, Self::Pi | Self::Tracking | Self::Adaptive)
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
    /// How far the film has moved from its law, where that follows it ([`springpot::Adapted::ageing`]).
    pub ageing: Option<f64>,
    /// Change of its stiffness that was shown ([`springpot::TrackingState::stiffness_change`]), as the ageing.
    pub stiffness_change: Option<f64>,
}

/// A controller, ticked once a step.
pub trait Controller {
    /// From the voltage since the last tick, a sample of the sensor if one has arrived, and the
    /// reference for the end of this tick (m).
    fn tick(&mut self, applied: Applied<f64>, sample: Option<SensorSample<f64>>, reference_m: f64) -> ControllerOutput;

    /// States the factors of the film's stiffness and times at its temperature, within what a law follows
    /// ([`set_temperature_factors`](springpot::TrackingState::set_temperature_factors)); of controllers without a law to warm, nothing.
    fn set_temperature_factors(&mut self, _factors: [f64; 2]) {}
}

/// Settings of every controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerSettings {
    /// Steps per second.
    pub rate_hz: f64,
    /// Limits of the command.
    pub limits: CommandLimits,
    /// The observer of `Tracking` and `Adaptive`; `Pi` takes its bandwidth as well.
    pub observer: ObserverOptions,
    /// Learning of periodic references, of `Feedforward`, `Tracking` and `Adaptive`.
    pub learning: Option<LearningOptions>,
    /// Highest displacement of the reference, m: `None` is scaled on it.
    pub peak_m: f64,
}

/// Default bandwidth of `Pi`, Hz: the best on the simulated films' sines.
pub const PI_HZ: f64 = 0.8;

/// References that `Pi` keeps, to compare a late sample with the reference of its time.
const KEPT_REFERENCES: usize = 1024;
const WINDOW_S: f64 = 10.0;
/// Where the one spring of the static inverse is as stiff as the model, Hz: within the band of usual fits.
const STATIC_HZ: f64 = 1.0 / 7.0;

/// The controller of `kind` for `parameters`, in the arithmetic of `precision`.
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
    let learning = settings.learning.map(|options| Learning::new(&law, &actuator, limits.max_voltage_v, options));
    Ok(match kind {
        ControllerKind::None => {
            let peak_v = one_spring.voltage(settings.peak_m).0;
            Box::new(Proportional { peak_v, peak_m: settings.peak_m })
        }
        ControllerKind::Static => Box::new(one_spring),
        ControllerKind::Window => {
            let length = window_length(WINDOW_S, settings.rate_hz);
            let (law, rest) = window_law::<T>(parameters.film(), law.step_s(), length)?;
            let follower = Follower::new(Feedforward::new(law, &actuator, limits)?);
            Box::new(Following { state: follower.state(rest), follower, correction: |_| None, warm: |_, _| () })
        }
        ControllerKind::Pi => {
            let tracking = Tracking::new(law, &actuator, limits, settings.observer).map_err(refused)?;
            Box::new(ProportionalIntegral::new(one_spring, tracking.observer().gains(), settings.rate_hz))
        }
        ControllerKind::Feedforward => {
            let (rest, learning) = (law.state(), learning.transpose()?);
            let follower = learning_too(Feedforward::new(law, &actuator, limits)?, learning);
            Box::new(Following { state: follower.state(rest), follower, correction: |_| None, warm: |_, _| () })
        }
        ControllerKind::Tracking | ControllerKind::Adaptive => {
            let (rest, learning) = (law.state(), learning.transpose()?);
            let tracking = Tracking::new(law, &actuator, limits, settings.observer).map_err(refused)?;
            let follower = learning_too(tracking, learning);
            let correction = |state: &FollowerState<T>| {
                let (observer, tracking) = (state.observer(), state.compensator());
                let changes =
                    (tracking.adapting() == Adapting::Learn).then(|| [tracking.ageing(), tracking.stiffness_change()]);
                Some((observer.disturbance(), observer.force_scale(), changes))
            };
            let mut state = follower.state(rest);
            if kind == ControllerKind::Adaptive {
                state.set_adapting(Adapting::Learn);
            }
            let warm = |state: &mut FollowerState<T>, [stiffness, time]: [T; 2]| {
                // The bounds are checked before, in twice as many digits.
                let _ = state.set_temperature_factors(stiffness, time);
            };
            Box::new(Following { state, follower, correction, warm })
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

/// A follower along `compensator`, with `learning` where there is any.
fn learning_too<T: Real, C: Compensator<T>>(compensator: C, learning: Option<Learning<T>>) -> Follower<T, C> {
    let follower = Follower::new(compensator);
    match learning {
        Some(learning) => follower.with_learning(learning),
        None => follower,
    }
}

/// Disturbance (N), force scale and, where the law follows the film, ageing and change of the stiffness that the sensor has shown, if there is one.
type Correction<T> = Option<(T, T, Option<[T; 2]>)>;

/// `Feedforward`, `Window` with another memory, `Tracking` and `Adaptive`.
struct Following<T: Real, C: Compensator<T>> {
    follower: Follower<T, C>,
    state: FollowerState<T, C>,
    correction: fn(&FollowerState<T, C>) -> Correction<T>,
    warm: fn(&mut FollowerState<T, C>, [T; 2]),
}

impl<T: Real, C: Compensator<T>> Controller for Following<T, C> {
    fn tick(&mut self, applied: Applied<f64>, sample: Option<SensorSample<f64>>, reference_m: f64) -> ControllerOutput {
        let Self { follower, state, correction, .. } = self;
        let command = follower.step(state, of_type(applied), sample.map(in_type), T::from_f64(reference_m));
        let correction = correction(state);
        let changes = correction.and_then(|(.., changes)| changes);
        ControllerOutput {
            voltage_v: command.voltage_v.to_f64(),
            reference_m: follower.learning().is_none().then(|| command.reference_m.to_f64()),
            limited: command.limited,
            estimate_m: Some(state.displacement().to_f64()),
            disturbance_n: correction.map(|(disturbance, ..)| disturbance.to_f64()),
            force_scale: correction.map(|(_, scale, _)| scale.to_f64()),
            ageing: changes.map(|[ageing, _]| ageing.to_f64()),
            stiffness_change: changes.map(|[_, change]| change.to_f64()),
        }
    }

    fn set_temperature_factors(&mut self, factors: [f64; 2]) {
        (self.warm)(&mut self.state, factors.map(T::from_f64));
    }
}
