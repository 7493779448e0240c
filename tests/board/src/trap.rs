//! Addresses that trap: whatever the firmware reads or writes at a register of the chip, the models answer.
//!
//! The chip's addresses are mapped without any right. An access faults. A plain [`Move`] of a word is done in the handler. Any other
//! instruction sees the model's value in the opened page, for the one step until the trap flag of the processor closes it again; what it wrote
//! goes to the model. The signals come from the thread that accesses, at the access: nothing is concurrent, and everything happens in the
//! order of the program.

use std::ffi::{c_int, c_void};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError, TryLockError};
use std::{mem, ptr};

use libc::{siginfo_t, ucontext_t};

use crate::chip::Chip;
use crate::instruction::{Move, Operand};

/// Addresses of the chips, with their lengths: pages of the flash; the factory's values; peripherals; those of an STM32F4 bit by bit; pins and
/// converters of an STM32G4; the core's own.
const REGIONS: [(usize, usize); 7] = [
    (0x0807_e000, 0x2000),
    (0x1fff_7000, 0x1000),
    (0x4000_0000, 0x8_0000),
    (0x4200_0000, 0x100_0000),
    (0x4800_0000, 0x2000),
    (0x5000_0000, 0x1000),
    (0xe000_0000, 0x10_0000),
];
const PAGE: usize = 4096;
/// The processor traps after the next instruction.
const TRAP_FLAG: i64 = 1 << 8;
/// In the error code of a fault: the access was a write.
const WRITES: i64 = 1 << 1;

/// The chip, while there is one.
static MACHINE: Mutex<Option<Machine>> = Mutex::new(None);

/// The handler of faults before.
static BEFORE: OnceLock<libc::sigaction> = OnceLock::new();

/// A chip and what its program may do on it.
pub struct Machine {
    pub chip: Chip,
    /// Accesses that are left.
    left: u64,
    /// The word in the open page, and whether the access writes it.
    step: Option<(usize, bool)>,
}

// SAFETY: the chips on its wires may belong to one thread. One thread at a time reaches them: that of the test, which has the board, or
// the one that runs the firmware while the first waits for it.
unsafe impl Send for Machine {}

impl Machine {
    pub fn new(chip: Chip, left: u64) -> Self {
        Self { chip, left, step: None }
    }

    /// Accesses are counted anew.
    pub fn allow(&mut self, accesses: u64) {
        self.left = accesses;
    }
}

/// The chip, for inspection between two accesses.
pub fn machine() -> MutexGuard<'static, Option<Machine>> {
    MACHINE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Maps the addresses and installs the handlers, once for the process.
///
/// # Panics
///
/// Where the addresses are taken.
pub fn install() {
    static INSTALLED: OnceLock<()> = OnceLock::new();
    INSTALLED.get_or_init(|| {
        for (start, length) in REGIONS {
            let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_NORESERVE | libc::MAP_FIXED_NOREPLACE;
            // SAFETY: the mapping replaces nothing, and nothing has a reference into it.
            let mapped = unsafe { libc::mmap(start as *mut c_void, length, libc::PROT_NONE, flags, -1, 0) };
            assert_eq!(mapped as usize, start, "the addresses from {start:#x} are taken");
        }
        let before = handle(libc::SIGSEGV, on_fault);
        // It is set here alone.
        let _ = BEFORE.set(before);
        handle(libc::SIGTRAP, on_step);
    });
}

/// Installs a handler, and returns the action before.
fn handle(signal: c_int, handler: extern "C" fn(c_int, *mut siginfo_t, *mut c_void)) -> libc::sigaction {
    // SAFETY: all zeros are a valid action: no flags, no signal blocked.
    let (mut action, mut before): (libc::sigaction, libc::sigaction) = unsafe { mem::zeroed() };
    action.sa_sigaction = handler as usize;
    action.sa_flags = libc::SA_SIGINFO;
    // SAFETY: the handler has the type that SA_SIGINFO asks for.
    let done = unsafe { libc::sigaction(signal, &action, &mut before) };
    assert_eq!(done, 0, "no handler for signal {signal}");
    before
}

extern "C" fn on_fault(signal: c_int, info: *mut siginfo_t, context: *mut c_void) {
    // SAFETY: the kernel hands both to a handler with SA_SIGINFO, and they are the handler's until it returns.
    let (info, context) = unsafe { (&*info, &mut *context.cast::<ucontext_t>()) };
    // SAFETY: a SIGSEGV has an address.
    let address = unsafe { info.si_addr() } as usize;
    let registers = &mut context.uc_mcontext.gregs;
    if !REGIONS.iter().any(|&(start, length)| (start..start + length).contains(&address)) {
        // Not ours: the instruction faults again, for the handler of faults before.
        // SAFETY: the action was in force before.
        unsafe { libc::sigaction(signal, BEFORE.get().map_or(ptr::null(), |before| before), ptr::null_mut()) };
        return;
    }
    let mut guard = lock();
    let Some(machine) = guard.as_mut() else { die("a register was accessed, but no chip has power") };
    machine.left = machine.left.checked_sub(1).unwrap_or_else(|| die("the firmware accesses registers without end"));
    let (word, writes) = (address & !3, registers[libc::REG_ERR as usize] & WRITES != 0);
    // SAFETY: the processor has just executed these bytes; the longest that are read are those of one instruction.
    if let Some(moved) = unsafe { Move::at(registers[libc::REG_RIP as usize] as *const u8) }.filter(|_| address == word)
    {
        match moved.operand {
            Operand::Register(index) if writes => machine.chip.write(word as u32, registers[index] as u32),
            Operand::Register(index) => registers[index] = i64::from(machine.chip.read(word as u32)),
            Operand::Constant(value) => machine.chip.write(word as u32, value),
        }
        registers[libc::REG_RIP as usize] += moved.length;
        return;
    }
    // What an instruction reads of a word that it writes has no effect on the chip.
    let value = if writes { machine.chip.peek(word as u32) } else { machine.chip.read(word as u32) };
    protect(word, libc::PROT_READ | libc::PROT_WRITE);
    // SAFETY: the page is open, and it is ours.
    unsafe { (word as *mut u32).write_volatile(value) };
    machine.step = Some((word, writes));
    registers[libc::REG_EFL as usize] |= TRAP_FLAG;
}

extern "C" fn on_step(_: c_int, _: *mut siginfo_t, context: *mut c_void) {
    // SAFETY: as above.
    let context = unsafe { &mut *context.cast::<ucontext_t>() };
    context.uc_mcontext.gregs[libc::REG_EFL as usize] &= !TRAP_FLAG;
    let mut guard = lock();
    let Some(machine) = guard.as_mut() else { die("a trap without a chip") };
    let Some((word, writes)) = machine.step.take() else { die("a trap without a pending access") };
    if writes {
        // SAFETY: the page is still open.
        let value = unsafe { (word as *const u32).read_volatile() };
        machine.chip.write(word as u32, value);
    }
    protect(word, libc::PROT_NONE);
}

fn protect(address: usize, rights: c_int) {
    // SAFETY: the page belongs to the regions that were mapped above.
    if unsafe { libc::mprotect((address & !(PAGE - 1)) as *mut c_void, PAGE, rights) } != 0 {
        die("a page's rights cannot be changed");
    }
}

fn lock() -> MutexGuard<'static, Option<Machine>> {
    match MACHINE.try_lock() {
        Ok(guard) => guard,
        Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
        Err(TryLockError::WouldBlock) => die("a register was accessed while the models were inspected"),
    }
}

/// Ends the process: there is no way back into the program that faulted.
fn die(why: &str) -> ! {
    let text = format!("board-on-host: {why}\n");
    // SAFETY: the bytes are valid for as long as the call takes. The standard error of the test harness would keep them.
    unsafe { libc::write(libc::STDERR_FILENO, text.as_ptr().cast(), text.len()) };
    std::process::abort()
}
