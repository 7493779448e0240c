//! How the arcs of a film show, and the one with which it must trip.

/// How arcs show, by the closed form.
#[derive(Clone, Copy)]
pub struct Shows {
    pub dwell_ms: f64,
    /// Probability that one shows as such.
    pub arc: f64,
    /// Probability that it trips in time.
    pub in_time: f64,
}

impl Shows {
    /// Arcs of a film that takes `charging_ms` to be charged to `volts`.
    pub fn new(dwell_ms: f64, charging_ms: f64, volts: f64) -> Self {
        let band = (60.0 + 0.03 * volts) / volts;
        let probability = |depth: f64| (charging_ms * depth).min(1.0);
        let (arc, outside) = (probability(0.75 - band), probability(1.0 - band));
        let number = 480.0 * arc / (dwell_ms + charging_ms);
        let (one_more, two_more) = (1.0 - (-number).exp(), 1.0 - (-number).exp() * (1.0 + number));
        let first = arc / outside;
        Self { dwell_ms, arc, in_time: first * one_more + (1.0 - first) * two_more }
    }
}

/// Finds the arc with which it must trip, apart from the driver: those that fall clearly deep enough.
#[derive(Default)]
pub struct ArcsSeen {
    shown_v: f64,
    first_at: Option<u32>,
}

impl ArcsSeen {
    /// Whether the reading of a tick is the arc that must trip.
    pub fn trips(&mut self, tick: u32, lowest_v: f64, monitor_v: f64) -> bool {
        let band_v = 61.0 + 0.03 * lowest_v;
        let arcs = monitor_v < 0.75 * lowest_v - band_v && self.shown_v - monitor_v > band_v;
        self.shown_v = monitor_v;
        let apart = self.first_at.map_or(u32::MAX, |at| tick - at);
        if arcs && apart > 520 {
            self.first_at = Some(tick);
        }
        arcs && (21..=520).contains(&apart)
    }
}
