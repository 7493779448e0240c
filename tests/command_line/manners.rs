//! Messages of the tool while it works and how it ends: exit statuses, warnings, progress, figures, folders.

use std::fs;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use tests::tool::{Bench, names, number};

use crate::TOOL;
use crate::control_commands::write_raised;

fn utf8(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

/// A shell in the folder that runs the tool with the arguments of `line` after `before`.
#[cfg(target_os = "linux")]
fn shell(bench: &Bench, before: &str, line: &str) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("{before}; exec '{}' {line}", TOOL.0)]).current_dir(bench.path(""));
    command
}

/// Whether this process was started with HUP ignored, which its children are then as well.
#[cfg(target_os = "linux")]
fn hang_ups_are_ignored() -> bool {
    let status = fs::read_to_string("/proc/self/status").expect("Linux has it");
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).expect("a mask").trim();
    u64::from_str_radix(mask, 16).expect("hexadecimal") & 1 == 1
}

/// The exit status distinguishes Ctrl-C, TERM and HUP for shells and schedulers. Under `nohup` a hang-up ends nothing.
#[cfg(target_os = "linux")]
#[test]
fn each_signal_has_its_exit_status() {
    let bench = Bench::new(TOOL);
    bench.write("long.csv", "time_s,voltage_v\n0,0\n6000,6000\n");
    for (signals, before, status) in [
        (["TERM"].as_slice(), ":", 143),
        (&["HUP"], ":", 129),
        (&["INT"], ":", 130),
        (&["HUP", "TERM"], "trap '' HUP", 143),
    ] {
        if signals == ["HUP"] && hang_ups_are_ignored() {
            println!("not tested here: these tests run under nohup, which a program cannot undo");
            continue;
        }
        // Where the machine is so busy that a run is done before it is looked at, the next one is tried.
        let ended = (0..10).find_map(|_| {
            let line = "simulate --params preset:table3-n2 --profile long.csv --out out.csv";
            let mut running = shell(&bench, before, line).stdout(Stdio::null()).spawn().expect("runs");
            while bench.files().len() < 2 && running.try_wait().expect("waits").is_none() {
                std::thread::sleep(Duration::from_millis(2));
            }
            for signal in signals {
                let _ = Command::new("kill").args([&format!("-{signal}"), &running.id().to_string()]).status();
            }
            let code = running.wait().expect("ends").code();
            let is_done = code == Some(0);
            if is_done {
                fs::remove_file(bench.path("out.csv")).expect("written");
            }
            (!is_done).then_some(code)
        });
        assert_eq!(ended, Some(Some(status)), "{signals:?} after {before}");
        assert_eq!(bench.files(), ["long.csv"]);
    }
}

/// A full disk: what could not be written leaves no folder either, and one that was there stays.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_no_folder() {
    let bench = Bench::new(TOOL);
    bench.recordings("wang");
    let replay = "replay --params preset:table3-n2 wang-5s.csv --out new/results";
    // No file may hold a byte; the write fails as it does on a full disk.
    let on_full_disk = |line: &str| shell(&bench, "trap '' XFSZ; ulimit -f 0", line).output().expect("runs");
    let library = "export --params preset:table3-n2 --emit arduino --out new/results";
    for arguments in [replay, "demo --out new/results", "man --out new/results", library] {
        let output = on_full_disk(arguments);
        let line = utf8(&output.stderr);
        assert_eq!((output.status.code(), line.lines().count()), (Some(2), 1), "{line}");
        names(&line, &["new/results", "too large"]);
        assert!(!bench.path("new").exists(), "{arguments}");
    }
    fs::create_dir_all(bench.path("new/results")).expect("made");
    assert_eq!(on_full_disk(replay).status.code(), Some(2));
    assert_eq!(fs::read_dir(bench.path("new/results")).expect("it stays").count(), 0);
}

/// Warnings go to standard error: what is piped on is the result alone.
#[test]
fn warnings_are_no_results() {
    let bench = Bench::new(TOOL);
    bench.recordings("wang");
    for line in [
        "fit wang-5s.csv --branches 0 --curve none --out film.toml",
        "replay --params film.toml wang-5s.csv",
        "export --params film.toml --out film.bin",
    ] {
        let output = bench.run(line);
        let (results, messages) = (utf8(&output.stdout), utf8(&output.stderr));
        assert!(output.status.success() && !results.contains("warning"), "{results}");
        assert!(!messages.is_empty() && messages.lines().all(|line| line.starts_with("warning: ")), "{messages}");
        let quiet = bench.run(&format!("-q {line}"));
        assert!(quiet.status.success() && quiet.stderr.is_empty(), "{}", utf8(&quiet.stderr));
        let json = bench.run(&format!("{line} --json"));
        assert!(json.stderr.is_empty() && serde_json::from_slice::<Value>(&json.stdout).is_ok());
    }
    // Errors are reported all the same.
    names(&bench.fails("--quiet replay --params film.toml none.csv"), &["none.csv"]);
}

/// Where standard error is no terminal, progress is a line now and then, with share, count and the time that is left; the share
/// does not fall. `-v` reports each stage.
#[test]
fn long_work_reports_how_far_it_is() {
    let bench = Bench::new(TOOL);
    bench.recordings("wang");
    let line = "fit --json --out film.toml wang-5s.csv --topology parallel --curve none --starts 2";
    let often = |line: &str| bench.with(line).env("HOST_SIM_PROGRESS_S", "0.02").output().expect("runs");
    let output = often(line);
    assert!(serde_json::from_slice::<Value>(&output.stdout).is_ok(), "one document and nothing else");
    let messages = utf8(&output.stderr);
    let lines: Vec<&str> =
        messages.lines().filter(|line| line.contains(" of ") && line.contains(" % after ")).collect();
    assert!(lines.iter().any(|line| line.contains("parallel with n = ") && line.ends_with(" left")), "{messages}");
    let share = |line: &str| -> u64 {
        let before = line.split(" % after ").next().expect("a share");
        before.rsplit(' ').next().expect("a number").parse().expect("a whole number")
    };
    assert!(lines.is_sorted_by_key(|line| share(line)) && lines.iter().all(|line| share(line) <= 100), "{messages}");
    assert!(often(&format!("{line} --quiet")).stderr.is_empty());
    let verbose = bench.run("-v fit --branches 0 --out film.toml wang-5s.csv");
    names(&utf8(&verbose.stderr), &["springpot: ", "with n = 0"]);
}

/// `replay` runs a model as the controller does. As `fit` runs it, it gives the errors of the fit.
#[test]
fn fit_and_replay_give_the_same_error() {
    let bench = Bench::new(TOOL);
    bench.recordings("hossain");
    let fit = bench.json("fit --out film.toml hossain-5s.csv --branches 1 --topology parallel --curve none");
    let row = &fit["recordings"][0];
    let replay = |more: &str| {
        let report = bench.json(&format!("replay --params film.toml hossain-5s.csv {more}"));
        number(&report["recordings"][0]["nrmse_pct"])
    };
    let same = replay(&format!("--rate {} --memory full --precision f64 --method bdf2", row["rate_hz"]));
    let (fitted, controller) = (number(&row["nrmse_pct"]), replay(""));
    println!("fit {fitted} %, replay likewise {same} %, as on the controller {controller} %");
    assert!((same - fitted).abs() <= 1e-6 * fitted, "{same} {fitted}");
    assert!(controller != fitted);
    names(&bench.prints("replay --params film.toml hossain-5s.csv"), &["at 1000 Hz, memory compressed, f32"]);
}

/// The check answers by its exit status, names what is in the way with what is needed and what is allowed, and its correction holds.
#[test]
fn a_check_answers_and_corrects() {
    let bench = Bench::new(TOOL);
    let sine = |name: &str, low: &str, high: &str| {
        let shape = format!("--shape sine --low {low} --high {high} --period 10s --duration 30s");
        bench.json(&format!("reference {shape} --out {name}"));
    };
    let check = |reference: &str, more: &str| {
        let line = format!("feedforward --params preset:table3-n2 --reference {reference} --check {more}");
        let (output, json) = (bench.run(&line), bench.run(&format!("{line} --json")));
        assert_eq!(output.status.code(), json.status.code());
        let report: Value = serde_json::from_slice(&json.stdout).expect("one document");
        (output.status.code().expect("ends"), utf8(&output.stdout), report["check"].clone())
    };
    sine("fits.csv", "0.5mm", "0.6mm");
    let (status, _, report) = check("fits.csv", "");
    assert!(status == 0 && report["feasible"] == true && report["binding"] == serde_json::json!([]), "{report}");

    // A voltage or a field that is too low: needed and allowed are reported, and the needed one is enough.
    for (option, allowed, words) in [
        ("--max-voltage", "2kV", ["limit: voltage", "2000 V (--max-voltage) allowed"]),
        ("--max-field", "12MV/m", ["limit: field", "12.00 MV/m (--max-field) allowed"]),
    ] {
        let (status, printed, report) = check("fits.csv", &format!("{option} {allowed}"));
        names(&printed, &["not feasible", words[0], words[1]]);
        let needed = number(&report["binding"][0]["needed"]);
        let with = |share: f64| check("fits.csv", &format!("{option} {}", share * needed)).0;
        assert_eq!((status, with(1.0001), with(0.9999)), (1, 0, 1), "{option}");
        if option == "--max-voltage" {
            assert_eq!(number(&report["binding"][0]["allowed"]), 2000.0);
            assert!((needed - number(&report["largest_voltage_v"])).abs() < 1e-6);
        }
    }

    // A film whose sizes are assumed has no field that could be in the way, however high the voltage.
    bench.recordings("wang");
    bench.json("fit wang-5s.csv --out film.toml --branches 1 --topology parallel --curve none");
    sine("high.csv", "1mm", "50mm");
    let output = bench.run("feedforward --params film.toml --reference high.csv --check");
    let printed = utf8(&output.stdout);
    assert_eq!(output.status.code(), Some(1));
    names(&printed, &["limit: voltage"]);
    assert!(!printed.contains("limit: field") && !printed.contains('∞'), "{printed}");

    // A stroke that no offset makes feasible: a smaller one is named, with its offset, and is feasible.
    sine("wide.csv", "0mm", "2.5mm");
    let (status, printed, report) = check("wide.csv", "--max-voltage 5kV");
    println!("{printed}");
    assert_eq!(status, 1);
    let words =
        ["limit: force", "0 N or more", "limit: voltage", "no offset makes it feasible", "of it with an offset of"];
    names(&printed, &words);
    let [factor, offset] = ["factor", "offset_m"].map(|key| number(&report["smaller"][key]));
    assert!((0.1..1.0).contains(&factor), "{factor}");
    write_raised(&bench, "corrected.csv", "wide.csv", (factor, offset));
    assert_eq!(check("corrected.csv", "--max-voltage 5kV").0, 0);
}
