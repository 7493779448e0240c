#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod ad5754;
mod ads868x;
mod bus;
mod clock;
mod line;
mod port;
mod serial;
mod violation;

pub use ad5754::{Ad5754, DAC_POWER_UP_NS, DAC_SETTLING_NS};
pub use ads868x::{ADC_POWER_UP_NS, Ads868x, Variant};
pub use bus::{SpiBus, SpiTiming, SpiWire};
pub use clock::Clock;
pub use line::Line;
pub use serial::{Absent, Bits, Sdi, SerialChip};
pub use violation::{Rule, Violation};
