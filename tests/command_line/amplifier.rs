//! `amplifier` as scripts call it.

use std::fs;
use std::path::PathBuf;

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

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        fs::write(self.path(name), content).expect("written");
        self.path(name)
    }
}

/// From 0 V to 3 kV at 1 s and back at `until_s`, behind 0.1 s up and 0.4 s down: the exponentials, with the monitor's gain and offset.
fn log(until_s: f64) -> String {
    let mut csv = String::from("time_s,command_v,voltage_v\n");
    for row in 0..600_i32 {
        let time_s = f64::from(row) / 100.0;
        let risen = |time_s: f64| 3000.0 * -(-(time_s - 1.0).max(0.0) / 0.1).exp_m1();
        let fallen = (-(time_s - until_s).max(0.0) / 0.4).exp();
        let command = if time_s >= 1.0 && time_s < until_s { 3000.0 } else { 0.0 };
        // ±2 V, so that there is a noise.
        let volts = risen(time_s.min(until_s)) * fallen;
        csv += &format!("{time_s},{command},{}\n", 1.02 * volts + 10.0 + f64::from(row * 7919 % 5) - 2.0);
    }
    csv
}

#[test]
fn a_log_becomes_parameters_and_a_figure() {
    let bench = Bench::new();
    let (log, figure, out) = (bench.file("log.csv", log(3.0)), bench.path("log.svg"), bench.path("new.toml"));
    let base = ["amplifier", text(&log)];
    let more = ["--plot", text(&figure), "--params", "preset:table3-n2", "--out", text(&out)];
    let report = TOOL.json(&[&base[..], &more].concat());
    let number = |name: &str| report[name].as_f64().expect("a number");
    assert!((number("rise_s") - 0.1).abs() < 0.003 && (number("fall_s") - 0.4).abs() < 0.012, "{report}");
    assert!((number("gain") - 1.02).abs() < 0.002 && (number("offset_v") - 10.0).abs() < 1.0, "{report}");
    assert!((1.0..2.0).contains(&number("residual_v")) && report["samples"] == 600, "{report}");
    for (name, truth) in [("rise_s", 0.1), ("fall_s", 0.4), ("gain", 1.02), ("offset_v", 10.0)] {
        let interval = &report["intervals_95_pct"][name];
        let (low, high) = (interval[0].as_f64().expect("an end"), interval[1].as_f64().expect("an end"));
        assert!(low < number(name) && number(name) < high && high - low < 0.1 * truth, "{name}: {low} to {high}");
    }
    let svg = fs::read_to_string(&figure).expect("written");
    assert!(svg.contains("<svg") && svg.contains("Residual") && svg.contains("voltage (kV)"));

    // The file is one that every command reads, with the times in it.
    let written = fs::read_to_string(&out).expect("written");
    names(&written, &["[board.amplifier]", "rise_s = 0.", "fall_s = 0."]);
    let blob = bench.path("new.bin");
    TOOL.json(&["export", "--params", text(&out), "--rate", "1000", "--out", text(&blob)]);

    let printed = TOOL.with(&base).assert().success().get_output().stdout.clone();
    let printed = String::from_utf8(printed).expect("UTF-8");
    names(
        &printed,
        &["rise_s 0.", "95 % interval", "monitor: gain 1.02", "[board.amplifier]\nrise_s = 0.", "\nfall_s = 0."],
    );
}

/// The check of a reference with the times that were identified.
#[test]
fn the_check_knows_what_was_identified() {
    let bench = Bench::new();
    let (log, params, reference) =
        (bench.file("log.csv", log(3.0)), bench.path("lagging.toml"), bench.path("reference.csv"));
    TOOL.json(&["amplifier", text(&log), "--params", "preset:table3-n2", "--out", text(&params)]);
    let shape = ["reference", "--shape", "sine", "--low", "0.5e-3", "--high", "1.5e-3", "--period", "1"];
    TOOL.json(&[&shape[..], &["--duration", "10", "--out", text(&reference)]].concat());
    let base = ["feedforward", "--reference", text(&reference), "--check", "--params"];
    let check = &TOOL.says_no(&[&base[..], &[text(&params)]].concat())["check"];
    assert_eq!(check["feasible"], false);
    assert!(check["amplifier"]["falls_too_fast_pct"].as_f64().expect("a share") > 1.0, "{check}");
    let first = check["amplifier"]["falls_too_fast_s"].as_f64().expect("a time");
    let printed = TOOL.with(&[&base[..], &[text(&params)]].concat()).assert().code(1).get_output().stdout.clone();
    let printed = String::from_utf8(printed).expect("UTF-8");
    names(
        &printed,
        &["not feasible", "must fall faster than the amplifier's bleeder allows", &format!("first at {first:.3} s")],
    );
    // Without its times it is not reported.
    let ideal = &TOOL.says_no(&[&base[..], &["preset:table3-n2"]].concat())["check"];
    assert!(ideal.get("amplifier").is_none(), "{ideal}");
}

#[test]
fn what_the_log_does_not_tell_is_not_written() {
    let bench = Bench::new();
    let (log, out) = (bench.file("log.csv", log(100.0)), bench.path("new.toml"));
    let base = ["amplifier", text(&log)];
    let report = TOOL.json(&base);
    assert!(report["fall_s"].is_null() && report["rise_s"].is_number(), "{report}");
    names(report["not_determined"][0].as_str().expect("a sentence"), &["fall_s", "record a step down to 0 V"]);
    let printed = TOOL.with(&base).assert().success().get_output().stdout.clone();
    let printed = String::from_utf8(printed).expect("UTF-8");
    assert!(printed.contains("fall_s is not determined by this log") && !printed.contains("fall_s = "), "{printed}");
    let line = TOOL.fails(&[&base[..], &["--params", "preset:table3-n2", "--out", text(&out)]].concat());
    names(&line, &["log.csv", "fall_s", "record a step down to 0 V"]);
    assert!(!out.exists());
}
