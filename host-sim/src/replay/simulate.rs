//! Runs of a model along a recorded input: the controller's code, or its full-memory reference.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use indicatif::ProgressBar;
use springpot::{
    Actuator, Compressed, Law, LawError, Load, Maxwell, Memory, Options, Real, State, VoltageDrive, Window,
};

use crate::agreement::relative_rms;
use crate::error::{Error, Result};
use crate::files::output::{self, Staged};
use crate::files::parameters::Parameters;
use crate::files::recording::Input;
use crate::grid::Grid;
use crate::replay::full_memory::FullMemory;

/// How much of the past a run remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MemoryChoice {
    /// Head and tail, as on the controller.
    Compressed,
    /// A plain window of so many seconds.
    Window(f64),
    /// Everything, exactly (in f64, by FFT).
    Full,
}

impl FromStr for MemoryChoice {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "compressed" => Ok(Self::Compressed),
            "full" => Ok(Self::Full),
            _ => text
                .strip_prefix("window:")
                .and_then(|seconds| seconds.parse().ok())
                .filter(|seconds: &f64| seconds.is_finite() && *seconds > 0.0)
                .map(Self::Window)
                .ok_or_else(|| "use compressed, full or window:SECONDS with seconds above 0".into()),
        }
    }
}

impl fmt::Display for MemoryChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Compressed => f.write_str("compressed"),
            Self::Window(seconds) => write!(f, "window:{seconds}"),
            Self::Full => f.write_str("full"),
        }
    }
}

/// The arithmetic of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Precision {
    /// As on the controller.
    F32,
    /// For reference.
    F64,
}

/// How a model is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunOptions {
    /// Steps per second.
    pub rate_hz: f64,
    /// Memory of the law.
    pub memory: MemoryChoice,
    /// Arithmetic of the step. Full memory is computed in f64 in any case, and rounded at the end for f32.
    pub precision: Precision,
}

impl Default for RunOptions {
    /// What the controller runs.
    fn default() -> Self {
        Self { rate_hz: 1000.0, memory: MemoryChoice::Compressed, precision: Precision::F32 }
    }
}

/// Force and displacement of a run, one value per sample of its grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// The voltage, where one drove the film, V.
    pub voltage_v: Option<Vec<f64>>,
    /// The force on the film, N.
    pub force_n: Vec<f64>,
    /// Its displacement, m.
    pub displacement_m: Vec<f64>,
}

impl Response {
    /// Writes the response as CSV, `more` columns behind the usual ones, staged.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where it cannot be written.
    pub fn stage(&self, path: &Path, grid: Grid, more: &[(&str, Option<&[f64]>)]) -> Result<Staged> {
        let time: Vec<f64> = (0..grid.samples).map(|k| grid.time_s(k)).collect();
        let mut columns = vec![
            ("time_s", Some(time.as_slice())),
            ("voltage_v", self.voltage_v.as_deref()),
            ("force_n", Some(&self.force_n)),
            ("displacement_m", Some(&self.displacement_m)),
        ];
        columns.extend_from_slice(more);
        output::stage_columns(path, &[], &columns)
    }
}

/// An evenly sampled drive.
enum Drive {
    Voltage(Vec<f64>),
    Force(Vec<f64>),
    Displacement(Vec<f64>),
}

impl Drive {
    fn values(&self) -> &[f64] {
        match self {
            Self::Voltage(values) | Self::Force(values) | Self::Displacement(values) => values,
        }
    }
}

/// Samples that full memory takes: each costs some 280 bytes.
pub const MOST_IN_FULL: usize = 1 << 24;

/// Runs `parameters` along `input`, resampled to `grid`; `progress` counts samples.
///
/// # Errors
///
/// [`Error`] for a law or a drive that is refused, and where full memory with coupling finds no answer.
pub fn run(
    parameters: &Parameters,
    input: &Input,
    grid: Grid,
    options: &RunOptions,
    progress: &ProgressBar,
) -> Result<Response> {
    let values = grid.resample(input.samples());
    let drive = match input {
        Input::Voltage(_) => Drive::Voltage(values),
        Input::Force(_) => Drive::Force(values),
        Input::Displacement(_) => Drive::Displacement(values),
    };
    let (force_n, displacement_m) = match (options.memory, options.precision) {
        (MemoryChoice::Full, precision) => {
            let (mut force, mut displacement) = full(parameters, &drive, grid)?;
            if precision == Precision::F32 {
                for value in force.iter_mut().chain(&mut displacement) {
                    *value = f64::from(*value as f32);
                }
            }
            (force, displacement)
        }
        (MemoryChoice::Compressed, Precision::F32) => compressed::<f32>(parameters, &drive, grid, progress)?,
        (MemoryChoice::Compressed, Precision::F64) => compressed::<f64>(parameters, &drive, grid, progress)?,
        (MemoryChoice::Window(s), Precision::F32) => windowed::<f32>(parameters, &drive, grid, s, progress)?,
        (MemoryChoice::Window(s), Precision::F64) => windowed::<f64>(parameters, &drive, grid, s, progress)?,
    };
    let coupling = parameters.actuator.stretch_coupling;
    if matches!(drive, Drive::Voltage(_)) && displacement_m.iter().any(|x| coupling * x > MOST_COUPLED) {
        return Err(pulled_in(coupling));
    }
    if !force_n.iter().chain(&displacement_m).all(|value| value.is_finite()) {
        return Err(Error::Computation(
            "the response leaves the range of the number type; check the units of the input and the parameters".into(),
        ));
    }
    let voltage_v = match drive {
        Drive::Voltage(voltage) => Some(voltage),
        Drive::Force(_) | Drive::Displacement(_) => None,
    };
    Ok(Response { voltage_v, force_n, displacement_m })
}

type Columns = (Vec<f64>, Vec<f64>);

fn compressed<T: Real>(parameters: &Parameters, drive: &Drive, grid: Grid, progress: &ProgressBar) -> Result<Columns> {
    let law = compressed_law::<T>(&parameters.model, grid.rate_hz)?;
    let state = law.state();
    step_through(&law, state, &parameters.actuator, drive, progress)
}

fn windowed<T: Real>(
    parameters: &Parameters,
    drive: &Drive,
    grid: Grid,
    seconds: f64,
    progress: &ProgressBar,
) -> Result<Columns> {
    // A window longer than the run holds nothing more.
    let length = ((seconds * grid.rate_hz).round() as usize).clamp(1, grid.samples);
    let law = Law::<T, Window<T, Vec<T>>>::window(&parameters.model, grid.step_s(), vec![T::ZERO; length])?;
    let state = law.state(vec![T::ZERO; length])?;
    step_through(&law, state, &parameters.actuator, drive, progress)
}

/// The law that the controller steps at `rate_hz`.
///
/// # Errors
///
/// [`Error`] for a rate or a model that is refused.
pub fn compressed_law<T: Real>(model: &Maxwell, rate_hz: f64) -> Result<Law<T, Compressed<T>>> {
    Law::compressed(model, Options::at_step(1.0 / rate_hz)).map_err(|error| match error {
        LawError::Step(_) | LawError::Horizon { .. } => {
            Error::option("--rate", format!("{rate_hz:?} Hz; a law needs at least 1e-3 Hz"))
        }
        error => error.into(),
    })
}

/// Steps `law` along `drive`: the same calls as on the controller.
fn step_through<T: Real, M: Memory<T>>(
    law: &Law<T, M>,
    mut state: State<T, M>,
    actuator: &Actuator,
    drive: &Drive,
    progress: &ProgressBar,
) -> Result<Columns> {
    let mut force = Vec::with_capacity(drive.values().len());
    let mut displacement = Vec::with_capacity(drive.values().len());
    let mut push = |f: T, x: T| {
        force.push(f.to_f64());
        displacement.push(x.to_f64());
        if force.len() % 4096 == 0 {
            progress.inc(4096);
        }
    };
    match drive {
        Drive::Voltage(voltage) => {
            let largest = voltage.iter().fold(1.0, |largest: f64, v| largest.max(v.abs()));
            let volts = VoltageDrive::new(actuator, largest, law.stiffness())?;
            for &v in voltage {
                let load: Load<T> = volts.load(T::from_f64(v));
                let x = law.displacement_under(&mut state, load);
                push(load.force + load.slope * x, x);
            }
        }
        Drive::Force(total) => {
            for &f in total {
                let f = T::from_f64(f);
                push(f, law.displacement(&mut state, f));
            }
        }
        Drive::Displacement(path) => {
            for &x in path {
                let x = T::from_f64(x);
                push(law.force(&mut state, x), x);
            }
        }
    }
    Ok((force, displacement))
}

/// A force that coupling has made so many times as large belongs to a film that is pulled in.
const MOST_COUPLED: f64 = 10.0;

fn pulled_in(coupling: f64) -> Error {
    Error::Computation(format!(
        "pull-in: with stretch_coupling = {coupling:?} 1/m the force grows faster than the film resists; lower the coupling \
         or the voltage"
    ))
}

/// The exact answer with full memory.
fn full(parameters: &Parameters, drive: &Drive, grid: Grid) -> Result<Columns> {
    if grid.samples > MOST_IN_FULL {
        let cause = format!("full memory of {} samples; {MOST_IN_FULL} at the most, lower the rate", grid.samples);
        return Err(Error::option("--memory", cause));
    }
    let memory = FullMemory::new(grid.samples, grid.step_s());
    let actuator = &parameters.actuator;
    match drive {
        Drive::Force(force) => Ok((force.clone(), memory.displacement(&parameters.model, force))),
        Drive::Displacement(path) => Ok((memory.force(&parameters.model, path), path.clone())),
        Drive::Voltage(voltage) => {
            actuator.check()?;
            let electrostatic: Vec<f64> = voltage.iter().map(|v| actuator.force_per_square_volt() * v * v).collect();
            let total = |x: &[f64]| -> Vec<f64> {
                let coupled = electrostatic.iter().zip(x).map(|(f, x)| f * (1.0 + actuator.stretch_coupling * x));
                coupled.map(|f| f + actuator.preload_n()).collect()
            };
            let stiffness = memory.dynamic_stiffness(&parameters.model);
            let mut displacement = vec![0.0; grid.samples];
            // The coupling depends on the answer: repeat until it stays. Each pass gains about a digit.
            for _ in 0..200 {
                let better = memory.displacement_from(&stiffness, &total(&displacement));
                let change = relative_rms(&displacement, &better);
                displacement = better;
                if actuator.stretch_coupling == 0.0 || change < 1e-13 {
                    return Ok((total(&displacement), displacement));
                }
            }
            Err(pulled_in(actuator.stretch_coupling))
        }
    }
}
