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

    fn parameters_fail(&self, content: impl AsRef<[u8]>) -> String {
        let file = self.file("bad.toml", content);
        let [recording, ..] = tests::recordings("wang");
        let line = self.fails(&["replay", "--params", &file, recording.to_str().expect("UTF-8")]);
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
    empty.resize(50_000_000, b'\n');
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

/// Pull-in, where the force grows faster than the film resists, is an error with every memory, and nothing is written.
#[test]
fn pull_in_is_an_error() {
    let bench = Bench::new();
    let [recording, ..] = tests::recordings("wang");
    let recording = recording.to_str().expect("UTF-8");
    for (coupling, memory) in [
        ("400.0", "compressed"),
        ("400.0", "full"),
        ("20000.0", "full"),
        ("20000.0", "compressed"),
        ("400.0", "window:1"),
    ] {
        let parameters =
            PARAMETERS.replace("mass_kg = 0.316", &format!("mass_kg = 0.316\nstretch_coupling = {coupling}"));
        let file = bench.file("p.toml", parameters.replace("main = { c = 62740.0", "main = { c = 20000.0"));
        let line = bench.fails(&["replay", "--params", &file, "--memory", memory, "--precision", "f64", recording]);
        names(&line, &["pull-in"]);
        assert!(line.contains(recording) || line.contains(&file), "{line}");
    }
}

const PARAMETERS: &str = "schema = 1\nname = \"x\"\n[actuator]\nrelative_permittivity = 4.7\nlength_m = 0.04\nwidth_m = 0.06\n\
    thickness_m = 160e-6\nmass_kg = 0.316\n[model]\ntopology = \"eq11\"\n\
    main = { c = 62740.0, alpha = 0.2 }\nbranches = [\n [{ c = 1.0, alpha = 1.0 }, { c = 2.0, alpha = 0.5 }],\n]\n";

#[test]
fn parameter_files() {
    let bench = Bench::new();
    let good = PARAMETERS;
    let [recording, ..] = tests::recordings("wang");
    let fine = bench.file("fine.toml", good);
    TOOL.with(&["replay", "--params", &fine, recording.to_str().expect("UTF-8")]).assert().success();
    let with = |from: &str, to: &str| {
        assert!(good.contains(from));
        bench.parameters_fail(good.replace(from, to))
    };
    names(&with("mass_kg = 0.316", "mass_kg = 0.316\nmas_kg = 1"), &["bad.toml:9:", "mas_kg"]);
    names(&with("alpha = 0.2", "alpha = 0.2, beta = 1"), &["bad.toml:11:", "beta"]);
    names(&with("c = 62740.0", "c = -1.0"), &["bad.toml:11:", "main", "c = -1"]);
    names(&with("c = 62740.0", "c = 0"), &["bad.toml:11:", "c = 0"]);
    names(&with("c = 62740.0", "c = nan"), &["bad.toml:11:", "NaN"]);
    names(&with("c = 2.0", "c = -2.0"), &["bad.toml:13:", "branch 1, springpot 2"]);
    names(&with("alpha = 0.5", "alpha = 1.5"), &["bad.toml:13:", "alpha = 1.5"]);
    names(&with("alpha = 0.5 }", "}"), &["bad.toml:13:", "alpha"]);
    names(&with("thickness_m = 160e-6", "thickness_m = 0.0"), &["bad.toml:7:", "thickness_m"]);
    names(&with("thickness_m = 160e-6\n", ""), &["bad.toml:", "thickness_m"]);
    names(&with("mass_kg = 0.316", "mass_kg = -0.3"), &["bad.toml:8:", "mass_kg"]);
    names(&with("mass_kg = 0.316", "mass_kg = 0.3\nstretch_coupling = -1"), &["bad.toml:9:", "stretch_coupling"]);
    names(&with("mass_kg = 0.316", "mass_kg = 0.3\npreload = \"later\""), &["bad.toml:9:", "later"]);
    names(&with("schema = 1", "schema = 7"), &["bad.toml:1:", "schema = 7"]);
    names(&with("\"eq11\"", "\"serial\""), &["bad.toml:10:", "serial"]);
    names(&with("schema = 1", "schema == 1"), &["bad.toml:1:"]);
    names(&with("62740.0", "\"62740\""), &["bad.toml:11:"]);
    let three = "{ c = 2.0, alpha = 0.5 }, { c = 2.0, alpha = 0.5 }]";
    names(&with("{ c = 2.0, alpha = 0.5 }]", three), &["bad.toml:13:", "3 springpots", "two"]);
    names(&with("62740.0", "1e308"), &["bad.toml", "nothing to solve"]);
    let six = " [{ c = 1.0, alpha = 1.0 }, { c = 2.0, alpha = 0.5 }],\n".repeat(6);
    names(&with(" [{ c = 1.0, alpha = 1.0 }, { c = 2.0, alpha = 0.5 }],\n", &six), &["bad.toml:18:", "6 branches"]);
    names(&bench.parameters_fail(b"schema = 1\nname = \"\xff\"\n"), &["bad.toml:2:", "UTF-8"]);
    names(&bench.parameters_fail(""), &["bad.toml"]);
}
