//! Controllers to compare: the laws of `springpot` as a controller runs them, and simpler ones beside them.

use std::collections::VecDeque;

use clap::ValueEnum;
use springpot::{
    Actuator, Applied, CommandLimits, Feedforward, FeedforwardState, Law, Limited, Memory, ObserverOptions, Real,
    Sample, Tracking, TrackingState, Window,
};

use crate::error::{Error, Result};
use crate::files::parameters::Parameters;
use crate::replay::simulate::compressed_law;

/// Which controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, ValueEnum)]
pub enum Kind {
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

impl Kind {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::None, Self::Static, Self::Window, Self::Pi, Self::Feedforward, Self::Tracking];

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

    /// Whether it uses a displacement sensor.
    pub fn uses_sensor(self) -> bool {
        matches!(self, Self::Pi | Self::Tracking)
    }
}

/// What a controller puts out in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    /// The voltage, V.
    pub voltage_v: f64,
    /// The shaped reference at the end of the tick, where the controller shapes it, m.
    pub reference_m: Option<f64>,
    /// Limits that were met.
    pub limited: Limited,
    /// Estimated displacement, m.
    pub estimate_m: Option<f64>,
    /// Estimated disturbance force, N, and force scale.
    pub disturbance_n: Option<f64>,
    /// Force scale.
    pub force_scale: Option<f64>,
}

/// A controller, ticked once a step.
pub trait Controller {
    /// From the voltage since the last tick, a sample of the sensor if one has arrived, and the
    /// reference for the end of this tick (m).
    fn tick(&mut self, applied: Applied<f64>, sample: Option<Sample<f64>>, reference_m: f64) -> Output;
}

/// How controllers are set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Steps per second.
    pub rate_hz: f64,
    /// Limits of the command.
    pub limits: CommandLimits,
    /// The observer of `Tracking`; its bandwidth is that of the feedback alone as well.
    pub observer: ObserverOptions,
    /// Highest reference to come, m: what `none` is scaled on.
    pub peak_m: f64,
}

/// Bandwidth of the feedback alone where none is given, Hz: the best on the twins' sines.
pub const PI_HZ: f64 = 0.8;

/// References that the feedback remembers.
const REMEMBERED: usize = 1024;
/// Length of the plain window, s.
const WINDOW_S: f64 = 10.0;
/// Where the one spring of the static inverse is as stiff as the model, Hz: within the band of usual fits.
const STATIC_HZ: f64 = 1.0 / 7.0;

/// The controller of `kind` for `parameters`, in the arithmetic of T.
///
/// # Errors
///
/// [`Error`] where a law is refused.
pub fn build<T: Real + Send + 'static>(
    kind: Kind,
    parameters: &Parameters,
    settings: &Settings,
) -> Result<Box<dyn Controller + Send>> {
    let law = compressed_law::<T>(&parameters.model, settings.rate_hz)?;
    let (actuator, limits) = (parameters.actuator, settings.limits);
    let spring = law.frequency_response(STATIC_HZ).inv().re;
    let one_spring = |coupling| Static { actuator, limits, spring, coupling };
    Ok(match kind {
        Kind::None => {
            let peak_v = one_spring(true).voltage(settings.peak_m).0;
            Box::new(Proportional { peak_v, peak_m: settings.peak_m })
        }
        Kind::Static => Box::new(one_spring(true)),
        Kind::Window => {
            let length = ((WINDOW_S * settings.rate_hz).round() as usize).max(1);
            let law = Law::<T, Window<T, Vec<T>>>::window(&parameters.model, law.step_s(), vec![T::ZERO; length])?;
            let rest = law.state(vec![T::ZERO; length])?;
            let feedforward = Feedforward::new(law, &actuator, limits)?;
            let state = feedforward.state(rest);
            Box::new(Inverse { feedforward, state })
        }
        Kind::Pi => {
            let gains = springpot::Observer::<T>::new(law, &actuator, limits.max_voltage_v, settings.observer)
                .map_err(bandwidth)?
                .gains();
            Box::new(Feedback {
                inverse: one_spring(true),
                gains,
                step_s: 1.0 / settings.rate_hz,
                ..Feedback::default()
            })
        }
        Kind::Feedforward => {
            let rest = law.state();
            let feedforward = Feedforward::new(law, &actuator, limits)?;
            let state = feedforward.state(rest);
            Box::new(Inverse { feedforward, state })
        }
        Kind::Tracking => {
            let rest = law.state();
            let tracking: Tracking<T> = Tracking::new(law, &actuator, limits, settings.observer).map_err(bandwidth)?;
            let state = tracking.state(rest);
            Box::new(Tracked { tracking, state })
        }
    })
}

fn bandwidth(error: springpot::ControlError) -> Error {
    match error {
        springpot::ControlError::Actuator(error) => error.into(),
        error => Error::option("--bandwidth", error.to_string()),
    }
}

struct Proportional {
    peak_v: f64,
    peak_m: f64,
}

impl Controller for Proportional {
    fn tick(&mut self, _: Applied<f64>, _: Option<Sample<f64>>, reference_m: f64) -> Output {
        let share = if self.peak_m > 0.0 { reference_m / self.peak_m } else { 0.0 };
        let limited = if share < 0.0 { Limited::BELOW_ZERO } else { Limited::NONE };
        Output { voltage_v: self.peak_v * share.clamp(0.0, 1.0).sqrt(), limited, ..Output::default() }
    }
}

#[derive(Clone, Copy)]
struct Static {
    actuator: Actuator,
    limits: CommandLimits,
    /// N/m.
    spring: f64,
    coupling: bool,
}

impl Static {
    fn of_force(&self, force: f64, at_m: f64) -> (f64, Limited) {
        let coupling = if self.coupling { 1.0 + self.actuator.stretch_coupling * at_m } else { 1.0 };
        let square = force / (self.actuator.force_per_square_volt() * coupling);
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

impl Controller for Static {
    fn tick(&mut self, _: Applied<f64>, _: Option<Sample<f64>>, reference_m: f64) -> Output {
        let (voltage_v, limited) = self.voltage(reference_m);
        Output { voltage_v, limited, ..Output::default() }
    }
}

/// Proportional–integral feedback to the force, which Eq. 1 turns into a voltage.
struct Feedback {
    inverse: Static,
    /// N/m and N/(m·s).
    gains: [f64; 2],
    step_s: f64,
    integral_n: f64,
    error_m: f64,
    since_s: f64,
    /// References of the last ticks, the newest last.
    references_m: VecDeque<f64>,
}

impl Default for Feedback {
    fn default() -> Self {
        Self {
            inverse: Static {
                actuator: Actuator::KARNER_2022,
                limits: CommandLimits::BENCH,
                spring: 1.0,
                coupling: true,
            },
            gains: [0.0; 2],
            step_s: 1e-3,
            integral_n: 0.0,
            error_m: 0.0,
            since_s: 0.0,
            references_m: VecDeque::new(),
        }
    }
}

impl Controller for Feedback {
    fn tick(&mut self, _: Applied<f64>, sample: Option<Sample<f64>>, reference_m: f64) -> Output {
        self.since_s += self.step_s;
        if let Some(sample) = sample {
            // A late sample is compared with the reference of its time.
            let then = self.references_m.iter().rev().nth(sample.age_ticks).copied().unwrap_or(0.0);
            self.error_m = then - sample.displacement;
            self.integral_n = (self.integral_n + self.gains[1] * self.since_s * self.error_m).max(0.0);
            self.since_s = 0.0;
        }
        self.references_m.push_back(reference_m);
        if self.references_m.len() > REMEMBERED {
            self.references_m.pop_front();
        }
        let (voltage_v, limited) =
            self.inverse.of_force(self.gains[0] * self.error_m + self.integral_n, reference_m.max(0.0));
        Output { voltage_v, limited, ..Output::default() }
    }
}

fn of_type<T: Real>(applied: Applied<f64>) -> Applied<T> {
    Applied { commanded: T::from_f64(applied.commanded), reading: applied.reading.map(T::from_f64) }
}

struct Inverse<T: Real, M: Memory<T>> {
    feedforward: Feedforward<T, M>,
    state: FeedforwardState<T, M>,
}

impl<T: Real, M: Memory<T>> Controller for Inverse<T, M> {
    fn tick(&mut self, applied: Applied<f64>, _: Option<Sample<f64>>, reference_m: f64) -> Output {
        let estimate = self.feedforward.apply(&mut self.state, of_type(applied));
        let command = self.feedforward.command(&mut self.state, T::from_f64(reference_m));
        Output {
            voltage_v: command.voltage.to_f64(),
            reference_m: Some(command.reference.to_f64()),
            limited: command.limited,
            estimate_m: Some(estimate.to_f64()),
            ..Output::default()
        }
    }
}

struct Tracked<T: Real> {
    tracking: Tracking<T>,
    state: TrackingState<T>,
}

impl<T: Real> Controller for Tracked<T> {
    fn tick(&mut self, applied: Applied<f64>, sample: Option<Sample<f64>>, reference_m: f64) -> Output {
        let sample = sample.map(|s| Sample { displacement: T::from_f64(s.displacement), age_ticks: s.age_ticks });
        let estimate = self.tracking.observe(&mut self.state, of_type(applied), sample);
        let command = self.tracking.command(&mut self.state, T::from_f64(reference_m));
        Output {
            voltage_v: command.voltage.to_f64(),
            reference_m: Some(command.reference.to_f64()),
            limited: command.limited,
            estimate_m: Some(estimate.to_f64()),
            disturbance_n: Some(self.state.observer().disturbance().to_f64()),
            force_scale: Some(self.state.observer().force_scale().to_f64()),
        }
    }
}
