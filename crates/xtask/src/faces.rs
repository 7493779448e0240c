//! The law in other languages and on other boards: what its tests need beyond the default run, installed, and those tests.

use std::path::{Path, PathBuf};
use std::process::Command;

use clap::ValueEnum;

use crate::process::{Result, cargo, command, read, root, run as run_command};
use crate::test::QEMU;
use crate::{embedded, other_board, setup};

/// A language, or the crates on other boards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Face {
    /// The emitted C: gcc and clang, sanitizers, Cortex-M0, M4F, M33 and RISC-V in QEMU.
    C,
    /// The Rust crates on other boards: Cortex-M33 and RISC-V in QEMU, with the example firmware.
    Rust,
    /// The Python package: installed into an environment of its own, against the command line, its types and its notebook.
    Python,
    /// MATLAB's two: the MEX function in Octave, `springpot_replay.m`, the S-function before a stub of Simulink's headers.
    Octave,
    /// The FMU: schemas, states and equal bits with FMPy, in an environment of its own.
    Fmu,
}

/// Installs what is missing and runs the tests of `only` this face, or of all.
pub fn run(only: Option<Face>) -> Result<()> {
    for face in Face::value_variants().iter().filter(|face| only.is_none_or(|only| only == **face)) {
        match face {
            Face::C => c()?,
            Face::Rust => rust()?,
            Face::Python => python()?,
            Face::Octave => octave()?,
            Face::Fmu => fmu()?,
        }
    }
    Ok(())
}

/// The emitted C, its tests in the default run included.
pub fn c() -> Result<()> {
    setup::c_compilers()?;
    // One after the other: emulators would take the cores from each other. Octave is a face of its own.
    let of_the_package =
        ["test", "--package", "host-emit", "--", "--include-ignored", "--test-threads=1", "--skip", "matlab"];
    run_command(cargo(&of_the_package))?;
    let of_the_tool = ["test", "--package", "tests", "--test", "command_line", "export_c", "--", "--include-ignored"];
    run_command(cargo(&of_the_tool))
}

/// The Rust crates on cores that are not the firmware's, with all films on that one too, and the example firmware for boards of these.
pub fn rust() -> Result<()> {
    let toolchain = setup::toolchain(&[setup::TARGETS, setup::OTHER_TARGETS].concat())?;
    setup::qemu_for_both()?;
    embedded::all_cores(&toolchain)?;
    other_board::everywhere(&toolchain)
}

/// The MEX function and the script in Octave, and the S-function.
pub fn octave() -> Result<()> {
    setup::octave()?;
    run_command(cargo(&["test", "--package", "host-emit", "matlab", "--", "--include-ignored"]))?;
    let of_the_tool =
        ["test", "--package", "tests", "--test", "command_line", "export_sfunction", "--", "--include-ignored"];
    run_command(cargo(&of_the_tool))
}

/// The Python package, as `pip install .` installs it.
pub fn python() -> Result<()> {
    let package = root().join("python");
    let built = root().join("target").join("faces");
    let python = environment(&built.join("python"))?;
    // The workspace's own checks do not come here.
    let here = |mut command: Command| {
        command.current_dir(&package).env("CARGO_TARGET_DIR", built.join("rust"));
        command
    };
    same_versions(&package)?;
    run_command(here(cargo(&["fmt", "--check"])))?;
    run_command(here(cargo(&["clippy", "--quiet", "--release", "--locked", "--", "-D", "warnings"])))?;
    // As the tests build it: its numbers are those of a release.
    run_command(cargo(&[["build", "--quiet", "--workspace", "--bin", "host-sim"].as_slice(), &QEMU].concat()))?;
    let pip = |arguments: &[&str]| {
        let pip = ["-m", "pip", "--quiet", "--disable-pip-version-check", "install"];
        here(command(&python, &[&pip, arguments].concat()))
    };
    run_command(pip(&["--requirement", "requirements.txt"]))?;
    // A version that is there already is another build of it.
    run_command(pip(&["--force-reinstall", "--no-deps", "."]))?;
    let mut tests = here(command(&python, &["-m", "pytest"]));
    tests.env("SPRINGPOT_HOST_SIM", root().join("target").join("debug").join("host-sim"));
    run_command(tests)
}

/// FMUs of both versions, driven by FMPy; its tests in the default run included.
pub fn fmu() -> Result<()> {
    setup::make()?;
    let python = environment(&root().join("target").join("faces").join("fmu"))?;
    let requirements = "host-sim/emit/tests/fmu/requirements.txt";
    let pip = ["-m", "pip", "--quiet", "--disable-pip-version-check", "install", "--requirement", requirements];
    run_command(command(&python, &pip))?;
    let mut tests =
        cargo(&["test", "--package", "tests", "--test", "command_line", "export_fmu", "--", "--include-ignored"]);
    tests.env("SPRINGPOT_FMPY", &python);
    run_command(tests)
}

/// The package's lock file and the project's name the same versions of what both have: its figures are those of the command line.
fn same_versions(package: &Path) -> Result<()> {
    let (own, project) = (locked(&package.join("Cargo.lock"))?, locked(&root().join("Cargo.lock"))?);
    let other = own.iter().find(|(name, version)| {
        let versions: Vec<&String> =
            project.iter().filter(|(known, _)| known == name).map(|(_, known)| known).collect();
        !versions.is_empty() && !versions.contains(&version)
    });
    let Some((name, version)) = other else { return Ok(()) };
    let known = project.iter().find(|(known, _)| known == name).map_or("", |(_, known)| known);
    Err(format!("python/Cargo.lock has {name} {version}: cargo update --precise {known} {name}@{version} there"))
}

/// Names and versions in a lock file.
fn locked(path: &Path) -> Result<Vec<(String, String)>> {
    let text = read(path)?;
    let value =
        |line: &str, key: &str| Some(line.strip_prefix(key)?.strip_prefix(" = \"")?.trim_end_matches('"').to_owned());
    let lines: Vec<&str> = text.lines().collect();
    Ok(lines.windows(2).filter_map(|pair| Some((value(pair[0], "name")?, value(pair[1], "version")?))).collect())
}

/// The interpreter of the environment in `folder`, which is made if it is missing.
fn environment(folder: &Path) -> Result<String> {
    let program: PathBuf = folder.join("bin").join("python");
    if !program.exists() {
        let python = setup::python()?;
        run_command(command(python, &["-m", "venv", "--clear", &folder.to_string_lossy()]))?;
    }
    Ok(program.to_string_lossy().into_owned())
}
