//! Everything that must be true, on the host and in QEMU.

use std::time::Instant;

use crate::process::{Result, cargo, output, run as run_command};
use crate::{embedded, firmware, setup};

/// Installs what is missing and runs every check and test.
pub fn run() -> Result<()> {
    let start = Instant::now();
    let toolchain = setup::run()?;
    let workspace = |arguments: &[&str]| run_command(cargo(arguments));

    workspace(&["fmt", "--all", "--check"])?;
    workspace(&["clippy", "--quiet", "--workspace", "--all-targets", "--", "-D", "warnings"])?;
    for library in ["springpot", "dea-driver"] {
        workspace(&["clippy", "--quiet", "--package", library, "--all-features", "--", "-D", "warnings"])?;
    }
    let mut doc = cargo(&["doc", "--quiet", "--workspace", "--no-deps", "--document-private-items"]);
    doc.env("RUSTDOCFLAGS", "-D warnings");
    run_command(doc)?;
    workspace(&["test", "--quiet", "--workspace"])?;
    // The same on the fast square root.
    workspace(&["test", "--quiet", "--package", "springpot", "--features", "micromath", "--test", "it"])?;
    embedded::run(&toolchain)?;
    firmware::run(&toolchain)?;
    println!("all tests passed in {} s", start.elapsed().as_secs());
    Ok(())
}

/// Checks licences with cargo-deny, which is installed if it is missing.
pub fn deny() -> Result<()> {
    if output(cargo(&["deny", "--version"])).is_err() {
        run_command(cargo(&["install", "--locked", "cargo-deny"]))?;
    }
    let checks = ["check", "licenses", "bans", "sources"];
    run_command(cargo(&[["deny", "--workspace", "--all-features"].as_slice(), &checks].concat()))?;
    // The images are workspaces of their own.
    for manifest in ["firmware/Cargo.toml", "tests/embedded/Cargo.toml"] {
        let of_images = ["deny", "--manifest-path", manifest, "--config", "deny.toml", "--log-level", "error"];
        run_command(cargo(&[of_images.as_slice(), &checks].concat()))?;
    }
    Ok(())
}
