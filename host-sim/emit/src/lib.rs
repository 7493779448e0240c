//! The law of a film in other languages: what Rust computes at construction as tables, what a step does as code.
//!
//! | file | what it holds |
//! | --- | --- |
//! | `c/*.h` | the steps in C99, written by hand but for `2-film.h`, in the order of [`HEADER`]: the same file for every film |
//! | [`declarations()`] | `2-film.h`, the structures of constants, from those of the crate `springpot` |
//! | [`film()`] | the numbers of a film as a C source |
//! | [`arduino`] | both as a library for Arduino and PlatformIO, with an example |
//! | [`matlab`] | both with a MEX gateway for MATLAB and Octave and an S-function for Simulink, written by hand in `matlab/` |
//! | [`fmu`](mod@fmu) | both as an FMU for co-simulation, of FMI 2.0 or 3.0 |
//! | [`output`] | all of these as files, and the blob for a controller |
//!
//! The C computes with the operations of the crate `springpot` in their order, so that it gives the same bits.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod arduino;
mod film;
pub mod fmu;
pub mod matlab;
pub mod output;
mod symbol;
mod table;

pub use film::{Film, declarations, film};
pub use symbol::symbol;

/// The version of the tables, which header and film must share: `SPRINGPOT_FORMAT` in C.
pub const FORMAT: u32 = 5;

/// `springpot.h`: the same for every film.
pub const HEADER: &str = concat!(
    include_str!("../c/1-head.h"),
    include_str!("../c/2-film.h"),
    include_str!("../c/3-state.h"),
    include_str!("../c/4-law.h"),
    include_str!("../c/5-inverse.h"),
    include_str!("../c/6-adaptation.h"),
    include_str!("../c/7-control.h"),
    include_str!("../c/8-cycles.h"),
    include_str!("../c/9-learning.h"),
    include_str!("../c/10-follower.h"),
    include_str!("../c/11-self-sensing.h"),
);

/// `springpot_tick.h`: the tick of a film or of a law of control, which MATLAB, Simulink and FMUs step; the same for every film.
const TICK: &str = include_str!("../matlab/springpot_tick.h");

/// A template with the film's symbol, its name and the version of this tool.
fn filled(template: &str, symbol: &str, name: &str) -> String {
    template.replace("@SYMBOL@", symbol).replace("@NAME@", name).replace("@VERSION@", env!("CARGO_PKG_VERSION"))
}
