//! Driver of a dielectric elastomer actuator, on embedded-hal.
//!
//! A soft film between compliant electrodes is squeezed by kilovolts. This crate is what stands between a control law and
//! that film: it commands the amplifier, reads the sensors, keeps the film and its user safe, keeps parameters over power
//! loss, and talks to a host. All of it runs on the host as well, against mocks.
//!
//! # The parts
//!
//! - [`chips`]: codes of the converters as types, with their volts per count and a calibration.
//! - [`Amplifier`] (AD5754) and [`Ads868x`]: the chips, on [`embedded_hal::spi::SpiDevice`].
//! - [`Supervisor`]: disarmed, armed, running or tripped; limits of voltage, field, slew and stroke; [`Monitor`] and
//!   [`Plausibility`] watch the sensors. Whatever trips ends at 0 V with the enable output low, its cause latched.
//! - [`Controller`]: the tick of a control loop and what a host can ask of it; [`Device`]: a board that ticks one, once it has
//!   parameters.
//! - [`Blob`]: the parameters of a board as bytes; [`Store`] keeps them in two slots of flash.
//! - [`wire`]: the frames and messages between controller and host; [`server`]: the board's side of that conversation.
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

pub mod chips;
mod control;
mod parameters;
mod safety;
pub mod server;
pub mod wire;

pub use chips::{AdcError, Ads868x, Amplifier, AmplifierError, Drive};
pub use control::{Controller, Inputs, Outputs};
pub use parameters::{BLOB_LEN, Blob, BlobError, Control, Parameters, SCHEMA, Store, StoreError};
pub use safety::{
    Cause, Limits, LimitsError, Monitor, MonitorLimits, OnSensorFault, Plausibility, PlausibilityLimits, Readings,
    Refusal, SensorFault, State, Supervisor, Tick,
};
pub use server::Device;
