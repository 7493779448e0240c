//! Lints of all code, on the host and for the chips.

use std::path::Path;

use crate::packages::LIBRARIES;
use crate::process::{Result, cargo, entries, format, read, root, run as run_command};
use crate::programs::{QEMU, SENSED};
use crate::setup::{OTHER_TARGETS, TARGETS, toolchain};
use crate::{embedded, firmware, other_board, packages};

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

/// The formats of all code.
pub fn formats() -> Result<()> {
    run_command(cargo("fmt --all --check"))?;
    [firmware::folder(), embedded::folder(), other_board::folder()].iter().try_for_each(|folder| format(folder))
}

/// The lints of the workspace with the tests in QEMU, of each library with each of its features, and of the images for the chips, whose other
/// cores are given the same sources.
pub fn run() -> Result<()> {
    let toolchain = toolchain(&[TARGETS, OTHER_TARGETS].concat())?;
    WITHOUT_TESTS.iter().try_for_each(|folder| no_tests_in(&root().join(folder)))?;
    formats()?;
    // `--all-targets` would check each library a second time, as a benchmark.
    let targets = "--lib --bins --examples --tests --bench *";
    run_command(cargo(&format!("clippy --quiet --workspace {targets} {QEMU},{SENSED} -- -D warnings")))?;
    for library in LIBRARIES {
        let clippy = |features: &str| {
            run_command(cargo(&format!("clippy --quiet --package {library} {features} -- -D warnings")))
        };
        clippy("--no-default-features")?;
        for feature in packages::features_of(library)? {
            clippy(&format!("--no-default-features --features {feature}"))?;
        }
        clippy("--all-features")?;
    }
    firmware::lint(&toolchain)?;
    toolchain.lint(&embedded::folder(), TARGETS[0], "")?;
    toolchain.lint(&embedded::folder(), OTHER_TARGETS[1], "")?;
    OTHER_TARGETS.iter().try_for_each(|target| toolchain.lint(&other_board::folder(), target, "--locked"))
}

fn no_tests_in(folder: &Path) -> Result<()> {
    for path in entries(folder)? {
        if path.is_dir() {
            no_tests_in(&path)?;
        } else if read(&path)?.contains("#[test]") {
            return Err(format!("{} has a test that is never run", path.display()));
        }
    }
    Ok(())
}
