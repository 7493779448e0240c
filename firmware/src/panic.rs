//! The panic handler: the amplifier is disabled, the message is kept, the chip is reset.
//!
//! After an overflow of the stack this cannot run: the core locks up, and the watchdog resets it.

use core::fmt::{self, Write};
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::addr_of_mut;

use cortex_m::interrupt;
use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

use crate::family::flash;
use crate::{board, clock};

/// Marks a record, unlike the memory's contents after power-up.
const MAGIC: u32 = 0x7061_6e69;

/// Marks that the parameters in force are only tried.
const ON_TRIAL: u32 = 0x7472_6961;

/// Mark of a trial, kept over a reset.
#[unsafe(link_section = ".kept")]
static mut TRIAL: MaybeUninit<u32> = MaybeUninit::uninit();

/// Remembers over a reset whether the parameters in force are only tried.
pub fn remember_trial(on_trial: bool) {
    // SAFETY: any bits make a number; the background alone reads and writes it.
    unsafe { addr_of_mut!(TRIAL).cast::<u32>().write_volatile(if on_trial { ON_TRIAL } else { 0 }) };
}

/// Reads whether a trial was remembered last. After power-up the memory holds anything else.
pub fn remembers_trial() -> bool {
    // SAFETY: as above.
    unsafe { addr_of_mut!(TRIAL).cast::<u32>().read_volatile() == ON_TRIAL }
}

/// The last panic, cleared by the next start alone.
#[unsafe(link_section = ".kept")]
static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();

#[repr(C)]
struct Record {
    magic: u32,
    /// Bytes that hold, and their complement.
    length: u32,
    complement: u32,
    text: [u8; 200],
}

/// The message of the panic that ended the last run, if one did.
pub struct Message {
    text: [u8; 200],
    length: usize,
}

impl Message {
    /// Takes the message, so that the next start does not find it.
    pub fn take() -> Self {
        let record = addr_of_mut!(RECORD).cast::<Record>();
        // SAFETY: any bits make a record; it is read once, before interrupts are on, and written in a panic only.
        let found = unsafe {
            let found = record.read_volatile();
            addr_of_mut!((*record).magic).write_volatile(0);
            found
        };
        let length = found.length as usize;
        let holds = found.magic == MAGIC && found.length == !found.complement && length <= found.text.len();
        Self { text: found.text, length: if holds { length } else { 0 } }
    }

    pub fn as_str(&self) -> &str {
        // A letter may have been cut in two at the end.
        match core::str::from_utf8(&self.text[..self.length]) {
            Ok(text) => text,
            Err(error) => core::str::from_utf8(&self.text[..error.valid_up_to()]).unwrap_or_default(),
        }
    }
}

impl Write for Record {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let start = self.length as usize;
        let room = &mut self.text[start..];
        let length = text.len().min(room.len());
        room[..length].copy_from_slice(&text.as_bytes()[..length]);
        self.length += length as u32;
        Ok(())
    }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    interrupt::disable();
    // The enable output is low before anything else is tried.
    board::disable();
    let mut record = Record { magic: MAGIC, length: 0, complement: 0, text: [0; 200] };
    // It truncates.
    let _ = write!(record, "{}", info.message());
    if let Some(place) = info.location() {
        let _ = write!(record, " at {}:{}", place.file(), place.line());
    }
    record.complement = !record.length;
    // SAFETY: nothing else runs any more.
    unsafe { addr_of_mut!(RECORD).cast::<Record>().write_volatile(record) };
    SCB::sys_reset()
}

/// The clock security system: the crystal has stopped, and the core runs on its internal oscillator, ten times slower.
#[exception]
unsafe fn NonMaskableInt() {
    if flash::forgives() {
        return;
    }
    panic!("{}: the crystal has stopped", clock::PANIC);
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    panic!("hard fault at {:#010x}", frame.pc());
}

/// Handles an interrupt that was not enabled.
#[exception]
unsafe fn DefaultHandler(number: i16) {
    panic!("unexpected interrupt {number}");
}
