//! The chip itself; images for QEMU have `emulated.rs` instead.

use dea_driver::{BlobError, Cause};

use crate::clock::ClockFault;
pub use crate::family::serial::received;
pub use crate::family::{core_hz, id};

/// Nothing has to be checked before the start.
pub fn start() {}

/// The timer starts the ticks.
pub fn begin_tick() {}

/// Reports a fault of the clocks, which is latched.
pub fn report(fault: ClockFault) -> Option<Cause> {
    defmt::error!("clock: {}", fault);
    Some(Cause::Clock)
}

/// Whether a store without parameters, in which this was `found`, was never written.
pub fn is_erased(found: Option<BlobError>) -> bool {
    found.is_none()
}
