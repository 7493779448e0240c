//! The modes of a run, and the records of a tick.

use serde::{Deserialize, Serialize};
use springpot::{Adapted, Adapting};

#[cfg(feature = "link")]
use crate::safety::DriverState;

/// Task of the law while running.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// The film gets the voltage that was set; the observer follows it.
    Voltage,
    /// The film gets the voltage that brings the model to the reference; the sensor is only checked.
    Feedforward,
    /// The same, less the disturbance that the observer estimates.
    Tracking,
}

/// An order for the correction learned for a periodic reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LearningOrder {
    /// Reset it now; the correction in a run fades out within a second.
    Forget,
    /// Begin the next run with it, if that follows the same reference from the same phase on. Without this order a run begins without a
    /// correction.
    CarryOver,
}

/// An order for the law of a film that changes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AdaptationOrder {
    /// The law adapts while the sensor shows the film: [`Adapting::Learn`].
    Learn {
        /// [Ageing](Adapted::ageing) from which a run trips.
        trip_at: f32,
    },
    /// Learned changes stay in use, and nothing is learned: [`Adapting::Hold`].
    Hold,
    /// Return to the law as it was fitted within some seconds, and learn nothing: [`Adapting::Off`].
    Off,
    /// Discard learned changes; learning, if it is on, continues.
    Forget,
    /// Store the learned changes with the parameters: in use, and held, from the next start on. Clears stored ones where nothing was
    /// learned. While the amplifier is off.
    Keep,
    /// Set the factors of the film's temperature, with or without a sensor:
    /// [`set_temperature_factors`](springpot::TrackingState::set_temperature_factors). They last over runs, stops and trips, until
    /// [`Off`](Self::Off), other parameters or a restart.
    Temperature {
        /// Its stiffness over that of its law, 0.25 to 4.
        stiffness: f32,
        /// Its relaxation times over those of its law, a third to three times.
        time: f32,
    },
}

/// The learned changes of a film.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AdaptationStatus {
    /// How the law adapts.
    pub adapting: Adapting,
    /// The changes that are in use.
    pub adapted: Adapted<f32>,
    /// Relative change of the stiffness: [`stiffness_change`](springpot::TrackingState::stiffness_change).
    pub stiffness_change: f32,
    /// Ageing from which a run trips; infinite before it was first ordered to learn.
    pub trip_at: f32,
    /// Factor of the stiffness at the film's [temperature](AdaptationOrder::Temperature); 1 without an order.
    pub stiffness: f32,
    /// Factor of its relaxation times, likewise.
    pub time: f32,
}

/// The record of a tick, for a host's log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Telemetry {
    /// The tick.
    pub tick: u32,
    /// Records that were dropped before this one, because the link was busy.
    pub dropped: u32,
    /// Voltage commanded, V at the film.
    pub command_v: f32,
    /// Voltage monitor, V at the film.
    pub monitor_v: f32,
    /// Displacement sensor, m.
    pub displacement_m: f32,
    /// Displacement that the model predicts, corrected by the sensor, m.
    pub predicted_m: f32,
    /// The shaped reference, without the learned correction, m; in [`Mode::Voltage`] the prediction.
    pub reference_m: f32,
    /// Correction learned from the reference's cycles and added to it, m.
    pub learned_m: f32,
    /// Estimated force that the model does not explain, N.
    pub disturbance_n: f32,
    /// Electrostatic force in units of the model's.
    pub force_scale: f32,
    /// The last sample minus the prediction for its time, m.
    pub innovation_m: f32,
    /// Limits that the command met, as bits ([`springpot::Limited`]).
    pub limited: u8,
}

/// The record of a tick of a run, for the flight recorder.
#[cfg(feature = "link")]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FlightRecord {
    /// The tick.
    pub tick: u32,
    /// The state after it.
    pub state: DriverState,
    /// Voltage commanded, V at the film.
    pub command_v: f32,
    /// Voltage monitor, V at the film; NaN if it did not answer.
    pub monitor_v: f32,
    /// Displacement sensor, m; NaN without a sample.
    pub displacement_m: f32,
    /// Displacement that the model predicts, m.
    pub predicted_m: f32,
    /// The shaped reference, m.
    pub reference_m: f32,
    /// Limits that the command met, as bits ([`springpot::Limited`]).
    pub limited: u8,
}

#[cfg(feature = "link")]
impl FlightRecord {
    /// The tick of `telemetry`, which ended in `state`.
    #[must_use]
    pub fn new(telemetry: &Telemetry, state: DriverState) -> Self {
        let Telemetry { tick, command_v, monitor_v, displacement_m, predicted_m, reference_m, limited, .. } =
            *telemetry;
        Self { tick, state, command_v, monitor_v, displacement_m, predicted_m, reference_m, limited }
    }
}
