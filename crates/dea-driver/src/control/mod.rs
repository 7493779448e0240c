//! The control tick.

mod controller;

pub use controller::{Controller, Inputs, Outputs};
