//! Actions of the firmware that the chip's documents forbid.

use crate::chip::Block;
use crate::chip::pin::Pin;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Violation {
    /// The loop is on with an input outside its limits.
    LoopInput { hz: u32 },
    /// The loop is on with its oscillator outside its limits.
    LoopOscillator { hz: u32 },
    /// The loop was switched on before what it follows was ready.
    LoopWithoutInput,
    /// The loop's factors were written while it was on. They have not changed.
    LoopSetWhileOn,
    /// A bus is faster than it may be.
    BusClock { bus: &'static str, hz: u32 },
    /// The flash has fewer wait states than the core's clock needs.
    WaitStates { set: u32, needed: u32 },
    /// A block was accessed without its clock. Writes did nothing, reads gave 0.
    NoClock(Block),
    /// Nothing is modelled there.
    NoModel { address: u32 },
    /// Data were written to a block that still held the last.
    Overwritten(Block),
    /// A pad is too slow for the clock on its bus.
    SlowPad { pin: Pin, sck_hz: u32 },
    /// A select moved while a byte was on the bus.
    SelectWithinByte { pin: Pin },
    /// Two chips on one bus were selected at once.
    TwoSelected { pin: Pin },
    /// The ADCs are clocked faster than they may be.
    ConverterClock { hz: u32 },
    /// A conversion was started before the ADC was ready, or while it converted.
    ConversionNotReady { adc: u8 },
    /// The chip's own reference was converted by an ADC that does not have it, without its switch, or sampled for too short a time.
    ReferenceNotSampled { adc: u8 },
    /// The DMA has no half words of the ADC to put into the firmware's ring: address, sizes or directions are others.
    DmaTarget { address: u32 },
    /// A stream was set while it was on, or switched on with the flag of its last round. It has not changed.
    DmaSetWhileOn,
    /// A pin was converted that is not analog.
    NotAnalog { pin: Pin },
    /// A setting of the watchdog was written that is closed, or that still takes over what came before. It has not changed.
    WatchdogNotSet,
    /// The flash was written or erased without being asked to, while it was busy, or elsewhere than where the parameters are.
    FlashOrder { address: u32 },
}
