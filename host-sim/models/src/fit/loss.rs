//! Loss functions of the residuals: squares, or Huber's for recordings with drop-outs.

/// Loss function of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Loss {
    /// Squares: best for noise.
    Square,
    /// Huber's: squares up to 0.5 % of the measured range, absolute values beyond, so that drop-outs have little effect.
    Huber,
}

/// Huber's loss with its limit, in the residuals' unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Huber {
    limit: f64,
}

impl Huber {
    /// The loss for measurements of the given [`percentile_range`]: the same for every candidate, so that their costs can be
    /// compared.
    pub fn new(range: f64) -> Self {
        Self { limit: (0.005 * range).max(f64::MIN_POSITIVE) }
    }

    /// Half the sum of squares, linear beyond the limit.
    pub fn cost(&self, residuals: &[f64]) -> f64 {
        residuals
            .iter()
            .map(|r| if r.abs() <= self.limit { 0.5 * r * r } else { self.limit * (r.abs() - 0.5 * self.limit) })
            .sum()
    }

    /// Weights of iteratively reweighted least squares: with them the squares have the slope of this loss.
    pub fn weights(&self, residuals: &[f64]) -> Weights {
        let weight = |r: &f64| if r.abs() > self.limit { (self.limit / r.abs()).sqrt() } else { 1.0 };
        Weights(residuals.iter().map(weight).collect())
    }
}

/// Square roots of the residuals' weights.
pub struct Weights(Vec<f64>);

impl Weights {
    /// Multiplies `values`, one per residual.
    pub fn apply(&self, values: &mut [f64]) {
        values.iter_mut().zip(&self.0).for_each(|(value, weight)| *value *= weight);
    }
}

/// The range between the 2nd and the 98th percentile, which drop-outs do not change.
pub fn percentile_range(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * (sorted.len().max(1) - 1) as f64) as usize).copied().unwrap_or(0.0);
    at(0.98) - at(0.02)
}

/// Robust estimate of the residuals' standard deviation: 1.4826 times their median absolute value.
pub fn robust_deviation(residuals: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    1.4826 * *median
}
