//! Bad files and bad command lines: one line that names the place, exit status 2, nothing written.

use std::fs;
use std::path::Path;

use tests::tool::{Bench, names};

use crate::TOOL;

fn recording_fails(bench: &Bench, content: impl AsRef<[u8]>) -> String {
    bench.write("bad.csv", content);
    let line = bench.fails("replay --params preset:table3-n2 bad.csv");
    assert_eq!(line, bench.fails("simulate --params preset:table3-n2 --profile bad.csv --out out.csv"));
    assert!(line.contains("bad.csv"), "names the file: {line}");
    line
}

/// A gigabyte of garbage is refused at once, without filling the memory. Sparse files and devices make the test cheap.
#[test]
fn a_gigabyte_of_garbage() {
    let bench = Bench::new(TOOL);
    let file = fs::File::create(bench.path("garbage.csv")).expect("created");
    file.set_len(1 << 30).expect("a sparse file");
    names(&bench.fails("replay --params preset:table3-n2 garbage.csv"), &["garbage.csv", "not text"]);
    names(&bench.fails("replay --params garbage.csv x.csv"), &["garbage.csv", "not a parameter file"]);
    names(&bench.fails("replay --params /dev/zero x.csv"), &["/dev/zero", "not a parameter file"]);
    // Lines, but no recording; a recording that turns to garbage half way; a line, and line ends, without an end.
    let noise = b"\xff\xfe\x00garbage\n".repeat(1000);
    let header = b"time_s,voltage_v,displacement_m\n0,0,0\n".as_slice();
    for (content, words) in [
        (noise.clone(), "time_s"),
        ([header, b"1,1,1\n", &noise].concat(), "bad.csv:4:"),
        ([header, &[b'7'; 100_000]].concat(), "65536"),
        ([header, &[b'\n'; 5_000_000]].concat(), "1 data row;"),
    ] {
        names(&recording_fails(&bench, content), &[words]);
    }
}

/// `simulate` refuses a bad recording with the line of `replay`, which is in cases/recordings.trycmd.
#[test]
fn simulate_refuses_what_replay_refuses() {
    let bench = Bench::new(TOOL);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("command_line/cases/recordings.in");
    let files = fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path());
    // The others have no measured displacement, which `simulate` does not need.
    let bad: Vec<_> = files.filter(|path| !path.ends_with("volts.csv") && !path.ends_with("unmeasured.csv")).collect();
    assert!(bad.len() > 20, "{} recordings", bad.len());
    for path in bad {
        recording_fails(&bench, fs::read(path).expect("readable"));
    }
}

#[test]
fn a_write_protected_file_is_kept() {
    let bench = Bench::new(TOOL);
    bench.recordings("wang");
    bench.write("kept.csv", "kept");
    let mut permissions = fs::metadata(bench.path("kept.csv")).expect("there").permissions();
    permissions.set_readonly(true);
    fs::set_permissions(bench.path("kept.csv"), permissions).expect("set");
    let line = bench.fails("simulate --params preset:table3-n2 --profile wang-5s.csv --out kept.csv");
    names(&line, &["kept.csv", "write-protected"]);
    assert_eq!(bench.read("kept.csv"), "kept");
}

/// Names of columns that are pages of text fill no screen.
#[test]
fn long_names_are_shortened() {
    let bench = Bench::new(TOOL);
    let others: Vec<String> = (0..300).map(|k| format!("remark {k} {}", "x".repeat(60))).collect();
    for (title, words) in
        [("y".repeat(20_000), "no displacement was read"), ("Displacement (mm)".into(), "displacement ")]
    {
        let rows = (0..300).map(|k| format!("{},{},0.{k:03}{}\n", 0.1 * f64::from(k), 10 * k, ",a".repeat(300)));
        let header = format!("Time (s),Voltage (V),{title},{}\n", others.join(","));
        bench.write("long.csv", header + &rows.collect::<String>());
        let read = bench.prints("import --out long long.csv");
        assert!(read.contains("ignored") && read.contains(words), "{read}");
        assert!(read.lines().all(|line| line.chars().count() <= 1000), "{read}");
    }
}
