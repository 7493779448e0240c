//! A serial line that flips bits, loses and doubles bytes, and stalls.

use std::collections::VecDeque;

use rand::RngExt;
use rand_distr::{Distribution, Exp1};
use rand_pcg::Pcg64;

/// Bytes that 460 800 baud carry in a millisecond.
const BYTES_PER_MS: usize = 46;

/// Treatment of bytes while the adapter stalls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stall {
    /// It keeps them, and delivers them afterwards.
    Holds,
    Loses,
}

/// Which way a line goes. The adapter is between its wire and the host, and cannot hold up the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    ToBoard,
    ToHost,
}

pub struct Line {
    way: Way,
    /// For the wire.
    waiting: VecDeque<u8>,
    /// Behind it, for a host whose adapter stalls.
    held: VecDeque<u8>,
    /// Probability that a bit is wrong; a byte is lost, or doubled, as often.
    errors: f64,
    /// Bits until the next wrong one.
    until_error: f64,
    random: Pcg64,
    pub stall: Option<Stall>,
}

impl Line {
    pub fn new(way: Way, errors: f64, random: Pcg64) -> Self {
        let (waiting, held) = (VecDeque::new(), VecDeque::new());
        let mut line = Self { way, waiting, held, errors, until_error: 0.0, random, stall: None };
        line.until_error = line.gap();
        line
    }

    fn gap(&mut self) -> f64 {
        let units: f64 = Exp1.sample(&mut self.random);
        units / self.errors
    }

    /// Takes bytes from a sender that does not wait.
    pub fn send(&mut self, bytes: &[u8]) {
        self.waiting.extend(bytes);
    }

    /// Room for a sender that waits until its bytes have left: bytes of `capacity` that are free.
    pub fn room(&self, capacity: usize) -> usize {
        capacity.saturating_sub(self.waiting.len())
    }

    /// Delivers what arrives within a millisecond.
    pub fn carry(&mut self, mut deliver: impl FnMut(u8)) {
        let holds = self.stall == Some(Stall::Holds);
        if !holds {
            self.held.drain(..).for_each(&mut deliver);
        }
        if holds && self.way == Way::ToBoard {
            return;
        }
        for _ in 0..BYTES_PER_MS {
            let Some(byte) = self.waiting.pop_front() else { return };
            let is_lost = self.stall == Some(Stall::Loses) || self.random.random_bool(self.errors);
            let is_doubled = self.random.random_bool(self.errors);
            if let (false, Some(byte)) = (is_lost, self.on_the_wire(byte)) {
                for _ in 0..1 + u8::from(is_doubled) {
                    if holds { self.held.push_back(byte) } else { deliver(byte) }
                }
            }
        }
    }

    /// A byte between start and stop bit: one whose frame is wrong is lost.
    fn on_the_wire(&mut self, byte: u8) -> Option<u8> {
        let mut found = Some(byte);
        while self.until_error < 10.0 {
            found = match self.until_error as usize {
                bit @ 1..=8 => found.map(|byte| byte ^ 1 << (bit - 1)),
                _ => None,
            };
            self.until_error += self.gap();
        }
        self.until_error -= 10.0;
        found
    }
}
