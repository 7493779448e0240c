//! Environments of Python.

use std::path::Path;
use std::process::Command;

use crate::process::{Result, command, run as run_command};
use crate::setup;

/// A command of pip in the environment of `python`.
pub fn pip(python: &str, verb: &str, arguments: &[&str]) -> Command {
    let mut pip = command(python, &["-m", "pip", "--quiet", "--disable-pip-version-check", verb]);
    pip.args(arguments);
    pip
}

/// The interpreter of the environment in `folder`, which is made if it is missing.
pub fn environment(folder: &Path) -> Result<String> {
    let program = interpreter(folder);
    if !Path::new(&program).exists() {
        let python = setup::python()?;
        run_command(command(python, &["-m", "venv", "--clear", &folder.to_string_lossy()]))?;
    }
    Ok(program)
}

/// The interpreter of an environment.
pub fn interpreter(folder: &Path) -> String {
    folder.join("bin").join("python").to_string_lossy().into_owned()
}
