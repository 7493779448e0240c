//! The demand of a reference on film, amplifier and limits, sample by sample.

use springpot::{Actuator, AmplifierLag, AmplifierModel, CommandLimits, Feedforward, Law, Preload};

use super::{Binding, Limit, RISE_S};
use crate::error::Result;
use crate::files::parameters::Parameters;
use crate::grid::Grid;
use crate::references::minimum_jerk;
use crate::statistics::{peak, range};

/// Largest offset that is tried, m: beyond any film.
const MAX_OFFSET_M: f64 = 10.0;
/// Offsets that are tried before the smallest is sought between two, each half the one before.
const OFFSET_TRIALS: i32 = 16;
/// Share of the largest voltage below which the film hardly feels it: 1e-4 of the largest force.
const NO_FORCE: f64 = 0.01;
/// Share of a reference's range by which shaping may take it off, and the time over which its acceleration counts, s.
const SHAPED: f64 = 4e-3;
const SMOOTH_S: f64 = 5e-3;
/// Share of a limit that is rounding.
const ROUNDING: f64 = 1e-9;
/// The demand of a reference with an offset on the actuator.
pub(super) struct Demand<'a> {
    /// Without the weight, whose share is taken from the force.
    actuator: Actuator,
    /// Without one of the field where the film's sizes are assumed.
    limits: CommandLimits,
    /// Largest displacement of the board, m.
    max_displacement_m: f32,
    /// The amplifier; none that follows at once.
    pub(super) lag: Option<Lag>,
    reference: &'a [f64],
    /// The reference as the controller shapes it, m.
    shaped: Vec<f64>,
    /// The rise of an offset, 0 to 1.
    rise: Vec<f64>,
    law: Law<f64>,
    /// The weight's share, N.
    preload: f64,
    /// Electrostatic force along the reference, N.
    pub(super) force: Vec<f64>,
    /// Force per metre of offset, N/m: a linear film's force is linear in the path. None for other films.
    per_offset: Option<Vec<f64>>,
    /// Force below which a difference is rounding, N.
    pub(super) slack: f64,
}

impl<'a> Demand<'a> {
    pub(super) fn new(
        parameters: &Parameters,
        reference: &'a [f64],
        grid: Grid,
        limits: CommandLimits,
    ) -> Result<Self> {
        let law = parameters.film().compressed_law::<f64>(grid.rate_hz)?;
        parameters.actuator.check()?;
        let rise: Vec<f64> = (0..grid.samples).map(|k| minimum_jerk(grid.time_s(k) / RISE_S)).collect();
        let is_linear = parameters.curve.is_none() && parameters.spring.is_none();
        let per_offset = is_linear.then(|| force_along(&law, rise.iter().copied()));
        let max_field_v_per_m = if parameters.assumed_sizes { f64::MAX } else { limits.max_field_v_per_m };
        let mut demand = Self {
            actuator: Actuator { preload: Preload::Settled, ..parameters.actuator },
            limits: CommandLimits { max_field_v_per_m, ..limits },
            max_displacement_m: max_displacement_m(parameters),
            lag: Lag::new(limits.amplifier, grid)?,
            reference,
            shaped: Vec::new(),
            rise,
            law,
            preload: parameters.actuator.preload_n(),
            force: Vec::new(),
            per_offset,
            slack: 0.0,
        };
        demand.shaped = demand.shaped(parameters, limits)?;
        demand.force = demand.force_along_path(0.0);
        demand.slack = 1e-9 * peak(&demand.force);
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

    /// Elongation (m) of a spring in series along the reference.
    pub(super) fn elongation(&self) -> Vec<f64> {
        let mut film = self.law.state();
        let mut elongated = |&x: &f64| {
            self.law.force(&mut film, x);
            film.elongation()
        };
        self.reference.iter().map(&mut elongated).collect()
    }

    /// The reference (m) as a controller with these `limits` shapes it, whose construction refuses what pulls the film in.
    fn shaped(&self, parameters: &Parameters, limits: CommandLimits) -> Result<Vec<f64>> {
        let feedforward = Feedforward::new(self.law.clone(), &parameters.actuator, limits)?;
        let mut state = feedforward.state(self.law.state());
        let shaped = self.reference.iter().map(|&target| feedforward.command(&mut state, target).reference_m);
        Ok(shaped.collect())
    }

    /// The largest acceleration (m/s²) that the reference needs, and its sample, where shaping by the bounds of speed and acceleration takes it off by more
    /// than a share of its range.
    fn acceleration(&self, grid: Grid) -> Option<(usize, f64)> {
        let off = |k: usize| (self.shaped[k] - self.reference[k]).abs();
        let worst = (0..self.reference.len()).max_by(|&a, &b| off(a).total_cmp(&off(b)))?;
        let (low, high) = range(self.reference);
        if off(worst) <= SHAPED * (high - low) {
            return None;
        }
        // Between rows that are sparser than the steps a reference has corners.
        let over = |ticks: usize| {
            let per_square_second = (grid.rate_hz / ticks as f64).powi(2);
            let bend = |k: usize| self.reference[k - ticks] - 2.0 * self.reference[k] + self.reference[k + ticks];
            let bends =
                (ticks..self.reference.len().saturating_sub(ticks)).map(|k| (k, per_square_second * bend(k).abs()));
            bends.max_by(|a, b| a.1.total_cmp(&b.1))
        };
        let smooth = ((SMOOTH_S * grid.rate_hz) as usize).max(1);
        let allowed = self.limits.max_acceleration_m_per_s2;
        [smooth, 1].into_iter().filter_map(over).find(|(_, needed)| *needed > allowed)
    }

    /// Squared voltage that sample `k` of the reference with `offset` (m) needs for `force` (N), V².
    fn squared_voltage(&self, k: usize, offset: f64, force: f64) -> f64 {
        self.actuator.squared_voltage(force, self.displacement(k, offset))
    }

    /// The voltages (V) that the reference with `offset` (m) needs for `force` (N); 0 where no voltage gives so little.
    pub(super) fn voltages(&self, offset: f64, force: &[f64]) -> Vec<f64> {
        force.iter().enumerate().map(|(k, &f)| self.squared_voltage(k, offset, f).max(0.0).sqrt()).collect()
    }

    /// Whether sample `k` of the reference with `offset` (m) is beyond the board's largest displacement, in its own numbers.
    fn is_beyond_board(&self, k: usize, offset: f64) -> bool {
        self.displacement(k, offset) as f32 > self.max_displacement_m
    }

    /// Whether sample `k` of the reference with `offset` (m) needs more than the largest voltage or field for `force` (N).
    pub(super) fn exceeds(&self, k: usize, offset: f64, force: f64) -> bool {
        let largest = self.largest(k, offset);
        self.squared_voltage(k, offset, force) / (largest * largest) - 1.0 > 0.0
    }

    /// The limits that the reference does not keep, each where it is exceeded most.
    pub(super) fn binding(&self, grid: Grid) -> Vec<Binding> {
        let worst = |limit, over: &dyn Fn(usize) -> Option<(f64, f64)>| {
            let excess = |&(_, (needed, allowed)): &(usize, (f64, f64))| f64::abs(needed - allowed);
            let most = (0..self.force.len())
                .filter_map(|k| Some((k, over(k)?)))
                .max_by(|a, b| excess(a).total_cmp(&excess(b)))?;
            let (k, (needed, allowed)) = most;
            Some(Binding { limit, needed, allowed, at_s: grid.time_s(k) })
        };
        let voltages = self.voltages(0.0, &self.force);
        let voltage = |k: usize| voltages[k];
        let field_v = |k: usize| self.actuator.field_voltage(self.limits.max_field_v_per_m, self.displacement(k, 0.0));
        let (largest_v, largest_field) = (self.limits.max_voltage_v, self.limits.max_field_v_per_m);
        let over = |needed: f64, allowed: f64| (needed > allowed).then_some((needed, allowed));
        let mut binding = vec![
            worst(Limit::Force, &|k| (self.force[k] < -self.slack).then_some((self.force[k], 0.0))),
            worst(Limit::Voltage, &|k| over(voltage(k), largest_v)),
            worst(Limit::Field, &|k| over(largest_field * (voltage(k) / field_v(k)), largest_field)),
        ];
        let next = |k: usize| voltage((k + 1).min(self.force.len() - 1));
        // From 0 V on, where V = √F, any voltage rises fast; the film hardly feels it there.
        let felt = |k: usize| voltage(k).max(next(k)) > NO_FORCE * largest_v;
        let slew = |k: usize| (next(k) - voltage(k)).abs() * grid.rate_hz;
        let speed =
            |k: usize| (self.reference[(k + 1).min(self.reference.len() - 1)] - self.reference[k]).abs() * grid.rate_hz;
        let (largest_slew, largest_speed) = (self.limits.max_slew_v_per_s, self.limits.max_velocity_m_per_s);
        let beyond = |needed: f64, allowed: f64| (needed > allowed * (1.0 + ROUNDING)).then_some((needed, allowed));
        binding.push(worst(Limit::Slew, &|k| beyond(slew(k), largest_slew).filter(|_| felt(k))));
        binding.push(worst(Limit::Velocity, &|k| beyond(speed(k), largest_speed)));
        binding.push(worst(Limit::Displacement, &|k| {
            self.is_beyond_board(k, 0.0).then(|| (self.displacement(k, 0.0), self.max_displacement_m.into()))
        }));
        binding.push(self.acceleration(grid).map(|(k, needed)| Binding {
            limit: Limit::Acceleration,
            needed,
            allowed: self.limits.max_acceleration_m_per_s2,
            at_s: grid.time_s(k),
        }));
        if let Some(lag) = self.lag {
            let asked = lag.asked(self, 0.0, &self.force);
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
    pub(super) fn least_offset(&self, below: &[bool], low: f64, high: f64) -> f64 {
        let (Some(per_offset), None) = (&self.per_offset, self.lag) else {
            // The force grows with the offset, and falls by a smaller share of it: bisection.
            let lacks = |offset: f64| {
                let force = self.force_with(offset);
                force.iter().any(|force| *force < -self.slack)
                    || self.lag.is_some_and(|lag| lag.asked(self, offset, &force).falls_too_fast.contains(&true))
            };
            let reach = reach(low, high);
            if self.lag.is_none() {
                return if lacks(MAX_OFFSET_M.min(reach)) { f64::INFINITY } else { bisected(-reach, reach, lacks).1 };
            }
            // The way back from the rise of a large offset may be more than the amplifier follows.
            let enough = (0..OFFSET_TRIALS).rev().map(|k| reach * 0.5_f64.powi(k)).find(|&offset| !lacks(offset));
            return enough.map_or(f64::INFINITY, |enough| bisected(-reach, enough, lacks).1);
        };
        // Before the rise has an effect, the force must be positive by itself.
        let effective = 1e-9 * per_offset.iter().copied().fold(0.0, f64::max);
        let needed = |k: usize| match per_offset[k] {
            more if more > effective => Some(-(self.force[k] + self.slack) / more),
            _ => below[k].then_some(f64::INFINITY),
        };
        (0..self.force.len()).filter_map(needed).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The largest offset (m) that stays within the largest voltage, field and displacement, and with which the amplifier need not lead too far, for a reference between `low` and `high` (m).
    pub(super) fn most_offset(&self, low: f64, high: f64) -> Option<f64> {
        let fits = |offset: f64| {
            let force = self.force_with(offset);
            (0..force.len()).all(|k| !self.exceeds(k, offset, force[k]) && !self.is_beyond_board(k, offset))
                && !self.lag.is_some_and(|lag| lag.asked(self, offset, &force).leads_too_high.contains(&true))
        };
        // The voltage grows with the offset: bisection.
        let reach = reach(low, high);
        fits(-reach).then(|| {
            let mut too_much = reach;
            while fits(too_much) && too_much < MAX_OFFSET_M {
                too_much *= 2.0;
            }
            bisected(-reach, too_much, fits).0
        })
    }
}

/// An amplifier that lags, over a step of the grid.
#[derive(Clone, Copy)]
pub(super) struct Lag {
    /// Share of the distance to the command that a rising voltage covers in a step.
    up: f64,
    /// Share of the voltage that the bleeder leaves after a step.
    left: f64,
}

/// The steps that an amplifier cannot follow.
pub(super) struct Asked {
    pub(super) falls_too_fast: Vec<bool>,
    pub(super) leads_too_high: Vec<bool>,
}

impl Lag {
    fn new(amplifier: AmplifierLag, grid: Grid) -> Result<Option<Self>> {
        if amplifier == AmplifierLag::NONE {
            return Ok(None);
        }
        let model: AmplifierModel<f64> = AmplifierModel::new(amplifier, grid.step_s())?;
        Ok(Some(Self { up: model.advance(0.0, 1.0), left: model.lowest(1.0) }))
    }

    /// The demand of the reference with `offset` (m), which needs `force` (N), from each sample to the next. At a voltage below
    /// `NO_FORCE` of the largest a fall that is late does not move the film.
    pub(super) fn asked(self, demand: &Demand<'_>, offset: f64, force: &[f64]) -> Asked {
        let voltage = demand.voltages(offset, force);
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

/// The largest displacement (m) that the board of `parameters` allows; infinite without one.
pub(super) fn max_displacement_m(parameters: &Parameters) -> f32 {
    parameters.board.as_ref().map_or(f32::INFINITY, |board| board.limits.max_displacement_m)
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
