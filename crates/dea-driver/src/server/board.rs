//! The parts of a board that a session with a host uses.

use embedded_storage::nor_flash::NorFlash;
use springpot::Compressed;

use crate::control::FlightRecord;
use crate::parameters::{ControllerMemory, Store, StoreError};
use crate::server::Device;
use crate::wire::InjectedFault;

/// The parts of a board that a [`Session`](crate::server::Session) uses. `M` is the memory of its controller's law.
pub trait Board<M: ControllerMemory = Compressed<f32>> {
    /// The flash of its parameters.
    type Flash: NorFlash;

    /// Its number; blobs for another one are refused.
    const ID: u16;

    /// Runs `work` while no tick can interrupt it, and returns how many cycles of the processor it took.
    fn with<R>(&mut self, work: impl FnOnce(&mut Device<M>) -> R) -> (R, u32);

    /// Slowest and fastest tick rate that it supports, Hz.
    fn rates_hz(&self) -> (f32, f32);

    /// The store of its parameters.
    fn store(&mut self) -> &mut Store<Self::Flash, M>;

    /// Saves a blob. Ticks may be held up while the flash erases and writes, a second or two; the amplifier is disabled.
    ///
    /// # Errors
    ///
    /// As [`Store::save`].
    fn save(&mut self, blob: &[u8]) -> Result<(), StoreError> {
        self.store().save(blob).map(drop)
    }

    /// Ticks at `rate_hz` from now on.
    fn set_rate(&mut self, rate_hz: f32);

    /// The record of its flight recorder that is `back` records older than the newest.
    fn flight_record(&mut self, back: u32) -> Option<FlightRecord> {
        let _ = back;
        None
    }

    /// Bytes of the link that were lost so far because the background was behind, wrapping.
    fn lost_bytes(&self) -> u32 {
        0
    }

    /// Largest depth of the stack so far, bytes; 0 where it is not measured.
    fn stack_peak(&self) -> u32 {
        0
    }

    /// A number that differs from board to board and from one call to the next, also after a reset: of a chip's id and a fast counter. Tokens depend
    /// on it.
    fn noise(&self) -> u32 {
        0
    }

    /// The message of the firmware's last panic; empty if there was none.
    #[allow(clippy::unnecessary_literal_bound)] // a board returns its own
    fn panic_message(&self) -> &str {
        ""
    }

    /// Remembers over a reset whether the parameters in use were only tried: the reset loses them, and the stored ones may allow more.
    /// Leave this and [`remembers_trial`](Self::remembers_trial) out on a board without memory that survives a reset.
    fn remember_trial(&mut self, on_trial: bool) {
        let _ = on_trial;
    }

    /// Whether a trial was remembered last, before a reset or since.
    fn remembers_trial(&self) -> bool {
        false
    }

    /// Stops feeding the watchdog, so that it resets the chip. The amplifier is disabled. Returns false without a watchdog.
    fn stop_feeding_watchdog(&mut self) -> bool {
        false
    }

    /// Checks a part of the program's [image](crate::server::Image), and returns false if it has changed since the start. Called in every
    /// turn of the background.
    fn image_is_intact(&mut self) -> bool {
        true
    }

    /// Injects a fault, in an image with a virtual bench; false in any other, and for a fault that it cannot inject.
    fn inject_fault(&mut self, fault: InjectedFault) -> bool {
        let _ = fault;
        false
    }
}
