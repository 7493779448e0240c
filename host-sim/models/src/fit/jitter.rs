//! Time stamps that are off: rows that are not even, and residuals that are larger where the film moves.

use super::observation::Observation;
use super::preparation::{Severity, Warning};

/// Mean distance of the ratio of neighbouring intervals from a whole number, above which rows are not even: lost rows leave whole ones.
const UNEVEN: f64 = 0.1;
/// Least correlation of the squares of speeds and of the residuals' changes: of sines whose noise is of the clock alone it is about 0.4.
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
    let steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let off_whole = |pair: &[f64]| {
        let ratio = pair[0].max(pair[1]) / pair[0].min(pair[1]);
        (ratio - ratio.round()).abs()
    };
    if mean(steps.windows(2).map(off_whole))? < UNEVEN {
        return None;
    }
    // Half the square of a residual's change from one row to the next is noise² + jitter² v²: what the model does not follow changes slowly.
    let speeds = modelled.windows(2).zip(time_s.windows(2)).map(|(x, t)| (x[1] - x[0]) / (t[1] - t[0]));
    let changes = residuals.windows(2).map(|pair| pair[1] - pair[0]);
    let squares: Vec<[f64; 2]> =
        speeds.zip(changes).map(|(speed, change)| [speed * speed, 0.5 * change * change]).collect();
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
