#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![warn(clippy::pedantic)]
// Models, modes and moduli are the names of the field, and its documentation is mathematics.
#![allow(clippy::similar_names, clippy::doc_markdown)]

mod actuator;
mod complex;
mod control;
mod curve;
mod error;
mod kernel;
mod law;
mod model;
mod numbers;
mod scalar;

pub use actuator::{Actuator, EPSILON_0, GRAVITY, Load, Preload, VoltageDrive};
pub use control::{
    Adapted, Adapting, AmplifierLag, AmplifierModel, Applied, CapacitanceRelation, CommandLimits, Compensator,
    CreepCoefficients, Feedforward, FeedforwardState, FilmReading, Follower, FollowerState, HARMONICS, Learning,
    LearningOptions, LearningState, Limited, Observer, ObserverOptions, ObserverState, SelfSensed, SelfSensing,
    SelfSensingFault, SelfSensingOptions, SelfSensingState, SensorSample, Statistics, Tracking, TrackingState,
    VoltageCommand,
};
pub use curve::{Curve, Knot, MAX_KNOTS, MAX_SPRING_KNOTS, Measure, Rubber, Spring};
pub use error::{
    ActuatorError, ControlError, CurveError, LawError, MAX_BRANCHES, ModelElement, ModelError, SelfSensingError,
};
pub use kernel::Discretisation;
pub use law::{Coefficients, Compressed, CompressionBound, Law, LawOptions, LawState, Memory, Window};
pub use model::{Chain, Maxwell, Preset, Springpot, TemperatureDependence, Topology};
/// The complex number of [`Maxwell::modulus`] and of the frequency responses, from the crate `num-complex`.
pub use num_complex::Complex;
#[doc(hidden)]
pub use numbers::{Numbers, Record};
pub use scalar::{Real, Scalar};
