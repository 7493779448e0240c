//! `springpot`: see `springpot --help`.

fn main() -> std::process::ExitCode {
    host_sim::main()
}
