//! The firmware: its images, and the tests that run them in QEMU.

use std::process::Command;

use crate::process::{Result, cargo, output, root, run as run_command};
use crate::setup::{TARGETS, Toolchain};

/// An image: what it is for, and the options of its build.
struct Image {
    what: &'static str,
    options: &'static [&'static str],
}

const IMAGES: [Image; 3] = [
    Image { what: "QEMU", options: &[] },
    Image { what: "drills in QEMU", options: &["--features", "drills", "--target-dir", "target/drills"] },
    Image { what: "a board", options: &["--no-default-features", "--features", "rtt", "--target-dir", "target/board"] },
];

/// Builds the image that runs in QEMU: what `host-sim pil` starts.
pub fn image(toolchain: &Toolchain) -> Result<()> {
    build(toolchain, &IMAGES[0])
}

/// Builds all images, which fails beyond their budget of flash and RAM, and runs the tests in QEMU.
pub fn run(toolchain: &Toolchain) -> Result<()> {
    let mut format = cargo(&["fmt", "--check"]);
    format.current_dir(root().join("firmware"));
    run_command(format)?;
    for image in &IMAGES {
        if matches!(toolchain, Toolchain::Rustup) {
            let lint =
                [["clippy", "--quiet", "--release"].as_slice(), image.options, &["--", "-D", "warnings"]].concat();
            run_command(command(toolchain, &lint))?;
        }
        build(toolchain, image)?;
    }
    // In the profile of the other tests: the host tool is built already.
    run_command(cargo(&["test", "--quiet", "--package", "tests", "--features", "qemu", "--test", "firmware"]))
}

fn build(toolchain: &Toolchain, image: &Image) -> Result<()> {
    output(command(toolchain, &[["build", "--quiet", "--release"].as_slice(), image.options].concat()))?;
    println!("the image for {} is built, within its budget", image.what);
    Ok(())
}

fn command(toolchain: &Toolchain, arguments: &[&str]) -> Command {
    toolchain.cargo(&root().join("firmware"), TARGETS[0], arguments)
}
