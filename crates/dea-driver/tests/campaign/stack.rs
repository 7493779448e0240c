//! A bit that flips on the stack between two instructions: the processor traps after each of them.

use std::arch::asm;
use std::ffi::{c_int, c_void};
use std::mem;
use std::sync::Once;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use libc::{REG_EFL, REG_RSP, siginfo_t, ucontext_t};

#[derive(Clone, Copy, Debug)]
pub struct Flip {
    /// Instructions before it.
    pub after: u64,
    /// Which bit of the stack in use then.
    pub pick: u64,
}

const TRAP_FLAG: i64 = 1 << 8;
/// Below the stack pointer, a function may use so many bytes.
const RED_ZONE: usize = 128;

/// Instructions that are left, those that there were, the bit, and where the stack of the work begins.
static LEFT: AtomicU64 = AtomicU64::new(0);
static PASSED: AtomicU64 = AtomicU64::new(0);
static PICK: AtomicU64 = AtomicU64::new(0);
static TOP: AtomicUsize = AtomicUsize::new(0);

extern "C" fn on_step(_: c_int, _: *mut siginfo_t, context: *mut c_void) {
    // SAFETY: the kernel hands it to a handler with SA_SIGINFO, and it is the handler's until it returns.
    let registers = unsafe { &mut (*context.cast::<ucontext_t>()).uc_mcontext.gregs };
    PASSED.fetch_add(1, Ordering::Relaxed);
    let left = LEFT.load(Ordering::Relaxed);
    if left > 0 {
        return LEFT.store(left - 1, Ordering::Relaxed);
    }
    registers[REG_EFL as usize] &= !TRAP_FLAG;
    let lowest = registers[REG_RSP as usize] as usize - RED_ZONE;
    let bits = 8 * TOP.load(Ordering::Relaxed).saturating_sub(lowest) as u64;
    if bits == 0 {
        return;
    }
    let bit = PICK.load(Ordering::Relaxed) % bits;
    let byte = (lowest + (bit / 8) as usize) as *mut u8;
    // SAFETY: it is within the stack of this thread. What the program makes of it is the subject.
    unsafe { byte.write_volatile(byte.read_volatile() ^ 1 << (bit % 8)) };
}

fn install() {
    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(|| {
        // SAFETY: all zeros are a valid action: no flags, no signal blocked.
        let mut action: libc::sigaction = unsafe { mem::zeroed() };
        action.sa_sigaction = on_step as extern "C" fn(_, _, _) as usize;
        action.sa_flags = libc::SA_SIGINFO;
        // SAFETY: the handler has the type that SA_SIGINFO asks for.
        assert_eq!(unsafe { libc::sigaction(libc::SIGTRAP, &action, std::ptr::null_mut()) }, 0);
    });
}

#[inline(never)]
pub fn with_flip<R>(flip: Flip, work: impl FnOnce() -> R) -> R {
    install();
    LEFT.store(flip.after, Ordering::Relaxed);
    PICK.store(flip.pick, Ordering::Relaxed);
    PASSED.store(0, Ordering::Relaxed);
    let top: usize;
    // SAFETY: the stack pointer is only read.
    unsafe { asm!("mov {}, rsp", out(reg) top, options(nomem, nostack, preserves_flags)) };
    TOP.store(top, Ordering::Relaxed);
    // SAFETY: the handler of the trap is there.
    unsafe { asm!("pushfq", "or qword ptr [rsp], 0x100", "popfq") };
    let result = work();
    // SAFETY: without the flag nothing traps.
    unsafe { asm!("pushfq", "and qword ptr [rsp], -257", "popfq") };
    result
}

/// The number of instructions of `work`.
pub fn count<R>(work: impl FnOnce() -> R) -> u64 {
    with_flip(Flip { after: u64::MAX, pick: 0 }, work);
    PASSED.load(Ordering::Relaxed)
}

/// Ends the process if it is still the same case after so many seconds.
pub fn end_process_after(seconds: u32) {
    // SAFETY: it has no handler, so that it ends the process.
    unsafe { libc::alarm(seconds) };
}
