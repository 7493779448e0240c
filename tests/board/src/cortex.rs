//! Instructions of the core that `cortex-m` calls as functions: the host has others.

use crate::trap;

/// Waits for `cycles` of the core.
#[unsafe(no_mangle)]
extern "C" fn __delay(cycles: u32) {
    if let Some(machine) = trap::machine().as_mut() {
        machine.chip.wait_cycles(cycles);
    }
}

/// Memory barriers: the host does everything in order.
#[unsafe(no_mangle)]
extern "C" fn __dsb() {}

#[unsafe(no_mangle)]
extern "C" fn __dmb() {}

#[unsafe(no_mangle)]
extern "C" fn __isb() {}

#[unsafe(no_mangle)]
extern "C" fn __nop() {}
