//! Bad files and bad command lines: one line that names the place, exit status 2, nothing written.

use std::fs;
use std::io::Write;
use std::path::PathBuf;

use tempfile::TempDir;
use tests::tool::names;

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

#[test]
fn bad_recordings() {
    let bench = Bench::new();
    let head = "time_s,voltage_v,displacement_m\n";
    let fails = |content: &str| bench.recording_fails(content);
    names(&fails("voltage_v,displacement_m\n0,0\n1,1\n"), &["bad.csv:1:", "time_s"]);
    names(&fails("time_s,displacement_m\n0,0\n1,1\n"), &["bad.csv:1:", "voltage_v", "force_n"]);
    names(&fails("time_s,time_ms,voltage_v\n0,0,0\n1,1,1\n"), &["bad.csv:1:", "time_ms"]);
    names(&fails("time_s,voltage_v,voltage_v\n0,0,0\n1,1,1\n"), &["bad.csv:1:", "voltage_v"]);
    names(&fails(&format!("{head}0,0,0\n0.1,high,0\n")), &["bad.csv:3:", "voltage_v", "high"]);
    names(&fails(&format!("# a comment\n{head}0,0,0\n# more\n0.1,1,1e-3x\n")), &["bad.csv:5:", "displacement_m"]);
    names(&fails(&format!("{head}0,0,0\n0.1,NaN,0\n")), &["bad.csv:3:", "voltage_v", "NaN"]);
    names(&fails(&format!("{head}0,0,0\n0.1,inf,0\n")), &["bad.csv:3:", "inf"]);
    names(&fails(&format!("{head}0,0,0\n0.2,1,0\n0.1,2,0\n")), &["bad.csv:4:", "backwards", "0.1"]);
    names(&fails(&format!("{head}0,0,0\n0.1,1,0\n0.1,2,0\n")), &["bad.csv:4:", "stands still"]);
    names(&fails(&format!("{head}0,0,0\n,1,0\n")), &["bad.csv:3:", "time_s"]);
    names(&fails(&format!("{head}0,0,0\n0.1\n")), &["bad.csv:3:", "ends before voltage_v"]);
    names(&fails(&format!("{head}0,0,0\n")), &["1 data rows"]);
    names(&fails(head), &["0 data rows"]);
    names(&fails(""), &["time_s"]);
    names(&fails(&format!("{head}0,0,0\n0.1,,0\n0.2,1,0\n")), &["bad.csv:3:", "voltage_v is empty"]);
    names(&fails(&format!("{head}0,,0\n0.1,,0\n")), &["neither"]);
    names(&fails(&format!("{head}0,0,0\n1e12,1,0\n")), &["--rate", "lower the rate"]);
    names(&fails(&format!("{head}0,0,0\n1,1e200,0\n")), &["bad.csv:3:", "voltage_v", "1e200"]);
    names(&fails("time_s,voltage_v,displacement_m,note\n0,0,0,\n1,1,0,\"5 mm\n2,1,0,\n"), &["bad.csv:3:", "quote"]);
    names(&fails("time_s,voltage_v,displacement_m,note\n0,0,0,\n1,1,0,\"5 mm"), &["bad.csv:3:", "quote"]);
    names(&fails("# from an old Mac\rtime_s,voltage_v,displacement_m\r0,0,0\r1,x,0\r"), &["bad.csv:4:", "x"]);
    names(&fails("\u{feff}# exported\r\n\r\ntime_s,voltage_v,displacement_m\r\n0,0,0\r\n1,x,0\r\n"), &["bad.csv:5:"]);
}

#[test]
fn a_recording_without_displacement_cannot_be_compared() {
    let bench = Bench::new();
    for content in ["time_s,voltage_v\n0,0\n1,1\n", "time_s,voltage_v,displacement_m\n0,0,\n1,1,\n"] {
        let file = bench.file("v.csv", content);
        names(&bench.fails(&["replay", "--params", "preset:table3-n2", &file]), &["v.csv", "displacement_m"]);
        let displaced = ["replay", "--drive", "displacement", "--params", "preset:table3-n2", &file];
        names(&bench.fails(&displaced), &["v.csv", "displacement_m"]);
    }
}

#[test]
fn directories_and_files_that_are_not_there() {
    let bench = Bench::new();
    let folder = bench.path("");
    let [recording, ..] = tests::recordings("wang");
    let recording = recording.to_str().expect("UTF-8");
    names(&bench.fails(&["replay", "--params", "preset:table3-n2", &folder]), &["directory"]);
    names(&bench.fails(&["replay", "--params", &folder, recording]), &["directory"]);
    names(&bench.fails(&["replay", "--params", "preset:table3-n2", "nowhere.csv"]), &["nowhere.csv"]);
    names(&bench.fails(&["replay", "--params", "nowhere.toml", recording]), &["nowhere.toml"]);
    names(&bench.fails(&["replay", "--params", "preset:table9", recording]), &["table9", "table3-n1"]);
    let simulate = ["simulate", "--params", "preset:table3-n2", "--profile", recording, "--out"];
    names(&bench.fails(&[simulate.as_slice(), &[folder.as_str()]].concat()), &["directory"]);
    let lost = bench.path("no/such/folder/out.csv");
    names(&bench.fails(&[simulate.as_slice(), &[lost.as_str()]].concat()), &["out.csv"]);
    // A recording is never overwritten by its own response.
    let kept = bench.file("kept.csv", fs::read(recording).expect("committed"));
    names(&bench.fails(&["replay", "--params", "preset:table3-n2", "--out", &folder, &kept]), &["overwrite"]);
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

#[test]
fn nothing_that_is_read_is_overwritten() {
    let bench = Bench::new();
    let [recording, ..] = tests::recordings("wang");
    let recording = bench.file("rec.csv", fs::read(recording).expect("committed"));
    let parameters = bench.file("p.toml", PARAMETERS);
    let simulate = ["simulate", "--params", &parameters, "--profile", &recording, "--out"];
    names(&bench.fails(&[simulate.as_slice(), &[&recording]].concat()), &["rec.csv", "overwrite"]);
    names(&bench.fails(&[simulate.as_slice(), &[&parameters]].concat()), &["p.toml", "overwrite"]);
    names(&bench.fails(&[simulate.as_slice(), &["/dev/null"]].concat()), &["/dev/null", "device"]);
    names(&bench.fails(&["fit", "--out", &recording, &recording]), &["rec.csv", "overwrite"]);
    let table = ["frequency-response", "--from", "1", "--to", "2", "--points", "3", "--params", &parameters, "--out"];
    names(&bench.fails(&[table.as_slice(), &[&parameters]].concat()), &["p.toml", "overwrite"]);
    let kept = bench.file("kept.csv", "kept");
    fs::set_permissions(&kept, {
        let mut permissions = fs::metadata(&kept).expect("there").permissions();
        permissions.set_readonly(true);
        permissions
    })
    .expect("set");
    names(&bench.fails(&[simulate.as_slice(), &[&kept]].concat()), &["kept.csv", "write-protected"]);
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

#[test]
fn command_lines() {
    let bench = Bench::new();
    let [recording, ..] = tests::recordings("wang");
    let recording = recording.to_str().expect("UTF-8");
    let out = bench.path("out.csv");
    let fails = |arguments: &[&str]| bench.fails(arguments);
    let replay = |more: &[&str]| fails(&[&["replay", "--params", "preset:table3-n2", recording], more].concat());
    for rate in ["0", "-5", "nan", "inf", "1e-300", "1e-9", "1e12"] {
        let line = replay(&[&format!("--rate={rate}")]);
        assert!(line.contains("--rate"), "{line}");
    }
    names(&replay(&["--rate", "fast"]), &["--rate", "fast"]);
    for memory in ["short", "window:0", "window:", "window:nan", "window:-3"] {
        names(&replay(&["--memory", memory]), &["--memory", "window:SECONDS"]);
    }
    names(&replay(&["--precision", "f16"]), &["--precision", "f16"]);
    names(&replay(&["--drive", "sideways"]), &["--drive", "sideways"]);
    names(&fails(&["replay", recording]), &["--params"]);
    names(&fails(&["replay", "--params", "preset:table3-n2"]), &["REC.csv"]);
    names(&fails(&["dance"]), &["dance"]);
    names(&fails(&[]), &["--help"]);
    let response = |from: &str, to: &str, points: &str| {
        let range = ["--from", from, "--to", to, "--points", points, "--out", &out];
        fails(&[&["frequency-response", "--params", "preset:table3-n2"], range.as_slice()].concat())
    };
    names(&response("0", "1", "3"), &["--from"]);
    names(&response("2", "1", "3"), &["--to"]);
    names(&response("1", "2", "0"), &["--points"]);
    names(&response("nan", "2", "3"), &["--from"]);
    names(&response("1e-300", "1e300", "3"), &["--from"]);
    names(&response("1", "2", "1"), &["--points"]);
    let plant = |option: &str, value: &str| {
        let mut arguments = vec!["plant", "--out", &out];
        let usual = [("--plant", "wang"), ("--frequency", "0.2"), ("--duration", "5"), ("--rate", "100")];
        for (name, usual) in usual {
            if name != option {
                arguments.extend([name, usual]);
            }
        }
        let given = format!("{option}={value}");
        arguments.push(&given);
        fails(&arguments)
    };
    names(&plant("--frequency", "0"), &["--frequency"]);
    names(&plant("--duration", "-1"), &["--duration"]);
    names(&plant("--rate", "0"), &["--rate"]);
    names(&plant("--peak-voltage", "nan"), &["--peak-voltage"]);
    names(&plant("--peak-voltage", "200000"), &["pull-in"]);
    names(&plant("--noise", "-1"), &["--noise"]);
    names(&plant("--quantum", "1e9"), &["--quantum"]);
    names(&plant("--frequency", "1e300"), &["--frequency"]);
    names(&plant("--duration", "1e-9"), &["--duration"]);
    names(&plant("--plant", "rubber"), &["rubber", "hossain"]);
}
