//! The law in other languages and on other boards: what its tests need beyond the default run, installed, and those tests.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use clap::ValueEnum;

use crate::process::{Result, cargo, command, format, locked, make, output, root, run as run_command};
use crate::programs::QEMU;
use crate::python::{environment, interpreter, pip};
use crate::{benchmark, embedded, other_board, packages, setup, test, windows};

/// A language, or the crates on other boards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Face {
    /// The emitted C: gcc and clang, sanitizers, Cortex-M0, M4F, M33 and RISC-V in QEMU.
    C,
    /// The Rust crates: their features and packages; on other boards, Cortex-M33 and RISC-V in QEMU, with the example firmware.
    Rust,
    /// The Python package: a wheel, installed where there is no Rust, against the command line, its types and its notebook.
    Python,
    /// The benchmark against other models, on one film: packages of Python (816 MB), and that the tool predicts better than a curve without
    /// memory. Only by its name.
    Benchmark,
    /// MATLAB's two: the MEX function in Octave, `springpot_replay.m`, the S-function before a stub of Simulink's headers.
    Octave,
    /// The FMU: schemas, states and equal bits with FMPy, in an environment of its own.
    Fmu,
    /// The page of `springpot bench` in Chromium: looks, accessibility (axe-core), stops, every way to lose the page. By its name it makes the book's pictures of it.
    Browser,
    /// The Windows executable under Wine, beside the tool of this system. Only by its name.
    Windows,
}

/// Installs what is missing and runs the tests of `only` this face, or of all but those whose installations are large: of Wine and of the benchmark's
/// packages.
pub fn run(only: Option<Face>) -> Result<()> {
    let is_asked = |face: Face| only.map_or(!matches!(face, Face::Windows | Face::Benchmark), |only| only == face);
    for face in Face::value_variants().iter().filter(|face| is_asked(**face)) {
        match face {
            Face::C => {
                setup::c_compilers()?;
                // Two at a time: each keeps a core busy. Octave is a face of its own.
                run_command(ignored("emitted", "--test-threads=2 --skip matlab"))?;
                run_command(ignored(TOOL, "export_c"))?;
            }
            // On cores that are not the firmware's, with all films on that one too, and the example firmware for boards of these.
            Face::Rust => {
                let toolchain = setup::toolchain(&[setup::TARGETS, setup::OTHER_TARGETS].concat())?;
                setup::qemu_for_both()?;
                embedded::all_cores(&toolchain)?;
                other_board::everywhere(&toolchain)?;
                packages::run()?;
            }
            Face::Windows => windows::run()?,
            Face::Browser => browser(only.is_some())?,
            Face::Python => python()?,
            Face::Benchmark => benchmark::sample()?,
            Face::Octave => {
                setup::octave()?;
                run_command(ignored("emitted", "matlab"))?;
                run_command(ignored(TOOL, "export_sfunction"))?;
            }
            Face::Fmu => {
                setup::ensure(setup::MAKE)?;
                let python = environment(&root().join("target").join("faces").join("fmu"))?;
                run_command(pip(&python, "install", &["--requirement", "host-sim/emit/tests/fmu/requirements.txt"]))?;
                let mut tests = ignored(TOOL, "export_fmu");
                tests.env("SPRINGPOT_FMPY", &python);
                run_command(tests)?;
            }
        }
    }
    Ok(())
}

/// Stops in the browser whose time is measured.
const CLICKS: &str = "200";

/// The page of a bench in a browser. `named`: the pictures of the book are those of this run.
fn browser(named: bool) -> Result<()> {
    let browser = setup::chromium()?;
    let built = root().join("target").join("faces").join("browser");
    // The package brings axe-core's own file; nothing of it is run but that, in the page.
    let python = environment(&built)?;
    run_command(pip(&python, "install", &["--no-deps", "axe-playwright-python==0.1.8"]))?;
    let find = "import importlib.util, pathlib; print(next(pathlib.Path(importlib.util.find_spec('axe_playwright_python').origin).parent.rglob('axe.min.js')))";
    let axe = output(command(&python, &["-c", find]))?;
    let [tool, board] = test::programs()?;
    let mut test = command(&python, &["host-sim/tests/browser/bench.py", browser]);
    let pictures = built.join("pictures");
    test.args([tool, board, pictures.clone()]).arg(CLICKS);
    test.env("SPRINGPOT_AXE", axe.trim());
    run_command(test)?;
    for name in ["bench.webp", "bench-phone.webp"].into_iter().filter(|_| named) {
        let copied = fs::copy(pictures.join(name), root().join("docs").join(name));
        copied.map_err(|error| format!("{name}: {error}"))?;
    }
    Ok(())
}

/// The tests of the command line.
const TOOL: &str = "command_line";

/// Tests of the `target` that `options` name, also those that need more than the default run has: with the features of that run, which has built them.
fn ignored(target: &str, options: &str) -> Command {
    cargo(&format!("test --workspace {QEMU} --test {target} -- --include-ignored {options}"))
}

/// The Python package, as a wheel.
fn python() -> Result<()> {
    let package = root().join("python");
    let built = root().join("target").join("faces");
    let python = environment(&built.join("python"))?;
    // The workspace's own checks do not come here.
    let here = |mut command: Command| {
        command.current_dir(&package).env("CARGO_TARGET_DIR", built.join("rust"));
        command
    };
    same_versions(&package)?;
    format(&package)?;
    run_command(here(cargo("clippy --quiet --release --locked -- -D warnings")))?;
    let [tool, board] = test::programs()?;
    run_command(here(pip(&python, "install", &["--requirement", "requirements.txt"])))?;
    let wheels = built.join("wheels");
    make(&wheels)?;
    let folder = wheels.to_string_lossy();
    run_command(here(pip(&python, "wheel", &["--no-deps", "--wheel-dir", &folder, "."])))?;
    let wheel = ["--no-index", "--no-deps", "--force-reinstall", "--find-links", &folder, "springpot"];
    // From here on as where there is no Rust: the wheel in an environment with NumPy alone, then its tests.
    let without_rust = |command: Command| {
        let mut command = here(command);
        command.env("PATH", path_without_rust()).env_remove("CARGO").env_remove("RUSTUP_HOME");
        command
    };
    let fresh = built.join("fresh");
    run_command(command(setup::python()?, &["-m", "venv", "--clear", &fresh.to_string_lossy()]))?;
    let fresh = interpreter(&fresh);
    run_command(without_rust(pip(&fresh, "install", &["numpy"])))?;
    let started = Instant::now();
    run_command(without_rust(pip(&fresh, "install", &wheel)))?;
    println!("the wheel is installed in {:.1} s, without Rust", started.elapsed().as_secs_f64());
    run_command(without_rust(command(&fresh, &["examples/cost.py"])))?;
    run_command(without_rust(pip(&python, "install", &wheel)))?;
    let mut tests = without_rust(command(&python, &["-m", "pytest"]));
    tests.env("SPRINGPOT_HOST_SIM", tool).env("SPRINGPOT_VIRTUAL_BOARD", board);
    run_command(tests)
}

/// PATH without the folders that have a compiler of Rust or cargo.
fn path_without_rust() -> OsString {
    let path = env::var_os("PATH").unwrap_or_default();
    let has_rust = |folder: &PathBuf| ["cargo", "rustc"].iter().any(|program| folder.join(program).exists());
    let kept = env::split_paths(&path).filter(|folder| !has_rust(folder));
    env::join_paths(kept).unwrap_or_default()
}

/// The package's lock file and the project's name the same versions of what both have: its figures are those of the command line.
fn same_versions(package: &Path) -> Result<()> {
    let (own, project) = (locked(package)?, locked(&root())?);
    let other = own.iter().find(|(name, version)| {
        let versions: Vec<&String> =
            project.iter().filter(|(known, _)| known == name).map(|(_, known)| known).collect();
        !versions.is_empty() && !versions.contains(&version)
    });
    let Some((name, version)) = other else { return Ok(()) };
    let known = project.iter().find(|(known, _)| known == name).map_or("", |(_, known)| known);
    Err(format!("python/Cargo.lock has {name} {version}: cargo update --precise {known} {name}@{version} there"))
}
