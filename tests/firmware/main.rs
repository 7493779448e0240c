//! The firmware in QEMU: it gives the host's bits, and every fault ends at 0 V with its cause latched.
//!
//! `cargo xtask firmware` builds the images and runs this.

mod bits;
mod faults;
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

/// The image that `cargo xtask firmware` has built, or one of its siblings.
fn image(folder: &str) -> PathBuf {
    root().join(folder).join("thumbv7em-none-eabihf/release/firmware")
}

/// A number of docs/results.md, by the name of its row and the title of its column.
fn stated(row: &str, column: &str) -> f64 {
    Documents::read().expect("readable").number(&[row], column).expect("a number in the table")
}

/// A test that has failed ends after this time. Nothing else depends on it.
const DEADLINE: Duration = Duration::from_secs(600);
