//! The voltage monitor against the command.

use springpot::{AmplifierLag, AmplifierModel};

use crate::safety::{LimitsError, MonitorLimits};

/// Follows the command at the amplifier's own slew and lag and compares the monitor with it.
///
/// ```
/// use dea_driver::{Limits, Monitor};
///
/// // 20 ticks of disagreement are allowed.
/// let mut monitor = Monitor::new(Limits::bench(160e-6).monitor, 1000.0);
/// assert!((0..1000).all(|_| monitor.agrees(3000.0, 3000.0)));
/// assert!((0..20).all(|_| monitor.agrees(3000.0, 0.0)));
/// assert!(!monitor.agrees(3000.0, 0.0));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Monitor {
    slew_v_per_tick: f32,
    band_v: f32,
    band_share: f32,
    /// The amplifier at its slowest and at its fastest; none that follows at once.
    lag: Option<[AmplifierModel<f32>; 2]>,
    largest_excess: i32,
    /// Where an amplifier may be that follows the command at its slew or faster, V.
    lowest_v: f32,
    highest_v: f32,
    /// [`OUTSIDE`] more for every tick outside the band, one less for every tick inside.
    excess: i32,
    /// The reading of the last tick, V.
    before_v: f32,
    /// Ticks after an arc until which another one trips, and how many of them are left.
    watch_ticks: i32,
    watched: i32,
    /// Once no more of them are left than this, the arc is over, and the next fall is another one.
    again_ticks: i32,
    /// Ticks by which a fall is made up for, and those that are missing: so many more for each fall, one less for every tick.
    made_up_ticks: i32,
    fallen: i32,
    /// The same after the last fall that counted.
    fallen_last: i32,
    falls: u16,
    falls_too_often: bool,
}

/// Ticks inside the band that make up for one outside. A film that arcs again and again is outside more often than that.
const OUTSIDE: i32 = 16;

/// Share of the lowest possible voltage below which a reading that has fallen there shows an arc. An amplifier that lags behind its
/// command rises while it is below; only one that overshoots by a quarter falls there.
const ARC_SHARE: f32 = 0.75;

/// How much slower and faster an amplifier may be than its time constants say: they change with load, temperature and supply.
const MAX_SPEED_RATIO: f64 = 1.5;
const MIN_SPEED_RATIO: f64 = 0.5;

/// Time that makes up for a fall, s.
const MADE_UP_S: f32 = 10.0;
/// Falls that may have to be made up for, and falls of a run.
const MAX_FALLS: i32 = 6;
const MAX_FALLS_OF_A_RUN: u16 = 30;

/// Time after an arc and its settling time within which another one trips, s.
const AGAIN_S: f32 = 0.5;

impl Monitor {
    /// A monitor at 0 V, checked `rate_hz` times a second.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // saturates
    pub fn new(limits: MonitorLimits, rate_hz: f32) -> Self {
        let settle_ticks = (limits.settle_s * rate_hz + 0.5) as i32;
        let again_ticks = (AGAIN_S * rate_hz + 0.5) as i32;
        Self {
            slew_v_per_tick: limits.slew_v_per_s / rate_hz,
            band_v: limits.band_v,
            band_share: limits.band_share,
            lag: None,
            largest_excess: settle_ticks.saturating_mul(OUTSIDE),
            lowest_v: 0.0,
            highest_v: 0.0,
            excess: 0,
            before_v: 0.0,
            watch_ticks: settle_ticks.saturating_add(again_ticks),
            watched: 0,
            again_ticks,
            made_up_ticks: (MADE_UP_S * rate_hz + 0.5) as i32,
            fallen: 0,
            fallen_last: 0,
            falls: 0,
            falls_too_often: false,
        }
    }

    /// The constants except the lag, for a check of the memory.
    #[cfg(feature = "link")]
    pub(crate) fn constants(&self) -> ([f32; 3], [i32; 4]) {
        let ticks = [self.largest_excess, self.watch_ticks, self.again_ticks, self.made_up_ticks];
        ([self.slew_v_per_tick, self.band_v, self.band_share], ticks)
    }

    /// Whether counters and voltages are possible after ticks with commands up to `max_v` (V): others would hide a wrong reading.
    #[cfg(feature = "link")]
    pub(crate) fn is_sound(&self, max_v: f32) -> bool {
        // An arithmetic step may end a little beyond.
        let possible_v = -1.0..=max_v + 1.0;
        let counters = [self.excess, self.watched, self.fallen, self.fallen_last];
        possible_v.contains(&self.lowest_v)
            && possible_v.contains(&self.highest_v)
            && counters.iter().all(|&count| count >= 0)
            && self.watched <= self.watch_ticks
    }

    /// The same monitor for an amplifier with this `lag`, whose time constants may be half to one and a half times as long, at `rate_hz`
    /// ticks a second.
    ///
    /// # Errors
    ///
    /// [`LimitsError::Amplifier`] for a time constant that is negative, not finite or above 10 s / 1.5.
    pub fn behind(self, lag: AmplifierLag, rate_hz: f32) -> Result<Self, LimitsError> {
        let step_s = 1.0 / f64::from(rate_hz);
        let model = |by: f64| {
            let scaled = AmplifierLag { rise_s: by * lag.rise_s, fall_s: by * lag.fall_s };
            AmplifierModel::lagging(scaled, step_s).map_err(|_| LimitsError::Amplifier(lag))
        };
        let lag = model(MAX_SPEED_RATIO)?.zip(model(MIN_SPEED_RATIO)?).map(|(slow, fast)| [slow, fast]);
        Ok(Self { lag, ..self })
    }

    /// Starts again at 0 V, with nothing counted.
    pub fn reset(&mut self) {
        (self.lowest_v, self.highest_v, self.excess) = (0.0, 0.0, 0);
        (self.before_v, self.watched) = (0.0, 0);
        (self.fallen, self.fallen_last, self.falls, self.falls_too_often) = (0, 0, 0, false);
    }

    /// Compares the command of the last tick (V) with the monitor's reading (V). Returns false once they have differed for longer than the
    /// settling time in sum, where sixteen ticks of agreement cancel one of difference; and, until [`reset`](Self::reset), after a second
    /// arc or [too many falls](Self::falls_too_often).
    ///
    /// A reading agrees if it is within the band around the voltages that an amplifier of this slew or more, with its [lag](Self::behind),
    /// can have in this tick or in the one before, since a converter may answer with the sample of the frame before. NaN differs.
    ///
    /// An arc is a reading that has fallen since the last tick by more than the band, or follows NaN, and is below three quarters of the
    /// lowest of these voltages by more than the band. Falls within the settling time after an arc belong to it; the next arc within half a
    /// second after that is the second.
    #[must_use]
    pub fn agrees(&mut self, command_v: f32, monitor_v: f32) -> bool {
        let (lowest_before_v, highest_before_v) = (self.lowest_v, self.highest_v);
        // The slowest from below and from above.
        let risen_v = self.lowest_v + self.slew_v_per_tick;
        let fallen_v = self.highest_v - self.slew_v_per_tick;
        let [low_v, high_v] = self.followed(command_v);
        self.lowest_v = if risen_v < low_v { risen_v } else { low_v };
        self.highest_v = if fallen_v > high_v { fallen_v } else { high_v };
        let lowest_v = if self.lowest_v < lowest_before_v { self.lowest_v } else { lowest_before_v };
        let highest_v = if self.highest_v > highest_before_v { self.highest_v } else { highest_before_v };
        let band = self.band_v + self.band_share * highest_v;
        let inside = lowest_v - band <= monitor_v && monitor_v <= highest_v + band;
        self.excess = if inside { less(self.excess) } else { self.excess.saturating_add(OUTSIDE) };
        // Not `<`: after NaN it has fallen.
        let stays = monitor_v + band >= self.before_v;
        self.fallen = less(self.fallen);
        if monitor_v < lowest_v - band && !stays {
            self.count_fall();
        }
        let arcs = monitor_v < ARC_SHARE * lowest_v - band && !stays;
        self.before_v = monitor_v;
        let over = self.watched <= self.again_ticks;
        if arcs && over && self.watched > 0 {
            self.excess = i32::MAX;
        }
        self.watched = if arcs && over { self.watch_ticks } else { less(self.watched) };
        self.excess <= self.largest_excess
    }
}

impl Monitor {
    /// Where the command takes the slowest and the fastest amplifier in a tick, from the lowest and from the highest voltage (V).
    #[inline]
    fn followed(&self, command_v: f32) -> [f32; 2] {
        let Some([slow, fast]) = &self.lag else { return [command_v; 2] };
        let rises = if command_v > self.lowest_v { slow } else { fast };
        let falls = if command_v < self.highest_v { slow } else { fast };
        [rises.advance(self.lowest_v, command_v), falls.advance(self.highest_v, command_v)]
    }
}

impl Monitor {
    /// Counts a fall, unless it belongs to the last one: it may come back for the settling time.
    #[cold]
    #[inline(never)]
    fn count_fall(&mut self) {
        if self.falls > 0 && self.fallen_last.saturating_sub(self.fallen) <= self.largest_excess / OUTSIDE {
            return;
        }
        self.fallen = self.fallen.saturating_add(self.made_up_ticks);
        self.fallen_last = self.fallen;
        self.falls = self.falls.saturating_add(1);
        if self.fallen > self.made_up_ticks.saturating_mul(MAX_FALLS) || self.falls > MAX_FALLS_OF_A_RUN {
            self.falls_too_often = true;
            self.excess = i32::MAX;
        }
    }

    /// Number of falls of the reading out of the band, by more than the band within a tick, since the last [`reset`](Self::reset).
    #[must_use]
    pub fn falls(&self) -> u16 {
        self.falls
    }

    /// Whether there were too many [falls](Self::falls): more than 30, or more than six for which ten seconds each have not made up.
    #[must_use]
    pub fn falls_too_often(&self) -> bool {
        self.falls_too_often
    }
}

/// One less, down to 0.
fn less(ticks: i32) -> i32 {
    (ticks - 1).max(0)
}

/// `value`, no larger than `bound` in size: without the panic of [`f32::clamp`] for a NaN bound.
pub(crate) fn bounded(value: f32, bound: f32) -> f32 {
    if value > bound {
        bound
    } else if value < -bound {
        -bound
    } else {
        value
    }
}

/// A sign that flips in one counter, or a voltage or a time that no tick leaves, is noticed while everything else is possible.
#[cfg(feature = "link")]
#[test]
fn one_impossible_counter_or_voltage_is_not_sound() {
    let mut monitor = Monitor::new(crate::Limits::bench(160e-6).monitor, 1000.0);
    assert!((0..1000).all(|_| monitor.agrees(3000.0, 3000.0)));
    // An arc, after which all counters count.
    assert!(monitor.agrees(3000.0, 0.0));
    assert!([monitor.excess, monitor.watched, monitor.fallen, monitor.fallen_last].iter().all(|&count| count > 0));
    assert!(monitor.is_sound(3000.0) && !monitor.is_sound(2990.0));
    // A volt beyond what was commanded is rounding.
    (monitor.lowest_v, monitor.highest_v) = (-0.9, 3000.9);
    assert!(monitor.is_sound(3000.0));
    let flips: [fn(&mut Monitor); 8] = [
        |m| m.excess ^= i32::MIN,
        |m| m.watched ^= i32::MIN,
        |m| m.fallen ^= i32::MIN,
        |m| m.fallen_last ^= i32::MIN,
        |m| m.watched = m.watch_ticks + 1,
        |m| m.lowest_v = -1.1,
        |m| m.highest_v = 3001.1,
        |m| m.highest_v = f32::NAN,
    ];
    for (index, flip) in flips.into_iter().enumerate() {
        let mut flipped = monitor;
        flip(&mut flipped);
        assert!(!flipped.is_sound(3000.0), "flip {index}");
    }
}
