//! Errors of models, laws, actuators and controls, which are checked when they are built. A step has no errors.

use core::fmt;

/// Largest number of branches of a model. Defined here so that the errors import nothing.
pub const MAX_BRANCHES: usize = 5;

/// The element of a model that an error is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ModelElement {
    /// The springpot beside the branches.
    Main,
    /// Element `element` (0 or 1) of branch `branch`, both counted from 0.
    Branch {
        /// Which branch.
        branch: usize,
        /// Which of its two springpots.
        element: usize,
    },
}

impl fmt::Display for ModelElement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Main => f.write_str("main springpot"),
            Self::Branch { branch, element } => {
                write!(f, "branch {}, springpot {}", branch + 1, element + 1)
            }
        }
    }
}

/// Why a [`Maxwell`](crate::Maxwell) model was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ModelError {
    /// A coefficient c that is not finite or not greater than 0 (N·s^α/m).
    Coefficient {
        /// The springpot.
        element: ModelElement,
        /// The value.
        c: f64,
    },
    /// An order α that is not within 0…1.
    Order {
        /// The springpot.
        element: ModelElement,
        /// The value.
        alpha: f64,
    },
    /// A mass that is not finite or is negative (kg).
    Mass(f64),
    /// More branches than [`MAX_BRANCHES`].
    Branches(usize),
}

impl fmt::Display for ModelError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Coefficient { element, c } => {
                write!(f, "{element}: c = {c} must be finite and greater than 0 (N·s^alpha/m)")
            }
            Self::Order { element, alpha } => {
                write!(f, "{element}: alpha = {alpha} must be within 0 and 1")
            }
            Self::Mass(mass) => write!(f, "mass {mass} kg must be finite and not negative"),
            Self::Branches(n) => {
                write!(f, "{n} branches, at most {MAX_BRANCHES} are possible")
            }
        }
    }
}

impl core::error::Error for ModelError {}

/// Why a [`Law`](crate::Law) was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LawError {
    /// A step that is not finite or not greater than 0 (s).
    Step(f64),
    /// A memory horizon that is not finite or not longer than twice the head.
    Horizon {
        /// The horizon, s.
        horizon_s: f64,
        /// Length of the head, s.
        head_s: f64,
    },
    /// A tolerance that is not greater than 0.
    Tolerance(f64),
    /// The tail misses the tolerance: use more modes, a shorter horizon or a larger tolerance.
    ToleranceMissed {
        /// Largest error of the relaxation modulus that was reached, relative to the modulus at that time scale.
        reached: f64,
        /// The tolerance of the options.
        asked: f64,
    },
    /// Fewer modes than the model has springs and discrete relaxation times, which must be exact.
    TooFewModes {
        /// Modes of the law.
        modes: usize,
        /// Modes needed at the least.
        needed: usize,
    },
    /// A head that is shorter than the inertia of the method reaches back.
    HeadTooShort {
        /// Increments of the head.
        head: usize,
        /// Increments needed.
        needed: usize,
    },
    /// A stiffness of one step that is 0 or infinite in the number type.
    NothingToSolve,
    /// A coefficient that no film has: non-finite, negative, or of a mode that grows.
    Coefficient(&'static str),
    /// An elastic curve that was refused.
    Curve(CurveError),
    /// No samples were given for a window.
    EmptyWindow,
    /// Storage for a window's state of another length than its weights.
    Storage {
        /// Length of the storage.
        given: usize,
        /// Length of the weights.
        needed: usize,
    },
}

impl fmt::Display for LawError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Step(step) => write!(f, "step {step} s must be finite and greater than 0"),
            Self::Horizon { horizon_s, head_s } => {
                write!(f, "memory horizon {horizon_s} s must be finite and longer than twice the head of {head_s} s")
            }
            Self::Tolerance(tolerance) => write!(f, "tolerance {tolerance} must be greater than 0"),
            Self::ToleranceMissed { reached, asked } => write!(
                f,
                "the tail misses the tolerance: {reached:.1e} instead of {asked:.1e}; \
                 use more modes, a shorter horizon or a larger tolerance"
            ),
            Self::TooFewModes { modes, needed } => {
                write!(f, "{modes} modes are too few for this model: use a memory with at least {needed}")
            }
            Self::HeadTooShort { head, needed } => {
                write!(f, "a head of {head} increments is too short for the inertia of this method: use at least {needed}")
            }
            Self::NothingToSolve => f.write_str(
                "nothing to solve: the stiffness of one step is 0, infinite or beyond the number type; check the units of the coefficients",
            ),
            Self::Coefficient(which) => write!(f, "{which} of the law must be finite, and what relaxes must decay"),
            Self::Curve(error) => write!(f, "{error}"),
            Self::EmptyWindow => f.write_str("a window of 0 samples: use storage for at least one"),
            Self::Storage { given, needed } => {
                write!(f, "storage of {given} samples for a window of {needed}: use storage of the same length")
            }
        }
    }
}

impl core::error::Error for LawError {}

impl From<CurveError> for LawError {
    fn from(error: CurveError) -> Self {
        Self::Curve(error)
    }
}

/// Why an elastic [`Curve`](crate::Curve) was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CurveError {
    /// A number of knots that is not 2 to 17.
    Knots(usize),
    /// A knot that is not finite, or not to the right of the one before it.
    Knot {
        /// Its index, from 0.
        index: usize,
    },
    /// A range that does not hold the displacement 0.
    Range {
        /// Its lower end, m.
        low_m: f64,
        /// Its upper end, m.
        high_m: f64,
    },
    /// The value at 0 is not 0, or the slope there not 1.
    AtRest {
        /// The value at 0, m.
        value_m: f64,
        /// The slope at 0.
        slope: f64,
    },
    /// A curve that does not rise.
    NotMonotone {
        /// Where it rises least, m.
        displacement_m: f64,
        /// Its slope there; that at rest is 1.
        slope: f64,
    },
    /// Constants of [`Rubber`](crate::Rubber) that are not finite and positive.
    Rubber,
    /// A stretch at which Gent's chains are taut, or the film has no length.
    Taut {
        /// Where, m.
        displacement_m: f64,
        /// The stretch there.
        stretch: f64,
    },
}

impl fmt::Display for CurveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Knots(knots) => write!(f, "{knots} knots; an elastic curve has 2 to 17"),
            Self::Knot { index } => {
                write!(f, "knot {} must be finite, and its displacement larger than that of the one before", index + 1)
            }
            Self::Range { low_m, high_m } => {
                write!(
                    f,
                    "the elastic curve reaches from {low_m} m to {high_m} m; it must hold 0, where the film rests"
                )
            }
            Self::AtRest { value_m, slope } => {
                write!(
                    f,
                    "the elastic curve has the value {value_m} m and the slope {slope} at 0; they must be 0 and 1"
                )
            }
            Self::NotMonotone { displacement_m, slope } => {
                write!(f, "the elastic curve must rise: its slope is {slope:.4} at {displacement_m:.6} m, at rest 1")
            }
            Self::Rubber => {
                f.write_str("share, limit, rest_stretch and free_length_m must be finite and greater than 0")
            }
            Self::Taut { displacement_m, stretch } => write!(
                f,
                "at {displacement_m:.6} m the film has the stretch {stretch:.4}, where its chains are taut or it has no length"
            ),
        }
    }
}

impl core::error::Error for CurveError {}

/// Why an [`Actuator`](crate::Actuator) or a [`VoltageDrive`](crate::VoltageDrive) was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ActuatorError {
    /// A quantity that is not finite or not greater than 0; the name carries its unit.
    NotPositive {
        /// Name of the quantity.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
    /// A mass that is not finite or is negative (kg).
    Mass(f64),
    /// A stretch coupling that is not finite (1/m).
    Coupling(f64),
    /// A saturation voltage that is not finite and greater than 0 (V).
    Saturation(f64),
    /// Pull-in within one step: the electrostatic pull exceeds the film's stiffness of one step.
    PullIn {
        /// Stiffness of the electrostatic pull at the largest voltage, N/m.
        pull: f64,
        /// Stiffness of one step of the law, N/m.
        stiffness: f64,
    },
}

impl fmt::Display for ActuatorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotPositive { quantity, value } => {
                write!(f, "{quantity} = {value} must be finite and greater than 0")
            }
            Self::Mass(mass) => write!(f, "mass_kg = {mass} must be finite and not negative"),
            Self::Coupling(coupling) => {
                write!(f, "stretch_coupling = {coupling} must be finite (1/m)")
            }
            Self::Saturation(volts) => write!(f, "saturation_v = {volts} must be finite and greater than 0 (V)"),
            Self::PullIn { pull, stiffness } => write!(
                f,
                "pull-in: the electrostatic pull of {pull:.3e} N/m at the largest voltage overcomes the film's \
                 {stiffness:.3e} N/m; lower the voltage or the coupling"
            ),
        }
    }
}

impl core::error::Error for ActuatorError {}

/// Why a [`Feedforward`](crate::Feedforward), [`Observer`](crate::Observer) or [`Tracking`](crate::Tracking) was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ControlError {
    /// The actuator was refused at the largest voltage.
    Actuator(ActuatorError),
    /// A quantity that is not finite or not greater than 0; the name carries its unit.
    NotPositive {
        /// Name of the quantity.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
    /// A quantity that is negative, not finite or too large; the name carries its unit.
    OutOfRange {
        /// Name of the quantity.
        quantity: &'static str,
        /// The value.
        value: f64,
        /// The largest one.
        most: f64,
    },
    /// A bandwidth that is too high for the sensor: interval and delay of its samples would cost too much phase margin.
    SensorTooSlow {
        /// The bandwidth, Hz.
        bandwidth_hz: f64,
        /// The largest one for this sensor, Hz.
        largest_hz: f64,
    },
    /// A delay of the sensor that is longer than the observer's memory of predictions.
    SensorTooLate {
        /// Delay in ticks.
        ticks: usize,
        /// Largest delay that is remembered, ticks.
        most: usize,
    },
    /// A number of harmonics that cannot be learned.
    Harmonics {
        /// The number asked for.
        harmonics: usize,
    },
    /// A sensor that would count as lost between two samples.
    LostBetweenSamples {
        /// Time without a sample after which it counts as lost, s.
        lost_after_s: f64,
        /// Time between samples, s.
        sample_interval_s: f64,
    },
    /// A bandwidth above a third of the model's resonance, the frequency from which inertia outweighs its stiffness.
    NearResonance {
        /// The bandwidth, Hz.
        bandwidth_hz: f64,
    },
}

/// The first of `values` that is not finite and greater than 0. Not inlined: unrolled, the checks of a table take twice its space in
/// flash.
#[inline(never)]
pub(crate) fn first_not_positive(values: &[(&'static str, f64)]) -> Option<(&'static str, f64)> {
    values.iter().copied().find(|&(_, value)| !(value.is_finite() && value > 0.0))
}

impl From<ActuatorError> for ControlError {
    fn from(error: ActuatorError) -> Self {
        Self::Actuator(error)
    }
}

impl fmt::Display for ControlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Actuator(error) => write!(f, "{error}"),
            Self::NotPositive { quantity, value } => {
                write!(f, "{quantity} = {value} must be finite and greater than 0")
            }
            Self::OutOfRange { quantity, value, most } => write!(f, "{quantity} = {value} must be from 0 to {most}"),
            Self::SensorTooSlow { bandwidth_hz, largest_hz } => write!(
                f,
                "bandwidth {bandwidth_hz} Hz is too much for a sensor this slow; {largest_hz:.3} Hz at the most"
            ),
            Self::SensorTooLate { ticks, most } => {
                write!(f, "sensor samples {ticks} ticks late; {most} at the most")
            }
            Self::Harmonics { harmonics } => {
                write!(f, "{harmonics} harmonics to learn; from 1 to {} are possible", crate::HARMONICS)
            }
            Self::LostBetweenSamples { lost_after_s, sample_interval_s } => write!(
                f,
                "lost_after_s = {lost_after_s} is less than the {sample_interval_s} s from one sample to the next"
            ),
            Self::NearResonance { bandwidth_hz } => {
                write!(f, "bandwidth {bandwidth_hz} Hz lies above a third of the model's resonance; lower it")
            }
        }
    }
}

impl core::error::Error for ControlError {}
