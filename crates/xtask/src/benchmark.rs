//! The benchmark against other models of films: a Python program with packages of its own.

use std::ffi::OsStr;
use std::path::{Path, absolute};

use crate::process::{Result, at, cargo, command, root, run as run_command};
use crate::python::{environment, pip};
use crate::test;

/// All films with a release of the tool, and the tensile test in the file `measured`.
pub fn run(measured: Option<&Path>) -> Result<()> {
    // The program runs in the root of the project. A file that is missing is refused before the builds.
    let there = |file: &Path| file.metadata().and_then(|_| absolute(file)).map_err(at(file));
    let measured = measured.map(there).transpose()?;
    run_command(cargo("build --quiet --release --package host-sim"))?;
    let tool = root().join("target").join("release").join("host-sim");
    let options = measured.as_ref().map_or_else(Vec::new, |file| vec!["--measured".as_ref(), file.as_os_str()]);
    start(&tool, &options)
}

/// One film with the tool of the tests.
pub fn sample() -> Result<()> {
    let [tool, _] = test::programs()?;
    start(&tool, &["--sample".as_ref()])
}

/// Runs the program on the `tool`.
fn start(tool: &Path, options: &[&OsStr]) -> Result<()> {
    let python = environment(&root().join("target").join("faces").join("benchmark"))?;
    run_command(pip(&python, "install", &["--requirement", "tests/benchmark/requirements.txt"]))?;
    let mut program = command(&python, &["-B", "tests/benchmark/benchmark.py"]);
    program.arg(tool).args(options);
    // Short products are slower on many threads.
    program.env("OPENBLAS_NUM_THREADS", "1");
    run_command(program)
}
