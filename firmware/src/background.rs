//! The board's side of the link: timer, watchdog, parameter store.

use core::ptr::addr_of_mut;
use core::slice::from_raw_parts;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use dea_driver::server::{Board, FlightRecorder, FlightSlot, Image};
use dea_driver::wire::{FlightRecord, InjectedFault};
use dea_driver::{Device, Store, StoreError};
use rtic::Mutex;

use crate::board::{self, CYCLES_PER_TICK};
use crate::family::flash::ParameterFlash;
use crate::family::{FLIGHT_SLOTS, INTERRUPTS};
use crate::panic::{self, Message};
use crate::watchdog::Watchdog;

/// The slowest tick, Hz: the counter has 24 bits, and the watchdog waits for 50 ms.
pub const MIN_RATE_HZ: f32 = 100.0;
/// The fastest, Hz.
const MAX_RATE_HZ: f32 = 5000.0;
/// Longest time without a tick, ms; with the watchdog's oscillator at 17 to 47 kHz it is 33 to 95 ms.
const WATCHDOG_MS: u32 = 50;
/// Longest time for which the flash may stop the program, ms: erasing 16 KiB takes 0.8 s at the most.
const FLASH_MS: u32 = 4000;
/// Words of the vector table: those of the core, and the interrupts of the chip.
const VECTORS: usize = 16 + INTERRUPTS;

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
pub fn watch(watchdog: &mut Watchdog) {
    watchdog.wait_for(WATCHDOG_MS);
}

/// Memory of the flight recorder.
pub type FlightMemory = &'static mut [FlightSlot; FLIGHT_SLOTS];

/// Kept over a reset.
#[unsafe(link_section = ".kept")]
static mut FLIGHT: [FlightSlot; FLIGHT_SLOTS] = [[0; 10]; FLIGHT_SLOTS];

/// The flight recorder, with the records from before the reset. To be called once.
pub fn flight_recorder() -> FlightRecorder<FlightMemory> {
    // SAFETY: the start alone calls this, once, so that there is no other reference. Any bits make slots.
    FlightRecorder::new(unsafe { &mut *addr_of_mut!(FLIGHT) })
}

/// Bytes of the link for which there was no room.
static LOST: AtomicU32 = AtomicU32::new(0);

/// Counts a byte of the link for which there was no room: it is lost, and its frame with it.
pub fn lose_byte() {
    LOST.store(LOST.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
}

/// The program in the flash: the vectors, and from the text to the initial values of the RAM. The parameters between them change.
pub fn program() -> [(&'static [u32], Image); 2] {
    unsafe extern "C" {
        static __vector_table: u32;
        static __stext: u32;
        static __sidata: u32;
        static __sdata: u32;
        static __edata: u32;
    }
    let length = |start: *const u32, end: *const u32| (end as usize - start as usize) / size_of::<u32>();
    let data = length(&raw const __sdata, &raw const __edata);
    let program = length(&raw const __stext, &raw const __sidata) + data;
    // SAFETY: the linker has put flash there, which this program does not write.
    let parts =
        unsafe { [from_raw_parts(&raw const __vector_table, VECTORS), from_raw_parts(&raw const __stext, program)] };
    parts.map(|words| (words, Image::new(words)))
}

/// Whether a host has asked for a reset by the watchdog.
static EXPIRING: AtomicBool = AtomicBool::new(false);

/// Whether the tick must not feed the watchdog any more.
pub fn is_watchdog_expiring() -> bool {
    EXPIRING.load(Ordering::Relaxed)
}

/// The board, as the link's background sees it.
pub struct Background<'a, D, W, F> {
    pub device: D,
    pub watchdog: W,
    pub store: &'a mut Store<ParameterFlash>,
    pub ticker: &'a mut Ticker,
    pub panic_message: &'a Message,
    pub recorder: F,
    pub program: [(&'static [u32], Image); 2],
}

impl<D, W, F> Board for Background<'_, D, W, F>
where
    D: Mutex<T = Device>,
    W: Mutex<T = Watchdog>,
    F: Mutex<T = FlightRecorder<FlightMemory>>,
{
    type Flash = ParameterFlash;
    const ID: u16 = board::ID;

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

    fn rates_hz(&self) -> (f32, f32) {
        let fastest = self.ticker.core_hz as f32 / CYCLES_PER_TICK;
        (MIN_RATE_HZ, fastest.min(MAX_RATE_HZ))
    }

    fn store(&mut self) -> &mut Store<ParameterFlash> {
        self.store
    }

    fn save(&mut self, blob: &[u8]) -> Result<(), StoreError> {
        self.watchdog.lock(|watchdog| watchdog.wait_for(FLASH_MS));
        let saved = self.store.save(blob);
        self.watchdog.lock(watch);
        saved.map(drop)
    }

    fn set_rate(&mut self, rate_hz: f32) {
        self.ticker.set_rate(rate_hz);
    }

    fn flight_record(&mut self, back: u32) -> Option<FlightRecord> {
        self.recorder.lock(|recorder| recorder.record(back))
    }

    fn lost_bytes(&self) -> u32 {
        LOST.load(Ordering::Relaxed)
    }

    fn stack_peak(&self) -> u32 {
        stack_peak()
    }

    fn noise(&self) -> u32 {
        // The time of the request's last byte, in cycles of the core.
        crate::machine::id() ^ SYST::get_current()
    }

    fn image_is_intact(&mut self) -> bool {
        self.program.iter_mut().all(|(words, image)| image.is_intact(words))
    }

    fn panic_message(&self) -> &str {
        self.panic_message.as_str()
    }

    fn remember_trial(&mut self, on_trial: bool) {
        panic::remember_trial(on_trial);
    }

    fn remembers_trial(&self) -> bool {
        panic::remembers_trial()
    }

    fn stop_feeding_watchdog(&mut self) -> bool {
        EXPIRING.store(true, Ordering::Relaxed);
        true
    }

    fn inject_fault(&mut self, fault: InjectedFault) -> bool {
        crate::bench::inject_fault(fault)
    }
}

/// Largest depth of the stack so far, bytes: words that still have the paint of the start were never used.
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
