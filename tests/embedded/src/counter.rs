//! Counts executed instructions.
//!
//! QEMU started with `-icount shift=0` lets a nanosecond pass per instruction, so SysTick, which runs at the core clock,
//! counts instructions in units of one clock period: deterministic, and exact to a period in whatever is measured.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::Peripherals;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;

/// Core clock of the emulated board.
const CLOCK_MHZ: u64 = match u64::from_str_radix(env!("CLOCK_MHZ"), 10) {
    Ok(clock_mhz) => clock_mhz,
    Err(_) => panic!("the build script gives the clock"),
};

const PERIOD: u32 = 0x00ff_ffff;

static WRAPS: AtomicU32 = AtomicU32::new(0);

#[exception]
fn SysTick() {
    WRAPS.store(WRAPS.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
}

/// A running counter.
pub struct Counter(());

impl Counter {
    /// Starts counting.
    pub fn start() -> Self {
        let Some(Peripherals { SYST: mut timer, .. }) = Peripherals::take() else {
            panic!("peripherals are taken once")
        };
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(PERIOD);
        timer.clear_current();
        timer.enable_counter();
        timer.enable_interrupt();
        Self(())
    }

    /// Instructions that `work` takes, and what it returns.
    pub fn count<R>(&self, work: impl FnOnce() -> R) -> (u64, R) {
        let start = Self::periods();
        let result = work();
        ((Self::periods() - start) * 1000 / CLOCK_MHZ, result)
    }

    fn periods() -> u64 {
        loop {
            let wraps = WRAPS.load(Ordering::Relaxed);
            let current = SYST::get_current();
            if wraps == WRAPS.load(Ordering::Relaxed) {
                return u64::from(wraps) * (u64::from(PERIOD) + 1) + u64::from(PERIOD - current);
            }
        }
    }
}
