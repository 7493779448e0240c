//! The voltage that makes a film follow a reference, and whether there is one.

use indicatif::ProgressBar;
use serde::Serialize;
use springpot::{Applied, CommandLimits, Feedforward, Law, Limited, Memory, Real, State, Window};

use crate::error::{Error, Result};
use crate::files::parameters::Parameters;
use crate::grid::Grid;
use crate::references::minimum_jerk;
use crate::replay::full_memory::FullMemory;
use crate::replay::simulate::{MOST_IN_FULL, MemoryChoice, Precision, RunOptions, compressed_law};

/// Commands along a reference, one per sample of its grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Commands {
    /// The voltage, V.
    pub voltage_v: Vec<f64>,
    /// Where the model is under it, m.
    pub displacement_m: Vec<f64>,
    /// The shaped reference, m.
    pub reference_m: Vec<f64>,
    /// The limits that were met.
    pub limited: Vec<Limited>,
}

/// Commands that take the model of `parameters` along `reference` (m, on `grid`) within `limits`; `progress` counts
/// samples. Sample k of the voltage brings the model to sample k of the reference, as `simulate` runs it.
///
/// With full memory the whole path is inverted at once: its voltages are clipped, not slewed, and nothing is shaped.
///
/// # Errors
///
/// [`Error`] where a law is refused.
pub fn along(
    parameters: &Parameters,
    reference: &[f64],
    grid: Grid,
    options: &RunOptions,
    limits: CommandLimits,
    progress: &ProgressBar,
) -> Result<Commands> {
    match (options.memory, options.precision) {
        (MemoryChoice::Full, _) => full(parameters, reference, grid, limits),
        (MemoryChoice::Compressed, Precision::F32) => compressed::<f32>(parameters, reference, grid, limits, progress),
        (MemoryChoice::Compressed, Precision::F64) => compressed::<f64>(parameters, reference, grid, limits, progress),
        (MemoryChoice::Window(s), Precision::F32) => windowed::<f32>(parameters, reference, grid, s, limits, progress),
        (MemoryChoice::Window(s), Precision::F64) => windowed::<f64>(parameters, reference, grid, s, limits, progress),
    }
}

fn compressed<T: Real>(
    parameters: &Parameters,
    reference: &[f64],
    grid: Grid,
    limits: CommandLimits,
    progress: &ProgressBar,
) -> Result<Commands> {
    let law = compressed_law::<T>(&parameters.model, grid.rate_hz)?;
    let rest = law.state();
    let feedforward = Feedforward::new(law, &parameters.actuator, limits)?;
    Ok(follow(&feedforward, rest, reference, progress))
}

fn windowed<T: Real>(
    parameters: &Parameters,
    reference: &[f64],
    grid: Grid,
    seconds: f64,
    limits: CommandLimits,
    progress: &ProgressBar,
) -> Result<Commands> {
    let length = ((seconds * grid.rate_hz).round() as usize).clamp(1, grid.samples);
    let law = Law::<T, Window<T, Vec<T>>>::window(&parameters.model, grid.step_s(), vec![T::ZERO; length])?;
    let rest = law.state(vec![T::ZERO; length])?;
    let feedforward = Feedforward::new(law, &parameters.actuator, limits)?;
    Ok(follow(&feedforward, rest, reference, progress))
}

/// The calls of a controller, tick by tick.
fn follow<T: Real, M: Memory<T>>(
    feedforward: &Feedforward<T, M>,
    rest: State<T, M>,
    reference: &[f64],
    progress: &ProgressBar,
) -> Commands {
    let mut state = feedforward.state(rest);
    let mut commands = Commands::default();
    for (k, &target) in reference.iter().enumerate() {
        let command = feedforward.command(&mut state, T::from_f64(target));
        let displacement = feedforward.apply(&mut state, Applied::as_commanded(command.voltage));
        commands.voltage_v.push(command.voltage.to_f64());
        commands.displacement_m.push(displacement.to_f64());
        commands.reference_m.push(command.reference.to_f64());
        commands.limited.push(command.limited);
        if k % 4096 == 4095 {
            progress.inc(4096);
        }
    }
    commands
}

fn full(parameters: &Parameters, reference: &[f64], grid: Grid, limits: CommandLimits) -> Result<Commands> {
    if grid.samples > MOST_IN_FULL {
        let cause = format!("full memory of {} samples; {MOST_IN_FULL} at the most, lower the rate", grid.samples);
        return Err(Error::option("--memory", cause));
    }
    let actuator = &parameters.actuator;
    actuator.check()?;
    let force = FullMemory::new(grid.samples, grid.step_s()).force(&parameters.model, reference);
    let mut commands = Commands { reference_m: reference.to_vec(), ..Commands::default() };
    let mut clipped = Vec::with_capacity(force.len());
    for (force, x) in force.iter().zip(reference) {
        let coupling = 1.0 + actuator.stretch_coupling * x;
        let square = (force - actuator.preload_n()) / (actuator.force_per_square_volt() * coupling);
        let mut limited = if square < 0.0 { Limited::BELOW_ZERO } else { Limited::NONE };
        let field = limits.max_field_v_per_m * actuator.thickness_m / coupling.max(1.0);
        let wanted = square.max(0.0).sqrt();
        if wanted > field {
            limited |= Limited::FIELD;
        }
        if wanted > limits.max_voltage_v {
            limited |= Limited::MAX_VOLTAGE;
        }
        let voltage = wanted.min(field).min(limits.max_voltage_v);
        commands.voltage_v.push(voltage);
        commands.limited.push(limited);
        clipped.push(actuator.force_per_square_volt() * voltage * voltage * coupling + actuator.preload_n());
    }
    commands.displacement_m = if commands.limited.iter().all(|limited| limited.is_none()) {
        reference.to_vec()
    } else {
        FullMemory::new(grid.samples, grid.step_s()).displacement(&parameters.model, &clipped)
    };
    Ok(commands)
}

/// Whether a reference can be followed, and what would have to be changed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Feasibility {
    /// Whether no voltage below 0 or above the largest is needed.
    pub feasible: bool,
    /// Share of the time that needs a force below what 0 V gives, %.
    pub below_zero_pct: f64,
    /// Share of the time that needs more than the largest voltage or field, %.
    pub above_largest_pct: f64,
    /// First time at which either is needed, s.
    pub first_s: Option<f64>,
    /// Lowest electrostatic force that is needed, N.
    pub lowest_force_n: f64,
    /// Largest voltage that is needed, V.
    pub largest_voltage_v: f64,
    /// The reference's lowest and highest displacement after its first 2 s, m.
    pub low_m: f64,
    /// See `low_m`.
    pub high_m: f64,
    /// What has to be added at the least so that the reference needs no voltage below 0, m: a rise of 2 s, then a constant.
    /// Negative where it lies higher than it must; nothing, where no offset within the film's reach is enough.
    pub least_offset_m: Option<f64>,
    /// The most that can be added before the largest voltage is needed, m; negative for a reference that is too high.
    pub most_offset_m: Option<f64>,
}

/// No film is stretched so far, m.
const MOST_OFFSET_M: f64 = 10.0;
/// Time in which an offset is added, s.
const RISE_S: f64 = 2.0;

/// Whether the model of `parameters` can follow `reference` (m, on `grid`) within `limits`.
///
/// The force is linear in the path, so that of an offset is the offset times the force of a rise to 1 m.
///
/// # Errors
///
/// [`Error`] where a law is refused.
pub fn check(parameters: &Parameters, reference: &[f64], grid: Grid, limits: &CommandLimits) -> Result<Feasibility> {
    let law = compressed_law::<f64>(&parameters.model, grid.rate_hz)?;
    let actuator = parameters.actuator;
    actuator.check()?;
    let force_along = |path: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
        let mut film = law.state();
        path.map(|x| law.force(&mut film, x)).collect()
    };
    let preload = actuator.preload_n();
    let rise: Vec<f64> = (0..grid.samples).map(|k| minimum_jerk(grid.time_s(k) / RISE_S)).collect();
    let force: Vec<f64> = force_along(&mut reference.iter().copied()).iter().map(|f| f - preload).collect();
    let per_offset = force_along(&mut rise.iter().copied());

    let largest_force = force.iter().fold(0.0, |largest: f64, f| largest.max(f.abs()));
    let slack = 1e-9 * largest_force;
    // How far the squared voltage of a sample with an offset lies above the largest one, relative to that.
    let excess = |k: usize, offset: f64| {
        let coupling = 1.0 + actuator.stretch_coupling * (reference[k] + offset * rise[k]);
        let field = limits.max_field_v_per_m * actuator.thickness_m / coupling.max(1.0);
        let largest = field.min(limits.max_voltage_v);
        let square = (force[k] + offset * per_offset[k]) / (actuator.force_per_square_volt() * coupling.max(1e-9));
        (square / (largest * largest) - 1.0, square)
    };
    let below: Vec<bool> = force.iter().map(|f| *f < -slack).collect();
    let above: Vec<bool> = (0..force.len()).map(|k| excess(k, 0.0).0 > 0.0).collect();
    let share = |flags: &[bool]| 100.0 * flags.iter().filter(|flag| **flag).count() as f64 / flags.len() as f64;
    let first = (0..force.len()).find(|&k| below[k] || above[k]);

    // Where the rise has no say yet, the force must be positive by itself.
    let telling = 1e-9 * per_offset.iter().copied().fold(0.0, f64::max);
    let least = (0..force.len())
        .filter(|&k| per_offset[k] > telling || below[k])
        .map(|k| if per_offset[k] > telling { -(force[k] + slack) / per_offset[k] } else { f64::INFINITY })
        .fold(f64::NEG_INFINITY, f64::max);
    let fits = |offset: f64| (0..force.len()).all(|k| excess(k, offset).0 <= 0.0);
    let settled = ((RISE_S * grid.rate_hz) as usize).min(reference.len() - 1);
    let (low, high) = reference[settled..]
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
    // Voltage grows with the offset: bisect between no reference at all and what no film can do.
    let reach = 10.0 * high.abs().max(high - low).max(1e-6);
    let most = fits(-reach).then(|| {
        let (mut enough, mut too_much) = (-reach, reach);
        while fits(too_much) && too_much < MOST_OFFSET_M {
            too_much *= 2.0;
        }
        for _ in 0..60 {
            let middle = 0.5 * (enough + too_much);
            if fits(middle) {
                enough = middle;
            } else {
                too_much = middle;
            }
        }
        enough
    });
    let square = (0..force.len()).map(|k| excess(k, 0.0).1).fold(0.0, f64::max);
    Ok(Feasibility {
        feasible: first.is_none(),
        below_zero_pct: share(&below),
        above_largest_pct: share(&above),
        first_s: first.map(|k| grid.time_s(k)),
        lowest_force_n: force.iter().copied().fold(f64::INFINITY, f64::min),
        largest_voltage_v: square.sqrt(),
        low_m: low,
        high_m: high,
        least_offset_m: (least.is_finite() && most.is_none_or(|most| least <= most)).then_some(least),
        most_offset_m: most,
    })
}
