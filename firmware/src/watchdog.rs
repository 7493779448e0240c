//! The independent watchdog, which is alike in every family of chips.

/// Its registers.
const KEY: *mut u32 = 0x4000_3000 as *mut u32;
const PRESCALER: *mut u32 = 0x4000_3004 as *mut u32;
const RELOAD: *mut u32 = 0x4000_3008 as *mut u32;
const STATUS: *const u32 = 0x4000_300c as *const u32;
/// Keys: open the settings, restart the counter, start the watchdog.
const OPEN: u32 = 0x5555;
const FEED: u32 = 0xaaaa;
const START: u32 = 0xcccc;
/// Its oscillator, kHz, and the counter's values.
const SLOW_KHZ: u32 = 32;
const COUNTS: u32 = 4096;
/// The register of the debugger's choices, and that which stops the watchdog while the core is halted.
const DEBUG_FREEZE: *mut u32 = 0xe004_2008 as *mut u32;
const STOPS_WATCHDOG: u32 = 1 << 12;
/// Polls of a pending setting: some milliseconds; it needs 0.2 ms.
const PATIENCE: u32 = 20_000;

/// The watchdog, of which a program has one.
pub struct Watchdog(());

impl Watchdog {
    /// The one of the chip, not started. To be called once.
    pub fn take() -> Self {
        Self(())
    }

    /// Starts it, or sets another time: `ms` by its oscillator, 32 s at the most. Its registers are on a slow clock: a write is ignored
    /// while an earlier one takes effect, and the counter uses the old value until then.
    pub fn wait_for(&mut self, ms: u32) {
        let counts = |divider: u32| (ms * SLOW_KHZ) >> (2 + divider);
        let divider = (0..6).find(|&divider| counts(divider) <= COUNTS).unwrap_or(6);
        // SAFETY: its registers are the caller's.
        let settles = || (0..PATIENCE).any(|_| unsafe { STATUS.read_volatile() } & 0b11 == 0);
        settles();
        // SAFETY: as above.
        unsafe {
            KEY.write_volatile(START);
            KEY.write_volatile(OPEN);
            PRESCALER.write_volatile(divider);
            RELOAD.write_volatile(counts(divider).clamp(1, COUNTS) - 1);
        }
        settles();
        self.feed();
    }

    pub fn feed(&mut self) {
        // SAFETY: its register is the caller's.
        unsafe { KEY.write_volatile(FEED) };
    }
}

/// Keeps the watchdog running while a debugger halts the core: the film would stay at high voltage otherwise. Debuggers set this bit when
/// they attach, so it is cleared in every tick.
pub fn outlive_debugger() {
    // SAFETY: the start and the tick alone change this register.
    unsafe { DEBUG_FREEZE.write_volatile(DEBUG_FREEZE.read_volatile() & !STOPS_WATCHDOG) };
}
