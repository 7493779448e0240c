//! Time stamps that are off: rows that are not even, and residuals that are larger where the film moves.

use super::observation::Observation;
use super::preparation::{Severity, Warning};
use crate::statistics::differences;

/// Mean of how uneven intervals are, above which a clock may jitter.
const UNEVEN: f64 = 0.05;
/// Least correlation of the squares of speeds and of what is left of the residuals: of sines whose noise is of the clock alone it is about 0.4.
const MIN_CORRELATION: f64 = 0.08;

/// About the RMS of what the time stamps are off by, s, in the recording where it is largest; 0 where noise hides it. `modelled` and `residuals` (m or N)
/// are those of the measured rows.
pub(super) fn jitter_s(observations: &[Observation], modelled: &[Vec<f64>], residuals: &[Vec<f64>]) -> f64 {
    let of = |((observation, modelled), residuals): ((&Observation, &Vec<f64>), &Vec<f64>)| {
        of_rows(&observation.measured.time_s, modelled, residuals).unwrap_or(0.0)
    };
    observations.iter().zip(modelled).zip(residuals).map(of).fold(0.0, f64::max)
}

/// Warns where `jitter_s` shows time stamps that are off.
pub(super) fn warn(jitter_s: f64, warnings: &mut Vec<Warning>) {
    if jitter_s > 0.0 {
        warnings.push(Severity::Caution.warning(format!(
            "the clock jitters: time stamps are off by about {:.1} ms RMS, since the rows are not even and the residuals larger where the film moves; record with an even clock",
            1e3 * jitter_s
        )));
    }
}

fn of_rows(time_s: &[f64], modelled: &[f64], residuals: &[f64]) -> Option<f64> {
    let steps: Vec<f64> = differences(time_s).collect();
    // Lost rows leave whole ratios, rows that become sparser a step between those beside it.
    let off = |steps: &[f64]| {
        let ratio = steps[0].max(steps[1]) / steps[0].min(steps[1]);
        let middle = steps[1] / (steps[0] * steps[2]).sqrt();
        (ratio - ratio.round()).abs().min(middle.ln().abs())
    };
    if mean(steps.windows(3).map(off))? < UNEVEN {
        return None;
    }
    // What is left of a row between those beside it is noise² + jitter² v²: what the model does not follow is smooth.
    let squares: Vec<[f64; 2]> = time_s
        .windows(3)
        .zip(modelled.windows(3).zip(residuals.windows(3)))
        .map(|(t, (x, r))| {
            let share = (t[1] - t[0]) / (t[2] - t[0]);
            let left = r[1] - r[0] - share * (r[2] - r[0]);
            let speed = (x[2] - x[0]) / (t[2] - t[0]);
            [speed * speed, left * left / (1.0 + share * share + (1.0 - share) * (1.0 - share))]
        })
        .collect();
    let [speed, residual] = [0, 1].map(|i| mean(squares.iter().map(|pair| pair[i])));
    let (speed, residual) = (speed?, residual?);
    let moment = |i: usize, j: usize| {
        let middle = [speed, residual];
        mean(squares.iter().map(|pair| (pair[i] - middle[i]) * (pair[j] - middle[j])))
    };
    let (common, of_speed, of_residual) = (moment(0, 1)?, moment(0, 0)?, moment(1, 1)?);
    (common > MIN_CORRELATION * (of_speed * of_residual).sqrt()).then(|| (common / of_speed).sqrt())
}

/// None of no values, and where one is not finite.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    Some(sum / count).filter(|mean: &f64| mean.is_finite())
}
