//! Control that steps one law once per tick: feedforward, observer, and tracking, which combines both.

mod amplifier;
mod block;
mod cycle;
mod fade;
mod feedforward;
mod harmonic;
mod inverse;
mod learning;
mod limits;
mod observer;
mod observer_options;
mod pace;
mod path;
mod statistics;
mod tracking;

pub use amplifier::{AmplifierLag, AmplifierModel};
pub use feedforward::{Feedforward, FeedforwardState};
pub use harmonic::HARMONICS;
pub use inverse::{Applied, VoltageCommand};
pub use learning::{Learning, LearningOptions, LearningState};
pub use limits::{CommandLimits, Limited};
pub use observer::{Observer, ObserverState, SensorSample};
pub use observer_options::ObserverOptions;
pub use statistics::Statistics;
pub use tracking::{Tracking, TrackingState};
