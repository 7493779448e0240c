//! How a recording is driven: a held load, cycles, or anything else.

use std::ops::Range;

use crate::grid::{Samples, peak, range};

/// The course of a drive.
#[derive(Clone, Debug, PartialEq)]
pub enum Course {
    /// A load that is held from this time (s) on: creep or relaxation.
    Held(f64),
    /// Cycles of about the same length: from and to which time (s) each one lasts.
    Cycles(Vec<Range<f64>>),
    /// Neither.
    Other,
}

/// A load counts as held while it changes by at most this share of its size.
const STEADY: f64 = 0.02;
/// A held load lasts at least this share of its recording.
const MIN_HELD_SHARE: f64 = 0.6;
/// The middle that a drive must leave on both sides to make a cycle, as a share of its range.
const HYSTERESIS: f64 = 0.2;
/// Fewest cycles that show a drift.
const MIN_CYCLES: usize = 3;
/// How much longer or shorter than their median cycles may be.
const UNEVEN: f64 = 0.2;

impl Course {
    /// The course of `drive`.
    pub fn from_drive(drive: &Samples) -> Self {
        if let Some(since_s) = held_since(drive) {
            return Self::Held(since_s);
        }
        let cycles = cycles(drive);
        if cycles.len() < MIN_CYCLES {
            return Self::Other;
        }
        let mut lengths: Vec<f64> = cycles.iter().map(|cycle| cycle.end - cycle.start).collect();
        lengths.sort_by(f64::total_cmp);
        let median = lengths[lengths.len() / 2];
        let even = lengths.iter().all(|length| (length - median).abs() <= UNEVEN * median);
        if even { Self::Cycles(cycles) } else { Self::Other }
    }
}

/// The time (s) from which on the drive stays at its last value, if it stays there for most of the recording.
fn held_since(drive: &Samples) -> Option<f64> {
    let (&first_s, &last_s, &end) = (drive.time_s.first()?, drive.time_s.last()?, drive.value.last()?);
    let size = peak(&drive.value);
    let since_s = match drive.value.iter().rposition(|value| (value - end).abs() > STEADY * size) {
        // Held from the beginning: the load was applied at 0 on the recording's clock.
        None => 0.0,
        Some(row) => *drive.time_s.get(row + 1)?,
    };
    (last_s - since_s >= MIN_HELD_SHARE * (last_s - first_s)).then_some(since_s)
}

/// From one rise through the middle to the next.
fn cycles(drive: &Samples) -> Vec<Range<f64>> {
    let (low, high) = range(&drive.value);
    let (middle, margin) = (0.5 * (low + high), 0.5 * HYSTERESIS * (high - low));
    let mut rises = Vec::new();
    let mut below = false;
    for (time_s, value) in drive.time_s.iter().zip(&drive.value) {
        if *value < middle - margin {
            below = true;
        } else if *value > middle + margin && below {
            below = false;
            rises.push(*time_s);
        }
    }
    rises.windows(2).map(|pair| pair[0]..pair[1]).collect()
}
