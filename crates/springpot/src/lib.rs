//! The creep of dielectric elastomer actuators, as a recursion with fixed memory.
//!
//! A dielectric elastomer film creeps: under a steady voltage its stroke grows for minutes, under a sinusoidal one the
//! whole oscillation drifts. Karner, Belšak and Gotlih (Fractal Fract. 2022, 6, 720) describe it with springpots, elements
//! between a spring and a dashpot, in the fully fractional generalised Maxwell model of their Eq. 11. A springpot never
//! forgets, so the textbooks' way to compute it grows with every sample, and cutting it short loses the creep.
//!
//! This crate steps Eq. 11 in constant time and a few hundred bytes, without allocation, on a microcontroller: forwards
//! (force → displacement: an observer's prediction) and backwards (displacement → force: feedforward), from the same state
//! and on the same line of arithmetic.
//!
//! ```
//! use springpot::{Actuator, Law, Options, Preset, VoltageDrive};
//!
//! # fn main() -> Result<(), Box<dyn core::error::Error>> {
//! // Configuration, built once: the paper's model with two branches, at 1 kHz.
//! let model = Preset::named("table3-n2").unwrap().model()?;
//! let law: Law<f32> = Law::compressed(&model, Options::at_step(1e-3))?;
//! let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6000.0, law.stiffness())?;
//!
//! // State, stepped a thousand times a second: 3 kV for a minute.
//! let mut state = law.state();
//! let first = law.displacement_under(&mut state, drive.load(3000.0));
//! for _ in 0..60_000 {
//!     law.displacement_under(&mut state, drive.load(3000.0));
//! }
//! assert!(state.position() > 8.0 * first); // it crept
//!
//! // And back: the force, and the voltage, that hold the film where it is now.
//! let here = state.position();
//! let force = law.force(&mut state, here);
//! let volts = drive.voltage(force, here);
//! assert!((volts - 3000.0).abs() < 1.0);
//! # Ok(())
//! # }
//! ```
//!
//! # The parts
//!
//! - [`Springpot`], [`Maxwell`], [`Topology`]: the model, with its responses in frequency and time.
//! - [`Law`] is the model at a step, [`State`] what a step changes. [`Compressed`] (the default) and [`Window`] are the two
//!   ways to remember.
//! - [`Actuator`] and [`VoltageDrive`] turn voltage into force and back (Eq. 1).
//! - [`Feedforward`] makes a film follow a reference without a sensor, [`Observer`] estimates it from voltage and samples of
//!   its displacement, [`Tracking`] is both. All step the one law, once a tick.
//! - [`Preset`]: the published parameters.
//!
//! Everything that can be wrong is refused when a model, a law or a drive is built ([`ModelError`], [`LawError`],
//! [`ActuatorError`], [`ControlError`]). A step cannot fail, panic or allocate, and takes the same number of operations
//! every time (an observer a few more when a sample arrives). A step given a force, displacement or voltage that is not a
//! number never recovers: check before. References, sensor samples and monitor readings that are no numbers are passed over.
//!
//! # Units
//!
//! SI throughout: metres, newtons, volts, seconds, kilograms; a springpot's c is in N·s^α/m.
//!
//! # Features
//!
//! - `defmt`: the configuration types and errors can be logged on a microcontroller.
//! - `micromath`: a fast approximate square root from force to voltage, see [`Real::sqrt`].
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![warn(clippy::pedantic)]
// Models, modes and moduli are the names of the field, and its documentation is mathematics.
#![allow(clippy::similar_names, clippy::doc_markdown)]

mod actuator;
mod complex;
mod control;
mod error;
mod kernel;
mod law;
mod model;
mod scalar;

pub use actuator::{Actuator, EPSILON_0, GRAVITY, Load, Preload, VoltageDrive};
pub use control::{
    Applied, Command, CommandLimits, Feedforward, FeedforwardState, Limited, Observer, ObserverOptions, ObserverState,
    Sample, Statistics, Tracking, TrackingState,
};
pub use error::{ActuatorError, ControlError, Element, LawError, ModelError};
pub use law::{Coefficients, Compressed, Law, Memory, Options, State, Window};
pub use model::{Chain, MAX_BRANCHES, Maxwell, Preset, Springpot, Topology};
/// The complex number of [`Maxwell::modulus`] and of the frequency responses, from the crate `num-complex`.
pub use num_complex::Complex;
pub use scalar::{Real, Scalar};
