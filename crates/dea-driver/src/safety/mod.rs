//! What keeps the film and its user safe: limits, the checks of the sensors, and the supervisor.

mod monitor;
mod plausibility;
mod supervisor;

pub use monitor::{Monitor, MonitorLimits};
pub use plausibility::{Plausibility, PlausibilityLimits, SensorFault};
pub use supervisor::{Cause, Limits, LimitsError, OnSensorFault, Readings, Refusal, State, Supervisor, Tick};
