//! The law that a run steps: rate, memory and precision as a command line names them.

use std::fmt;
use std::str::FromStr;

use host_io::choice;
use springpot::{Discretisation, Law, LawState, Memory, Real, Window};

use crate::error::{Error, Result};
use crate::files::parameters::Film;
use crate::grid::Grid;
use crate::quantity;

/// How much of the past a run remembers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MemoryChoice {
    /// Head and tail, as on the controller.
    Compressed,
    /// A plain window of this length, s.
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
                .and_then(|text| quantity::seconds(text).ok())
                .filter(|seconds| *seconds > 0.0)
                .map(Self::Window)
                .ok_or_else(|| {
                    "use compressed, full or window:SECONDS with seconds above 0, such as window:10s".into()
                }),
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

choice! {
    /// The arithmetic of a run.
    pub enum Precision {
        /// As on the controller.
        F32 = "f32",
        /// For reference.
        F64 = "f64",
    }
}

/// How a model is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunOptions {
    /// Steps per second.
    pub rate_hz: f64,
    /// Memory of the law.
    pub memory: MemoryChoice,
    /// Arithmetic of the step. Full memory is always computed in f64, and rounded at the end for f32.
    pub precision: Precision,
}

impl Default for RunOptions {
    /// The law that the controller runs.
    fn default() -> Self {
        Self { rate_hz: 1000.0, memory: MemoryChoice::Compressed, precision: Precision::F32 }
    }
}

/// Work that is written once for every memory and precision.
pub trait OnLaw {
    /// The result of the work.
    type Output;

    /// Does the work with `law`, from the state `rest` of a film that was never moved.
    fn on_law<T: Real, M: Memory<T>>(self, law: Law<T, M>, rest: LawState<T, M>) -> Result<Self::Output>;
}

/// Work with a law of recursive memory, or with full memory, which has no law to step.
pub trait OnMemory: OnLaw {
    /// Does the work with full memory, in f64.
    fn with_full_memory(self) -> Result<Self::Output>;
}

/// Builds the law of `film` that `options` name, for steps on `grid`, and does `work` with it.
///
/// # Errors
///
/// [`Error`] for a rate or a model that is refused, and those of the work.
pub fn on_memory<W: OnMemory>(film: Film<'_>, grid: Grid, options: &RunOptions, work: W) -> Result<W::Output> {
    match options.memory {
        MemoryChoice::Full => work.with_full_memory(),
        MemoryChoice::Compressed => on_compressed(film, grid.rate_hz, options.precision, work),
        MemoryChoice::Window(_) if film.method != Discretisation::Gl => {
            Err(Error::field("method", "a plain window is Grünwald–Letnikov; use `method` gl or another `memory`"))
        }
        MemoryChoice::Window(seconds) => match options.precision {
            Precision::F32 => on_window::<f32, W>(film, grid, seconds, work),
            Precision::F64 => on_window::<f64, W>(film, grid, seconds, work),
        },
    }
}

/// Builds the law of `film` that a controller steps at `rate_hz`, in `precision`, and does `work` with it.
pub fn on_compressed<W: OnLaw>(film: Film<'_>, rate_hz: f64, precision: Precision, work: W) -> Result<W::Output> {
    fn on<T: Real, W: OnLaw>(film: Film<'_>, rate_hz: f64, work: W) -> Result<W::Output> {
        let law = film.compressed_law::<T>(rate_hz)?;
        let rest = law.state();
        work.on_law(law, rest)
    }
    match precision {
        Precision::F32 => on::<f32, W>(film, rate_hz, work),
        Precision::F64 => on::<f64, W>(film, rate_hz, work),
    }
}

fn on_window<T: Real, W: OnLaw>(film: Film<'_>, grid: Grid, seconds: f64, work: W) -> Result<W::Output> {
    // A window longer than the run holds nothing more.
    let length = window_length(seconds, grid.rate_hz).min(grid.samples);
    let (law, rest) = window_law::<T>(film, grid.step_s(), length)?;
    work.on_law(law, rest)
}

/// Steps of a window of `seconds`, at least one.
pub fn window_length(seconds: f64, rate_hz: f64) -> usize {
    ((seconds * rate_hz).round() as usize).max(1)
}

/// The law with a plain window of the last `length` steps, and its state at rest.
pub fn window_law<T: Real>(film: Film<'_>, step_s: f64, length: usize) -> Result<AtRest<T, VecWindow<T>>> {
    let law = film.behind(Law::<T, VecWindow<T>>::window(film.model, step_s, vec![T::ZERO; length])?)?;
    let rest = law.state(vec![T::ZERO; length])?;
    Ok((law, rest))
}

/// A window on the heap.
pub type VecWindow<T> = Window<T, Vec<T>>;

/// A law with its state at rest.
pub type AtRest<T, M> = (Law<T, M>, LawState<T, M>);
