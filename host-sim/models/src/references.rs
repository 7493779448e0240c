//! References to follow: sines, triangles, steps and a random walk, with smooth starts and edges.

use std::f64::consts::TAU;

use host_io::choice;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use crate::error::{Error, Result};
use crate::files::recording::Recording;
use crate::grid::Grid;
use crate::quantity::positive;
use crate::statistics::{self, range};

/// The displacement of `recording` as a reference, on its grid at `rate_hz`.
///
/// # Errors
///
/// [`Error`] naming the file where it has no displacement, gaps, or one that no film reaches.
pub fn on_grid(recording: &Recording, rate_hz: f64) -> Result<(Vec<f64>, Grid)> {
    let path = recording.path();
    let grid = recording.grid(rate_hz)?;
    if grid.samples < 2 {
        return Err(Error::file(path, format!("shorter than a step at {rate_hz:?} Hz; raise `rate_hz`")));
    }
    let values = grid.resample(recording.displacement_drive()?.samples());
    if let Some(far) = values.iter().find(|x| x.abs() >= MAX_REACH_M) {
        let cause = format!("a displacement of {far} m is no stroke of a film; check the unit in the column's name");
        return Err(Error::file(path, cause));
    }
    Ok((values, grid))
}

choice! {
    /// Shape of a reference.
    pub enum Shape {
        /// Sine from its trough.
        Sine = "sine",
        /// Triangle from its trough, corners rounded.
        Triangle = "triangle",
        /// Plateaus of equal length at low, high, middle, low, …
        Steps = "steps",
        /// Band-limited random walk.
        RandomWalk = "random-walk",
    }
}

/// A reference between two displacements, which begins with a rise from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Shape.
    pub shape: Shape,
    /// Lowest displacement after the rise, m.
    pub low_m: f64,
    /// Highest displacement, m.
    pub high_m: f64,
    /// Length of a period, of a plateau with its edge, or the shortest period in a random walk, s.
    pub period_s: f64,
    /// Length of the rise and of edges, s. Minimum jerk: finite acceleration throughout.
    pub rise_s: f64,
    /// Seed of a random walk.
    pub seed: u64,
}

/// Displacement from which it is in another unit, m.
const MAX_REACH_M: f64 = 0.5;
const MAX_SAMPLES: usize = 20_000_000;
/// The longest period, s. A random walk runs for twenty periods before its first sample.
const MAX_PERIOD_S: f64 = 1e5;

impl Reference {
    /// A reference with a rise of 5 s.
    pub fn new(shape: Shape, low_m: f64, high_m: f64, period_s: f64) -> Self {
        Self { shape, low_m, high_m, period_s, rise_s: 5.0, seed: 1 }
    }

    /// Its values (m) over `duration_s` at `rate_hz`, with a rise of `rise_s`; if that is left out, as long as usual, or a quarter of a
    /// shorter reference and half a plateau.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] for sizes and times that make no sense.
    pub fn over(self, duration_s: f64, rate_hz: f64, rise_s: Option<f64>) -> Result<(Vec<f64>, Grid)> {
        positive("duration_s", duration_s)?;
        positive("rate_hz", rate_hz)?;
        let grid = Grid::covering(duration_s, rate_hz)?;
        if !(2..=MAX_SAMPLES).contains(&grid.samples) {
            let cause = format!("{} samples at this rate; from 2 to {MAX_SAMPLES} are possible", grid.samples);
            return Err(Error::field("duration_s", cause));
        }
        let plateau = if self.shape == Shape::Steps { 0.5 * self.period_s } else { f64::INFINITY };
        let rise_s = rise_s.unwrap_or_else(|| self.rise_s.min(0.25 * duration_s).min(plateau));
        Ok((Self { rise_s, ..self }.on(grid)?, grid))
    }

    /// Its values on `grid`, m.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] for sizes and times that make no sense.
    pub fn on(&self, grid: Grid) -> Result<Vec<f64>> {
        let Self { low_m, high_m, period_s, rise_s, .. } = *self;
        for (option, value_m) in [("low_m", low_m), ("high_m", high_m)] {
            if !value_m.is_finite() || value_m.abs() >= MAX_REACH_M {
                let cause = format!("{value_m:?} m is no stroke of a film; if it is in millimetres, write {value_m}mm");
                return Err(Error::field(option, cause));
            }
        }
        if low_m >= high_m {
            return Err(Error::field("low_m", format!("{low_m:?} m must be below `high_m` {high_m:?} m")));
        }
        for (option, value) in [("period_s", period_s), ("rise_s", rise_s)] {
            positive(option, value)?;
        }
        if !(2.0 * grid.step_s()..=MAX_PERIOD_S).contains(&period_s) {
            let cause = format!("{period_s:?} s must be from two samples to {MAX_PERIOD_S} s");
            return Err(Error::field("period_s", cause));
        }
        let duration_s = grid.time_s(grid.samples - 1);
        if rise_s > duration_s {
            let cause = format!("{rise_s:?} s is longer than the reference, {duration_s:?} s: it would never arrive");
            return Err(Error::field("rise_s", cause));
        }
        if self.shape == Shape::Steps && rise_s > period_s {
            let cause = format!(
                "{rise_s:?} s is longer than a plateau with its edge, {period_s:?} s: it would jump; use at most {period_s:?} s"
            );
            return Err(Error::field("rise_s", cause));
        }
        let span = high_m - low_m;
        if self.shape == Shape::RandomWalk {
            return Ok(self.random_walk(grid));
        }
        let after = |t: f64| match self.shape {
            Shape::Sine => 0.5 * (1.0 - (TAU * t / period_s).cos()),
            Shape::Triangle => rounded_triangle(t / period_s),
            _ => self.plateaus(t),
        };
        Ok((0..grid.samples)
            .map(|k| {
                let t = grid.time_s(k);
                if t < rise_s { low_m * minimum_jerk(t / rise_s) } else { low_m + span * after(t - rise_s) }
            })
            .collect())
    }

    /// Plateaus, 0 to 1.
    fn plateaus(&self, t: f64) -> f64 {
        const LEVELS: [f64; 4] = [0.0, 1.0, 0.5, 0.75];
        let number = (t / self.period_s) as usize;
        let level = |n: usize| LEVELS[n % LEVELS.len()];
        let into = t - number as f64 * self.period_s;
        let before = if number == 0 { level(0) } else { level(number - 1) };
        before + (level(number) - before) * minimum_jerk(into / self.rise_s)
    }

    /// Noise through four low-passes, scaled into the range.
    fn random_walk(&self, grid: Grid) -> Vec<f64> {
        let mut random = Pcg64::seed_from_u64(self.seed);
        let share = -(-TAU * grid.step_s() / self.period_s).exp_m1();
        let mut stages = [0.0; 4];
        let warm_up = (20.0 * self.period_s * grid.rate_hz) as usize;
        let mut walk = Vec::with_capacity(grid.samples);
        for k in 0..warm_up + grid.samples {
            let mut input: f64 = StandardNormal.sample(&mut random);
            for stage in &mut stages {
                *stage += share * (input - *stage);
                input = *stage;
            }
            if k >= warm_up {
                walk.push(input);
            }
        }
        let (low, high) = range(&walk);
        let rise = self.rise_s;
        let scaled = walk.iter().map(|x| self.low_m + (self.high_m - self.low_m) * (x - low) / (high - low));
        scaled.enumerate().map(|(k, x)| x * minimum_jerk(grid.time_s(k) / rise)).collect()
    }
}

/// From 0 to 1 while `share` grows from 0 to 1, with the least jerk.
pub fn minimum_jerk(share: f64) -> f64 {
    let s = share.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// A triangle of period 1 from 0 to 1 whose corners are parabolas over a tenth of the period.
fn rounded_triangle(turns: f64) -> f64 {
    const ROUND: f64 = 0.05;
    let phase = turns - turns.floor();
    let half = if phase <= 0.5 { phase } else { 1.0 - phase };
    let from_corner = half.min(0.5 - half);
    let rounded = if from_corner < ROUND { 0.5 * (from_corner * from_corner / ROUND + ROUND) } else { from_corner };
    let value = if half <= 0.25 { rounded } else { 0.5 - rounded };
    (value - 0.5 * ROUND) / (0.5 - ROUND)
}

/// The part of a series that repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Periods {
    /// Sample at which the first period begins.
    pub start: usize,
    /// Samples of a period.
    pub length: usize,
    /// Full periods.
    pub count: usize,
}

impl Periods {
    /// The shortest period of `series` that holds for its last half, and how far back it holds; at least two periods.
    pub fn from_series(series: &[f64]) -> Option<Self> {
        let (low, high) = range(series);
        let tolerance = 1e-3 * (high - low);
        if series.len() < 8 || tolerance <= 0.0 {
            return None;
        }
        let middle = series.len() / 2;
        // Far coarser than any period that is to be found.
        let stride = (series.len() / 2000).max(1);
        let differs = |lag: usize, from: usize, stride: usize| {
            (from..series.len()).step_by(stride).any(|k| (series[k] - series[k - lag]).abs() > tolerance)
        };
        let mut away = false;
        for lag in 1..=middle {
            let gone = differs(lag, middle, stride);
            // A slow series resembles itself at short lags: the difference must grow before it vanishes.
            away |=
                (middle..series.len()).step_by(stride).any(|k| (series[k] - series[k - lag]).abs() > 100.0 * tolerance);
            if !away || gone || differs(lag, middle, 1) {
                continue;
            }
            // Best among the neighbours that hold.
            let distance = |lag: usize| -> f64 {
                (middle..series.len()).step_by(stride).map(|k| (series[k] - series[k - lag]).powi(2)).sum()
            };
            let length =
                (lag..=(lag + lag / 50 + 1).min(middle)).min_by(|a, b| distance(*a).total_cmp(&distance(*b)))?;
            let first = (length..series.len()).rev().find(|&k| (series[k] - series[k - length]).abs() > tolerance);
            let start = first.map_or(0, |k| k + 1 - length);
            let count = (series.len() - start) / length;
            return (count >= 2).then_some(Self { start, length, count });
        }
        None
    }

    /// Mean of the last full period of `series` minus that of the first.
    pub fn drift(&self, series: &[f64]) -> f64 {
        let mean = |from: usize| statistics::mean(&series[from..from + self.length]);
        mean(self.start + (self.count - 1) * self.length) - mean(self.start)
    }
}
