//! A chip's serial port within a frame.

use crate::violation::{Rule, Violations};

/// The frame that is open, and the bit at the output. Times in ns.
#[derive(Clone, Debug, Default)]
pub(crate) struct Port {
    pub open: bool,
    /// Bits that were captured, and when the last one was.
    pub clocks: u32,
    pub captured: Option<u64>,
    /// When the select fell.
    pub selected: u64,
    /// The output before and after it changed last.
    pub before: bool,
    pub after: bool,
    pub changed: u64,
}

impl Port {
    /// The select falls.
    pub fn begin(&mut self, now: u64) {
        (self.open, self.clocks, self.captured, self.selected) = (true, 0, None, now);
    }

    /// The output goes to `after`.
    pub fn launch(&mut self, before: bool, after: bool, now: u64) {
        (self.before, self.after, self.changed) = (before, after, now);
    }

    /// The select rises: the bits of the frame. The last one is lost where it came less than `lag` before.
    pub fn end(&mut self, now: u64, lag: u64, violations: &mut Violations) -> u32 {
        self.open = false;
        let after_clock = self.captured.map_or(u64::MAX, |captured| now - captured);
        if after_clock < lag {
            violations.note(now, Rule::SelectAfterClock(after_clock));
            self.clocks = self.clocks.saturating_sub(1);
        }
        self.clocks
    }
}
