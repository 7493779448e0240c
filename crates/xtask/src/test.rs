//! Every check and every test, stage by stage, on the host and in QEMU.

use std::path::{Path, PathBuf};
use std::time::Instant;
use std::{fs, thread};

use crate::embedded::Films;
use crate::process::{Result, at, cargo, read, root, run as run_command};
use crate::programs::{Cases, Programs};
use crate::{embedded, firmware, setup};

/// Stages of a run that have passed.
struct Stages {
    begun: Instant,
    /// Stages with their seconds.
    passed: Vec<(&'static str, f64)>,
}

impl Stages {
    fn begin() -> Self {
        Self { begun: Instant::now(), passed: Vec::new() }
    }

    /// Runs a stage: prints its name, what it runs, and the time that it took.
    fn run<R>(&mut self, name: &'static str, stage: impl FnOnce() -> Result<R>) -> Result<R> {
        println!("\n== {name}");
        let start = Instant::now();
        let done = stage();
        let seconds = start.elapsed().as_secs_f64();
        let passed = self.passed.len();
        match &done {
            Ok(_) => {
                println!("== {name}: passed in {seconds:.0} s");
                self.passed.push((name, seconds));
            }
            Err(_) => println!("== {name}: failed after {seconds:.0} s; stages: {passed} passed, 1 failed"),
        }
        done
    }

    /// Runs a stage beside others: neither keeps two cores busy alone.
    fn run_beside<R>(
        &mut self,
        (name, stage): (&'static str, impl FnOnce() -> Result<()> + Send),
        others: impl FnOnce(&mut Self) -> Result<R>,
    ) -> Result<R> {
        thread::scope(|scope| {
            let thread = scope.spawn(|| {
                let mut stages = Self::begin();
                stages.run(name, stage).map(|()| stages)
            });
            let done = others(self);
            let beside = thread.join().map_err(|_| format!("{name}: panicked"))?;
            self.passed.extend(beside?.passed);
            done
        })
    }

    fn print(&self) {
        println!("\nseconds  stage");
        for (name, seconds) in &self.passed {
            println!("{seconds:7.0}  {name}");
        }
        println!("{:7.0}  all", self.begun.elapsed().as_secs_f64());
        println!("stages: {} passed, 0 failed", self.passed.len());
    }
}

/// Installs what is missing and runs every check and test.
pub fn run() -> Result<()> {
    setup::agree(&setup::TARGETS)?;
    let mut stages = Stages::begin();
    let images = || {
        let toolchain = setup::run()?;
        firmware::images(&toolchain)?;
        embedded::libraries(&toolchain)?;
        // All films, the cores of other boards, and the libraries as packages are those of `cargo xtask faces rust`.
        embedded::run(&toolchain, Films::Few)
    };
    let programs = stages.run_beside(("tools, images, and steps on chips", images), |stages| {
        stages.run("format", || run_command(cargo("fmt --all --check")))?;
        stages.run("lint", lint)?;
        stages.run("test builds", || Programs::built(&[QEMU, MICROMATH]))
    })?;
    let documentation = || run_command(cargo(&format!("test --quiet --workspace --doc {QEMU}")));
    stages.run_beside(("tests in documentation", documentation), |stages| {
        stages.run("tests, firmware in QEMU included", || programs.run(Cases::Sample))
    })?;
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        println!("\nnot run here: board-on-host, whose models of registers need Linux on x86-64");
    }
    stages.print();
    Ok(())
}

/// The tests with all cases of their sweeps, of which `cargo xtask test` runs a sample.
pub fn sweep() -> Result<()> {
    let mut stages = Stages::begin();
    let toolchain = stages.run("tools", setup::run)?;
    stages.run("firmware images", || firmware::images(&toolchain))?;
    let programs = stages.run("test builds", || Programs::built(&[QEMU]))?;
    stages.run("tests, all cases", || programs.run(Cases::All))?;
    stages.print();
    Ok(())
}

/// The tests that run the firmware's images.
pub const QEMU: &str = "--features tests/qemu";

/// The electrostatics on springpot's fast square root. The other packages keep the features with which they are built already.
const MICROMATH: &str = "--features tests/qemu,springpot/micromath --test electrostatics";

/// The tool and the virtual board as the tests have them, with the numbers of a release.
pub fn programs() -> Result<[PathBuf; 2]> {
    run_command(cargo(&format!("test --quiet --workspace {QEMU} --test command_line --no-run")))?;
    Ok(["host-sim-under-test", "virtual-board-on-host"].map(|name| root().join("target").join("debug").join(name)))
}

/// Sources of libraries whose manifest says `test = false`: a test in them would never run.
const WITHOUT_TESTS: [&str; 12] = [
    "host-sim/src",
    "host-sim/fft/src",
    "host-sim/emit/src",
    "host-sim/io/src",
    "host-sim/models/src",
    "python/src",
    "tests/board/src",
    "tests/support",
    "tests/chip-program/src",
    "tests/chips/src",
    "tests/documents/src",
    "tests/fuzz/targets/src",
];

/// All targets, the tests in QEMU included; `--all-targets` checks each library a second time, as a benchmark.
fn lint() -> Result<()> {
    for folder in WITHOUT_TESTS {
        no_tests_in(&root().join(folder))?;
    }
    run_command(cargo(&format!(
        "clippy --quiet --workspace --lib --bins --examples --tests --bench * {QEMU} -- -D warnings"
    )))
}

fn no_tests_in(folder: &Path) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(at(folder))? {
        let path = entry.map_err(at(folder))?.path();
        if path.is_dir() {
            no_tests_in(&path)?;
        } else if read(&path)?.contains("#[test]") {
            return Err(format!("{} has a test that is never run", path.display()));
        }
    }
    Ok(())
}
