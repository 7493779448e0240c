//! Replacements for parts that QEMU's chip lacks: a line with a baud rate, and ticks that come in time.
//!
//! Under `-icount` an instruction takes a nanosecond of the chip's time, however busy the machine is. Two things still depend on
//! the machine, and would end a run that is right on a board:
//!
//! - QEMU's USART has no baud rate. Bytes arrive as fast as the host writes them, in interrupts above the tick. Here no more
//!   are read in a tick than the line brings: QEMU keeps the next byte back until the last one has been read.
//! - While the core sleeps, the chip's time follows the machine's. A machine that wakes the emulator late lets a tick start late, or leaves
//!   out several. A tick that starts shortly before the next one is due would be taken for one that lasts too long. Here the period
//!   restarts with every tick, so that an overrun is the same as on a board: the tick itself took longer than its period.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::{SCB, SYST};
use dea_driver::wire::BAUD;
use dea_driver::{BlobError, Cause};
use stm32f4xx_hal::pac::Interrupt;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::Event;

use crate::clock::ClockFault;
use crate::family::Rcc;
use crate::family::serial::{self, Port};
use crate::family::tree::CORE_HZ;

/// Cycles of the core that a byte takes on the line: ten bits.
const CYCLES_PER_BYTE: u32 = CORE_HZ / (BAUD / 10);

/// Bytes that the line may still bring before the next tick.
static ALLOWED: AtomicU32 = AtomicU32::new(0);
/// Whether a byte waits for the next tick.
static WAITING: AtomicBool = AtomicBool::new(false);

/// Stops on a chip instead of QEMU, which has no device id: without a debugger the core would fault at the first log.
pub fn start() {
    let id = 0xe004_2000 as *const u32;
    // SAFETY: DBGMCU_IDCODE can be read at any time.
    while unsafe { id.read_volatile() } != 0 {
        cortex_m::asm::wfi();
    }
}

/// QEMU's chip has no id.
pub fn id() -> u32 {
    0
}

/// Returns the frequency of the core, Hz: QEMU's has one clock, whatever the registers say.
pub fn core_hz(_: &Rcc) -> u32 {
    CORE_HZ
}

/// Reports a fault of the clock. QEMU has no crystal, so that it is expected.
pub fn report(fault: ClockFault) -> Option<Cause> {
    defmt::debug!("clock: {}", fault);
    None
}

/// Whether a store without parameters, in which this was `found`, was never written. QEMU's flash reads 0 where nothing was loaded, which
/// no erased flash does.
pub fn is_erased(_: Option<BlobError>) -> bool {
    true
}

/// A tick begins: its period restarts, and the line may bring more bytes.
pub fn begin_tick() {
    // SAFETY: writing the current value only restarts the counter, which the timer's owner reads as a shorter tick; no
    // time is measured across the start of a tick.
    unsafe { (*SYST::PTR).cvr.write(0) };
    SCB::clear_pendst();
    ALLOWED.store((SYST::get_reload() + 1) / CYCLES_PER_BYTE, Ordering::Relaxed);
    if WAITING.load(Ordering::Relaxed) {
        rtic::pend(Interrupt::USART2);
    }
}

/// The received byte, if the line could have brought it by now.
pub fn received(port: &mut Port) -> Option<u8> {
    let allowed = ALLOWED.load(Ordering::Relaxed);
    if allowed == 0 {
        // It stays where it is until the next tick.
        port.unlisten(Event::RxNotEmpty);
        WAITING.store(true, Ordering::Relaxed);
        return None;
    }
    if WAITING.load(Ordering::Relaxed) {
        WAITING.store(false, Ordering::Relaxed);
        port.listen(Event::RxNotEmpty);
    }
    let byte = serial::received(port)?;
    ALLOWED.store(allowed - 1, Ordering::Relaxed);
    Some(byte)
}
