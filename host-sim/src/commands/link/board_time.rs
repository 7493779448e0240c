//! The time of a board, by the ticks of its stream.

/// Time constant with which the difference of both clocks is smoothed, s: samples come in bursts of up to some 20 ms.
const SMOOTHED_S: f64 = 0.1;
/// The board's time is guessed beyond its last sample by no more than the time to the next one and this, s: a board that is held up, or an
/// emulator, gets no values for times that it has not come to.
const GUESSED_S: f64 = 0.02;

/// How far a board is, by its own ticks.
///
/// A crystal is off by some ppm, the internal oscillator of a chip by a per cent, and an emulator on a busy machine falls behind by a third.
/// What is played lasts as long as it says by the board's time, which is that of its log.
#[derive(Debug, Default)]
pub(super) struct BoardTime {
    /// Ticks per second.
    rate_hz: f64,
    /// From one sample to the next, s.
    interval_s: f64,
    /// Tick of the first sample, at 0 s.
    first: Option<u32>,
    /// Board time of the last sample, s.
    sampled_s: f64,
    /// The host's time when it was last looked for samples, and when there were some, s.
    looked_s: f64,
    received_s: f64,
    /// By how much the board is behind the host, s.
    behind_s: f64,
    now_s: f64,
}

impl BoardTime {
    /// At 0 s, of a board with `rate_hz` ticks per second that sends a sample every `every` ticks.
    pub(super) fn new(rate_hz: f64, every: u16) -> Self {
        Self { rate_hz, interval_s: f64::from(every) / rate_hz, ..Self::default() }
    }

    /// All samples that had come were taken at `host_s` (s), the newest of them of this tick.
    pub(super) fn update(&mut self, newest: Option<u32>, host_s: f64) {
        let passed_s = host_s - self.looked_s;
        self.looked_s = host_s;
        let Some(tick) = newest else { return };
        self.received_s = host_s;
        let Some(first) = self.first else {
            (self.first, self.behind_s) = (Some(tick), host_s);
            return;
        };
        self.sampled_s = f64::from(tick.wrapping_sub(first)) / self.rate_hz;
        self.behind_s += (host_s - self.sampled_s - self.behind_s) * (passed_s / SMOOTHED_S).min(1.0);
    }

    /// The board's time when the host's is `host_s`, s: 0 until the first sample. It never runs back.
    pub(super) fn now_s(&mut self, host_s: f64) -> f64 {
        let latest_s = if self.first.is_some() { self.sampled_s + self.interval_s + GUESSED_S } else { 0.0 };
        self.now_s = self.now_s.max((host_s - self.behind_s).min(latest_s));
        self.now_s
    }

    /// For how long no sample has come, beyond the time that there is between two, by the host's time, s.
    pub(super) fn silent_s(&self) -> f64 {
        self.looked_s - self.received_s - self.interval_s
    }
}
