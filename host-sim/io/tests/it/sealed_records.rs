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

/// Keys and a signature that minisign 0.11 made.
const KEYS: [&str; 2] = [
    "untrusted comment: minisign public key 68C53D7D6DDC4E58\nRWRYTtxtfT3FaKnKUxncX+V207e3Iesa5CqVL0cFOY+VzG1J34Pt25I9\n",
    "untrusted comment: minisign public key 8EDB38C8C4F1B55A\nRWRatfHEyDjbjg/mLXfTpcdqoveVZHSazxzjIi2pAeKeaYtZnvAfaxEW\n",
];
const SIGNATURE: &str = "untrusted comment: signature from minisign secret key
RURYTtxtfT3FaBVMU0pxxlf9/WzUb03Ez+IS9MrrmrXu6SnPImGlLx/9gkFP2fSNbeliUJPGv8BMz+mARut6N8JLPUCJSN1KfAs=
trusted comment: bench 2
IBr5hyQgiQgs92fYcQ/bOVj10hPRvwB17WuFB8+PQUpum7wL9LabCaDc8SKhZCdJHqgR/9Yik3OOnOW7CuqLCQ==
";

#[test]
fn a_signature_is_of_its_record_and_by_its_key() {
    let folder = tempfile::tempdir().expect("a folder");
    let [record, signature, key, other] =
        ["record.json", "record.json.minisig", "lab.pub", "other.pub"].map(|name| folder.path().join(name));
    fs::write(&key, KEYS[0]).expect("written");
    fs::write(&other, KEYS[1]).expect("written");
    seal::write(&record, &BTreeMap::from([("record", "commissioning")]), &[]).expect("sealed");
    let refusal = |key| seal::signed(&record, key).expect_err("refused").to_string();
    let missing = refusal(&key);
    assert!(missing.contains("record.json.minisig") && missing.contains("minisign -S"), "{missing}");
    fs::write(&signature, SIGNATURE).expect("written");
    assert_eq!(seal::signed(&record, &key).expect("signed"), "bench 2");
    assert!(refusal(&other).contains("by the key in"), "{}", refusal(&other));
    assert!(refusal(&record).contains("is no public key"), "{}", refusal(&record));

    // Its first line is a comment that is not signed.
    let begin = SIGNATURE.find('\n').expect("a line") + 1;
    let mut runner = TestRunner::new(Config { cases: 300, failure_persistence: None, ..Config::default() });
    let change = (begin..SIGNATURE.len() - 1, "[ -~]");
    let tried = runner.run(&change, |(at, character)| {
        let changed = format!("{}{character}{}", &SIGNATURE[..at], &SIGNATURE[at + 1..]);
        fs::write(&signature, &changed).expect("written");
        prop_assert!(seal::signed(&record, &key).is_err() || changed == SIGNATURE, "{changed}");
        Ok(())
    });
    tried.expect("no other signature is taken");
    // The same signature of a record that was sealed again.
    fs::write(&signature, SIGNATURE).expect("written");
    seal::write(&record, &BTreeMap::from([("record", "commissioned")]), &[]).expect("sealed");
    assert!(refusal(&key).contains("is no signature of"), "{}", refusal(&key));
}
