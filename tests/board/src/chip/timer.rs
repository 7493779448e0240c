//! TIM5, RM0090 section 18: the counter, and the capture of the slow oscillator on channel 4.

use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::{Picoseconds, SECOND, periods};
use crate::chip::violation::Violation;

const CR1: u32 = 0x00;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR2: u32 = 0x1c;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2c;
const CCR4: u32 = 0x40;
const OR: u32 = 0x50;

const CEN: u32 = 1 << 0;
const UG: u32 = 1 << 0;
/// Flags in SR.
const UIF: u32 = 1 << 0;
const CC4IF: u32 = 1 << 4;
const CC4OF: u32 = 1 << 12;
/// Channel 4 captures, in CCER.
const CC4E: u32 = 1 << 12;
/// The fourth input is the slow oscillator, in OR.
const FROM_SLOW: u32 = 0b01;

pub struct Timer {
    registers: Registers,
    /// Divider in force: PSC is taken over by an update.
    divider: u32,
    /// When the counter was brought up to date.
    at: Picoseconds,
    /// Duration of a count, in parts of a second's picoseconds.
    fraction: u128,
    /// Edges of the slow oscillator up to then, and since when.
    edges: u64,
    since: Picoseconds,
    /// Edges since the last capture.
    since_capture: u32,
}

impl Default for Timer {
    fn default() -> Self {
        Self {
            registers: Registers::new(&[(ARR, u32::MAX)]),
            divider: 1,
            at: 0,
            fraction: 0,
            edges: 0,
            since: 0,
            since_capture: 0,
        }
    }
}

impl Timer {
    /// Counts until `now` at `clock_hz`, none without its clock, and captures the edges of the slow oscillator: Hz, since when.
    pub fn advance(&mut self, now: Picoseconds, clock_hz: Option<u32>, slow: Option<(u32, Picoseconds)>) {
        let Some(clock_hz) = clock_hz else {
            self.at = now;
            self.edges = slow.map_or(0, |(hz, since)| periods(now - since, hz));
            return;
        };
        let Some((slow_hz, since)) = slow else {
            self.count_until(now, clock_hz);
            self.edges = 0;
            return;
        };
        if self.since != since {
            (self.edges, self.since) = (0, since);
        }
        let edges = periods(now - since, slow_hz);
        while self.edges < edges {
            self.edges += 1;
            let edge = since + (u128::from(self.edges) * u128::from(SECOND)).div_ceil(slow_hz.into()) as Picoseconds;
            self.count_until(edge.max(self.at), clock_hz);
            self.edge();
        }
        self.count_until(now, clock_hz);
    }

    fn count_until(&mut self, to: Picoseconds, clock_hz: u32) {
        let elapsed = u128::from(to - self.at);
        self.at = to;
        if self.registers[CR1] & CEN == 0 {
            return;
        }
        let parts = self.fraction + elapsed * u128::from(clock_hz);
        let count = u128::from(SECOND) * u128::from(self.divider);
        self.fraction = parts % count;
        let period = u128::from(self.registers[ARR]) + 1;
        self.registers[CNT] = ((u128::from(self.registers[CNT]) + parts / count) % period) as u32;
    }

    fn edge(&mut self) {
        let mode = self.registers[CCMR2] >> 8;
        let captures = self.registers[CCER] & CC4E != 0 && mode & 0b11 == 0b01;
        if !captures || self.registers[OR] >> 6 & 0b11 != FROM_SLOW {
            return;
        }
        self.since_capture += 1;
        if self.since_capture < 1 << (mode >> 2 & 0b11) {
            return;
        }
        self.since_capture = 0;
        let flags = self.registers[SR];
        self.registers[SR] = flags | CC4IF | if flags & CC4IF != 0 { CC4OF } else { 0 };
        self.registers[CCR4] = self.registers[CNT];
    }
}

impl Peripheral for Timer {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        self.registers[offset]
    }

    fn was_read(&mut self, offset: u32) {
        if offset == CCR4 {
            self.registers[SR] &= !CC4IF;
        }
    }

    fn write(&mut self, offset: u32, value: u32, _: Picoseconds) -> Option<Violation> {
        match offset {
            // Writing zeros clears flags.
            SR => self.registers[SR] &= value,
            EGR if value & UG != 0 => {
                self.registers[CNT] = 0;
                self.fraction = 0;
                self.divider = self.registers[PSC] + 1;
                self.registers[SR] |= UIF;
            }
            // Captured, not written.
            CCR4 if self.registers[CCMR2] >> 8 & 0b11 != 0 => {}
            _ => self.registers[offset] = value,
        }
        if self.registers[CCER] & CC4E == 0 {
            self.since_capture = 0;
        }
        None
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}
