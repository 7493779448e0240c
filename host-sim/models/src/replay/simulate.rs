//! The response of a model to a recorded input: the controller's code, or its full-memory reference.

use std::path::Path;

use springpot::{Actuator, Law, LawState, Load, Memory, Real, VoltageDrive};

use crate::error::{Error, Result};
use crate::files::output::{self, Staged};
use crate::files::parameters::{Film, Parameters};
use crate::files::recording::Input;
use crate::grid::Grid;
use crate::progress::Watch;
use crate::replay::full_memory::FullMemory;
use crate::replay::memory::{OnLaw, OnMemory, Precision, RunOptions, on_memory};
use crate::statistics::peak;

/// Force and displacement of a run, one value per sample of its grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// The voltage, where it is the input, V.
    pub voltage_v: Option<Vec<f64>>,
    /// The force on the film, N.
    pub force_n: Vec<f64>,
    /// Its displacement, m.
    pub displacement_m: Vec<f64>,
}

impl Response {
    /// Writes the response as CSV, staged, with `more` columns after the standard ones.
    pub fn stage(&self, path: &Path, grid: Grid, more: &[(&str, Option<&[f64]>)]) -> Result<Staged> {
        let time = grid.times_s();
        let mut columns = vec![
            ("time_s", Some(time.as_slice())),
            ("voltage_v", self.voltage_v.as_deref()),
            ("force_n", Some(&self.force_n)),
            ("displacement_m", Some(&self.displacement_m)),
        ];
        columns.extend_from_slice(more);
        output::stage_columns(path, &columns)
    }
}

/// Largest number of samples with full memory: each takes some 280 bytes.
const MAX_FULL_SAMPLES: usize = 1 << 24;

/// Refuses more samples than full memory has room for.
pub(super) fn check_full(grid: Grid) -> Result<()> {
    if grid.samples <= MAX_FULL_SAMPLES {
        return Ok(());
    }
    let cause = format!("full memory of {} samples; {MAX_FULL_SAMPLES} at the most, lower the rate", grid.samples);
    Err(Error::field("memory", cause))
}

/// The response of `parameters` to `input`, resampled to `grid`; `progress` counts samples.
///
/// # Errors
///
/// [`Error`] for a law or an input that is refused, where full memory with coupling has no solution, and where `progress` ends it.
pub fn response(
    parameters: &Parameters,
    input: &Input,
    grid: Grid,
    options: &RunOptions,
    progress: &dyn Watch,
) -> Result<Response> {
    let input = input.map(|samples| grid.resample(samples));
    let actuator = &parameters.actuator;
    let run =
        ModelRun { film: parameters.film(), actuator, input: &input, grid, precision: options.precision, progress };
    let (force_n, displacement_m) = on_memory(parameters.film(), grid, options, run)?;
    let coupling = actuator.stretch_coupling;
    if let Input::Voltage(_) = input {
        if displacement_m.iter().any(|x| coupling * x > MAX_COUPLED_GROWTH) {
            return Err(Error::Computation(format!(
                "pull-in: with stretch_coupling = {coupling:?} 1/m the force grows faster than the film resists; lower the coupling \
                 or the voltage"
            )));
        }
        if let Some(x) = displacement_m.iter().find(|x| actuator.force_growth(**x) <= 0.0) {
            return Err(Error::Computation(format!(
                "with stretch_coupling = {coupling:?} 1/m the force is gone at {x:.6} m, where the film is; the coupling does not hold \
                 that far"
            )));
        }
    }
    if !force_n.iter().chain(&displacement_m).all(|value| value.is_finite()) {
        return Err(Error::Computation(
            "the response leaves the range of the number type; check the units of the input and the parameters".into(),
        ));
    }
    let voltage_v = match input {
        Input::Voltage(voltage) => Some(voltage),
        Input::Force(_) | Input::Displacement(_) => None,
    };
    Ok(Response { voltage_v, force_n, displacement_m })
}

/// Force and displacement, one value per sample.
type Columns = (Vec<f64>, Vec<f64>);

/// A model with its input on a grid.
struct ModelRun<'a> {
    film: Film<'a>,
    actuator: &'a Actuator,
    input: &'a Input<Vec<f64>>,
    grid: Grid,
    precision: Precision,
    progress: &'a dyn Watch,
}

impl OnLaw for ModelRun<'_> {
    type Output = Columns;

    /// Steps `law` along the input: the same calls as on the controller.
    fn on_law<T: Real, M: Memory<T>>(self, law: Law<T, M>, mut state: LawState<T, M>) -> Result<Columns> {
        let mut force = Vec::with_capacity(self.grid.samples);
        let mut displacement = Vec::with_capacity(self.grid.samples);
        let mut push = |f: T, x: T| {
            force.push(f.to_f64());
            displacement.push(x.to_f64());
            if force.len() % 4096 == 0 { self.progress.advance(4096) } else { Ok(()) }
        };
        match self.input {
            Input::Voltage(voltage) => {
                let volts = VoltageDrive::new(self.actuator, peak(voltage).max(1.0), law.min_stiffness())?;
                for &v in voltage {
                    let load: Load<T> = volts.load(T::from_f64(v));
                    let x = law.displacement_under(&mut state, load);
                    push(load.force_n + load.slope_n_per_m * x, x)?;
                }
            }
            Input::Force(total) => {
                for &f in total {
                    let f = T::from_f64(f);
                    push(f, law.displacement(&mut state, f))?;
                }
            }
            Input::Displacement(path) => {
                for &x in path {
                    let x = T::from_f64(x);
                    push(law.force(&mut state, x), x)?;
                }
            }
        }
        Ok((force, displacement))
    }
}

impl OnMemory for ModelRun<'_> {
    fn with_full_memory(self) -> Result<Columns> {
        check_full(self.grid)?;
        let memory = FullMemory::with_method(self.grid.samples, self.grid.step_s(), self.film.method);
        // Between its transforms; there is no end within one.
        self.progress.advance(0)?;
        let step_s = self.grid.step_s();
        let (mut force, mut displacement) = match self.input {
            Input::Force(force) => {
                let loads: Vec<Load<f64>> =
                    force.iter().map(|&force| Load { force_n: force, slope_n_per_m: 0.0 }).collect();
                (force.clone(), memory.displacement_under(self.film, &loads, step_s)?)
            }
            Input::Displacement(path) => (memory.force_along(self.film, path), path.clone()),
            Input::Voltage(voltage) => {
                self.actuator.check()?;
                let loads: Vec<Load<f64>> = voltage.iter().map(|&volts| self.actuator.load(volts)).collect();
                let displacement = memory.displacement_under(self.film, &loads, step_s)?;
                (
                    loads.iter().zip(&displacement).map(|(load, x)| load.force_n + load.slope_n_per_m * x).collect(),
                    displacement,
                )
            }
        };
        if self.precision == Precision::F32 {
            for value in force.iter_mut().chain(&mut displacement) {
                *value = f64::from(*value as f32);
            }
        }
        Ok((force, displacement))
    }
}

/// A film whose force has grown by this factor through coupling is pulled in.
const MAX_COUPLED_GROWTH: f64 = 10.0;
