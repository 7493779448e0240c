//! A linear model of any film along recordings, and the part of the readings that it leaves unexplained.
//!
//! The readings are a sum of filtered loads: of the load, its square and its cube, each through first-order filters whose times cover the
//! recording, and of powers of that sum. Films of any law come out within a fraction of a per cent of their stroke, without a search; what a
//! fault adds to the readings does not.

use std::ops::Range;
use std::{array, iter};

use super::observation::Observation;
use crate::files::recording::{Input, Recording};
use crate::least_squares::dot;
use crate::statistics::{differences, median, peak, percentile_range, range, robust_deviation};

/// Ratio of neighbouring filter times.
const RATIO: f64 = 3.0;
/// Most blocks of rows in all recordings.
const BLOCKS: usize = 1200;
/// Longest block and shortest filter time in periods of the fastest cycle: means over more of it show less, over a whole one nothing.
const PERIOD: f64 = 0.25;
const FILTER: f64 = 0.02;
/// Fraction by which places of blocks in their parts of a recording move on, so that no cycle is met in the same phase every time.
const GOLDEN: f64 = 0.618_033_988_749_895;
/// Part of a column that must be new beside the others.
const NEW: f64 = 1e-5;

/// A recording with a load and readings.
#[derive(Clone)]
pub(crate) struct Course {
    pub(super) file: String,
    pub(super) time_s: Vec<f64>,
    /// Voltage or force, as a share of the largest of all recordings.
    pub(super) drive: Vec<f64>,
    pub(super) is_voltage: bool,
    /// Reading of each row, m; NaN where it is missing or an outlier.
    pub(super) reading: Vec<f64>,
}

/// Recordings in parts of as many rows, each with a block of rows that count.
#[derive(Clone)]
pub(super) struct Blocks {
    pub(super) courses: Vec<Course>,
    /// Rows of a part, and of its block.
    part: usize,
    rows: usize,
    /// Interval of the rows, and period of the fastest cycle; infinite without cycles.
    step_s: f64,
    period_s: f64,
    /// Recording and time of each block that has readings.
    pub(super) places: Vec<(usize, f64)>,
    /// Mean reading of each, m.
    pub(super) reading: Vec<f64>,
    /// 0 for blocks that are left out, otherwise 1.
    pub(super) kept: Vec<f64>,
    /// Range of the readings without outliers, m.
    pub(super) stroke_m: f64,
}

/// Orthonormal columns, and what they leave of the readings.
#[derive(Clone)]
pub(super) struct Basis {
    columns: Vec<Vec<f64>>,
    /// 0 for blocks that are left out, otherwise 1.
    kept: Vec<f64>,
    /// Part of a column that must be new beside the others.
    new: f64,
    pub(super) rest: Vec<f64>,
}

impl Basis {
    pub(super) fn new(reading: &[f64], kept: &[f64], new: f64) -> Self {
        Self { columns: Vec::new(), kept: kept.to_vec(), new, rest: product(reading, kept) }
    }

    /// Adds `column`, if it is not a sum of the others, and returns how much of it the readings have beside those.
    pub(super) fn add(&mut self, column: &[f64]) -> f64 {
        let Some((unit, left)) = self.beside(column, &[]) else { return 0.0 };
        let share = dot(&self.rest, &unit);
        subtract(&mut self.rest, &unit);
        self.columns.push(unit);
        share / left
    }

    pub(super) fn extend<'a>(&mut self, columns: impl IntoIterator<Item = &'a Vec<f64>>) {
        for column in columns {
            self.add(column);
        }
    }

    /// The part of `column` that is no sum of the others and `more`, as a unit vector, and its length; none where there is no such part.
    fn beside(&self, column: &[f64], more: &[Vec<f64>]) -> Option<(Vec<f64>, f64)> {
        let mut column = product(column, &self.kept);
        let size = norm(&column);
        for _ in 0..2 {
            self.columns.iter().chain(more).for_each(|other| subtract(&mut column, other));
        }
        let left = norm(&column);
        column.iter_mut().for_each(|value| *value /= left);
        (left > self.new * size).then_some((column, left))
    }

    /// Sum of squares of what is left.
    pub(super) fn square(&self) -> f64 {
        dot(&self.rest, &self.rest)
    }

    /// Sum of squares of what is left with `columns` added.
    pub(super) fn square_with(&self, columns: &[Vec<f64>]) -> f64 {
        let (mut more, mut rest) = (Vec::new(), self.rest.clone());
        for column in columns {
            if let Some((unit, _)) = self.beside(column, &more) {
                subtract(&mut rest, &unit);
                more.push(unit);
            }
        }
        dot(&rest, &rest)
    }
}

fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

fn norm(values: &[f64]) -> f64 {
    dot(values, values).sqrt()
}

fn subtract(values: &mut [f64], unit: &[f64]) {
    let share = dot(values, unit);
    values.iter_mut().zip(unit).for_each(|(value, unit)| *value -= share * unit);
}

impl Course {
    /// The course of `recording`; none where it has no drive or no readings.
    pub(crate) fn new(recording: &Recording, file: String) -> Option<Self> {
        let drive = recording.drive().ok()?;
        let is_voltage = matches!(drive, Input::Voltage(_));
        let reading = recording.columns().into_iter().find(|(name, _)| *name == "displacement_m")?.1;
        let mut course = Self {
            file,
            time_s: recording.time_s().to_vec(),
            drive: drive.samples().value.clone(),
            is_voltage,
            reading,
        };
        if let Some(drop_outs) = recording.drop_outs() {
            drop_outs.rows.into_iter().for_each(|row| course.reading[row] = f64::NAN);
        }
        Some(course.cleaned())
    }

    /// The course of `observation` in every so many of its rows; none where a displacement drives it.
    pub(super) fn from_observation(observation: &Observation, every: usize) -> Option<Self> {
        let Observation { name, input, measured, sample_weights, .. } = observation;
        let is_voltage = matches!(input, Input::Voltage(_));
        let some = |values: &[f64]| values.iter().copied().step_by(every).collect::<Vec<f64>>();
        let (time_s, drive) = (some(&input.samples().time_s), some(&input.samples().value));
        let mut reading = vec![f64::NAN; time_s.len()];
        for (k, (t, value)) in measured.time_s.iter().zip(&measured.value).enumerate() {
            let weighs = sample_weights.get(k).is_none_or(|weight| *weight > 0.0);
            if let Ok(row) = time_s.binary_search_by(|time| time.total_cmp(t))
                && weighs
            {
                reading[row] = *value;
            }
        }
        let course = Self { file: name.clone(), time_s, drive, is_voltage, reading };
        (!matches!(input, Input::Displacement(_))).then(|| course.cleaned())
    }

    fn cleaned(mut self) -> Self {
        self.leave_out_ends();
        self.leave_out_outliers();
        self
    }

    /// Empties readings that stay at the largest or the smallest one under a load: they have a line of their own.
    fn leave_out_ends(&mut self) {
        const REST: f64 = 0.03;
        const RUN: usize = 4;
        let load = self.load(&self.drive);
        let rest = REST * peak(&load);
        let (low, high) = range(&self.reading.iter().copied().filter(|value| !value.is_nan()).collect::<Vec<f64>>());
        for end in [low, high] {
            let is_at_end: Vec<bool> =
                self.reading.iter().zip(&load).map(|(value, load)| *value == end && load.abs() > rest).collect();
            let runs = is_at_end.chunk_by(|a, b| a == b).filter(|run| run[0] && run.len() >= RUN);
            if 50 * runs.map(<[bool]>::len).sum::<usize>() > self.reading.len() {
                let at_end = self.reading.iter_mut().zip(&is_at_end).filter(|(_, is_at_end)| **is_at_end);
                at_end.for_each(|(value, _)| *value = f64::NAN);
            }
        }
    }

    /// Empties readings that are far from the median of those around them.
    fn leave_out_outliers(&mut self) {
        let present: Vec<usize> = (0..self.reading.len()).filter(|&k| !self.reading[k].is_nan()).collect();
        let values: Vec<f64> = present.iter().map(|&k| self.reading[k]).collect();
        let off: Vec<f64> = values.windows(7).map(|near| near[3] - median(near)).collect();
        let limit = (8.0 * robust_deviation(&off)).max(0.02 * percentile_range(values.into_iter()));
        for (k, off) in off.iter().enumerate() {
            if off.abs() > limit {
                self.reading[present[k + 3]] = f64::NAN;
            }
        }
    }

    /// The load: V² or force, as a share of the largest.
    fn load(&self, drive: &[f64]) -> Vec<f64> {
        if self.is_voltage { drive.iter().map(|v| v * v).collect() } else { drive.to_vec() }
    }
}

/// Filters whose values are computed together.
const LANES: usize = 8;

/// A load through first-order filters, each of a time of its own, at rest before it was applied at time 0.
struct Filters {
    tau_s: [f64; LANES],
    step_s: f64,
    decays: [f64; LANES],
    /// 1 minus the decay, and what a change of the load within the step has of it.
    rises: [f64; LANES],
    ramps: [f64; LANES],
    values: [f64; LANES],
}

impl Filters {
    fn new(tau_s: [f64; LANES], time_s: f64, load: f64) -> Self {
        let values = tau_s.map(|tau_s| load * (1.0 - (-time_s / tau_s).exp()));
        Self { tau_s, step_s: 0.0, decays: [1.0; LANES], rises: [0.0; LANES], ramps: [0.0; LANES], values }
    }

    /// A step of `step_s`, in which the load changes linearly: exact.
    #[inline]
    fn step(&mut self, step_s: f64, [before, load]: [f64; 2]) {
        if (step_s - self.step_s).abs() > 1e-6 * step_s {
            self.step_s = step_s;
            self.decays = self.tau_s.map(|tau_s| (-step_s / tau_s).exp());
            self.rises = self.decays.map(|decay| 1.0 - decay);
            self.ramps = array::from_fn(|lane| 1.0 - self.rises[lane] * self.tau_s[lane] / step_s);
        }
        for lane in 0..LANES {
            let kept = self.decays[lane] * self.values[lane] + self.rises[lane] * before;
            self.values[lane] = kept + (load - before) * self.ramps[lane];
        }
    }
}

impl Blocks {
    /// Joins `courses`, whose drives become shares of the largest, and whose fastest cycle is of `period_s`; none without readings that move.
    pub(super) fn new(mut courses: Vec<Course>, period_s: f64) -> Option<Self> {
        let peak = courses.iter().map(|course| peak(&course.drive)).fold(0.0, f64::max);
        courses.iter_mut().flat_map(|course| &mut course.drive).for_each(|value| *value /= peak);
        let total: usize = courses.iter().map(|course| course.time_s.len()).sum();
        let steps = courses.iter().flat_map(|course| differences(&course.time_s));
        let step_s = median(&steps.collect::<Vec<f64>>());
        let part = total.div_ceil(BLOCKS).max(1);
        let rows = part.min((PERIOD * period_s / step_s) as usize).max(1);
        let (places, reading, kept) = (Vec::new(), Vec::new(), Vec::new());
        let mut blocks = Self { courses, part, rows, step_s, period_s, places, reading, kept, stroke_m: 0.0 };
        let readings: Vec<Vec<f64>> = blocks.courses.iter().map(|course| course.reading.clone()).collect();
        let times: Vec<Vec<f64>> = blocks.courses.iter().map(|course| course.time_s.clone()).collect();
        blocks.reading = blocks.means(&readings);
        let recordings: Vec<Vec<f64>> = times.iter().enumerate().map(|(j, t)| vec![j as f64; t.len()]).collect();
        let (times, recordings) = (blocks.means(&times), blocks.means(&recordings));
        blocks.places = recordings.into_iter().map(|j| j as usize).zip(times).collect();
        blocks.kept = vec![1.0; blocks.reading.len()];
        blocks.stroke_m = percentile_range(blocks.reading.iter().copied());
        (blocks.stroke_m > 0.0 && peak > 0.0 && blocks.reading.len() > 100).then_some(blocks)
    }

    /// The recordings with the rows of each in the reverse order, if enough of them have readings.
    pub(super) fn reversed(&self) -> Option<Self> {
        let mut courses = self.courses.clone();
        for course in &mut courses {
            let last_s = course.time_s[course.time_s.len() - 1];
            course.time_s = course.time_s.iter().rev().map(|t| last_s - t).collect();
            course.drive.reverse();
            course.reading.reverse();
        }
        Self::new(courses, self.period_s)
    }

    /// The rows of each block of a recording of so many `rows`.
    fn blocks(&self, rows: usize) -> impl Iterator<Item = Range<usize>> + use<> {
        let (part, block) = (self.part, self.rows);
        (0..rows.div_ceil(part)).map(move |k| {
            let from = k * part + ((part - block) as f64 * (k as f64 * GOLDEN).fract()) as usize;
            from.min(rows)..(from + block).min(rows)
        })
    }

    /// Means over the blocks of one value for each row of each recording, of the rows that have a reading.
    pub(super) fn means(&self, values: &[Vec<f64>]) -> Vec<f64> {
        let mut means = Vec::new();
        for (course, values) in self.courses.iter().zip(values) {
            for block in self.blocks(values.len()) {
                let rows = course.reading[block.clone()].iter().zip(&values[block]);
                let present = rows.filter(|(reading, _)| !reading.is_nan());
                let (count, sum) = present.fold((0, 0.0), |(count, sum), (_, value)| (count + 1, sum + value));
                if count > 0 {
                    means.push(sum / f64::from(count));
                }
            }
        }
        means
    }

    /// The same of `loads` through filters of each of these times (s).
    fn filtered_means(&self, loads: &[Vec<f64>], taus_s: &[f64]) -> Vec<Vec<f64>> {
        let together = |some: &[f64]| {
            let tau_s = array::from_fn(|lane| some[lane.min(some.len() - 1)]);
            let mut means: [Vec<f64>; LANES] = array::from_fn(|_| Vec::with_capacity(self.reading.len()));
            for (Course { time_s, reading, .. }, load) in self.courses.iter().zip(loads) {
                let mut filters = Filters::new(tau_s, time_s[0], load[0]);
                let mut from = 0;
                for block in self.blocks(reading.len()) {
                    let (mut count, mut sums) = (0, [0.0; LANES]);
                    for k in from..block.end {
                        if k > 0 {
                            filters.step(time_s[k] - time_s[k - 1], [load[k - 1], load[k]]);
                        }
                        if k >= block.start && !reading[k].is_nan() {
                            count += 1;
                            sums.iter_mut().zip(filters.values).for_each(|(sum, value)| *sum += value);
                        }
                    }
                    if count > 0 {
                        means.iter_mut().zip(sums).for_each(|(means, sum)| means.push(sum / f64::from(count)));
                    }
                    from = block.end;
                }
            }
            means.into_iter().take(some.len())
        };
        taus_s.chunks(LANES).flat_map(together).collect()
    }

    /// The film that follows `drives`, one for each recording.
    pub(super) fn film(&self, drives: &[Vec<f64>]) -> Basis {
        self.film_from(drives, self.shortest_s(), 3)
    }

    /// The film that follows the load itself, without its square and cube.
    pub(super) fn plain_film(&self, drives: &[Vec<f64>]) -> Basis {
        self.film_from(drives, self.shortest_s(), 1)
    }

    /// The time (s) by which the stroke lags `drives` beside what creeps in `shortest_s` or more, and beside the `added` columns; and the sum
    /// of squares that is left.
    pub(super) fn lag_s(&self, drives: &[Vec<f64>], added: &[Vec<f64>], shortest_s: f64) -> (f64, f64) {
        let (loads, tau_s) = (self.loads(drives), self.shortest_s());
        let behind = self.filtered_means(&loads, &[tau_s]).concat();
        let slopes: Vec<f64> =
            self.means(&loads).iter().zip(behind).map(|(load, behind)| (behind - load) / tau_s).collect();
        let mut film = self.film_from(drives, shortest_s, 3);
        film.extend(added);
        (film.add(&slopes) / self.stroke_m, film.square())
    }

    /// The film of which nothing creeps in less than `shortest_s`, and which follows so many powers of the load.
    fn film_from(&self, drives: &[Vec<f64>], shortest_s: f64, powers: i32) -> Basis {
        let longest_s = self.longest_s();
        let mut basis = Basis::new(&self.reading, &self.kept, NEW);
        basis.add(&vec![1.0; self.reading.len()]);
        let loads = self.loads(drives);
        for power in 1..=powers {
            let loads: Vec<Vec<f64>> =
                loads.iter().map(|load| load.iter().map(|value| value.powi(power)).collect()).collect();
            basis.add(&self.means(&loads));
            let ratio = if power == 1 { RATIO } else { RATIO * RATIO };
            let taus_s = iter::successors(Some(shortest_s), |tau_s| Some(tau_s * ratio));
            let taus_s: Vec<f64> = taus_s.take_while(|tau_s| *tau_s < 3.0 * longest_s).collect();
            basis.extend(&self.filtered_means(&loads, &taus_s));
        }
        // A film whose stiffness depends on the stroke.
        let film = self.modelled(&basis);
        let load = self.means(&loads);
        basis.extend(&[
            film.iter().map(|x| x * x).collect(),
            film.iter().map(|x| x * x * x).collect(),
            film.iter().zip(&load).map(|(x, u)| x * u).collect(),
        ]);
        basis
    }

    fn loads(&self, drives: &[Vec<f64>]) -> Vec<Vec<f64>> {
        self.courses.iter().zip(drives).map(|(course, drive)| course.load(drive)).collect()
    }

    fn longest_s(&self) -> f64 {
        self.courses.iter().map(|course| course.time_s[course.time_s.len() - 1]).fold(0.0, f64::max)
    }

    /// The shortest filter time: what a cycle of the drive still shows.
    fn shortest_s(&self) -> f64 {
        (2.0 * self.step_s).max((1e-4 * self.longest_s()).min(FILTER * self.period_s))
    }

    /// The modelled reading of each block as a share of the stroke.
    pub(super) fn modelled(&self, basis: &Basis) -> Vec<f64> {
        self.reading.iter().zip(&basis.rest).map(|(reading, rest)| (reading - rest) / self.stroke_m).collect()
    }
}
