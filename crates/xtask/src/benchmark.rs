//! The benchmark against other models of films: a Python program with packages of its own.

use std::ffi::OsStr;
use std::path::{Path, absolute};

use crate::process::{Result, at, cargo, command, root, run as run_command};
use crate::python::{environment, pip};
use crate::test::QEMU;

/// All films with a release of the tool, and the tensile test in the file `measured`.
pub fn run(measured: Option<&Path>) -> Result<()> {
    // The program runs in the root of the project. A file that is missing is refused before the builds.
    let there = |file: &Path| file.metadata().and_then(|_| absolute(file)).map_err(at(file));
    let measured = measured.map(there).transpose()?;
    run_command(cargo("build --quiet --release --package host-sim"))?;
    let options = measured.as_ref().map_or_else(Vec::new, |file| vec!["--measured".as_ref(), file.as_os_str()]);
    start("release", &options)
}

/// One film with the tool of the tests.
pub fn sample() -> Result<()> {
    run_command(cargo(&format!("build --quiet --workspace --bin host-sim --bin virtual-board-on-host {QEMU}")))?;
    start("debug", &["--sample".as_ref()])
}

/// Runs the program on the tool of a `profile`.
fn start(profile: &str, options: &[&OsStr]) -> Result<()> {
    let target = root().join("target");
    let python = environment(&target.join("faces").join("benchmark"))?;
    run_command(pip(&python, "install", &["--requirement", "tests/benchmark/requirements.txt"]))?;
    let mut program = command(&python, &["-B", "tests/benchmark/benchmark.py"]);
    program.arg(target.join(profile).join("host-sim")).args(options);
    // Short products are slower on many threads.
    program.env("OPENBLAS_NUM_THREADS", "1");
    run_command(program)
}
