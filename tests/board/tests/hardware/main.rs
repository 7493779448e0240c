//! The firmware's modules for hardware on models of the chip: what they leave in its registers, and what they do on the way.
//!
//! Each test has a board of its own; they wait for one another.
#![cfg(all(target_arch = "x86_64", target_os = "linux"))]

mod bench;
mod clock;
mod converters;
#[cfg(feature = "self-sensing")]
mod current;
mod flash;
mod host;
mod judges;
mod kinds;
mod on_chip;
mod pads;
mod promises;
mod reset;
#[cfg(feature = "self-sensing")]
mod sensed;
mod serial;
mod slaves;
mod start;
mod watchdog;
