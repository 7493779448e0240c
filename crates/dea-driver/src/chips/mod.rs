//! The converters: ranges and codes, calibrations, and the chips on their bus (feature `chips`).

#[cfg(feature = "chips")]
mod ad5754;
#[cfg(feature = "chips")]
mod ads868x;
pub mod boards;
mod calibration;
mod codes;
mod drive;

#[cfg(feature = "chips")]
pub use ad5754::{Amplifier, AmplifierError, Reference};
#[cfg(feature = "chips")]
pub use ads868x::{AdcError, Ads868x};
pub use calibration::{Calibration, CalibrationError, MAX_POINTS};
pub use codes::{AdcCode, AdcRange, Ceilings, CommandRange, Converters, DacCode, Resolution};
pub use drive::Drive;
