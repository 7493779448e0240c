//! Control that steps one law once per tick: feedforward, observer, tracking, which combines both, and the follower around them.

mod adaptation;
mod adapted;
mod amplifier;
mod block;
mod capacitance;
mod cycle;
mod demodulation;
mod fade;
mod feedforward;
mod follower;
mod harmonic;
mod inverse;
mod learning;
mod limits;
mod observer;
mod observer_options;
mod pace;
mod path;
mod self_sensing;
mod statistics;
mod tracking;

pub use adapted::{Adapted, Adapting};
pub use amplifier::{AmplifierLag, AmplifierModel};
pub use capacitance::CapacitanceRelation;
pub use feedforward::{Feedforward, FeedforwardState};
pub use follower::{Compensator, Follower, FollowerState};
pub use harmonic::HARMONICS;
pub use inverse::{Applied, VoltageCommand};
pub use learning::{Learning, LearningOptions, LearningState};
pub use limits::{CommandLimits, Limited};
pub use observer::{Observer, ObserverState, SensorSample};
pub use observer_options::ObserverOptions;
pub use self_sensing::{FilmReading, SelfSensed, SelfSensing, SelfSensingFault, SelfSensingOptions, SelfSensingState};
pub use statistics::Statistics;
pub use tracking::{Tracking, TrackingState};
