//! The committed recordings, which are simulated.

use std::fs;
use std::path::{Path, PathBuf};

/// The recordings of one plant, fast to slow, for a package anywhere in the project.
pub fn recordings(plant: &str) -> [PathBuf; 3] {
    let mut folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().map(|folder| folder.join("tests/recordings"));
    let folder = folders.find(|folder| folder.is_dir()).expect("the project has recordings");
    ["5", "7", "13"].map(|period| folder.join(format!("{plant}-{period}s.csv")))
}

/// The same with every `step`th row only, written to `folder`.
#[allow(dead_code)] // not every package that shares this file thins them
pub fn thinned_recordings(plant: &str, folder: &Path, step: usize) -> [PathBuf; 3] {
    recordings(plant).map(|path| {
        let thinned = folder.join(path.file_name().expect("a name"));
        let text = fs::read_to_string(&path).expect("committed");
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let kept: Vec<&str> = lines.next().into_iter().chain(lines.step_by(step)).collect();
        fs::write(&thinned, kept.join("\n")).expect("written");
        thinned
    })
}
