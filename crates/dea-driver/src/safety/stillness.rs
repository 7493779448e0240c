//! The check that a sensor moves with the film.

use crate::safety::PlausibilityLimits;
use crate::safety::limits::MIN_TICKS;

/// A sensor is still if the model has moved by this many times what the sensor has.
const MOVES: f32 = 5.0;

/// Compares how far sensor and model have moved.
///
/// A frozen sensor still shows the noise of its converter, so that equal values alone do not give it away. From time to time, and
/// whenever the sensor has moved by more than its band, both are taken as the place to move from. The sensor is still if the model
/// is five bands away from there for a fifth of `stuck_ticks`, in which a sensor and a film that are late would have followed.
/// After `stuck_ticks` both start again: what is compared is motion, not creep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stillness {
    band: f32,
    most_ticks: u32,
    late_ticks: u32,
    /// Where both were.
    value: f32,
    modelled: f32,
    /// Since then.
    ticks: u32,
    /// Ticks in a row for which the model has been away.
    away_ticks: u32,
}

impl Stillness {
    pub(crate) const fn new(limits: PlausibilityLimits) -> Self {
        Self {
            band: limits.stuck_band,
            most_ticks: limits.stuck_ticks,
            late_ticks: limits.stuck_ticks / MIN_TICKS,
            value: f32::NAN,
            modelled: f32::NAN,
            ticks: 0,
            away_ticks: 0,
        }
    }

    /// Whether the sensor, now at `value`, is still while the model moves.
    pub(crate) fn is_still(&mut self, value: f32, modelled: f32) -> bool {
        // NaN is not still.
        let stays = (value - self.value).abs() <= self.band;
        if !stays || (self.ticks >= self.most_ticks && self.away_ticks == 0) {
            *self = Self { value, modelled, ticks: 0, away_ticks: 0, ..*self };
        }
        self.ticks = self.ticks.saturating_add(1);
        let was_still = self.away_ticks > self.late_ticks;
        let away = (modelled - self.modelled).abs() > MOVES * self.band;
        // Once still it stays so until it moves: a swing brings the model back to where it was.
        self.away_ticks = if away || was_still { self.away_ticks.saturating_add(1) } else { 0 };
        self.away_ticks > self.late_ticks
    }
}
