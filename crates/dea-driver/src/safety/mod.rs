//! Protection of the film and its user: limits, the checks of the sensors, and the supervisor.

mod limits;
mod monitor;
mod motion;
mod plausibility;
mod state;
mod supervisor;

pub use limits::{Limits, LimitsError, MonitorLimits, OnSensorFault, PlausibilityLimits};
pub use monitor::Monitor;
pub use motion::Motion;
pub use plausibility::{Plausibility, SensorFault};
pub use state::{Cause, DriverState, Refusal};
pub use supervisor::{Readings, Supervisor, Tick};
