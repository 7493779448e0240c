//! The chip itself: what the images for QEMU have in `emulated.rs` instead.

use dea_driver::BlobError;
use stm32f4xx_hal::rcc::Rcc;

use crate::clock::ClockFault;
pub use crate::serial::received;

/// Nothing has to be checked before the start.
pub fn start() {}

/// The timer starts the ticks.
pub fn begin_tick() {}

/// Returns the frequency of the core, Hz.
pub fn core_hz(rcc: &Rcc) -> u32 {
    rcc.clocks.hclk().raw()
}

/// Reports why the core runs on its internal oscillator.
pub fn report(fault: ClockFault) {
    defmt::error!("clock: {}; the internal oscillator serves", fault);
}

/// Whether a store without parameters, in which this was `found`, was never written.
pub fn is_erased(found: Option<BlobError>) -> bool {
    found.is_none()
}
