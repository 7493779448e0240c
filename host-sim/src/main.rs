//! `host-sim`: see `host-sim --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    match host_sim::commands::run(std::env::args_os()) {
        // The best so far is written, but scripts should know.
        Ok(()) if host_sim::interrupt::came() => ExitCode::from(130),
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("host-sim: {error}");
            ExitCode::from(2)
        }
    }
}
