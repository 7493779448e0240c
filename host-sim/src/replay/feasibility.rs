//! Whether a film can follow a reference at all, before any voltage is applied.

use serde::Serialize;
use springpot::{Actuator, AmplifierLag, AmplifierModel, CommandLimits, Law, Preload};

use crate::error::Result;
use crate::files::parameters::Parameters;
use crate::grid::Grid;
use crate::references::minimum_jerk;
use crate::replay::memory::compressed_law;

/// Whether a reference can be followed, and which offset makes it so.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Feasibility {
    /// Whether it needs no voltage below 0 or above the largest, and no amplifier faster than the board's.
    pub feasible: bool,
    /// Whether the field was checked: not where the film's sizes are assumed.
    pub field_checked: bool,
    /// Share of the time that needs a force below what 0 V gives, %.
    pub below_zero_pct: f64,
    /// Share of the time that needs more than the largest voltage or field, %.
    pub above_largest_pct: f64,
    /// Share of the time beyond the stroke that the film's elastic curve was measured over, %: the curve goes on linearly there.
    pub beyond_curve_pct: f64,
    /// First time at which either is needed, s.
    pub first_s: Option<f64>,
    /// Lowest electrostatic force that is needed, N.
    pub lowest_force_n: f64,
    /// Largest voltage that is needed, V.
    pub largest_voltage_v: f64,
    /// Lowest displacement of the reference after its first 2 s, m.
    pub low_m: f64,
    /// Highest displacement after the first 2 s, m.
    pub high_m: f64,
    /// The smallest offset with which the reference needs no voltage below 0, m: a rise of 2 s, then a constant. Negative
    /// where the reference lies higher than necessary; `None` where no offset within reach is enough.
    pub least_offset_m: Option<f64>,
    /// The largest offset that needs no more than the largest voltage, m; negative for a reference that is too high.
    pub most_offset_m: Option<f64>,
    /// What of it the amplifier cannot follow, where it lags.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplifier: Option<AmplifierDemand>,
    /// The limits that are not kept, each with what is needed and what is allowed where it is exceeded most.
    pub binding: Vec<Binding>,
    /// A smaller reference that can be followed, where no offset makes this one so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smaller: Option<Smaller>,
}

/// A limit that a reference does not keep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Binding {
    /// Which one.
    pub limit: Limit,
    /// What the reference needs, where it exceeds the limit most, in the limit's unit.
    pub needed: f64,
    /// What is allowed there.
    pub allowed: f64,
    /// When that is, s.
    pub at_s: f64,
}

/// What a reference may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// An electrostatic force that is not negative, N: voltage only stretches a film.
    Force,
    /// The largest voltage, V.
    Voltage,
    /// The largest electric field, V/m.
    Field,
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

/// What a reference needs of an amplifier that lags.
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

/// Largest offset that is tried, m: beyond any film.
const MOST_OFFSET_M: f64 = 10.0;
/// Offsets that are tried before the smallest is sought between two, each half the one before.
const OFFSET_TRIALS: i32 = 16;
/// Share of the largest voltage below which the film hardly feels it: 1e-4 of the largest force.
const NO_FORCE: f64 = 0.01;
/// Time in which an offset is added, s.
const RISE_S: f64 = 2.0;

/// Whether the model of `parameters` can follow `reference` (m, on `grid`) within `limits`.
///
/// # Errors
///
/// [`Error`](crate::Error) where a law is refused.
pub fn check(parameters: &Parameters, reference: &[f64], grid: Grid, limits: &CommandLimits) -> Result<Feasibility> {
    let field_checked = !parameters.assumed_sizes;
    let unlimited = CommandLimits { max_field_v_per_m: f64::MAX, ..*limits };
    let demand = Demand::new(parameters, reference, grid, if field_checked { limits } else { &unlimited })?;
    let below: Vec<bool> = demand.force.iter().map(|f| *f < -demand.slack).collect();
    let above: Vec<bool> = (0..reference.len()).map(|k| demand.exceeds(k, 0.0, demand.force[k])).collect();
    let share = |flags: &[bool]| 100.0 * flags.iter().filter(|flag| **flag).count() as f64 / flags.len() as f64;
    let beyond: Vec<bool> = match &parameters.curve {
        Some(curve) => {
            let (low, high) = curve.pieces().range();
            reference.iter().map(|x| !(low..=high).contains(x)).collect()
        }
        None => vec![false; reference.len()],
    };
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
    let settled = ((RISE_S * grid.rate_hz) as usize).min(reference.len() - 1);
    let (low_m, high_m) = reference[settled..]
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
    let least = demand.least_offset(&below, low_m, high_m);
    let most_offset_m = demand.most_offset(low_m, high_m);
    let square = (0..reference.len()).map(|k| demand.squared_voltage(k, 0.0, demand.force[k])).fold(0.0, f64::max);
    let least_offset_m = (least.is_finite() && most_offset_m.is_none_or(|most| least <= most)).then_some(least);
    let feasible = first.is_none() && amplifier_follows;
    let binding = if feasible { Vec::new() } else { demand.binding(grid) };
    Ok(Feasibility {
        feasible,
        field_checked,
        below_zero_pct: share(&below),
        above_largest_pct: share(&above),
        beyond_curve_pct: share(&beyond),
        first_s: first.map(|k| grid.time_s(k)),
        lowest_force_n: demand.force.iter().copied().fold(f64::INFINITY, f64::min),
        largest_voltage_v: square.sqrt(),
        low_m,
        high_m,
        least_offset_m,
        most_offset_m,
        amplifier,
        binding,
        smaller: None,
    })
}

/// As [`check`], and where no offset makes the reference feasible, the largest tenth of it that one does.
///
/// # Errors
///
/// As [`check`].
pub fn check_and_mend(
    parameters: &Parameters,
    reference: &[f64],
    grid: Grid,
    limits: &CommandLimits,
) -> Result<Feasibility> {
    let mut found = check(parameters, reference, grid, limits)?;
    if found.feasible || found.has_offset() {
        return Ok(found);
    }
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

/// What a reference with an offset asks of the actuator.
struct Demand<'a> {
    /// Without the weight, whose share is taken from the force.
    actuator: Actuator,
    limits: &'a CommandLimits,
    /// The amplifier; none that follows at once.
    lag: Option<Lag>,
    reference: &'a [f64],
    /// The rise of an offset, 0 to 1.
    rise: Vec<f64>,
    law: Law<f64>,
    /// The weight's share, N.
    preload: f64,
    /// Electrostatic force along the reference, N.
    force: Vec<f64>,
    /// Force per metre of offset, N/m: a linear film's force is linear in the path. None behind an elastic curve.
    per_offset: Option<Vec<f64>>,
    /// Force below which a difference is rounding, N.
    slack: f64,
}

impl<'a> Demand<'a> {
    fn new(parameters: &Parameters, reference: &'a [f64], grid: Grid, limits: &'a CommandLimits) -> Result<Self> {
        let law = compressed_law::<f64>(parameters.film(), grid.rate_hz)?;
        parameters.actuator.check()?;
        let rise: Vec<f64> = (0..grid.samples).map(|k| minimum_jerk(grid.time_s(k) / RISE_S)).collect();
        let per_offset = parameters.curve.is_none().then(|| force_along(&law, rise.iter().copied()));
        let mut demand = Self {
            actuator: Actuator { preload: Preload::Settled, ..parameters.actuator },
            limits,
            lag: Lag::of(limits.amplifier, grid)?,
            reference,
            rise,
            law,
            preload: parameters.actuator.preload_n(),
            force: Vec::new(),
            per_offset,
            slack: 0.0,
        };
        demand.force = demand.force_along_path(0.0);
        let largest = demand.force.iter().fold(0.0, |largest: f64, f| largest.max(f.abs()));
        demand.slack = 1e-9 * largest;
        Ok(demand)
    }

    fn displacement(&self, k: usize, offset: f64) -> f64 {
        self.reference[k] + offset * self.rise[k]
    }

    /// Electrostatic force (N) along the reference with `offset` (m), by the law.
    fn force_along_path(&self, offset: f64) -> Vec<f64> {
        let path = (0..self.reference.len()).map(|k| self.displacement(k, offset));
        force_along(&self.law, path).into_iter().map(|force| force - self.preload).collect()
    }

    /// The same, by superposition where the film is linear.
    fn force_with(&self, offset: f64) -> Vec<f64> {
        match &self.per_offset {
            Some(per_offset) => self.force.iter().zip(per_offset).map(|(f, more)| f + offset * more).collect(),
            None => self.force_along_path(offset),
        }
    }

    /// Squared voltage that sample `k` of the reference with `offset` (m) needs for `force` (N), V².
    fn squared_voltage(&self, k: usize, offset: f64, force: f64) -> f64 {
        self.actuator.squared_voltage(force, self.displacement(k, offset))
    }

    /// Whether sample `k` of the reference with `offset` (m) needs more than the largest voltage or field for `force` (N).
    fn exceeds(&self, k: usize, offset: f64, force: f64) -> bool {
        let largest = self.largest(k, offset);
        self.squared_voltage(k, offset, force) / (largest * largest) - 1.0 > 0.0
    }

    /// The limits that the reference does not keep, each where it is exceeded most.
    fn binding(&self, grid: Grid) -> Vec<Binding> {
        let worst = |limit, over: &dyn Fn(usize) -> Option<(f64, f64)>| {
            let excess = |&(_, (needed, allowed)): &(usize, (f64, f64))| f64::abs(needed - allowed);
            let most = (0..self.force.len())
                .filter_map(|k| Some((k, over(k)?)))
                .max_by(|a, b| excess(a).total_cmp(&excess(b)))?;
            let (k, (needed, allowed)) = most;
            Some(Binding { limit, needed, allowed, at_s: grid.time_s(k) })
        };
        let voltage = |k: usize| self.squared_voltage(k, 0.0, self.force[k]).max(0.0).sqrt();
        let field_v = |k: usize| self.actuator.field_voltage(self.limits.max_field_v_per_m, self.displacement(k, 0.0));
        let (largest_v, largest_field) = (self.limits.max_voltage_v, self.limits.max_field_v_per_m);
        let over = |needed: f64, allowed: f64| (needed > allowed).then_some((needed, allowed));
        let mut binding = vec![
            worst(Limit::Force, &|k| (self.force[k] < -self.slack).then_some((self.force[k], 0.0))),
            worst(Limit::Voltage, &|k| over(voltage(k), largest_v)),
            worst(Limit::Field, &|k| over(largest_field * (voltage(k) / field_v(k)), largest_field)),
        ];
        if let Some(lag) = self.lag {
            let asked = lag.asked(self, 0.0, &self.force);
            let next = |k: usize| voltage((k + 1).min(self.force.len() - 1));
            binding.push(worst(Limit::Fall, &|k| {
                asked.falls_too_fast[k].then(|| {
                    let fall = |share: f64| share * grid.rate_hz;
                    (fall(voltage(k) - next(k)), fall(voltage(k) * (1.0 - lag.left)))
                })
            }));
            binding.push(worst(Limit::Lead, &|k| {
                asked.leads_too_high[k]
                    .then(|| (voltage(k) + (next(k) - voltage(k)) / lag.up, self.largest(k + 1, 0.0)))
            }));
        }
        binding.into_iter().flatten().collect()
    }

    /// The largest voltage (V) at sample `k` of the reference with `offset` (m), for the field as well.
    fn largest(&self, k: usize, offset: f64) -> f64 {
        let field = self.actuator.field_voltage(self.limits.max_field_v_per_m, self.displacement(k, offset));
        field.min(self.limits.max_voltage_v)
    }

    /// The smallest offset (m) with which no sample needs a force below that at 0 V, or a faster fall than the amplifier's, given the
    /// samples that are below it without an offset, for a reference between `low` and `high` (m).
    fn least_offset(&self, below: &[bool], low: f64, high: f64) -> f64 {
        let (Some(per_offset), None) = (&self.per_offset, self.lag) else {
            // The force grows with the offset, and falls by a smaller share of it: bisection.
            let lacks = |offset: f64| {
                let force = self.force_with(offset);
                force.iter().any(|force| *force < -self.slack)
                    || self.lag.is_some_and(|lag| lag.asked(self, offset, &force).falls_too_fast.contains(&true))
            };
            let reach = reach(low, high);
            if self.lag.is_none() {
                return if lacks(MOST_OFFSET_M.min(reach)) { f64::INFINITY } else { bisected(-reach, reach, lacks).1 };
            }
            // The way back from the rise of a large offset may be more than the amplifier follows.
            let enough = (0..OFFSET_TRIALS).rev().map(|k| reach * 0.5_f64.powi(k)).find(|&offset| !lacks(offset));
            return enough.map_or(f64::INFINITY, |enough| bisected(-reach, enough, lacks).1);
        };
        // Before the rise has an effect, the force must be positive by itself.
        let effective = 1e-9 * per_offset.iter().copied().fold(0.0, f64::max);
        (0..self.force.len())
            .filter(|&k| per_offset[k] > effective || below[k])
            .map(
                |k| {
                    if per_offset[k] > effective {
                        -(self.force[k] + self.slack) / per_offset[k]
                    } else {
                        f64::INFINITY
                    }
                },
            )
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// The largest offset (m) that stays within the largest voltage and field, for a reference between `low` and `high` (m).
    fn most_offset(&self, low: f64, high: f64) -> Option<f64> {
        let fits = |offset: f64| {
            let force = self.force_with(offset);
            (0..force.len()).all(|k| !self.exceeds(k, offset, force[k]))
                && !self.lag.is_some_and(|lag| lag.asked(self, offset, &force).leads_too_high.contains(&true))
        };
        // The voltage grows with the offset: bisection.
        let reach = reach(low, high);
        fits(-reach).then(|| {
            let mut too_much = reach;
            while fits(too_much) && too_much < MOST_OFFSET_M {
                too_much *= 2.0;
            }
            bisected(-reach, too_much, fits).0
        })
    }
}

/// An amplifier that lags, over a step of the grid.
#[derive(Clone, Copy)]
struct Lag {
    /// Share of the distance to the command that a rising voltage goes in a step.
    up: f64,
    /// Share of the voltage that the bleeder leaves after a step.
    left: f64,
}

/// The steps that an amplifier cannot follow.
struct Asked {
    falls_too_fast: Vec<bool>,
    leads_too_high: Vec<bool>,
}

impl Lag {
    fn of(amplifier: AmplifierLag, grid: Grid) -> Result<Option<Self>> {
        if amplifier == AmplifierLag::NONE {
            return Ok(None);
        }
        let model: AmplifierModel<f64> = AmplifierModel::new(amplifier, grid.step_s())?;
        Ok(Some(Self { up: model.advance(0.0, 1.0), left: model.lowest(1.0) }))
    }

    /// What the reference with `offset` (m), which needs `force` (N), asks from each sample to the next. At a voltage below
    /// `NO_FORCE` of the largest a fall that is late does not move the film.
    fn asked(self, demand: &Demand<'_>, offset: f64, force: &[f64]) -> Asked {
        let voltage: Vec<f64> =
            force.iter().enumerate().map(|(k, &f)| demand.squared_voltage(k, offset, f).max(0.0).sqrt()).collect();
        let lowest = NO_FORCE * demand.limits.max_voltage_v;
        let steps = || voltage.windows(2).enumerate().map(|(k, pair)| (k, pair[0], pair[1]));
        Asked {
            falls_too_fast: steps()
                .map(|(_, now, next)| now > lowest && next < self.left * now * (1.0 - 1e-9))
                .chain([false])
                .collect(),
            leads_too_high: steps()
                .map(|(k, now, next)| {
                    let largest = demand.largest(k + 1, offset);
                    next > now && next <= largest && now + (next - now) / self.up > largest * (1.0 + 1e-9)
                })
                .chain([false])
                .collect(),
        }
    }
}

/// How far an offset may lie from 0 for a reference between `low` and `high` (m).
fn reach(low: f64, high: f64) -> f64 {
    10.0 * high.abs().max(high - low).max(1e-6)
}

/// Both sides of where `holds` ends, which it does once between `low` and `high`.
fn bisected(low: f64, high: f64, holds: impl Fn(f64) -> bool) -> (f64, f64) {
    let (mut holding, mut ended) = (low, high);
    for _ in 0..60 {
        let middle = 0.5 * (holding + ended);
        if ended - holding <= 1e-9 * (high - low) {
            break;
        }
        if holds(middle) {
            holding = middle;
        } else {
            ended = middle;
        }
    }
    (holding, ended)
}

/// Force (N) of `law` along `path` (m), from rest.
fn force_along(law: &Law<f64>, path: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut film = law.state();
    path.map(|x| law.force(&mut film, x)).collect()
}
