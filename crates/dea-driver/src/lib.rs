//! Driver of a dielectric elastomer actuator, on embedded-hal.
//!
//! A soft film between compliant electrodes is squeezed by kilovolts. This crate is what stands between a control law and
//! that film: it commands the amplifier, reads the sensors, keeps the film and its user safe, keeps parameters over power
//! loss, and talks to a host. All of it runs on the host as well, against mocks.
//!
//! # The parts
//!
//! - [`convert`]: codes of the converters as types, with their volts per count and a calibration.
//! - [`Amplifier`] (AD5754) and [`Ads868x`]: the chips, on [`embedded_hal::spi::SpiDevice`].
//! - [`Supervisor`]: disarmed, armed, running or tripped; limits of voltage, field, slew and stroke; [`Monitor`] and
//!   [`Plausibility`] watch the sensors. Whatever trips ends at 0 V with the enable output low, its cause latched.
//! - [`Controller`]: the tick of a control loop and what a host can ask of it; [`Device`]: a board that ticks one, once it has
//!   parameters.
//! - [`Blob`]: the parameters of a board as bytes; [`Store`] keeps them in two slots of flash.
//! - [`link`]: the frames and messages between controller and host, and the board's side of that conversation.
//!
//! Units are SI: volts at the film, metres, seconds; time is counted in ticks of the control loop.
//!
//! # Features
//!
//! - `defmt`: states, causes and errors can be logged on a microcontroller.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![warn(clippy::pedantic)]
#![allow(clippy::doc_markdown)]

mod ads868x;
mod amplifier;
mod blob;
mod control;
pub mod convert;
mod device;
pub mod link;
mod monitor;
mod plausibility;
mod store;
mod supervisor;

pub use ads868x::{AdcError, Ads868x};
pub use amplifier::{Amplifier, AmplifierError};
pub use blob::{BLOB_LEN, Blob, BlobError, Control, LawNumbers, Parameters, SCHEMA};
pub use control::{Controller, Inputs, Outputs};
pub use device::{Device, Drive};
pub use monitor::{Monitor, MonitorLimits};
pub use plausibility::{Plausibility, PlausibilityLimits, SensorFault};
pub use store::{Store, StoreError};
pub use supervisor::{Cause, Limits, LimitsError, OnSensorFault, Readings, Refusal, State, Supervisor, Tick};
