//! Pins that a driver sets.

use std::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};

use crate::Clock;

/// An output pin of embedded-hal that is wired to a chip.
///
/// Each call first lets `ns_per_call` pass, which is what a CPU needs for it, and then sets the level.
pub struct Line<F> {
    clock: Clock,
    ns_per_call: u64,
    set: F,
}

impl<F: FnMut(bool, u64)> Line<F> {
    /// `set` gets the level (`true` is high) and the time in ns, and hands them to the chip's pin.
    pub fn new(clock: &Clock, ns_per_call: u64, set: F) -> Self {
        Self { clock: clock.clone(), ns_per_call, set }
    }

    fn level(&mut self, level: bool) {
        self.clock.advance(self.ns_per_call);
        (self.set)(level, self.clock.now());
    }
}

impl<F> ErrorType for Line<F> {
    type Error = Infallible;
}

impl<F: FnMut(bool, u64)> OutputPin for Line<F> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.level(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.level(true);
        Ok(())
    }
}
