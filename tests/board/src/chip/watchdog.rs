//! The independent watchdog: RM0090 section 21, RM0440 section 43. It is clocked by the slow oscillator and outlives everything.

use crate::chip::registers::Peripheral;
use crate::chip::time::{MICROSECOND, Picoseconds, SECOND};
use crate::chip::violation::Violation;

const KR: u32 = 0x00;
const PR: u32 = 0x04;
const RLR: u32 = 0x08;
const SR: u32 = 0x0c;
/// Until a setting is taken over: five periods of the slow oscillator.
const TAKES: Picoseconds = 160 * MICROSECOND;

/// A setting that is taken over: what counts, and what is to count from some moment on.
#[derive(Clone, Copy)]
struct Setting {
    counts: u32,
    next: u32,
    at: Picoseconds,
}

impl Setting {
    fn new(counts: u32) -> Self {
        Self { counts, next: counts, at: 0 }
    }

    fn is_pending(&self, now: Picoseconds) -> bool {
        now < self.at
    }

    fn at(&self, now: Picoseconds) -> u32 {
        if self.is_pending(now) { self.counts } else { self.next }
    }
}

pub struct Watchdog {
    divider: Setting,
    reload: Setting,
    open: bool,
    /// When it expires, once it runs.
    expires: Option<Picoseconds>,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self { divider: Setting::new(0), reload: Setting::new(0xfff), open: false, expires: None }
    }
}

impl Watchdog {
    /// When it expires by a slow oscillator of 32 kHz, if it runs, ns since power-up.
    pub fn expires_ns(&self) -> Option<u64> {
        self.expires.map(|at| at / 1000)
    }
}

impl Peripheral for Watchdog {
    fn value(&self, offset: u32, now: Picoseconds) -> u32 {
        match offset {
            PR => self.divider.at(now),
            RLR => self.reload.at(now),
            SR => u32::from(self.divider.is_pending(now)) | u32::from(self.reload.is_pending(now)) << 1,
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> Option<Violation> {
        let (setting, value) = match offset {
            KR => {
                self.open = value == 0x5555;
                if value == 0xcccc || value == 0xaaaa && self.expires.is_some() {
                    let count = (4 << self.divider.at(now).min(6)) * SECOND / 32_000;
                    self.expires = Some(now + u64::from(self.reload.at(now) + 1) * count);
                }
                return None;
            }
            PR => (&mut self.divider, value & 0b111),
            RLR => (&mut self.reload, value & 0xfff),
            _ => return None,
        };
        if !self.open || setting.is_pending(now) {
            return Some(Violation::WatchdogNotSet);
        }
        *setting = Setting { counts: setting.at(now), next: value, at: now + TAKES };
        None
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}
