//! The committed recordings, which are simulated.

use std::path::{Path, PathBuf};

/// The recordings of one plant, fast to slow. For packages that stand one folder below the project's root.
pub fn recordings(plant: &str) -> [PathBuf; 3] {
    ["5", "7", "13"]
        .map(|period| Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../tests/recordings/{plant}-{period}s.csv")))
}
