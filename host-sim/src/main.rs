//! `host-sim`: see `host-sim --help`.

use std::process::ExitCode;

use host_sim::commands::Verdict;

fn main() -> ExitCode {
    match host_sim::commands::run(std::env::args_os()) {
        // The best so far is written, but scripts should know.
        Ok(_) if host_sim::interrupt::came() => ExitCode::from(130),
        Ok(Verdict::Yes) => ExitCode::SUCCESS,
        Ok(Verdict::No) => ExitCode::from(1),
        Err(error) => {
            eprintln!("host-sim: {error}");
            ExitCode::from(2)
        }
    }
}
