//! The bench beside the controller: the library behind the `host-sim` commands.
//!
//! Recordings of high-voltage runs ([`recording`]) are driven through the very code that a microcontroller steps
//! ([`run`]), or through its exact full-memory reference ([`full_memory`]), and compared with what was measured
//! ([`agreement`]). [`fit`] finds the parameters of the model from recordings, [`study`] repeats the paper's study and
//! [`compare`] sets other models beside it; [`reduce`] finds smaller models with the same response. [`twin`] simulates
//! recordings of a nonlinear film, and [`closed_loop`] sets a [`controller`] on it to follow one of the [`references`].
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod agreement;
pub mod bench;
pub mod commands;
pub mod error;
pub mod files;
pub mod fit;
pub mod grid;
pub mod interrupt;
pub mod link;
pub mod reduce;
pub mod references;
pub mod replay;
pub mod report;
pub mod studies;
pub mod terminal;

pub use error::{Error, Result};
