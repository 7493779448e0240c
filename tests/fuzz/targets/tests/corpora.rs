//! The committed corpora, and what judges them.

use std::fs;
use std::path::{Path, PathBuf};

use dea_driver::wire::{Command, FRAME_LEN, Mode, Receiver, Request, encode};

fn corpus(target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../corpus").join(target);
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("readable").path()).collect();
    files.sort();
    files.into_iter().map(|path| (path.clone(), fs::read(path).expect("readable"))).collect()
}

/// No panic, nothing obeyed that must not be, and every promise kept. Some inputs are accepted and some are not: otherwise the
/// corpus tests only one of both.
fn replay(target: &str, run: fn(&[u8]) -> bool) {
    let files = corpus(target);
    println!("{target}: {} files, {} bytes", files.len(), files.iter().map(|(_, data)| data.len()).sum::<usize>());
    let mut accepted = 0;
    for (path, data) in &files {
        println!("{}", path.display());
        accepted += usize::from(run(data));
    }
    println!("{accepted} accepted");
    assert!(accepted >= 5 && files.len() - accepted >= 5, "{target}: {accepted} of {} accepted", files.len());
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

/// Blobs and slots that the targets seal are accepted as well as those that are in the corpus as they are: otherwise the header of an
/// older schema would refuse them all.
#[test]
fn every_kind_of_blob_has_one_that_is_accepted() {
    for kind in 0..4 {
        let of_kind =
            corpus("blobs").into_iter().filter(|(_, data)| data.first().is_some_and(|first| first % 4 == kind));
        let accepted = of_kind.filter(|(_, data)| fuzz_targets::blobs(data)).count();
        assert!(accepted > 0, "kind {kind}");
    }
}

/// The frames of these tests, written from dea-driver/doc/link.md, are those of the driver, byte by byte; so is the checksum, that of CRC-32's
/// definition.
#[test]
fn frames_are_sealed_as_the_driver_does() {
    assert_eq!(fuzz_targets::crc32(b"123456789"), 0xcbf4_3926);
    for command in [
        Command::Arm,
        Command::Start(Mode::Tracking),
        Command::SetVoltage(0.0),
        Command::Upload { offset: 0, bytes: [0; 128].into() },
        Command::Upload { offset: 300, bytes: [0xff; 128].into() },
        Command::Step([1.0; 24].into()),
    ] {
        let request = Request { sequence: 258, token: 0, command };
        let mut frame = [0; FRAME_LEN + 1];
        let length = encode(&request, &mut frame).expect("fits");
        let message = postcard::to_extend(&request, Vec::new()).expect("has a form");
        assert_eq!(fuzz_targets::seal(&message), frame[..length], "{request:?}");
    }
    // Longer than a group of COBS: 300 bytes without a zero, and one of 254.
    for length in [253, 254, 255, 300] {
        let message = [[1, 0, 0].as_slice(), &vec![7; length]].concat();
        let frame = fuzz_targets::seal(&message);
        let mut receiver = Receiver::new();
        let found: Vec<_> = frame.iter().filter_map(|&byte| receiver.push::<Request>(byte)).collect();
        assert_eq!(found.len(), 1);
        // Identify with more behind it than it has: whole, but unknown.
        assert_eq!((receiver.damaged(), receiver.unknown()), (0, 1), "{length}");
    }
}
