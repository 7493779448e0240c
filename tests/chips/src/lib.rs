#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod ad5754;
mod ads868x;
mod bus;
mod clock;
mod line;
mod pad;
mod serial;
mod violation;

pub use ad5754::{
    Ad5754, AfterShutdown, Channel, Coding, DAC_POWER_UP_NS, DAC_SETTLING_NS, DacRange, DacRegisterReads, FirstOutput,
    Unspecified,
};
pub use ads868x::{ADC_POWER_UP_NS, AdcRange, Ads868x, FlagOrder, Variant, address, alarm};
pub use bus::{Floating, SpiBus, SpiTiming, SpiWire};
pub use clock::{Clock, VirtualDelay};
pub use line::Line;
pub use pad::{LastBit, SlowPad};
pub use serial::{Absent, Bit, Sdi, SerialChip, clock_bit};
pub use violation::{Rule, Violation};
