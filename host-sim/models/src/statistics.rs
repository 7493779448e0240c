//! Statistics of series: ranges, means, percentiles, noise.

pub use crate::grid::{peak, range};

/// The mean; 0 if empty.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Root of the mean square; NaN if empty.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Differences of neighbours.
pub fn differences(values: &[f64]) -> impl Iterator<Item = f64> + '_ {
    values.windows(2).map(|pair| pair[1] - pair[0])
}

/// `values`, rising.
pub fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// The value below which this `share` of `sorted` values is; 0 if empty.
pub fn percentile(sorted: &[f64], share: f64) -> f64 {
    sorted.get((share * (sorted.len().max(1) - 1) as f64) as usize).copied().unwrap_or(0.0)
}

/// Peak to peak of a load; its size where it varies by at most 1 %, because it was applied at once and held.
pub fn change(load: &[f64]) -> f64 {
    let (low, high) = range(load);
    let size = peak(load);
    if high - low > 0.01 * size { high - low } else { size }
}

/// The median; NaN if empty.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let (mut values, middle) = (values.to_vec(), values.len() / 2);
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The sizes of the upper turning points of a drive: where it comes down to half.
pub fn peaks(values: &[f64]) -> Vec<f64> {
    let most = peak(values);
    let mut peaks = Vec::new();
    let (mut rises, mut highest, mut lowest) = (true, 0.0, 0.0);
    for value in values.iter().map(|value| value.abs()) {
        // Noise about 0 is no turning point.
        if rises && value < 0.5 * highest && highest > 0.2 * most {
            peaks.push(highest);
            (rises, lowest) = (false, value);
        } else if !rises && value > lowest + 0.2 * most {
            (rises, highest) = (true, value);
        } else if rises {
            highest = value.max(highest);
        } else {
            lowest = value.min(lowest);
        }
    }
    // The last rise may end before its turning point.
    if rises && peaks.iter().all(|peak| *peak < highest) {
        peaks.push(highest);
    }
    peaks
}

/// The range between the 2nd and the 98th percentile, which drop-outs do not change.
pub fn percentile_range(values: impl Iterator<Item = f64>) -> f64 {
    let sorted = sorted(values);
    percentile(&sorted, 0.98) - percentile(&sorted, 0.02)
}

/// Robust estimate of a standard deviation about 0: 1.4826 times the median size.
pub fn robust_deviation(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    1.4826 * *median
}

/// RMS noise from row to row, from fourth differences.
pub fn noise(values: &[f64]) -> f64 {
    let fourth: Vec<f64> = values.windows(5).map(|v| v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]).collect();
    robust_deviation(&fourth) / 70f64.sqrt()
}
