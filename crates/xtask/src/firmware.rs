//! The firmware: its images, and the tests that run them in QEMU.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::process::{Result, cargo, output, root, run as run_command};
use crate::setup::{TARGETS, Toolchain, built};

/// An image: what it is for, and the options of its build.
struct Image {
    what: &'static str,
    options: &'static [&'static str],
    /// Folder under `target` that gets a copy.
    copy: Option<&'static str>,
}

/// They share what they depend on. The one that `host-sim pil` starts is built last, so that it stays where cargo puts it.
const IMAGES: [Image; 3] = [
    Image { what: "the virtual board", options: &["--features", "virtual-bench"], copy: Some("virtual-board") },
    Image { what: "a board", options: &["--no-default-features", "--features", "rtt"], copy: Some("board") },
    Image { what: "QEMU", options: &[], copy: None },
];

/// Builds the image that runs in QEMU: what `host-sim pil` starts.
pub fn image(toolchain: &Toolchain) -> Result<()> {
    build(toolchain, &IMAGES[2]).map(drop)
}

/// Builds the image of the virtual board, and returns where it is.
pub fn virtual_board(toolchain: &Toolchain) -> Result<PathBuf> {
    build(toolchain, &IMAGES[0])
}

/// Checks and builds all images. The linker fails beyond their budget of flash and RAM.
pub fn images(toolchain: &Toolchain) -> Result<()> {
    let mut format = cargo(&["fmt", "--check"]);
    format.current_dir(folder());
    run_command(format)?;
    for image in &IMAGES {
        toolchain.lint(&folder(), TARGETS[0], image.options)?;
        build(toolchain, image)?;
    }
    no_virtual_bench_on_a_board(toolchain)
}

/// An image for a board does not build with the virtual bench: it would drive no pins, and tell its host of a film that is not there.
fn no_virtual_bench_on_a_board(toolchain: &Toolchain) -> Result<()> {
    let build = ["build", "--quiet", "--release", "--no-default-features", "--features", "rtt,virtual-bench"];
    let output = command(toolchain, &build).output().map_err(|error| format!("cargo: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() && said.contains("the virtual bench drives no pins") {
        println!("an image for a board refuses the virtual bench");
        Ok(())
    } else {
        Err(format!("an image for a board with the virtual bench must be refused, but: {}\n{said}", output.status))
    }
}

/// Builds all images and runs their tests in QEMU.
pub fn run(toolchain: &Toolchain) -> Result<()> {
    images(toolchain)?;
    // With the features of the whole workspace, as `cargo xtask test` builds them: nothing is built twice.
    run_command(cargo(&["test", "--quiet", "--workspace", "--features", "tests/qemu", "--test", "firmware"]))
}

/// Builds an image, and returns where it is.
fn build(toolchain: &Toolchain, image: &Image) -> Result<PathBuf> {
    output(command(toolchain, &[["build", "--quiet", "--release"].as_slice(), image.options].concat()))?;
    let file = Path::new(TARGETS[0]).join("release/firmware");
    let mut path = built().join(&file);
    if let Some(folder) = image.copy {
        let copy = built().join(folder).join(&file);
        let failed = |error| format!("{}: {error}", copy.display());
        fs::create_dir_all(copy.with_file_name("")).map_err(failed)?;
        fs::copy(&path, &copy).map_err(failed)?;
        path = copy;
    }
    println!("the image for {} is built, within its budget", image.what);
    Ok(path)
}

fn command(toolchain: &Toolchain, arguments: &[&str]) -> Command {
    toolchain.cargo(&folder(), TARGETS[0], arguments)
}

fn folder() -> PathBuf {
    root().join("firmware")
}
