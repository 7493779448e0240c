//! The law in other languages: what its tests need beyond the default run, installed, and those tests.

use clap::ValueEnum;

use crate::process::{Result, cargo, run as run_command};
use crate::setup;

/// A language.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Face {
    /// The emitted C: gcc and clang, sanitizers, Cortex-M0, M4F, M33 and RISC-V in QEMU.
    C,
}

/// Installs what is missing and runs the tests of `only` this face, or of all.
pub fn run(only: Option<Face>) -> Result<()> {
    for face in Face::value_variants().iter().filter(|face| only.is_none_or(|only| only == **face)) {
        match face {
            Face::C => c()?,
        }
    }
    Ok(())
}

/// The emitted C, its tests in the default run included.
pub fn c() -> Result<()> {
    setup::c_compilers()?;
    // One after the other: emulators would take the cores from each other.
    run_command(cargo(&["test", "--package", "bench-emit", "--", "--include-ignored", "--test-threads=1"]))?;
    let of_the_tool = ["test", "--package", "tests", "--test", "command_line", "export_c", "--", "--include-ignored"];
    run_command(cargo(&of_the_tool))
}
