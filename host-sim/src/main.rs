//! `host-sim`: see `host-sim --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    match host_sim::commands::run(std::env::args_os()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("host-sim: {error}");
            ExitCode::from(2)
        }
    }
}
