//! The control tick.

mod controller;
mod film_sensor;
#[cfg(any(feature = "loop-test", feature = "link"))]
mod loop_test;
mod sampler;
mod setpoint;
mod telemetry;

pub use controller::{Controller, Inputs, Outputs};
#[cfg(any(feature = "loop-test", feature = "link"))]
pub use loop_test::{Followed, Step, Target, TickCodes, Ticked};
pub use setpoint::SetpointError;
#[cfg(feature = "link")]
pub use telemetry::FlightRecord;
pub use telemetry::{AdaptationOrder, AdaptationStatus, LearningOrder, Mode, Telemetry};
