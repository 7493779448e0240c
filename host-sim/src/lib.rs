//! The library behind the `host-sim` commands.
//!
//! | room | what it does |
//! | --- | --- |
//! | [`commands`] | the command line, one file per command |
//! | [`report`] | figures and HTML pages |
//! | [`host_models`] | what the tool computes: replay, fits, studies, simulated films and closed loops |
//! | [`host_emit`] | the law of a film in C |
//! | [`host_io`] | what it reads and writes: files, the link to a controller, the terminal |
//!
//! Imports point downwards, without a circle. What computes is compiled for speed, everything else for a short build.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod commands;
pub mod report;

pub use host_io::{Error, Result, choice, error, files, grid, interrupt, link, progress, quantity, terminal};
pub use host_models::{
    agreement, amplifier, compression, cost, excitation, fit, reduce, references, replay, simulation, spectrum, studies,
};
