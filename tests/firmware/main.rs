//! The firmware in QEMU: it gives the host's bits, and every fault ends at 0 V with its cause latched.
//!
//! `cargo xtask firmware` builds the images and runs this.

mod bits;
mod faults;
mod page;
mod readme;
mod size;

use std::path::{Path, PathBuf};
use std::time::Duration;

use documents::Documents;
use tests::tool::Tool;

const TOOL: Tool = Tool(env!("CARGO_BIN_EXE_host-sim-under-test"));

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the project")
}

/// An image that `cargo xtask firmware` has built.
fn image(program: &str) -> PathBuf {
    root().join("firmware/target/thumbv7em-none-eabihf/release").join(program)
}

/// A number of docs/results.md, by the name of its row and the title of its column.
fn stated(row: &str, column: &str) -> f64 {
    Documents::read().expect("readable").number(&[row], column).expect("a number in the table")
}

/// A test that has failed ends after this time. Nothing else depends on it.
const DEADLINE: Duration = Duration::from_secs(600);
