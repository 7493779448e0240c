//! The committed corpora, and that what replays them can fail.

use std::fs;
use std::path::{Path, PathBuf};

fn corpus(target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../corpus").join(target);
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("readable").path()).collect();
    files.sort();
    files.into_iter().map(|path| (path.clone(), fs::read(path).expect("readable"))).collect()
}

/// No panic, nothing obeyed that must not be, and every promise kept.
fn replay(target: &str, run: fn(&[u8])) {
    let files = corpus(target);
    println!("{target}: {} files, {} bytes", files.len(), files.iter().map(|(_, data)| data.len()).sum::<usize>());
    assert!(files.len() > 100, "{target}: {} files", files.len());
    for (path, data) in files {
        println!("{}", path.display());
        run(&data);
    }
}

#[test]
fn frames() {
    replay("frames", fuzz_targets::frames);
}

#[test]
fn blobs() {
    replay("blobs", fuzz_targets::blobs);
}

#[test]
fn recordings() {
    replay("recordings", fuzz_targets::recordings);
}

#[test]
fn parameter_files() {
    replay("parameter-files", fuzz_targets::parameter_files);
}
