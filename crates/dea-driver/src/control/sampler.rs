//! When a sample of the displacement sensor is used.

use springpot::SensorSample;

/// Uses a sample of the sensor from time to time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampler {
    every: u32,
    since: u32,
    pub(super) age_ticks: usize,
}

impl Sampler {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    pub(super) fn new(rate_hz: f32, interval_s: f32, delay_s: f32) -> Self {
        let ticks = |seconds: f32| (seconds * rate_hz + 0.5) as u32;
        let every = ticks(interval_s).max(1);
        Self { every, since: every, age_ticks: ticks(delay_s) as usize }
    }

    /// The sample of this tick, if one is due and the sensor is plausible.
    pub(super) fn next(&mut self, displacement_m: Option<f32>) -> Option<SensorSample<f32>> {
        self.since = self.since.saturating_add(1);
        if self.since < self.every {
            return None;
        }
        self.since = 0;
        displacement_m.map(|displacement| SensorSample { displacement_m: displacement, age_ticks: self.age_ticks })
    }
}
