//! Resolution of a drive in time.

use super::observation::{self, Observation};
use crate::statistics::{change, differences, mean};

/// How exactly a delay is known along a drive.
#[derive(Clone, Copy, Debug)]
pub struct Resolution {
    /// Time between two rows in which the load steps, s: a step is anywhere between them. Near 0 for a load that follows its rows.
    pub(super) between_rows_s: f64,
    /// Time in which the load changes by its size, s.
    pub(super) radian_s: f64,
}

impl Resolution {
    /// The resolution of `observations`: means over rows, each as far as a delay is known from it, by the square of the load's rate.
    pub(super) fn new(observations: &[Observation]) -> Self {
        let (mut steps, mut rates, mut squares) = (0.0, 0.0, 0.0);
        for observation in observations {
            let load = observation::load(&observation.input);
            let (size, mean) = (change(&load), mean(&load));
            let rows_s: Vec<f64> = differences(&observation.input.samples().time_s).collect();
            let rate = |k: usize| load.get(k + 1).map_or(0.0, |next| (next - load[k]) / (rows_s[k] * size));
            // It is 0 before the first row.
            let mut before = load.first().zip(rows_s.first()).map_or(0.0, |(load, row_s)| load / (row_s * size));
            for (k, row_s) in rows_s.iter().enumerate() {
                // The part of the rate that neither row beside it has.
                let step = (rate(k) - before).abs().min((rate(k) - rate(k + 1)).abs());
                before = rate(k);
                steps += row_s * step * step;
                rates += before * before;
                squares += ((load[k] - mean) / size).powi(2);
            }
        }
        let over_rates = |sum: f64| if rates > 0.0 { sum / rates } else { 0.0 };
        Self { between_rows_s: over_rates(steps), radian_s: over_rates(squares).sqrt() }
    }
}
