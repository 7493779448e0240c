//! References that a fit has not seen, and the errors along them.

use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::Serialize;

use super::bench::Row;
use crate::references::minimum_jerk;
use crate::statistics::range;

/// Fewest segments whose largest error bounds the 95th percentile at 95 % confidence: 0.95⁵⁹ < 0.05.
pub const MIN_SEGMENTS: usize = 59;

/// Random moves and rests between two displacements.
#[derive(Clone, Debug, PartialEq)]
pub struct Segments {
    /// Values a thousand times a second, m; the moves from 0 and back to it are in no segment.
    pub reference_m: Vec<f64>,
    /// Time of each segment, s.
    pub times_s: Vec<Range<f64>>,
    /// Range of the displacements, m.
    pub range_m: f64,
    /// Where each move ends, m, and how long it takes, s; that back to 0 is the last.
    moves: Vec<(f64, f64)>,
    length_s: f64,
}

/// Values of a reference per second.
pub const RATE_HZ: f64 = 1000.0;
/// Share of the sensor's noise below which no error is seen: the noise itself is not known better.
pub const HIDDEN: f64 = 0.25;
/// Share of its way that a move keeps when it is shortened.
const SHORTENED: f64 = 0.7;

impl Segments {
    /// So many segments from `low_m` to `high_m` in a band up to `band_hz`, drawn from `seed`.
    pub fn random(low_m: f64, high_m: f64, band_hz: f64, count: usize, seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let length_s = 0.8 / band_hz;
        let mut draw = |k| {
            let to_m = if k > count { 0.0 } else { random.random_range(low_m..=high_m) };
            (to_m, length_s * random.random_range(0.5..1.0))
        };
        Self::along((0..count + 2).map(&mut draw).collect(), length_s)
    }

    fn along(moves: Vec<(f64, f64)>, length_s: f64) -> Self {
        let (mut from_m, mut reference_m) = (0.0, Vec::new());
        let samples = (length_s * RATE_HZ).round() as usize;
        for &(to_m, move_s) in &moves {
            let at = |j: usize| from_m + (to_m - from_m) * minimum_jerk(j as f64 / RATE_HZ / move_s);
            reference_m.extend((0..samples).map(at));
            from_m = to_m;
        }
        let segment = |k: usize| (k * samples) as f64 / RATE_HZ..((k + 1) * samples) as f64 / RATE_HZ;
        let ends: Vec<f64> = moves[..moves.len() - 1].iter().map(|(to_m, _)| *to_m).collect();
        let (low_m, high_m) = range(&ends);
        let times_s = (1..ends.len()).map(segment).collect();
        Self { reference_m, times_s, range_m: high_m - low_m, moves, length_s }
    }

    /// These with shorter moves in the segments in which `is_limited` holds for a sample; none where there is no such segment.
    pub fn shortened(&self, is_limited: impl Fn(usize) -> bool) -> Option<Self> {
        let samples = self.reference_m.len() / self.moves.len();
        let mut moves = self.moves.clone();
        for k in 1..moves.len() - 1 {
            if (k * samples..(k + 1) * samples).any(&is_limited) {
                let from_m = self.moves[k - 1].0;
                moves[k].0 = from_m + SHORTENED * (moves[k].0 - from_m);
            }
        }
        (moves != self.moves).then(|| Self::along(moves, self.length_s))
    }

    /// The value at `time_s`, m.
    pub fn at(&self, time_s: f64) -> f64 {
        let place = (time_s * RATE_HZ).max(0.0);
        let (k, share) = (place as usize, place.fract());
        let value = |k: usize| self.reference_m.get(k).or(self.reference_m.last()).copied().unwrap_or(0.0);
        value(k) + share * (value(k + 1) - value(k))
    }

    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        self.reference_m.len() as f64 / RATE_HZ
    }

    /// RMS error of each segment, % of the range, of `rows` that began at 0 s, without the sensor's `noise_m`, but not below [`HIDDEN`] of it.
    pub fn errors_pct(&self, rows: &[Row], noise_m: f64) -> Vec<f64> {
        let Some(first) = rows.first() else { return Vec::new() };
        let error = |row: &Row| row.displacement_m - self.at(row.time_s - first.time_s);
        let of = |times: &Range<f64>| {
            let within: Vec<f64> =
                rows.iter().filter(|row| times.contains(&(row.time_s - first.time_s))).map(error).collect();
            let square = within.iter().map(|e| e * e).sum::<f64>() / within.len() as f64;
            // A segment without rows, or without a reading in one of them, has no error that could be small.
            if square.is_nan() {
                return f64::INFINITY;
            }
            100.0 * (square - noise_m * noise_m).max((HIDDEN * noise_m).powi(2)).sqrt() / self.range_m
        };
        self.times_s.iter().map(of).collect()
    }
}

/// Errors along the segments, in % of their range.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Quality {
    /// How many segments there are.
    pub segments: usize,
    /// RMS error over all.
    pub rms_pct: f64,
    /// RMS error of the worst segment. With [`MIN_SEGMENTS`] it bounds that of 95 % of such segments, at 95 % confidence.
    pub largest_pct: f64,
    /// Interval of the RMS error that was predicted before.
    pub predicted_pct: [f64; 2],
    /// RMS error of each segment.
    pub errors_pct: Vec<f64>,
}

impl Quality {
    /// The quality of segments with these errors.
    pub fn new(errors_pct: Vec<f64>, predicted_pct: [f64; 2]) -> Self {
        let count = errors_pct.len();
        let square = errors_pct.iter().map(|pct| pct * pct).sum::<f64>() / count.max(1) as f64;
        Self {
            segments: count,
            rms_pct: square.sqrt(),
            largest_pct: errors_pct.iter().copied().fold(0.0, f64::max),
            predicted_pct,
            errors_pct,
        }
    }
}
