//! The voltage behind a modelled amplifier along a log.

use springpot::{AmplifierLag, AmplifierModel};

use crate::files::amplifier_log::AmplifierLog;
use crate::statistics::{differences, median};

/// How the voltage falls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fall {
    /// As [`AmplifierLag`] has it: no faster than a bleeder discharges the film.
    Bleeder,
    /// First order, towards the command.
    TowardsCommand,
}

/// The command between the rows of a log: linear, except where it jumps.
///
/// Rows show that a command has jumped between two of them, not when. A jump is `shift` row intervals before the row that first shows the new
/// value, −1 to 1: each its own, or, where there are many, all the same.
#[derive(Clone, Debug)]
pub(super) struct Command<'a> {
    time_s: &'a [f64],
    command_v: &'a [f64],
    /// Jump of the command at each row, V; 0 where it moves steadily.
    jump_v: Vec<f64>,
    /// Which shift is that of the row's jump.
    shift: Vec<usize>,
    pub(super) shifts: usize,
    /// The median of the row intervals, s.
    pub(super) interval_s: f64,
}

/// A change is a jump if it is larger than those beside it by this factor …
const STEEPER: f64 = 5.0;
/// … and than this share of the command's span.
const MIN_JUMP: f64 = 2e-3;
/// Most jumps with a time of their own, and most rows of a log times these.
const MAX_SHIFTS: usize = 32;
const MAX_ROWS: usize = 2_000_000;
/// Longest step of the integration, s, and how many of them an interval has at the least and at the most.
const MAX_STEP_S: f64 = 1e-3;
const STEPS: (f64, f64) = (2.0, 10.0);

impl<'a> Command<'a> {
    pub(super) fn new(log: &'a AmplifierLog) -> Self {
        let (time_s, command_v) = (log.time_s.as_slice(), log.command_v.as_slice());
        let change = |k: usize| if k == 0 || k >= command_v.len() { 0.0 } else { command_v[k] - command_v[k - 1] };
        let least = MIN_JUMP * log.span_v();
        let jump_v: Vec<f64> = (0..command_v.len())
            .map(|k| {
                // Before the first row and after the last, nothing is known to be steady.
                let beside = if k < 2 { 0.0 } else { change(k - 1).abs() }.max(change(k + 1).abs());
                let jumps = change(k).abs() > STEEPER * beside && change(k).abs() > least;
                if jumps { change(k) } else { 0.0 }
            })
            .collect();
        let jumps = jump_v.iter().filter(|jump| **jump != 0.0).count();
        let shifts = if jumps <= MAX_SHIFTS && jumps * jump_v.len() <= MAX_ROWS { jumps } else { 1 };
        let mut passed = 0;
        let shift = jump_v
            .iter()
            .map(|jump| {
                let this = passed.min(shifts.saturating_sub(1));
                passed += usize::from(*jump != 0.0);
                this
            })
            .collect();
        let intervals: Vec<f64> = differences(time_s).collect();
        Self { time_s, command_v, jump_v, shift, shifts, interval_s: median(&intervals) }
    }

    /// The voltage (V) at every row, from `start_v` at the first; none for a lag that is no amplifier's.
    pub(super) fn voltages(&self, lag: AmplifierLag, fall: Fall, start_v: f64, shifts: &[f64]) -> Option<Vec<f64>> {
        let mut amplifier = Amplifier::new(lag, fall);
        let mut voltage = start_v;
        let mut voltages = Vec::with_capacity(self.time_s.len());
        voltages.push(voltage);
        for k in 1..self.time_s.len() {
            let interval_s = self.time_s[k] - self.time_s[k - 1];
            // Of the jump at the row before, what comes after it; of the one at this row, what comes before it.
            let (behind, ahead) = (self.jump_v[k - 1], self.jump_v[k]);
            let shift = |row: usize| shifts.get(self.shift[row]).copied().unwrap_or(0.0);
            let (late, early) = (-shift(k - 1), shift(k));
            let (from, to) = (self.command_v[k - 1], self.command_v[k] - ahead);
            if behind != 0.0 && late > 0.0 {
                let middle = from + late * (to - from);
                voltage = amplifier.advance(voltage, (from - behind, middle - behind), late * interval_s)?;
                voltage = amplifier.advance(voltage, (middle, to), (1.0 - late) * interval_s)?;
            } else if ahead != 0.0 && early > 0.0 {
                let middle = to - early * (to - from);
                voltage = amplifier.advance(voltage, (from, middle), (1.0 - early) * interval_s)?;
                voltage = amplifier.advance(voltage, (middle + ahead, to + ahead), early * interval_s)?;
            } else {
                voltage = amplifier.advance(voltage, (from, to), interval_s)?;
            }
            voltages.push(voltage);
        }
        Some(voltages)
    }
}

/// The model that the controller steps, in steps of any length.
struct Amplifier {
    lag: AmplifierLag,
    fall: Fall,
    /// The step of both models, s.
    step_s: f64,
    /// While the command is above the voltage, and below.
    models: Option<(AmplifierModel<f64>, AmplifierModel<f64>)>,
}

impl Amplifier {
    fn new(lag: AmplifierLag, fall: Fall) -> Self {
        Self { lag, fall, step_s: 0.0, models: None }
    }

    /// The voltage (V) after `duration_s` in which the command follows a line.
    fn advance(&mut self, voltage: f64, (from, to): (f64, f64), duration_s: f64) -> Option<f64> {
        if duration_s <= 0.0 {
            return Some(voltage);
        }
        let steps = (duration_s / MAX_STEP_S).ceil().clamp(STEPS.0, STEPS.1);
        let step_s = duration_s / steps;
        // Times are decimal numbers: intervals differ in their last digits.
        if (step_s - self.step_s).abs() > 1e-9 * step_s {
            let Self { lag, fall, .. } = *self;
            let falling = match fall {
                Fall::Bleeder => lag,
                Fall::TowardsCommand => AmplifierLag { rise_s: lag.fall_s, fall_s: lag.fall_s },
            };
            (self.step_s, self.models) =
                (step_s, Some((AmplifierModel::new(lag, step_s).ok()?, AmplifierModel::new(falling, step_s).ok()?)));
        }
        let (rising, falling) = self.models.as_ref()?;
        let slope = (to - from) / steps;
        Some((0..steps as u32).fold(voltage, |voltage, step| {
            let command = from + slope * (f64::from(step) + 0.5);
            if command > voltage { rising.advance(voltage, command) } else { falling.advance(voltage, command) }
        }))
    }
}
