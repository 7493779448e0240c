//! Least squares of the modelled voltage, as the monitor shows it, against the monitor.

use rayon::prelude::*;
use springpot::AmplifierLag;

use super::response::{Command, Fall};
use crate::files::amplifier_log::AmplifierLog;
use crate::least_squares::{Minimum, Problem, StoppingCriteria, minimise};

/// The fitted values, in this order: time constants (s), voltage at the first row (V), the monitor's gain and offset (V), and [shifts](Command) of
/// the jumps.
pub(super) type Values = Vec<f64>;
pub(super) const RISE: usize = 0;
pub(super) const FALL: usize = 1;
const START: usize = 2;
pub(super) const GAIN: usize = 3;
pub(super) const OFFSET: usize = 4;
const SHIFTS: usize = 5;

/// Longest time constant, s: that of the controller's model.
pub(super) const MAX_S: f64 = 10.0;
/// The monitor's gain: beyond it the calibration is of something else.
const GAINS: (f64, f64) = (0.2, 5.0);
/// Time constants from which searches start, s: on a logarithmic grid.
const STARTS_S: (f64, f64, usize) = (1e-3, 2.0, 8);
/// So many of the starts with the smallest error are searched, first in a few steps.
const SEARCHED: usize = 6;
const FEW: StoppingCriteria = StoppingCriteria { iterations: 8, decrease: 1e-6 };
const UNTIL_DONE: StoppingCriteria = StoppingCriteria { iterations: 60, decrease: 1e-9 };
/// A pull that keeps what the log does not determine where it is, as a share of the command's span.
const PULL: f64 = 1e-6;

/// A log and the model that is fitted to it.
pub(super) struct Search<'a> {
    pub(super) log: &'a AmplifierLog,
    pub(super) command: Command<'a>,
    pub(super) fall: Fall,
    span_v: f64,
}

#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) values: Values,
    /// The free values, and their Jᵀ J.
    pub(super) free: Vec<usize>,
    pub(super) minimum: Minimum,
}

impl<'a> Search<'a> {
    pub(super) fn new(log: &'a AmplifierLog, fall: Fall) -> Self {
        Self { log, command: Command::new(log), fall, span_v: log.span_v() }
    }

    /// The best fit over all starts; none where no start leads anywhere.
    pub(super) fn best(&self) -> Option<Found> {
        let (shortest, longest, count) = STARTS_S;
        let grid: Vec<f64> =
            (0..count).map(|k| shortest * (longest / shortest).powf(k as f64 / (count - 1) as f64)).collect();
        let pairs: Vec<(f64, f64)> = grid.iter().flat_map(|&rise| grid.iter().map(move |&fall| (rise, fall))).collect();
        let mut starts: Vec<(f64, Values)> =
            pairs.par_iter().filter_map(|&(rise, fall)| self.start(rise, fall)).collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts.truncate(SEARCHED);
        let free: Vec<usize> = (0..SHIFTS + self.command.shifts).collect();
        let rough = starts.iter().filter_map(|(_, start)| self.refined(start, &free, FEW));
        let best = rough.min_by(|a, b| a.minimum.cost.total_cmp(&b.minimum.cost))?;
        self.refined(&best.values, &free, UNTIL_DONE)
    }

    /// `found` with variable `index` held at `value`: its cost.
    pub(super) fn cost_with(&self, found: &Found, index: usize, value: f64) -> Option<f64> {
        let mut values = found.values.clone();
        values[index] = value;
        let free: Vec<usize> = found.free.iter().copied().filter(|&i| i != index).collect();
        Some(self.refined(&values, &free, UNTIL_DONE)?.minimum.cost)
    }

    /// The monitor's reading (V) at every row by the model.
    pub(super) fn shown(&self, values: &[f64]) -> Option<Vec<f64>> {
        let voltage = self.voltages(values)?;
        Some(voltage.into_iter().map(|volts| values[GAIN] * volts + values[OFFSET]).collect())
    }

    /// Model minus monitor (V), where the monitor gave a reading.
    pub(super) fn residuals(&self, values: &[f64]) -> Option<Vec<f64>> {
        let shown = self.shown(values)?;
        Some(shown.iter().zip(&self.log.monitor_v).map(|(shown, read)| shown - read).filter(|r| !r.is_nan()).collect())
    }

    fn voltages(&self, values: &[f64]) -> Option<Vec<f64>> {
        let lag = AmplifierLag { rise_s: values[RISE], fall_s: values[FALL] };
        self.command.voltages(lag, self.fall, values[START], &values[SHIFTS..])
    }

    /// The values of a search that starts with these time constants, and their error: gain and offset by linear regression.
    fn start(&self, rise_s: f64, fall_s: f64) -> Option<(f64, Values)> {
        let first = self.log.monitor_v.iter().copied().find(|volts| !volts.is_nan())?.max(0.0);
        let mut values = vec![rise_s, fall_s, first, 1.0, 0.0];
        values.resize(SHIFTS + self.command.shifts, 0.0);
        let voltage = self.voltages(&values)?;
        let pairs = || voltage.iter().zip(&self.log.monitor_v).filter(|(_, read)| !read.is_nan());
        let count = pairs().count() as f64;
        let (sum_x, sum_y) = pairs().fold((0.0, 0.0), |(x, y), (v, read)| (x + v, y + read));
        let (mean_x, mean_y) = (sum_x / count, sum_y / count);
        let (xx, xy) = pairs()
            .fold((0.0, 0.0), |(xx, xy), (v, read)| (xx + (v - mean_x).powi(2), xy + (v - mean_x) * (read - mean_y)));
        let gain = if xx > 0.0 { (xy / xx).clamp(GAINS.0, GAINS.1) } else { 1.0 };
        (values[GAIN], values[OFFSET]) = (gain, mean_y - gain * mean_x);
        let cost = pairs().map(|(v, read)| (gain * v + values[OFFSET] - read).powi(2)).sum();
        Some((cost, values))
    }

    fn refined(&self, start: &[f64], free: &[usize], stopping: StoppingCriteria) -> Option<Found> {
        let largest = self.log.command_v.iter().copied().fold(0.0, f64::max);
        let bounds = free
            .iter()
            .map(|&i| match i {
                RISE | FALL => (0.0, MAX_S),
                START => (0.0, 2.0 * largest),
                GAIN => GAINS,
                OFFSET => (-largest, largest),
                _ => (-1.0, 1.0),
            })
            .collect();
        let problem = Around { search: self, start, free, bounds };
        let minimum = minimise(&problem, &free.iter().map(|&i| start[i]).collect::<Vec<_>>(), stopping)?;
        Some(Found { values: problem.whole(&minimum.values), free: free.to_vec(), minimum })
    }

    fn size(&self, index: usize) -> f64 {
        match index {
            RISE | FALL => 0.1,
            START | OFFSET => self.span_v,
            _ => 1.0,
        }
    }
}

/// The least-squares problem in the free variables around a start.
struct Around<'a> {
    search: &'a Search<'a>,
    start: &'a [f64],
    free: &'a [usize],
    bounds: Vec<(f64, f64)>,
}

impl Around<'_> {
    fn whole(&self, free: &[f64]) -> Values {
        let mut values = self.start.to_vec();
        self.free.iter().zip(free).for_each(|(&i, &value)| values[i] = value);
        values
    }

    /// The weight of the pull on variable `index`, V per unit.
    fn pull(&self, index: usize) -> f64 {
        PULL * self.search.span_v / self.search.size(index)
    }
}

impl Problem for Around<'_> {
    type Evaluation = Vec<f64>;

    fn residuals(&self, free: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let mut residuals = self.search.residuals(&self.whole(free))?;
        residuals.extend(self.free.iter().zip(free).map(|(&i, value)| self.pull(i) * (value - self.start[i])));
        Some((residuals.clone(), residuals))
    }

    /// Forward differences, away from a bound.
    fn jacobian(&self, free: &[f64], residuals: &Vec<f64>) -> Vec<Vec<f64>> {
        (0..free.len())
            .into_par_iter()
            .map(|i| {
                let size = self.search.size(self.free[i]);
                let step = 1e-5 * size + 1e-4 * free[i].abs();
                let step = if free[i] + step > self.bounds[i].1 { -step } else { step };
                let mut moved = free.to_vec();
                moved[i] += step;
                match self.residuals(&moved) {
                    Some((moved, _)) => moved.iter().zip(residuals).map(|(a, b)| (a - b) / step).collect(),
                    None => vec![0.0; residuals.len()],
                }
            })
            .collect()
    }

    fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    fn longest(&self, index: usize) -> f64 {
        10.0 * self.search.size(self.free[index])
    }
}
