//! Bad files and bad command lines: one line that names the place, exit status 2, nothing written.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use tests::tool::{names, text};

use crate::TOOL;

struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        Self { folder: TempDir::new().expect("a folder") }
    }

    fn file(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        let path = self.folder.path().join(name);
        fs::write(&path, content).expect("written");
        path.to_str().expect("UTF-8").into()
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().expect("UTF-8").into()
    }

    /// Runs the tool, which must fail with one line and exit status 2; returns that line.
    fn fails(&self, arguments: &[&str]) -> String {
        let before = self.listing();
        let line = TOOL.fails(arguments);
        assert_eq!(before, self.listing(), "nothing is left behind");
        line
    }

    fn listing(&self) -> Vec<PathBuf> {
        let mut all: Vec<PathBuf> =
            fs::read_dir(self.folder.path()).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
        all.sort();
        all
    }

    fn recording_fails(&self, content: impl AsRef<[u8]>) -> String {
        let file = self.file("bad.csv", content);
        let line = self.fails(&["replay", "--params", "preset:table3-n2", &file]);
        let out = self.path("out.csv");
        assert_eq!(line, self.fails(&["simulate", "--params", "preset:table3-n2", "--profile", &file, "--out", &out]));
        assert!(line.contains(&file), "names the file: {line}");
        line
    }
}

/// A gigabyte of garbage is refused at once, without filling the memory. Sparse files and devices make the test cheap.
#[test]
fn a_gigabyte_of_garbage() {
    let bench = Bench::new();
    let path = bench.path("garbage.csv");
    let file = fs::File::create(&path).expect("created");
    file.set_len(1 << 30).expect("a sparse file");
    names(&bench.fails(&["replay", "--params", "preset:table3-n2", &path]), &["garbage.csv", "not text"]);
    names(&bench.fails(&["replay", "--params", &path, "x.csv"]), &["garbage.csv", "not a parameter file"]);
    names(&bench.fails(&["replay", "--params", "/dev/zero", "x.csv"]), &["/dev/zero", "not a parameter file"]);
    // Lines, but no recording; and a recording that turns to garbage half way.
    let mut noise = b"\xff\xfe\x00garbage\n".repeat(1000);
    names(&bench.recording_fails(&noise), &["time_s"]);
    let mut good = b"time_s,voltage_v,displacement_m\n0,0,0\n1,1,1\n".to_vec();
    good.append(&mut noise);
    names(&bench.recording_fails(&good), &["bad.csv:4:"]);
    let mut long = b"time_s,voltage_v,displacement_m\n0,0,0\n".to_vec();
    long.write_all(&vec![b'7'; 100_000]).expect("memory");
    names(&bench.recording_fails(&long), &["65536"]);
    // Nothing but line ends, or an open quote, takes no memory either.
    let mut empty = b"time_s,voltage_v,displacement_m\n0,0,0\n".to_vec();
    empty.resize(5_000_000, b'\n');
    names(&bench.recording_fails(&empty), &["1 data rows"]);
}

/// `simulate` refuses a bad recording with the line of `replay`, which is in cases/recordings.trycmd.
#[test]
fn simulate_refuses_what_replay_refuses() {
    let bench = Bench::new();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("command_line/cases/recordings.in");
    let files = fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path());
    // The others have no measured displacement, which `simulate` does not need.
    let bad = files.filter(|path| !path.ends_with("volts.csv") && !path.ends_with("unmeasured.csv"));
    let bad: Vec<_> = bad.collect();
    assert!(bad.len() > 20, "{} recordings", bad.len());
    for path in bad {
        bench.recording_fails(fs::read(path).expect("readable"));
    }
}

#[test]
fn a_write_protected_file_is_kept() {
    let bench = Bench::new();
    let [recording, ..] = tests::recordings("wang");
    let kept = bench.file("kept.csv", "kept");
    let mut permissions = fs::metadata(&kept).expect("there").permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&kept, permissions).expect("set");
    let simulate = ["simulate", "--params", "preset:table3-n2", "--profile", text(&recording), "--out", &kept];
    names(&bench.fails(&simulate), &["kept.csv", "write-protected"]);
    assert_eq!(fs::read_to_string(&kept).expect("there"), "kept");
}
