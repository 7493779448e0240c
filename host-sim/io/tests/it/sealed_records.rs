//! Records that are sealed with their files: no change of a byte goes unseen. `SPRINGPOT_SWEEP=full` makes 100 000.

use std::collections::BTreeMap;
use std::fs;

use host_io::files::seal;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

#[test]
fn every_changed_byte_shows() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = ["ramp.json", "recording.csv"].map(|name| folder.path().join(name)).to_vec();
    fs::write(&files[0], "{\"steps\":[1,2,3]}").expect("written");
    fs::write(&files[1], "time_s,voltage_v\n0,0\n1,100\n").expect("written");
    let record = folder.path().join("record.json");
    seal::write(&record, &BTreeMap::from([("record", "commissioning"), ("verdict", "passed")]), &files)
        .expect("sealed");
    let read = seal::verify(&record).expect("unchanged");
    assert_eq!(read["files"].as_array().map(Vec::len), Some(2));

    let all: Vec<_> =
        files.into_iter().chain([record.clone()]).map(|path| (fs::read(&path).expect("read"), path)).collect();
    let cases = if std::env::var("SPRINGPOT_SWEEP").is_ok() { 100_000 } else { 500 };
    let mut runner = TestRunner::new(Config { cases, failure_persistence: None, ..Config::default() });
    let change = (0..all.len(), any::<prop::sample::Index>(), any::<u8>(), 0..3);
    let tried = runner.run(&change, |(file, at, byte, kind)| {
        let (bytes, path) = &all[file];
        let (mut changed, at) = (bytes.clone(), at.index(bytes.len()));
        match kind {
            0 => changed[at] ^= byte.max(1),
            1 => drop(changed.remove(at)),
            _ => changed.insert(at, byte),
        }
        fs::write(path, &changed).expect("written");
        let found = seal::verify(&record);
        fs::write(path, bytes).expect("written");
        prop_assert!(found.is_err() || changed == *bytes, "{}: {kind} at {at}", path.display());
        Ok(())
    });
    tried.expect("every change shows");
    seal::verify(&record).expect("unchanged again");
}
