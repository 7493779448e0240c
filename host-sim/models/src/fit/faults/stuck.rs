//! Readings that stay at one value while the drive moves.

use std::collections::VecDeque;
use std::ops::Range;

use super::super::explained::Course;
use super::{Change, Effect, Fault, SIZE, State};
use crate::statistics::{noise, range};

/// Change of the load, as a share of the largest, that moves any film; at the ends of the readings, where a sensor may be at the end of its
/// range and an amplifier too, a change that moves it away from there.
const MOVES: f64 = 0.3;
const MOVES_AWAY: f64 = 0.55;
/// Range of readings that stay, beside their noise, as a share of the stroke, and its largest size with the noise.
const STAYS: f64 = 2e-3;
const OF_NOISE: f64 = 7.0;
const MAX_LIMIT: f64 = 0.08;
/// Share of the stroke at its ends.
const AT_END: f64 = 0.15;
/// Fewest rows.
const ROWS: usize = 8;

impl State {
    /// The recordings whose reading stays, each with the longest time of that; the film then leaves those rows out.
    pub(super) fn stuck(&mut self) -> Vec<Fault> {
        let mut faults = Vec::new();
        for j in 0..self.blocks.courses.len() {
            let course = &self.blocks.courses[j];
            let parts = stays(course, &self.drives[j], self.blocks.stroke_m);
            let times: Vec<[f64; 2]> =
                parts.iter().map(|rows| [rows.start, rows.end - 1].map(|k| course.time_s[k])).collect();
            let Some([from_s, to_s]) = times.iter().copied().max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))
            else {
                continue;
            };
            let before = self.basis.square();
            let mut state = self.clone();
            for [from_s, to_s] in times {
                let place = |k: usize| state.blocks.places[k];
                let is_in = |k: &usize| place(*k).0 == j && (from_s..=to_s).contains(&place(*k).1);
                let blocks: Vec<usize> = (0..state.blocks.places.len()).filter(is_in).collect();
                if let (Some(first), Some(last)) = (blocks.first(), blocks.last()) {
                    state = state.with(&Change::Without(*first..last + 1));
                }
            }
            let size = self.rms(before - state.basis.square());
            if size < SIZE {
                continue;
            }
            let finding = format!(
                "from {from_s:.1} to {to_s:.1} s the reading is not of the film: it stays at the same value while the drive moves \
                 ({:.2} % of the stroke RMS)",
                100.0 * size
            );
            let advice = "a stuck sensor, one without its target, or a film that no longer follows: empty the readings there (import `blank`), \
                          or end the recording before (`to_s`)";
            faults.push(Fault { file: Some(course.file.clone()), finding, advice, size, effect: Effect::Other });
            *self = state;
        }
        faults
    }
}

/// The rows of `course` in which the reading stays although the load of `drive` moves, the longest parts that have no row in common.
fn stays(course: &Course, drive: &[f64], stroke_m: f64) -> Vec<Range<usize>> {
    let present: Vec<usize> = (0..course.reading.len()).filter(|&k| !course.reading[k].is_nan()).collect();
    let readings: Vec<f64> = present.iter().map(|&k| course.reading[k]).collect();
    let loads: Vec<f64> = present.iter().map(|&k| drive[k] * drive[k]).collect();
    let limit = OF_NOISE * noise(&readings) + STAYS * stroke_m;
    if limit > MAX_LIMIT * stroke_m {
        return Vec::new();
    }
    let (low, high) = range(&readings);
    let (mut reading, mut load) = (Window::default(), Window::default());
    let mut parts: Vec<Range<usize>> = Vec::new();
    let mut from = 0;
    for k in 0..readings.len() {
        reading.push(k, readings[k]);
        load.push(k, loads[k]);
        while reading.range() > limit {
            from += 1;
            reading.from(from);
            load.from(from);
        }
        let is_at_end = (readings[k] - low).min(high - readings[k]) < limit.max(AT_END * stroke_m);
        if k + 1 - from < ROWS || load.range() < if is_at_end { MOVES_AWAY } else { MOVES } {
            continue;
        }
        match parts.last_mut() {
            Some(last) if last.start == from => last.end = k + 1,
            Some(last) if last.end > from => {
                if last.len() < k + 1 - from {
                    *last = from..k + 1;
                }
            }
            _ => parts.push(from..k + 1),
        }
    }
    parts.into_iter().map(|part| present[part.start]..present[part.end - 1] + 1).collect()
}

/// Places of the smallest and the largest value of a window, and of those that follow them as it moves on.
#[derive(Default)]
struct Window {
    least: VecDeque<(usize, f64)>,
    most: VecDeque<(usize, f64)>,
}

impl Window {
    fn push(&mut self, k: usize, value: f64) {
        while self.least.back().is_some_and(|last| last.1 >= value) {
            self.least.pop_back();
        }
        while self.most.back().is_some_and(|last| last.1 <= value) {
            self.most.pop_back();
        }
        self.least.push_back((k, value));
        self.most.push_back((k, value));
    }

    fn from(&mut self, from: usize) {
        for ends in [&mut self.least, &mut self.most] {
            while ends.front().is_some_and(|first| first.0 < from) {
                ends.pop_front();
            }
        }
    }

    fn range(&self) -> f64 {
        self.most.front().zip(self.least.front()).map_or(0.0, |(most, least)| most.1 - least.1)
    }
}
