//! Errors of models, laws, actuators and controls, which are checked when they are built. A step has no errors.

use thiserror::Error;

/// Largest number of branches of a model. Defined here so that the errors import nothing.
pub const MAX_BRANCHES: usize = 5;

/// The element of a model that an error is about.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ModelElement {
    /// The springpot beside the branches.
    #[error("main springpot")]
    Main,
    /// Element `element` (0 or 1) of branch `branch`, both counted from 0.
    #[error("branch {}, springpot {}", .branch + 1, .element + 1)]
    Branch {
        /// Index of the branch.
        branch: usize,
        /// Index of its springpot.
        element: usize,
    },
}

/// Reasons to refuse a [`Maxwell`](crate::Maxwell) model.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ModelError {
    /// A coefficient c that is not finite or not greater than 0 (N·s^α/m).
    #[error("{element}: c = {c} must be finite and greater than 0 (N·s^alpha/m)")]
    Coefficient {
        /// The springpot.
        element: ModelElement,
        /// The value.
        c: f64,
    },
    /// An order α that is not within 0…1.
    #[error("{element}: alpha = {alpha} must be within 0 and 1")]
    Order {
        /// The springpot.
        element: ModelElement,
        /// The value.
        alpha: f64,
    },
    /// A mass that is not finite or is negative (kg).
    #[error("mass {0} kg must be finite and not negative")]
    Mass(f64),
    /// More branches than [`MAX_BRANCHES`].
    #[error("{0} branches, at most {MAX_BRANCHES} are possible")]
    Branches(usize),
    /// A temperature out of range (°C).
    #[error("a temperature of {0} °C must be from -100 to 250: K or °F?")]
    Temperature(f64),
    /// A slope or an activation energy out of range.
    #[error("{quantity} = {value} must be from -{most} to {most}")]
    TemperatureDependence {
        /// Name of the field.
        quantity: &'static str,
        /// The value.
        value: f64,
        /// The largest.
        most: f64,
    },
    /// A temperature at which a dependence is not valid.
    #[error(
        "at {temperature_c} °C the film would have {stiffness:.3} times its stiffness and {time:.3e} times its times, beyond what its dependence on the temperature describes"
    )]
    BeyondTemperature {
        /// The temperature, °C.
        temperature_c: f64,
        /// Factor of the stiffness.
        stiffness: f64,
        /// Factor of the times.
        time: f64,
    },
}

/// Reasons to refuse a [`Law`](crate::Law).
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LawError {
    /// A step that is not finite or not greater than 0 (s).
    #[error("step {0} s must be finite and greater than 0")]
    Step(f64),
    /// A memory horizon that is not finite or not longer than twice the head.
    #[error("memory horizon {horizon_s} s must be finite and longer than twice the head of {head_s} s")]
    Horizon {
        /// The horizon, s.
        horizon_s: f64,
        /// Length of the head, s.
        head_s: f64,
    },
    /// A tolerance that is not greater than 0.
    #[error("tolerance {0} must be greater than 0")]
    Tolerance(f64),
    /// The tail misses the tolerance: use more modes, a shorter horizon or a larger tolerance.
    #[error(
        "the tail misses the tolerance: {reached:.1e} instead of {asked:.1e}; \
         use more modes, a shorter horizon or a larger tolerance"
    )]
    ToleranceMissed {
        /// Largest error of the relaxation modulus that was reached, relative to the modulus at that time scale.
        reached: f64,
        /// The tolerance of the options.
        asked: f64,
    },
    /// Fewer modes than the model has springs and discrete relaxation times, which must be exact.
    #[error("{modes} modes are too few for this model: use a memory with at least {needed}")]
    TooFewModes {
        /// Modes of the law.
        modes: usize,
        /// Modes that are needed.
        needed: usize,
    },
    /// A head that is shorter than the inertia of the method reaches back.
    #[error("a head of {head} increments is too short for the inertia of this method: use at least {needed}")]
    HeadTooShort {
        /// Increments of the head.
        head: usize,
        /// Increments needed.
        needed: usize,
    },
    /// A stiffness of one step that is 0 or infinite in the number type.
    #[error(
        "nothing to solve: the stiffness of one step is 0, infinite or beyond the number type; check the units of the coefficients"
    )]
    NothingToSolve,
    /// An invalid coefficient: non-finite, negative, or of a mode that grows.
    #[error("{0} of the law must be finite, and what relaxes must decay")]
    Coefficient(&'static str),
    /// An elastic curve that was refused.
    #[error(transparent)]
    Curve(#[from] CurveError),
    /// A spring that falls more steeply than the memory holds within a step.
    #[error(
        "at {displacement_m:.6} m spring and memory have a stiffness of {stiffness:.3e} N/m within a step; the spring must not fall so steeply"
    )]
    Unstable {
        /// The displacement, m.
        displacement_m: f64,
        /// The stiffness of one step there, N/m.
        stiffness: f64,
    },
    /// A spring in series with the memory that does not rise.
    #[error(
        "the spring in series has a slope of {slope:.3e} N/m where it is stretched by {elongation_m:.6} m; it must rise everywhere"
    )]
    SeriesSpring {
        /// The displacement, m.
        elongation_m: f64,
        /// The slope there, N/m.
        slope: f64,
    },
    /// No samples were given for a window.
    #[error("a window of 0 samples: use storage for at least one")]
    EmptyWindow,
    /// Storage for a window's state of another length than its weights.
    #[error("storage of {given} samples for a window of {needed}: use storage of the same length")]
    Storage {
        /// Length of the storage.
        given: usize,
        /// Length of the weights.
        needed: usize,
    },
}

/// Reasons to refuse an elastic [`Curve`](crate::Curve).
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CurveError {
    /// A number of knots that is not 2 to 17, for a spring not 2 to 9.
    #[error("{0} knots; an elastic curve has 2 to 17, a spring 2 to 9")]
    Knots(usize),
    /// A knot that is not finite, or not to the right of the one before it.
    #[error("knot {} must be finite, and its displacement larger than that of the one before", .index + 1)]
    Knot {
        /// Its index, from 0.
        index: usize,
    },
    /// A range that does not hold the displacement 0.
    #[error("the elastic curve reaches from {low_m} m to {high_m} m; it must hold 0, where the film rests")]
    Range {
        /// Its lower end, m.
        low_m: f64,
        /// Its upper end, m.
        high_m: f64,
    },
    /// The value at 0 is not 0, or the slope there not 1.
    #[error("the elastic curve has the value {value_m} m and the slope {slope} at 0; they must be 0 and 1")]
    AtRest {
        /// The value at 0, m.
        value_m: f64,
        /// The slope at 0.
        slope: f64,
    },
    /// A curve that does not rise.
    #[error("the elastic curve must rise: its slope is {slope:.4} at {displacement_m:.6} m, at rest 1")]
    NotMonotone {
        /// Where it rises least, m.
        displacement_m: f64,
        /// Its slope there; that at rest is 1.
        slope: f64,
    },
    /// A force of a [`Spring`](crate::Spring) at 0 that is not 0.
    #[error("the spring has a force of {force_n} N at 0; it must be 0")]
    ForceAtRest {
        /// The force at 0, N.
        force_n: f64,
    },
    /// Constants of a [`Measure`](crate::Measure) that are not finite, or a length that is not positive.
    #[error("exponent and length_m must be finite, and length_m greater than 0")]
    Measure,
    /// Constants of [`Rubber`](crate::Rubber) that are not finite and positive.
    #[error("share, limit, rest_stretch and free_length_m must be finite and greater than 0")]
    Rubber,
    /// A stretch at which Gent's chains are taut, or the film has no length.
    #[error(
        "at {displacement_m:.6} m the film has the stretch {stretch:.4}, where its chains are taut or it has no length"
    )]
    Taut {
        /// The displacement, m.
        displacement_m: f64,
        /// The stretch there.
        stretch: f64,
    },
}

/// Reasons to refuse an [`Actuator`](crate::Actuator) or a [`VoltageDrive`](crate::VoltageDrive).
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ActuatorError {
    /// A quantity that is not finite or not greater than 0; the name carries its unit.
    #[error("{quantity} = {value} must be finite and greater than 0")]
    NotPositive {
        /// Name of the quantity.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
    /// A mass that is not finite or is negative (kg).
    #[error("mass_kg = {0} must be finite and not negative")]
    Mass(f64),
    /// A stretch coupling that is not finite (1/m).
    #[error("stretch_coupling = {0} must be finite (1/m)")]
    Coupling(f64),
    /// A saturation voltage that is not finite and greater than 0 (V).
    #[error("saturation_v = {0} must be finite and greater than 0 (V)")]
    Saturation(f64),
    /// Pull-in within one step: the electrostatic pull exceeds the film's stiffness of one step.
    #[error(
        "pull-in: the electrostatic pull of {pull:.3e} N/m at the largest voltage is above 99 % of the film's {stiffness:.3e} N/m; \
         lower the voltage or the coupling"
    )]
    PullIn {
        /// Stiffness of the electrostatic pull at the largest voltage, N/m.
        pull: f64,
        /// Stiffness of one step of the law, N/m.
        stiffness: f64,
    },
}

/// Reasons to refuse a [`Feedforward`](crate::Feedforward), [`Observer`](crate::Observer) or [`Tracking`](crate::Tracking).
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ControlError {
    /// The actuator was refused at the largest voltage.
    #[error(transparent)]
    Actuator(#[from] ActuatorError),
    /// A quantity that is not finite or not greater than 0; the name carries its unit.
    #[error("{quantity} = {value} must be finite and greater than 0")]
    NotPositive {
        /// Name of the quantity.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
    /// A quantity that is negative, not finite or too large; the name carries its unit.
    #[error("{quantity} = {value} must be from 0 to {most}")]
    OutOfRange {
        /// Name of the quantity.
        quantity: &'static str,
        /// The value.
        value: f64,
        /// The largest one.
        most: f64,
    },
    /// A bandwidth that is too high for the sensor: interval and delay of its samples would cost too much phase margin.
    #[error(
        "bandwidth {bandwidth_hz:.3} Hz is too much for a sensor of that rate and delay; {largest_hz:.3} Hz at the most"
    )]
    SensorTooSlow {
        /// The bandwidth, Hz.
        bandwidth_hz: f64,
        /// The largest one for this sensor, Hz.
        largest_hz: f64,
    },
    /// A bandwidth with which single precision cannot compute: below 1e-9 Hz, a cycle of 30 years.
    #[error("bandwidth {bandwidth_hz:e} Hz is too low; 1e-9 Hz at the least")]
    BandwidthTooLow {
        /// The bandwidth, Hz.
        bandwidth_hz: f64,
    },
    /// A force at the largest voltage with which single precision cannot compute.
    #[error("the force at the largest voltage is {force_n:e} N; from 1e-12 to 1e12 N are possible")]
    Force {
        /// The force, N.
        force_n: f64,
    },
    /// A delay of the sensor that is longer than the observer's memory of predictions.
    #[error(
        "samples of the sensor are {ticks} ticks late; {most} at the most: a lower rate of the law has longer ticks"
    )]
    SensorTooLate {
        /// Delay in ticks.
        ticks: usize,
        /// Largest delay that is remembered, ticks.
        most: usize,
    },
    /// A number of harmonics that cannot be learned.
    #[error("{harmonics} harmonics to learn; from 1 to {HARMONICS} are possible", HARMONICS = crate::HARMONICS)]
    Harmonics {
        /// The number in the options.
        harmonics: usize,
    },
    /// A sensor that would count as lost between two samples.
    #[error("lost_after_s = {lost_after_s} is less than the {sample_interval_s} s from one sample to the next")]
    LostBetweenSamples {
        /// Time without a sample after which it counts as lost, s.
        lost_after_s: f64,
        /// Time between samples, s.
        sample_interval_s: f64,
    },
    /// A bandwidth above a third of the model's resonance, the frequency from which inertia outweighs its stiffness, or one with which the
    /// correction has too much gain there.
    #[error("with a bandwidth of {bandwidth_hz:.3} Hz the observer would ring at the model's resonance; lower it")]
    NearResonance {
        /// The bandwidth, Hz.
        bandwidth_hz: f64,
    },
}

/// Reasons to refuse [`SelfSensing`](crate::SelfSensing).
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SelfSensingError {
    /// A quantity that is not finite or not greater than 0; the name carries its unit.
    #[error("{quantity} = {value} must be finite and greater than 0")]
    NotPositive {
        /// Name of the quantity.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
    /// Periods of the tone in a block that are not 2 to 64.
    #[error("{0} periods of the tone in a block; from 2 to 64 are possible")]
    Periods(u16),
    /// A largest capacitance that is not above that at rest.
    #[error("max_f = {max_f:e} F must be larger than rest_f = {rest_f:e} F")]
    Range {
        /// Capacitance at rest, F.
        rest_f: f64,
        /// The largest one, F.
        max_f: f64,
    },
    /// A cable whose capacitance is negative, or not less than that of cable and film.
    #[error("cable_f = {cable_f:e} F must not be negative, and less than the {rest_f:e} F of cable and film at rest")]
    Cable {
        /// Capacitance of the cable, F.
        cable_f: f64,
        /// Capacitance at rest, F.
        rest_f: f64,
    },
    /// A springpot whose order is not between 0 and 1, or whose share is not finite.
    #[error("creep = {creep} must be finite, and alpha = {alpha} between 0 and 1")]
    Creep {
        /// The share, s^α.
        creep: f64,
        /// The order.
        alpha: f64,
    },
    /// A displacement that does not rise with the capacitance.
    #[error("stroke_m: the displacement must rise with the capacitance, which it does not at {capacitance_f:e} F")]
    NotMonotone {
        /// Where, F.
        capacitance_f: f64,
    },
    /// The memory of the springpot was refused.
    #[error(transparent)]
    Law(#[from] LawError),
}

/// The first of `values` that is not finite and greater than 0. Not inlined: unrolled, the checks of a table take twice its space in
/// flash.
#[inline(never)]
pub(crate) fn first_not_positive(values: &[(&'static str, f64)]) -> Option<(&'static str, f64)> {
    values.iter().copied().find(|&(_, value)| !(value.is_finite() && value > 0.0))
}
