//! Samples at their times and evenly sampled series, interpolated both ways.

use crate::error::{Error, Result};

/// The smallest and the largest of `values`, NaN aside; infinite and the other way around without any.
pub fn range<'a>(values: impl IntoIterator<Item = &'a f64>) -> (f64, f64) {
    values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
}

/// The largest magnitude of `values`, NaN aside; 0 without any.
pub fn peak(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |peak, value| peak.max(value.abs()))
}

/// The median of the steps from time to time; none without two times.
pub(crate) fn usual_step(times: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied()
}

/// Beginning and end of each run of one value.
pub(crate) fn runs(values: &[f64]) -> Vec<(usize, usize)> {
    let mut starts: Vec<usize> = (0..values.len()).filter(|&k| k == 0 || values[k] != values[k - 1]).collect();
    starts.push(values.len());
    starts.windows(2).map(|pair| (pair[0], pair[1])).collect()
}

/// Samples of one quantity at their times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Times in seconds from the recording's first sample, or since a held load was applied; increasing.
    pub time_s: Vec<f64>,
    /// Values in SI units.
    pub value: Vec<f64>,
}

impl Samples {
    /// Their values at increasing `times`, interpolated linearly, constant beyond both ends.
    pub fn at(&self, times: impl Iterator<Item = f64>) -> Vec<f64> {
        self.interpolated(times, |_, _, _| 0.0)
    }

    /// The same with the curvature of smooth values: by the cubic through four of them, linearly where the curvature on both sides has not the
    /// same sign, so that steps, ramps and corners stay as they are.
    pub fn curved_at(&self, times: impl Iterator<Item = f64>) -> Vec<f64> {
        let (time, value) = (&self.time_s, &self.value);
        let slope = |k: usize| (value[k + 1] - value[k]) / (time[k + 1] - time[k]);
        let second = |k: usize| (slope(k + 1) - slope(k)) / (time[k + 2] - time[k]);
        self.interpolated(times, |before, next, now| {
            if before == 0 || next + 1 == time.len() {
                return 0.0;
            }
            let [first, last] = [second(before - 1), second(before)];
            let third = (last - first) / (time[next + 1] - time[before - 1]);
            let curvature = first + (now - time[before - 1]) * third;
            if first * last > 0.0 { (now - time[before]) * (now - time[next]) * curvature } else { 0.0 }
        })
    }

    /// The values of lines through neighbours `before` and `next` plus the `correction` between them.
    fn interpolated(
        &self,
        times: impl Iterator<Item = f64>,
        correction: impl Fn(usize, usize, f64) -> f64,
    ) -> Vec<f64> {
        let (time, value) = (&self.time_s, &self.value);
        let mut next = 0;
        let at = |now: f64| {
            while next < time.len() && time[next] <= now {
                next += 1;
            }
            match (next.checked_sub(1), value.get(next)) {
                (Some(before), Some(after)) => {
                    let share = (now - time[before]) / (time[next] - time[before]);
                    value[before] + share * (after - value[before]) + correction(before, next, now)
                }
                (Some(last), None) => value[last],
                (None, first) => first.copied().unwrap_or(0.0),
            }
        };
        times.map(at).collect()
    }
}

/// The times k / rate at which a model runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Samples per second.
    pub rate_hz: f64,
    /// Number of samples.
    pub samples: usize,
}

/// Largest number of samples of a grid: 27 h at 1 kHz. A run holds some 60 bytes per sample.
const MAX_SAMPLES: f64 = 1e8;

impl Grid {
    /// The shortest grid at `rate_hz` that covers `duration_s`.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] for a rate that is not positive and finite, or for too many samples.
    pub fn covering(duration_s: f64, rate_hz: f64) -> Result<Self> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(Error::field("rate_hz", format!("{rate_hz:?} Hz must be finite and greater than 0")));
        }
        // Products such as 155.0 · 1000 can lie a rounding error above the whole number.
        let last = (duration_s * rate_hz - 1e-6).ceil().max(0.0);
        if last.is_nan() || last >= MAX_SAMPLES {
            let cause =
                format!("{duration_s:?} s at {rate_hz:?} Hz are more than {MAX_SAMPLES} samples; lower the rate");
            return Err(Error::field("rate_hz", cause));
        }
        Ok(Self { rate_hz, samples: last as usize + 1 })
    }

    /// Seconds per sample.
    pub fn step_s(&self) -> f64 {
        1.0 / self.rate_hz
    }

    /// Time of sample `k` in seconds.
    pub fn time_s(&self, k: usize) -> f64 {
        k as f64 / self.rate_hz
    }

    /// The times of all samples in seconds.
    pub fn times_s(&self) -> Vec<f64> {
        (0..self.samples).map(|k| self.time_s(k)).collect()
    }

    /// `samples` interpolated linearly to the grid, constant beyond both ends.
    pub fn resample(&self, samples: &Samples) -> Vec<f64> {
        samples.at((0..self.samples).map(|k| self.time_s(k)))
    }

    /// The same with the curvature of smooth values ([`Samples::curved_at`]).
    pub fn resample_curved(&self, samples: &Samples) -> Vec<f64> {
        samples.curved_at((0..self.samples).map(|k| self.time_s(k)))
    }

    /// `series` on this grid, interpolated linearly to `times` within it.
    pub fn at(&self, series: &[f64], times: &[f64]) -> Vec<f64> {
        let last = series.len() - 1;
        let at = |t: &f64| {
            let place = (t * self.rate_hz).clamp(0.0, last as f64);
            let before = (place as usize).min(last.saturating_sub(1));
            let share = place - before as f64;
            let after = series[(before + 1).min(last)];
            series[before] + share * (after - series[before])
        };
        times.iter().map(at).collect()
    }
}
