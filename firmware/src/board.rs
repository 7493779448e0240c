//! What this board lends to the link.

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use dea_driver::link::Board;
#[cfg(feature = "drills")]
use dea_driver::link::Drill;
use dea_driver::{Device, Store};
use rtic::Mutex;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use crate::flash::ParameterFlash;
use crate::panic::Message;

/// What `host-sim export` takes by default.
pub const ID: u16 = 0x0405;
/// The slowest tick, Hz: the counter has 24 bits, and the watchdog waits for 50 ms.
pub const MIN_RATE_HZ: f32 = 100.0;
/// For so long the tick may not come, ms.
const WATCHDOG_MS: u32 = 50;
/// For so long the flash may hold up everything, ms: two sectors take 1 s at the most.
const FLASH_MS: u32 = 4000;

/// Ticks: SysTick at the core's clock.
pub struct Ticker {
    timer: SYST,
    core_hz: u32,
}

impl Ticker {
    /// Ticks at `rate_hz` from now on.
    pub fn start(mut timer: SYST, core_hz: u32, rate_hz: f32) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        let mut ticker = Self { timer, core_hz };
        ticker.set_rate(rate_hz);
        ticker.timer.enable_interrupt();
        ticker.timer.enable_counter();
        ticker
    }

    fn set_rate(&mut self, rate_hz: f32) {
        self.timer.set_reload((self.core_hz as f32 / rate_hz + 0.5) as u32 - 1);
        self.timer.clear_current();
    }
}

/// Starts the watchdog.
pub fn watch(watchdog: &mut IndependentWatchdog) {
    watchdog.start(WATCHDOG_MS.millis());
}

/// The board, as the link's background sees it.
pub struct Background<'a, D, W> {
    pub device: D,
    pub watchdog: W,
    pub store: &'a mut Store<ParameterFlash>,
    pub ticker: &'a mut Ticker,
    pub panic_message: &'a Message,
}

impl<D: Mutex<T = Device>, W: Mutex<T = IndependentWatchdog>> Board for Background<'_, D, W> {
    type Flash = ParameterFlash;
    const ID: u16 = ID;
    const RATES_HZ: (f32, f32) = (MIN_RATE_HZ, 5000.0);

    fn with<R>(&mut self, work: impl FnOnce(&mut Device) -> R) -> (R, u32) {
        let reload = SYST::get_reload() + 1;
        self.device.lock(|device| {
            let pending = SCB::is_pendst_pending();
            let start = SYST::get_current();
            let result = work(device);
            let end = SYST::get_current();
            // The counter runs down; a tick that became due meanwhile was one turn of it.
            let turns = if SCB::is_pendst_pending() && !pending { reload } else { 0 };
            (result, (start + turns).wrapping_sub(end))
        })
    }

    fn with_store<R>(&mut self, work: impl FnOnce(&mut Store<ParameterFlash>) -> R) -> R {
        self.watchdog.lock(|watchdog| watchdog.start(FLASH_MS.millis()));
        let result = work(self.store);
        self.watchdog.lock(watch);
        result
    }

    fn set_rate(&mut self, rate_hz: f32) {
        self.ticker.set_rate(rate_hz);
    }

    fn stack_peak(&self) -> u32 {
        stack_peak()
    }

    fn panic_message(&self) -> &str {
        self.panic_message.as_str()
    }

    #[cfg(feature = "drills")]
    fn drill(&mut self, drill: Drill) -> bool {
        crate::drills::ask(drill);
        true
    }
}

/// Stops where there is a chip instead of QEMU, which has no device id: nobody would answer what this image says, and the core
/// would fault over it.
#[cfg(feature = "semihosting")]
pub fn stop_on_a_chip() {
    let id = 0xe004_2000 as *const u32;
    // SAFETY: DBGMCU_IDCODE can be read at any time.
    while unsafe { id.read_volatile() } != 0 {
        cortex_m::asm::wfi();
    }
}

/// Largest depth of the stack so far, bytes: what the start painted and nothing has overwritten was never used.
fn stack_peak() -> u32 {
    unsafe extern "C" {
        static _stack_end: u32;
        static _stack_start: u32;
    }
    let (end, start) = (&raw const _stack_end, &raw const _stack_start);
    let words = (start as usize - end as usize) / size_of::<u32>();
    // SAFETY: the words between both belong to the stack; what runs now uses those near the start alone.
    let unused =
        (0..words).take_while(|&word| unsafe { end.add(word).read_volatile() } == cortex_m_rt::STACK_PAINT_VALUE);
    ((words - unused.count()) * size_of::<u32>()) as u32
}
