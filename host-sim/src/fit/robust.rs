//! How residuals count: squared, or less where a sensor dropped out.

/// The loss of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Loss {
    /// Squares: best for noise.
    Square,
    /// Huber's: squares near nought, absolute values beyond, so that drop-outs do not pull.
    Huber,
}

/// Square roots of the weights of residuals.
pub struct Weights(Vec<f64>);

impl Weights {
    /// Huber's weights, from the spread of the residuals themselves (median absolute deviation).
    pub fn huber(residuals: &[f64]) -> Self {
        // Residuals of a normal distribution keep 95 % of their efficiency.
        let limit = 1.345 * spread(residuals);
        Self(residuals.iter().map(|r| if r.abs() > limit { (limit / r.abs()).sqrt() } else { 1.0 }).collect())
    }

    /// Multiplies `values`, one per residual.
    pub fn apply(&self, values: &mut [f64]) {
        values.iter_mut().zip(&self.0).for_each(|(value, weight)| *value *= weight);
    }
}

/// The standard deviation of residuals that are mostly normal: 1.4826 times their median absolute value.
pub fn spread(residuals: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    1.4826 * *median
}
