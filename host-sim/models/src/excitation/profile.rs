//! Profiles of voltage that identify a film, within the limits of a board.
//!
//! Rest first, because the model begins at rest; smooth unipolar sines, because the force is proportional to V² and jumps excite what is no
//! creep; several frequencies, because one leaves the orders of the springpots open; a second amplitude, because creep and stiffening
//! look alike at one; a hold and a rest, because they show the creep itself, fast to slow, and the recovery.

use std::f64::consts::{PI, TAU};

use serde::Serialize;
use springpot::CommandLimits;

use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::references::minimum_jerk;

/// A profile to play to a film.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Its parts.
    pub parts: Vec<Part>,
}

/// A part of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Part {
    /// Where it begins, s.
    pub from_s: f64,
    /// Where it ends.
    pub to_s: f64,
    /// Its kind.
    #[serde(flatten)]
    pub shape: PartShape,
}

/// The kind of a part of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "shape", rename_all = "lowercase")]
pub enum PartShape {
    /// 0 V.
    Rest,
    /// Cycles of V̂/2 (1 − cos 2πft).
    Sine {
        /// f, Hz.
        frequency_hz: f64,
        /// V̂, V.
        peak_v: f64,
    },
    /// A smooth rise, a constant voltage and a smooth fall.
    Hold {
        /// The voltage, V.
        peak_v: f64,
        /// Length of rise and fall, s.
        ramp_s: f64,
    },
}

/// The specification of a profile.
#[derive(Clone, Debug, PartialEq)]
pub struct ProfileOptions {
    /// Largest voltage, V.
    pub peak_v: f64,
    /// Frequencies of the sines, Hz.
    pub frequencies_hz: Vec<f64>,
    /// Cycles of each.
    pub cycles: u32,
    /// Length of the hold, s.
    pub hold_s: f64,
    /// Length of the rest at the start, s. The rest after the hold is half as long as the hold.
    pub rest_s: f64,
}

/// The share of the largest voltage that a profile uses by default: the field grows as the film thins.
pub const USUAL_SHARE: f64 = 0.9;
/// The second amplitude, a share of the peak: a quarter of the force.
const SECOND: f64 = 0.5;
/// Level of the hold, a share of the peak: creep adds to its stroke.
const HELD: f64 = 0.8;
/// Largest slope of a minimum-jerk rise, as a multiple of its mean.
const STEEPEST: f64 = 1.875;

/// The largest voltage that `limits` allow on an undeformed film of `thickness_m`, and the name of the limit.
pub fn largest_voltage(limits: &CommandLimits, thickness_m: f64) -> (f64, &'static str) {
    let of_field = limits.max_field_v_per_m * thickness_m;
    if of_field < limits.max_voltage_v {
        (of_field, "max_field_v_per_m")
    } else {
        (limits.max_voltage_v, "max_voltage_v")
    }
}

impl Profile {
    /// The profile of `options` within `limits` on a film of `thickness_m`.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] naming the limit that is not kept, and what would keep it.
    pub fn new(options: &ProfileOptions, limits: &CommandLimits, thickness_m: f64) -> Result<Self> {
        let ProfileOptions { peak_v, frequencies_hz, cycles, hold_s, rest_s } = options;
        let (largest_v, limit) = largest_voltage(limits, thickness_m);
        if *peak_v > largest_v {
            let cause = format!("{peak_v} V is above {largest_v:.0} V ({limit}); use {:.0}", USUAL_SHARE * largest_v);
            return Err(Error::field("peak_v", cause));
        }
        let lag_s = limits.amplifier.rise_s.max(limits.amplifier.fall_s);
        for frequency_hz in frequencies_hz {
            let slew = PI * frequency_hz * peak_v;
            if slew > limits.max_slew_v_per_s {
                let most = limits.max_slew_v_per_s / (PI * peak_v);
                let cause = format!(
                    "{frequency_hz} Hz at {peak_v} V rise by {slew:.0} V/s, above max_slew_v_per_s = {}; use at most {most:.3} Hz",
                    limits.max_slew_v_per_s
                );
                return Err(Error::field("frequencies_hz", cause));
            }
            if TAU * frequency_hz * lag_s > 1.0 {
                let most = 1.0 / (TAU * lag_s);
                let cause = format!(
                    "the amplifier lags by {lag_s} s and does not follow {frequency_hz} Hz; use at most {most:.3} Hz"
                );
                return Err(Error::field("frequencies_hz", cause));
            }
        }
        let sine = |frequency_hz: f64, share: f64| {
            let length_s = f64::from(*cycles) / frequency_hz;
            (PartShape::Sine { frequency_hz, peak_v: share * peak_v }, length_s)
        };
        // Half of the largest slew, and no faster than a second: the amplifier's lag is no part of the film.
        let ramp_s = (2.0 * STEEPEST * HELD * peak_v / limits.max_slew_v_per_s).max(5.0 * lag_s).max(1.0);
        let mut lengths = vec![(PartShape::Rest, *rest_s)];
        lengths.extend(frequencies_hz.iter().map(|f| sine(*f, 1.0)));
        // The middle one, again at the second amplitude.
        lengths.extend(frequencies_hz.get(frequencies_hz.len() / 2).map(|f| sine(*f, SECOND)));
        if *hold_s > 0.0 {
            lengths.push((PartShape::Hold { peak_v: HELD * peak_v, ramp_s }, hold_s + 2.0 * ramp_s));
            lengths.push((PartShape::Rest, 0.5 * hold_s));
        }
        let mut from_s = 0.0;
        let part = |(shape, length_s)| {
            let part = Part { from_s, to_s: from_s + length_s, shape };
            from_s = part.to_s;
            part
        };
        Ok(Self { parts: lengths.into_iter().map(part).collect() })
    }

    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        self.parts.last().map_or(0.0, |part| part.to_s)
    }

    /// The voltage on `grid`, V.
    pub fn on(&self, grid: Grid) -> Vec<f64> {
        let mut parts = self.parts.iter().peekable();
        (0..grid.samples)
            .map(|k| {
                let t = grid.time_s(k);
                while parts.peek().is_some_and(|part| part.to_s <= t) {
                    parts.next();
                }
                parts.peek().map_or(0.0, |part| part.voltage_v(t))
            })
            .collect()
    }
}

impl Part {
    fn voltage_v(&self, t: f64) -> f64 {
        let (since, left) = (t - self.from_s, self.to_s - t);
        match self.shape {
            PartShape::Rest => 0.0,
            PartShape::Sine { frequency_hz, peak_v } => 0.5 * peak_v * (1.0 - (TAU * frequency_hz * since).cos()),
            PartShape::Hold { peak_v, ramp_s } => peak_v * minimum_jerk(since.min(left) / ramp_s),
        }
    }
}
