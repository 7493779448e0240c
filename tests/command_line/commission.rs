//! `springpot commission` and `verify` on the simulated bench.

use std::fs;

use tests::tool::{Bench, SIZES, names, number, rows};

use crate::TOOL;

/// A bad bench is named, and its record, which does not pass, shows every change. The record of another sitting
/// stays.
#[test]
fn a_bad_bench_has_a_record_that_names_it_and_does_not_pass() {
    let bench = Bench::new(TOOL);
    bench.write("film.toml", format!("schema = 1\n{SIZES}"));
    let line = "commission --board film.toml --fault leak=0.1 --entry serial=A17 --out sitting";
    let record = bench.says_no(line);
    assert_eq!(record["findings"][0]["cause"], "leak", "{record}");
    assert_eq!((&record["verdict"]["passed"], &record["entries"]["serial"]), (&false.into(), &"A17".into()));
    names(record["verdict"]["sentence"].as_str().expect("text"), &["not commissioned: leak", "monitor", "%"]);
    for step in rows(&record["ramp"]["steps"]).iter().skip(2) {
        let [predicted, measured] = ["predicted_m", "measured_m"].map(|key| number(&step[key]));
        assert!((predicted - measured).abs() < 0.1 * measured + 30e-6, "{step}");
    }
    let page = bench.read("sitting/record.html");
    assert!(page.find("Not passed: not commissioned: leak").expect("the verdict") < page.find("<h2").expect("a part"));

    let verified = bench.says_no("verify sitting/record.json");
    assert_eq!((number(&verified["files"]), &verified["passed"]), (2.0, &false.into()));
    assert_eq!(bench.says_no("verify sitting"), verified, "the folder of the record");
    for file in ["ramp.json", "record.html", "record.json"] {
        let path = bench.path("sitting").join(file);
        let bytes = fs::read(&path).expect("read");
        let mut changed = bytes.clone();
        changed[bytes.len() / 2] ^= 1;
        fs::write(&path, changed).expect("written");
        names(&bench.fails("verify sitting/record.json"), &[file, "was changed"]);
        fs::write(&path, bytes).expect("written");
    }
    #[cfg(unix)]
    for file in ["ramp.json", "record.json"] {
        let path = bench.path("sitting").join(file);
        let bytes = fs::read(&path).expect("read");
        fs::remove_file(&path).expect("removed");
        std::os::unix::fs::symlink("/dev/zero", &path).expect("linked");
        names(&bench.fails("verify sitting"), &[file]);
        fs::remove_file(&path).expect("removed");
        fs::write(&path, bytes).expect("written");
    }
    names(&bench.fails(line), &["sitting/record.json", "another folder", "--from"]);
    bench.says_no("verify sitting/record.json");
    bench.write("lab.pub", "no key");
    names(&bench.fails("verify sitting/record.json --key lab.pub"), &["lab.pub", "minisign -G"]);
}
