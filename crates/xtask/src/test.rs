//! Every test, stage by stage, on the host and in QEMU.

use std::path::PathBuf;
use std::thread;
use std::time::Instant;

use crate::embedded::Films;
use crate::process::{Result, cargo, root, run as run_command};
use crate::programs::{Cases, Programs, QEMU, SENSED};
use crate::{embedded, firmware, lint, setup};

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

/// Installs what is missing and runs every test.
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
        stages.run("format", lint::formats)?;
        let sensed = format!("{QEMU},{SENSED} --test hardware");
        stages.run("test builds", || Programs::built(&[QEMU, MICROMATH, &sensed]))
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

/// The electrostatics on springpot's fast square root. The other packages keep the features with which they are built already.
const MICROMATH: &str = "--features tests/qemu,springpot/micromath --test electrostatics";

/// The tool and the virtual board as the tests have them, with the numbers of a release.
pub fn programs() -> Result<[PathBuf; 2]> {
    run_command(cargo(&format!("test --quiet --workspace {QEMU} --test command_line --no-run")))?;
    Ok(["host-sim-under-test", "virtual-board-on-host"].map(|name| root().join("target").join("debug").join(name)))
}
