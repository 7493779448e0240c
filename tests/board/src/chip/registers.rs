//! Registers of a block by their offsets.

use std::ops::{Index, IndexMut};

use crate::chip::time::Picoseconds;
use crate::chip::violation::Violation;

/// Words that hold what is written.
#[derive(Clone)]
pub struct Registers([u32; 0x400 / 4]);

impl Registers {
    /// Registers with these values, the others 0.
    pub fn new(values: &[(u32, u32)]) -> Self {
        let mut registers = Self([0; 0x400 / 4]);
        values.iter().for_each(|&(offset, value)| registers[offset] = value);
        registers
    }
}

impl Index<u32> for Registers {
    type Output = u32;

    fn index(&self, offset: u32) -> &u32 {
        &self.0[offset as usize / 4]
    }
}

impl IndexMut<u32> for Registers {
    fn index_mut(&mut self, offset: u32) -> &mut u32 {
        &mut self.0[offset as usize / 4]
    }
}

/// A block as the bus accesses it.
pub trait Peripheral {
    fn value(&self, offset: u32, now: Picoseconds) -> u32;

    /// Clears what reading a register clears.
    fn was_read(&mut self, _offset: u32) {}

    /// Writes a register; returns what the manual forbids about it.
    fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> Option<Violation>;

    /// Restores the values after a reset.
    fn reset(&mut self);
}
