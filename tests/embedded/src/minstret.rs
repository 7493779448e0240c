//! Counts executed instructions: a RISC-V core does so itself, and QEMU's exactly with `-icount shift=0`.

use riscv::register::minstret;

/// A running counter.
pub struct Counter(());

impl Counter {
    /// It runs from reset on.
    pub fn start() -> Self {
        Self(())
    }

    /// Instructions that `work` takes, and what it returns.
    pub fn count<R>(&self, work: impl FnOnce() -> R) -> (u64, R) {
        let start = minstret::read64();
        let result = work();
        (minstret::read64() - start, result)
    }
}
