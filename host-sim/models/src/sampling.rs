//! Losses of a series where a model samples it: gaps between its rows, and motion between the model's steps.

use crate::grid::{Grid, Samples};
use crate::statistics::{change, differences, median, peak, rms};

/// RMS of what is missed, as a share of the range, that is reported.
const MISSED: f64 = 5e-3;

/// Remarks on `samples` that a model is to follow at `rate_hz`.
pub fn remarks(samples: &Samples, rate_hz: f64) -> Vec<String> {
    let missed = missed(samples, rate_hz);
    let between = (rms(&missed) > MISSED).then(|| between_steps(rate_hz, peak(&missed)));
    gap(&samples.time_s).into_iter().chain(between).collect()
}

/// Differences of `samples` and straight lines between the steps of a model, row by row, as shares of their range.
pub(crate) fn missed(samples: &Samples, rate_hz: f64) -> Vec<f64> {
    let duration_s = samples.time_s.last().copied().unwrap_or(0.0);
    let Ok(grid) = Grid::covering(duration_s, rate_hz) else { return Vec::new() };
    let followed = grid.at(&grid.resample(samples), &samples.time_s);
    let size = change(&samples.value).max(f64::MIN_POSITIVE);
    samples.value.iter().zip(&followed).map(|(value, followed)| (value - followed).abs() / size).collect()
}

/// The remark on a series that moves between the steps of a model by this `share` of its range.
pub(crate) fn between_steps(rate_hz: f64, share: f64) -> String {
    let (step_s, share) = (1.0 / rate_hz, 100.0 * share);
    format!(
        "the input moves between the model's steps of {step_s:.4} s, by up to {share:.0} % of its range: what happens there is left out"
    )
}

/// The remark on the first gap between rows at `time_s`.
pub(crate) fn gap(time_s: &[f64]) -> Option<String> {
    let steps: Vec<f64> = differences(time_s).collect();
    let usual_s = median(&steps);
    // Steps that grow little by little, such as logarithmic ones, are no gap.
    let is_gap = |k: usize| steps[k] > 5.0 * usual_s && (k == 0 || steps[k] > 2.0 * steps[k - 1]);
    let k = (0..steps.len()).find(|&k| is_gap(k))?;
    Some(format!("a gap of {:.3} s at {:.3} s; the input is interpolated across it", steps[k], time_s[k]))
}
