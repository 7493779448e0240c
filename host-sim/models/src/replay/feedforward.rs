//! The voltage that makes a film follow a reference.

use springpot::{Applied, CommandLimits, Feedforward, Law, LawState, Limited, Memory, Real};

use crate::error::Result;
use crate::files::parameters::Parameters;
use crate::grid::Grid;
use crate::progress::Watch;
use crate::replay::full_memory::FullMemory;
use crate::replay::memory::{OnLaw, OnMemory, RunOptions, on_memory};
use crate::replay::simulate::check_full;

/// Voltages along a reference, one value per sample of its grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VoltagePlan {
    /// The voltage, V.
    pub voltage_v: Vec<f64>,
    /// Displacement of the model under it, m.
    pub displacement_m: Vec<f64>,
    /// The shaped reference, m.
    pub reference_m: Vec<f64>,
    /// The limits that were met.
    pub limited: Vec<Limited>,
}

/// Voltages that take the model of `parameters` along `reference` (m, on `grid`) within `limits`; `progress` counts
/// samples. Sample k of the voltage brings the model to sample k of the reference, as `simulate` runs it.
///
/// With full memory the whole path is inverted at once: its voltages are clipped, not slewed, and nothing is shaped.
pub fn plan(
    parameters: &Parameters,
    reference: &[f64],
    grid: Grid,
    options: &RunOptions,
    limits: CommandLimits,
    progress: &dyn Watch,
) -> Result<VoltagePlan> {
    plan_after(parameters, &[], reference, grid, options, limits, progress)
}

/// As [`plan`], of a film that was driven with `history_v` (V, at the rate of `grid`) before; full memory begins at rest.
pub fn plan_after(
    parameters: &Parameters,
    history_v: &[f64],
    reference: &[f64],
    grid: Grid,
    options: &RunOptions,
    limits: CommandLimits,
    progress: &dyn Watch,
) -> Result<VoltagePlan> {
    let inversion = Inversion { parameters, history_v, reference, grid, limits, progress };
    on_memory(parameters.film(), grid, options, inversion)
}

struct Inversion<'a> {
    parameters: &'a Parameters,
    history_v: &'a [f64],
    reference: &'a [f64],
    grid: Grid,
    limits: CommandLimits,
    progress: &'a dyn Watch,
}

impl OnLaw for Inversion<'_> {
    type Output = VoltagePlan;

    /// The calls of a controller, tick by tick.
    fn on_law<T: Real, M: Memory<T>>(self, law: Law<T, M>, rest: LawState<T, M>) -> Result<VoltagePlan> {
        let feedforward = Feedforward::new(law, &self.parameters.actuator, self.limits)?;
        let mut state = feedforward.state(rest);
        for &volts in self.history_v {
            feedforward.apply(&mut state, Applied::as_commanded(T::from_f64(volts)));
        }
        let mut plan = VoltagePlan::default();
        for (k, &target) in self.reference.iter().enumerate() {
            let command = feedforward.command(&mut state, T::from_f64(target));
            let displacement = feedforward.apply(&mut state, Applied::as_commanded(command.voltage_v));
            plan.voltage_v.push(command.voltage_v.to_f64());
            plan.displacement_m.push(displacement.to_f64());
            plan.reference_m.push(command.reference_m.to_f64());
            plan.limited.push(command.limited);
            if k % 4096 == 4095 {
                self.progress.advance(4096)?;
            }
        }
        Ok(plan)
    }
}

impl OnMemory for Inversion<'_> {
    fn with_full_memory(self) -> Result<VoltagePlan> {
        let Self { parameters, reference, grid, limits, progress, .. } = self;
        check_full(grid)?;
        let actuator = &parameters.actuator;
        actuator.check()?;
        let film = parameters.film();
        let memory = FullMemory::with_method(grid.samples, grid.step_s(), film.method);
        progress.advance(0)?;
        let force = memory.force_along(film, reference);
        let mut plan = VoltagePlan { reference_m: reference.to_vec(), ..VoltagePlan::default() };
        let mut clipped = Vec::with_capacity(force.len());
        for (&force, &x) in force.iter().zip(reference) {
            let mut limited =
                if actuator.squared_voltage(force, x) < 0.0 { Limited::BELOW_ZERO } else { Limited::NONE };
            let field = actuator.field_voltage(limits.max_field_v_per_m, x);
            let wanted = actuator.voltage(force, x);
            if wanted > field {
                limited |= Limited::FIELD;
            }
            if wanted > limits.max_voltage_v {
                limited |= Limited::MAX_VOLTAGE;
            }
            let voltage = wanted.min(field).min(limits.max_voltage_v);
            plan.voltage_v.push(voltage);
            plan.limited.push(limited);
            clipped.push(actuator.load(voltage));
        }
        plan.displacement_m = if plan.limited.iter().all(|limited| limited.is_none()) {
            reference.to_vec()
        } else {
            memory.displacement_under(film, &clipped, grid.step_s())?
        };
        Ok(plan)
    }
}
