#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![warn(clippy::pedantic)]
#![allow(clippy::doc_markdown)]
#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod chips;
mod control;
mod parameters;
mod safety;
#[cfg(feature = "link")]
pub mod server;
#[cfg(feature = "link")]
pub mod wire;

/// Its `String` and `Vec` appear in [`Parameters`] and in the messages of the link.
pub use heapless;

pub use chips::Drive;
#[cfg(feature = "chips")]
pub use chips::{AdcError, Ads868x, Amplifier, AmplifierError};
pub use control::{
    AdaptationOrder, AdaptationStatus, Controller, Inputs, LearningOrder, Mode, Outputs, SetpointError, Telemetry,
};
#[cfg(feature = "loop-test")]
pub use control::{Followed, Step, Target, TickCodes, Ticked};
pub use parameters::{BLOB_LEN, Blob, BlobError, Control, ControllerMemory, Parameters, SCHEMA, SelfSensor};
#[cfg(feature = "store")]
pub use parameters::{BlobHeader, RamFlash, Store, StoreError, Stored};
pub use safety::{
    Cause, DriverState, Limits, LimitsError, Monitor, MonitorLimits, Motion, OnSensorFault, Plausibility,
    PlausibilityLimits, Readings, Refusal, SensorFault, Supervisor, Tick,
};
#[cfg(feature = "link")]
pub use server::Device;
