//! The library behind the `springpot` commands.
//!
//! | room | what it does |
//! | --- | --- |
//! | [`commands`] | the command line, one file per command |
//! | [`mod@bench`] | a board as a page and a terminal see it |
//! | [`report`] | figures and HTML pages |
//! | [`host_models`] | what the tool computes: replay, fits, studies, simulated films and closed loops |
//! | [`host_emit`] | the law of a film in C |
//! | [`host_io`] | what it reads and writes: files, the link to a controller, the terminal |
//!
//! Imports point downwards, without a circle. What computes is compiled for speed, everything else for a short build.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod bench;
pub mod commands;
pub mod report;

use std::process::ExitCode;

use commands::{Verdict, with_flags};

pub use host_io::{Error, Result, choice, error, files, grid, interrupt, link, progress, quantity, supply, terminal};
pub use host_models::{
    agreement, amplifier, commission, compression, cost, excitation, fit, reduce, references, replay, sampling,
    simulation, spectrum, statistics, studies,
};

/// The program: runs its command line, and reports an error as one line.
pub fn main() -> ExitCode {
    match (commands::run(std::env::args_os()), interrupt::came()) {
        // The best so far is written, but scripts should know.
        (Ok(_), Some(status)) => ExitCode::from(status),
        (Ok(Verdict::Yes), None) => ExitCode::SUCCESS,
        (Ok(Verdict::No), None) => ExitCode::from(1),
        (Err(error), _) => {
            terminal::error(with_flags(&error.to_string()));
            ExitCode::from(2)
        }
    }
}
