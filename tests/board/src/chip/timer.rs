//! TIM5, RM0090 section 18, RM0440 section 30: the counter, and the capture of the slow oscillator.

use crate::chip::family::Family;
use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::{Picoseconds, SECOND, periods};
use crate::chip::violation::Violation;

const CR1: u32 = 0x00;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2c;

const CEN: u32 = 1 << 0;
const UG: u32 = 1 << 0;
/// Flags in SR.
const UIF: u32 = 1 << 0;

/// The channel that the slow oscillator can be connected to.
struct Channel {
    /// From 0.
    number: u32,
    /// Register of its input, the field in it, and the slow oscillator's code.
    input: u32,
    field: u32,
    from_slow: u32,
}

/// RM0090: OR connects channel 4. RM0440: TISEL connects channel 1.
const F4: Channel = Channel { number: 3, input: 0x50, field: 0b11 << 6, from_slow: 0b01 << 6 };
const G4: Channel = Channel { number: 0, input: 0x5c, field: 0xf, from_slow: 1 };

impl Channel {
    /// Its flags, its bit in CCER, its mode and its register.
    fn captured(&self) -> u32 {
        1 << (1 + self.number)
    }

    fn overwritten(&self) -> u32 {
        1 << (9 + self.number)
    }

    fn enabled(&self) -> u32 {
        1 << (4 * self.number)
    }

    fn mode(&self, registers: &Registers) -> u32 {
        registers[0x18 + self.number / 2 * 4] >> (8 * (self.number % 2)) & 0xff
    }

    fn register(&self) -> u32 {
        0x34 + 4 * self.number
    }
}

pub struct Timer {
    family: Family,
    channel: Channel,
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

impl Timer {
    pub fn new(family: Family) -> Self {
        Self {
            family,
            channel: match family {
                Family::F4 => F4,
                Family::G4 => G4,
            },
            registers: Registers::new(&[(ARR, u32::MAX)]),
            divider: 1,
            at: 0,
            fraction: 0,
            edges: 0,
            since: 0,
            since_capture: 0,
        }
    }

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
        let channel = &self.channel;
        let mode = channel.mode(&self.registers);
        let captures = self.registers[CCER] & channel.enabled() != 0 && mode & 0b11 == 0b01;
        if !captures || self.registers[channel.input] & channel.field != channel.from_slow {
            return;
        }
        self.since_capture += 1;
        if self.since_capture < 1 << (mode >> 2 & 0b11) {
            return;
        }
        self.since_capture = 0;
        let flags = self.registers[SR];
        let overwritten = if flags & channel.captured() != 0 { channel.overwritten() } else { 0 };
        self.registers[SR] = flags | channel.captured() | overwritten;
        self.registers[channel.register()] = self.registers[CNT];
    }
}

impl Peripheral for Timer {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        self.registers[offset]
    }

    fn was_read(&mut self, offset: u32) {
        if offset == self.channel.register() {
            self.registers[SR] &= !self.channel.captured();
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
            _ if offset == self.channel.register() && self.channel.mode(&self.registers) & 0b11 != 0 => {}
            _ => self.registers[offset] = value,
        }
        if self.registers[CCER] & self.channel.enabled() == 0 {
            self.since_capture = 0;
        }
        None
    }

    fn reset(&mut self) {
        *self = Self::new(self.family);
    }
}
