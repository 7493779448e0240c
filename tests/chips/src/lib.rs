#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod ad5754;
mod serial;
mod violation;

pub use ad5754::{
    Ad5754, AfterShutdown, Channel, Coding, DAC_POWER_UP_NS, DAC_SETTLING_NS, DacRange, DacRegisterReads, FirstOutput,
    Unspecified,
};
pub use serial::{Absent, Bit, Sdi, SerialChip, clock_bit};
pub use violation::{Rule, Violation};
