//! The example firmware for boards that are not the project's: in QEMU and on this host, with the bits that its page states.

use std::path::PathBuf;

use crate::process::{Result, cargo, command, output, read, root};
use crate::setup::{OTHER_TARGETS, Toolchain, built};

/// The output of the example is here.
const PAGE: &str = "docs/own-board.md";

/// Builds the example for every core that it knows and as a program of this host, and runs it: it does what it must and prints
/// what its page states.
pub fn everywhere(toolchain: &Toolchain) -> Result<()> {
    for target in OTHER_TARGETS {
        judge(target, &output(toolchain.cargo(&folder(), target, "run --quiet --release --locked"))?)?;
    }
    let tuple = output(command("rustc", &["--print", "host-tuple"]))?;
    let mut host = cargo(&format!("run --quiet --release --locked --target {}", tuple.trim()));
    host.current_dir(folder()).env("CARGO_TARGET_DIR", built());
    judge("this host", &output(host)?)
}

/// Where it is.
pub fn folder() -> PathBuf {
    root().join("crates/dea-driver/examples/other-board")
}

/// The page states what a run prints: how far the film is from the sine at the most, the trip in the tick without a monitor, 0 V at the end,
/// and the bits.
fn judge(place: &str, printed: &str) -> Result<()> {
    if !read(&root().join(PAGE))?.contains(&format!("```text\n{printed}```\n")) {
        return Err(format!("the example for other boards, on {place}: not what {PAGE} states; it printed\n{printed}"));
    }
    println!("{place}: the example follows its sine, trips and ends at 0 V, with the bits that its page states");
    Ok(())
}
