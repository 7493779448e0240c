//! Control that steps one law once per tick: feedforward, observer, and tracking, which combines both.

mod amplifier;
mod cycle;
mod fade;
mod feedforward;
mod harmonic;
mod inverse;
mod learning;
mod limits;
mod observer;
mod pace;
mod path;
mod statistics;
mod tracking;

pub use amplifier::{AmplifierLag, AmplifierModel};
pub use feedforward::{Feedforward, FeedforwardState};
pub use inverse::{Applied, VoltageCommand};
pub use learning::{HARMONICS, Learning, LearningOptions, LearningState};
pub use limits::{CommandLimits, Limited};
pub use observer::{Observer, ObserverOptions, ObserverState, SensorSample};
pub use statistics::Statistics;
pub use tracking::{Tracking, TrackingState};
