//! What keeps the film and its user safe: limits, the checks of the sensors, and the supervisor.

mod limits;
mod monitor;
mod plausibility;
mod stillness;
mod supervisor;

pub use limits::{Limits, LimitsError, MonitorLimits, OnSensorFault, PlausibilityLimits};
pub use monitor::Monitor;
pub use plausibility::{Plausibility, SensorFault};
pub use supervisor::{Cause, DriverState, Readings, Refusal, Supervisor, Tick};
