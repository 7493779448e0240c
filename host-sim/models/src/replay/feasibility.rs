//! Check of whether a film can follow a reference at all, before any voltage is applied.

mod demand;

use serde::Serialize;
use springpot::{CommandLimits, Spring};

use self::demand::{Demand, max_displacement_m};
use crate::error::Result;
use crate::files::parameters::Parameters;
use crate::grid::Grid;
use crate::references::minimum_jerk;
use crate::replay::expectation::{Expectation, Recorded};
use crate::statistics::range;

/// Result of the check of a reference, and the offset that makes it feasible.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Feasibility {
    /// Whether it needs no voltage below 0 or above the largest, no faster change than the limits, no more displacement and no faster amplifier than the
    /// board's.
    pub feasible: bool,
    /// Whether the field was checked: not where the film's sizes are assumed.
    pub field_checked: bool,
    /// Share of the time that needs a force below what 0 V gives, %.
    pub below_zero_pct: f64,
    /// Share of the time that needs more than the largest voltage or field, %.
    pub above_largest_pct: f64,
    /// Share of the time beyond the stroke that the film's elastic curve or spring was measured over, %: it continues linearly there. A spring
    /// in series has a stroke of its own, its elongation.
    pub beyond_curve_pct: f64,
    /// First time at which either is needed, s.
    pub first_s: Option<f64>,
    /// Lowest electrostatic force that is needed, N.
    pub lowest_force_n: f64,
    /// Largest voltage that is needed, V.
    pub largest_voltage_v: f64,
    /// Displacement of its first sample, m. A film at rest is at 0: any other needs a jump.
    pub first_m: f64,
    /// Lowest displacement of the reference after its first 2 s, m.
    pub low_m: f64,
    /// Highest displacement after the first 2 s, m.
    pub high_m: f64,
    /// The smallest offset with which the reference needs no voltage below 0, m: a rise of 2 s, then a constant. Negative
    /// where the reference lies higher than necessary; `None` where no offset within reach is enough.
    pub least_offset_m: Option<f64>,
    /// The largest offset that needs no more than the largest voltage, m; negative for a reference that is too high.
    pub most_offset_m: Option<f64>,
    /// The part of it that the amplifier cannot follow, where it lags.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplifier: Option<AmplifierDemand>,
    /// The limits that are not kept, each with what is needed and what is allowed where it is exceeded most.
    pub binding: Vec<Binding>,
    /// The error to expect, where the parameter file has what was recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expectation: Option<Expectation>,
    /// A smaller reference that can be followed, where no offset makes this one so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smaller: Option<Smaller>,
}

/// A limit that a reference does not keep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Binding {
    /// Which one.
    pub limit: Limit,
    /// The value that the reference needs, where it exceeds the limit most, in the limit's unit.
    pub needed: f64,
    /// The value that is allowed there.
    pub allowed: f64,
    /// When that is, s.
    pub at_s: f64,
}

/// A limit of a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// An electrostatic force that is not negative, N: voltage only stretches a film.
    Force,
    /// The largest voltage, V.
    Voltage,
    /// The largest electric field, V/m.
    Field,
    /// The largest change of voltage, V/s.
    Slew,
    /// The largest speed of the reference, m/s.
    Velocity,
    /// The largest acceleration of the reference, m/s².
    Acceleration,
    /// The largest displacement of the board, m.
    Displacement,
    /// The fastest fall of the amplifier's voltage, V/s.
    Fall,
    /// The command that leads by the amplifier's lag, V.
    Lead,
}

/// A smaller reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Smaller {
    /// Factor of the reference.
    pub factor: f64,
    /// Offset to add to it then, m: a rise of 2 s, then a constant.
    pub offset_m: f64,
}

/// The demand of a reference on an amplifier that lags.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AmplifierDemand {
    /// Share of the time in which the voltage must fall faster than the bleeder lets it, −V / `fall_s`, %.
    pub falls_too_fast_pct: f64,
    /// First time at which it must, s.
    pub falls_too_fast_s: Option<f64>,
    /// Share of the time in which a command that leads by the lag is above the largest voltage, though the voltage itself is not, %.
    pub leads_too_high_pct: f64,
    /// First time at which it is, s.
    pub leads_too_high_s: Option<f64>,
}

/// Time in which an offset is added, s.
const RISE_S: f64 = 2.0;

/// Checks whether the model of `parameters` can follow `reference` (m, on `grid`) within `limits`.
pub fn check(parameters: &Parameters, reference: &[f64], grid: Grid, limits: &CommandLimits) -> Result<Feasibility> {
    let field_checked = !parameters.assumed_sizes;
    let demand = Demand::new(parameters, reference, grid, *limits)?;
    let below: Vec<bool> = demand.force.iter().map(|f| *f < -demand.slack).collect();
    let above: Vec<bool> = (0..reference.len()).map(|k| demand.exceeds(k, 0.0, demand.force[k])).collect();
    let share = |flags: &[bool]| 100.0 * flags.iter().filter(|flag| **flag).count() as f64 / flags.len() as f64;
    let beyond = beyond_curve(parameters, reference, &demand);
    let amplifier = demand.lag.map(|lag| {
        let asked = lag.asked(&demand, 0.0, &demand.force);
        let first = |flags: &[bool]| flags.iter().position(|flag| *flag).map(|k| grid.time_s(k));
        AmplifierDemand {
            falls_too_fast_pct: share(&asked.falls_too_fast),
            falls_too_fast_s: first(&asked.falls_too_fast),
            leads_too_high_pct: share(&asked.leads_too_high),
            leads_too_high_s: first(&asked.leads_too_high),
        }
    });
    let amplifier_follows =
        amplifier.is_none_or(|asked| asked.falls_too_fast_s.is_none() && asked.leads_too_high_s.is_none());
    let first = (0..reference.len()).find(|&k| below[k] || above[k]);
    // All of a reference that ends before.
    let settled = Some((RISE_S * grid.rate_hz) as usize).filter(|settled| settled + 1 < reference.len());
    let (low_m, high_m) = range(&reference[settled.unwrap_or(0)..]);
    // One that is held has no swing.
    let swing_m = if high_m > low_m { high_m - low_m } else { high_m.abs() };
    let least = demand.least_offset(&below, low_m, high_m);
    let most_offset_m = demand.most_offset(low_m, high_m);
    let least_offset_m = (least.is_finite() && most_offset_m.is_none_or(|most| least <= most)).then_some(least);
    let binding = demand.binding(grid);
    let is_beyond = |binding: &Binding| {
        matches!(binding.limit, Limit::Slew | Limit::Velocity | Limit::Acceleration | Limit::Displacement)
    };
    let feasible = first.is_none() && amplifier_follows && !binding.iter().any(is_beyond);
    let binding = if feasible { Vec::new() } else { binding };
    let voltage_v = demand.voltages(0.0, &demand.force);
    Ok(Feasibility {
        feasible,
        field_checked,
        below_zero_pct: share(&below),
        above_largest_pct: share(&above),
        beyond_curve_pct: share(&beyond),
        first_s: first.map(|k| grid.time_s(k)),
        lowest_force_n: demand.force.iter().copied().fold(f64::INFINITY, f64::min),
        largest_voltage_v: voltage_v.iter().copied().fold(0.0, f64::max),
        first_m: reference[0],
        low_m,
        high_m,
        least_offset_m,
        most_offset_m,
        amplifier,
        binding,
        expectation: Recorded::from_parameters(parameters)
            .filter(|_| swing_m > 0.0)
            .map(|recorded| recorded.expectation(parameters, reference, grid, swing_m, voltage_v))
            .map(|expectation| Expectation { is_held: high_m <= low_m, ..expectation }),
        smaller: None,
    })
}

/// The warning that the board of `parameters` ends a run along `reference` (m) where that is beyond its largest displacement.
pub fn beyond_board(parameters: &Parameters, reference: &[f64]) -> Option<String> {
    let (highest, allowed) = (range(reference).1, max_displacement_m(parameters));
    (highest as f32 > allowed).then(|| {
        let [highest, allowed] = [highest, allowed.into()].map(|m: f64| 1e3 * m);
        format!("the reference goes to {highest:.3} mm, the board allows {allowed:.3} mm (max_displacement_m of board.limits) and ends the run beyond it")
    })
}

/// Returns for each sample of `reference` (m) whether it is beyond the range of a curve or a spring: a spring in series has its own stroke.
fn beyond_curve(parameters: &Parameters, reference: &[f64], demand: &Demand<'_>) -> Vec<bool> {
    let beyond = |stroke: &[f64], (low, high): (f64, f64)| -> Vec<bool> {
        stroke.iter().map(|x| !(low..=high).contains(x)).collect()
    };
    let spring = parameters.spring.as_ref().map(Spring::range);
    match &parameters.curve {
        None => spring.map_or(vec![false; reference.len()], |range| beyond(&demand.elongation(), range)),
        Some(curve) => {
            let (low, high) = curve.pieces().range();
            let range = spring.map_or((low, high), |spring| (low.max(spring.0), high.min(spring.1)));
            beyond(reference, range)
        }
    }
}

/// As [`check`], and where no offset makes the reference feasible, the largest tenth of it that one does.
pub fn check_and_mend(
    parameters: &Parameters,
    reference: &[f64],
    grid: Grid,
    limits: &CommandLimits,
) -> Result<Feasibility> {
    let mut found = check(parameters, reference, grid, limits)?;
    if found.feasible || found.has_offset() && smaller(parameters, reference, grid, limits, 1.0)?.is_some() {
        return Ok(found);
    }
    // What is too fast is so with every offset.
    (found.least_offset_m, found.most_offset_m) = (None, None);
    let (mut fits, mut too_large) = (0, 10);
    while too_large - fits > 1 {
        let tenths = (fits + too_large) / 2;
        match smaller(parameters, reference, grid, limits, 0.1 * f64::from(tenths))? {
            Some(smaller) => {
                fits = tenths;
                found.smaller = Some(smaller);
            }
            None => too_large = tenths,
        }
    }
    Ok(found)
}

/// The reference times `factor` with an offset that makes it feasible, if there is one: it is checked.
fn smaller(
    parameters: &Parameters,
    reference: &[f64],
    grid: Grid,
    limits: &CommandLimits,
    factor: f64,
) -> Result<Option<Smaller>> {
    let scaled: Vec<f64> = reference.iter().map(|x| factor * x).collect();
    let found = check(parameters, &scaled, grid, limits)?;
    let offset_m = match (found.least_offset_m, found.most_offset_m) {
        _ if found.feasible => 0.0,
        (Some(least), Some(most)) => 0.5 * (least + most),
        _ => return Ok(None),
    };
    let raised: Vec<f64> =
        scaled.iter().enumerate().map(|(k, x)| x + offset_m * minimum_jerk(grid.time_s(k) / RISE_S)).collect();
    let feasible = found.feasible || check(parameters, &raised, grid, limits)?.feasible;
    Ok(feasible.then_some(Smaller { factor, offset_m }))
}

impl Feasibility {
    /// Whether an offset makes the reference feasible.
    pub fn has_offset(&self) -> bool {
        self.least_offset_m.is_some() && self.most_offset_m.is_some()
    }
}
