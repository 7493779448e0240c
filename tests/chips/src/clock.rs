//! Time as the test sees it.

use std::cell::Cell;
use std::rc::Rc;

/// Virtual time in nanoseconds, shared by all that hold a clone.
///
/// Nothing moves it but the bus, a [`Line`](crate::Line), and the test.
#[derive(Clone, Debug, Default)]
pub struct Clock(Rc<Cell<u64>>);

impl Clock {
    /// A clock at 0 ns.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Nanoseconds since the clock was made.
    #[must_use]
    pub fn now(&self) -> u64 {
        self.0.get()
    }

    /// Moves the clock forward by `ns`.
    pub fn advance(&self, ns: u64) {
        self.0.set(self.0.get() + ns);
    }

    /// Moves the clock to `ns`; time that has passed already stays passed.
    pub fn advance_to(&self, ns: u64) {
        self.0.set(self.0.get().max(ns));
    }
}
