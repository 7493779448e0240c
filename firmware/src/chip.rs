//! The chip itself: what the images for QEMU have in `emulated.rs` instead.

use dea_driver::{BlobError, Cause};
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::signature::Uid;

use crate::clock::ClockFault;
pub use crate::serial::received;

/// Nothing has to be checked before the start.
pub fn start() {}

/// Returns what differs from chip to chip.
pub fn id() -> u32 {
    let id = Uid::get();
    u32::from(id.x()) ^ u32::from(id.y()).rotate_left(16) ^ u32::from(id.waf_num()).rotate_left(8)
}

/// The timer starts the ticks.
pub fn begin_tick() {}

/// Returns the frequency of the core, Hz.
pub fn core_hz(rcc: &Rcc) -> u32 {
    rcc.clocks.hclk().raw()
}

/// Reports what is wrong with the clocks; it is latched.
pub fn report(fault: ClockFault) -> Option<Cause> {
    defmt::error!("clock: {}", fault);
    Some(Cause::Clock)
}

/// Whether a store without parameters, in which this was `found`, was never written.
pub fn is_erased(found: Option<BlobError>) -> bool {
    found.is_none()
}
