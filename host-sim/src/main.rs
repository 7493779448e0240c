//! `host-sim`: see `host-sim --help`.

use std::process::ExitCode;

use host_sim::commands::{Verdict, with_flags};
use host_sim::{interrupt, terminal};

fn main() -> ExitCode {
    match (host_sim::commands::run(std::env::args_os()), interrupt::came()) {
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
