//! The converters: bytes on a bus, codes, and the volts that they stand for.

mod ad5754;
mod ads868x;
mod codes;
mod drive;

pub use ad5754::{Amplifier, AmplifierError};
pub use ads868x::{AdcError, Ads868x};
pub use codes::{AdcCode, Calibration, CommandRange, DacCode};
pub use drive::Drive;
