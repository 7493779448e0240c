//! The course of a drive over time: rest, cycles and their sizes, holds.

use serde::Serialize;

use crate::grid::Samples;
use crate::statistics::sorted;

/// A drive below this share of its peak is at rest.
const REST: f64 = 0.02;
/// A hold that shows creep lasts as long, s.
pub const HOLD_S: f64 = 10.0;
/// A held drive stays within this share of its peak.
const HELD: f64 = 0.02;

/// The course of the drive of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DriveFacts {
    /// Largest size.
    pub peak: f64,
    /// Time at rest before it begins, s.
    pub rest_s: f64,
    /// Cycles in their order.
    #[serde(skip)]
    pub cycles: Vec<Cycle>,
    /// Frequencies that differ by a fifth at least, Hz; rising.
    pub frequencies_hz: Vec<f64>,
    /// Peaks that differ by a fifth at least; rising.
    pub amplitudes: Vec<f64>,
    /// The longest time at one level above rest, s.
    pub hold_s: f64,
}

/// A swing of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Twice the time above its half height, s.
    pub period_s: f64,
    /// Its largest size.
    pub peak: f64,
    /// From its trough to below its half height, s.
    pub span_s: (f64, f64),
}

impl DriveFacts {
    /// The facts of `drive`, at least two samples.
    pub fn new(drive: &Samples) -> Self {
        let size: Vec<f64> = drive.value.iter().map(|value| value.abs()).collect();
        let time = &drive.time_s;
        let peak = size.iter().copied().fold(0.0, f64::max);
        let first = time.first().copied().unwrap_or(0.0);
        let begins = size.iter().position(|value| *value > REST * peak);
        let rest_s = begins.map_or(0.0, |k| time[k.saturating_sub(1)] - first);
        let cycles = cycles(time, &size, peak);
        let (hold_s, held_at) = longest_hold(time, &size, peak, &cycles);
        let frequencies_hz = distinct(cycles.iter().map(|cycle| 1.0 / cycle.period_s));
        // A hold is an amplitude as well.
        let held_at = held_at.filter(|_| hold_s >= HOLD_S);
        let amplitudes = distinct(cycles.iter().map(|cycle| cycle.peak).chain(held_at));
        Self { peak, rest_s, cycles, frequencies_hz, amplitudes, hold_s }
    }
}

/// Swings: up from a trough by a fifth of `peak` and down again by half of their height.
fn cycles(time: &[f64], size: &[f64], peak: f64) -> Vec<Cycle> {
    let mut cycles = Vec::new();
    let (mut trough, mut top) = (0, None);
    for k in 0..size.len() {
        match top {
            None if size[k] <= size[trough] => trough = k,
            None if size[k] > size[trough] + 0.2 * peak => top = Some(k),
            None => {}
            Some(highest) if size[k] > size[highest] => top = Some(k),
            Some(highest) if size[k] < 0.5 * (size[trough] + size[highest]) => {
                cycles.extend(cycle(&time[trough..=k], &size[trough..=k]));
                (trough, top) = (k, None);
            }
            Some(_) => {}
        }
    }
    cycles
}

/// The cycle of a swing from its trough to below its half height. A sine is above that for half of its period, whatever comes before
/// and after it; what stays on top for long is a hold.
fn cycle(time: &[f64], size: &[f64]) -> Option<Cycle> {
    let highest = size.iter().copied().fold(0.0, f64::max);
    let height = highest - size[0];
    let half = size[0] + 0.5 * height;
    let crossing = |k: usize| {
        let share = (half - size[k - 1]) / (size[k] - size[k - 1]);
        time[k - 1] + share * (time[k] - time[k - 1])
    };
    let up = (1..size.len()).find(|&k| size[k] >= half)?;
    let width_s = crossing(size.len() - 1) - crossing(up);
    let on_top = |k: usize| size[k] > highest - 0.02 * height;
    let top_s: f64 = (1..size.len()).filter(|&k| on_top(k - 1) && on_top(k)).map(|k| time[k] - time[k - 1]).sum();
    let span_s = (time[0], time[time.len() - 1]);
    (width_s > 0.0 && top_s < 0.5 * width_s).then_some(Cycle { period_s: 2.0 * width_s, peak: highest, span_s })
}

/// The longest time at one level, and that level. The top of a cycle does not count.
fn longest_hold(time: &[f64], size: &[f64], peak: f64, cycles: &[Cycle]) -> (f64, Option<f64>) {
    let in_a_cycle = |from: f64, to: f64| cycles.iter().any(|cycle| cycle.span_s.0 <= from && to <= cycle.span_s.1);
    let (mut start, mut low, mut high) = (0, f64::INFINITY, f64::NEG_INFINITY);
    let mut longest = (0.0, None);
    for (k, value) in size.iter().enumerate() {
        (low, high) = (low.min(*value), high.max(*value));
        if high - low > HELD * peak || *value < 0.1 * peak {
            (start, low, high) = (k, *value, *value);
        }
        let held = time[k] - time[start];
        if held > longest.0 && size[start] >= 0.1 * peak && !in_a_cycle(time[start], time[k]) {
            longest = (held, Some(*value));
        }
    }
    longest
}

/// Values that differ by a fifth at least, rising.
pub fn distinct(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut kept: Vec<f64> = Vec::new();
    for value in sorted(values) {
        if kept.last().is_none_or(|last| value > 1.2 * last) {
            kept.push(value);
        }
    }
    kept
}
