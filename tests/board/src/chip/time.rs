//! Time of the chip: it passes with what the firmware accesses.

/// Since power-up.
pub type Picoseconds = u64;

pub const NANOSECOND: Picoseconds = 1000;
pub const MICROSECOND: Picoseconds = 1000 * NANOSECOND;
pub const SECOND: Picoseconds = 1_000_000 * MICROSECOND;

/// Cycles of the core from one access of a register to the next, beside what the access itself takes: a load, a test and a branch.
const CYCLES: u64 = 8;
/// Cycles of the bus that an access takes.
const BUS_CYCLES: u64 = 2;

/// Cycles of the core from the end of a frame, where a select rises, to the next access: the firmware returns from one transaction and
/// calls another. In its image that takes some 60 instructions from one edge to the other.
pub const CYCLES_BETWEEN_FRAMES: u64 = 50;

/// Time from one access to the next, on a bus with its own clock.
pub fn of_access(hclk_hz: u32, bus_hz: u32) -> Picoseconds {
    of_cycles(CYCLES, hclk_hz) + of_cycles(BUS_CYCLES, bus_hz)
}

pub fn of_cycles(cycles: u64, hz: u32) -> Picoseconds {
    cycles * SECOND / u64::from(hz.max(1))
}

/// Whole periods of `hz` in a time.
pub fn periods(time: Picoseconds, hz: u32) -> u64 {
    (u128::from(time) * u128::from(hz) / u128::from(SECOND)) as u64
}
