//! The name of a pin.

use std::fmt;

#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Pin {
    /// From 'A' to 'I'.
    pub port: char,
    pub number: u8,
}

impl Pin {
    pub const fn new(port: char, number: u8) -> Self {
        Self { port, number }
    }

    /// Place of the port among the ports.
    pub fn index(self) -> usize {
        self.port as usize - 'A' as usize
    }
}

impl fmt::Debug for Pin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "P{}{}", self.port, self.number)
    }
}
