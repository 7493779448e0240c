//! `host-sim`: the name that scripts call `springpot` by.

fn main() -> std::process::ExitCode {
    host_sim::main()
}
