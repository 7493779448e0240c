//! Messages of the tool while it works and how it ends: exit statuses, warnings, progress, figures, folders.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;
use tests::recordings;
use tests::tool::{names, text};

use crate::TOOL;

fn run(arguments: &[&str]) -> Output {
    TOOL.with(arguments).output().expect("runs")
}

fn utf8(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

/// A shell that runs the tool with `arguments` after `before`.
#[cfg(target_os = "linux")]
fn shell(before: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("{before}; exec \"$0\" \"$@\""), TOOL.0]).args(arguments);
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
    let folder = TempDir::new().expect("a folder");
    let profile = folder.path().join("long.csv");
    fs::write(&profile, "time_s,voltage_v\n0,0\n6000,6000\n").expect("written");
    let out = folder.path().join("out.csv");
    let arguments = ["simulate", "--params", "preset:table3-n2", "--profile", text(&profile), "--out", text(&out)];
    let files = || fs::read_dir(folder.path()).expect("a folder").count();
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
            let mut running = shell(before, &arguments).stdout(Stdio::null()).spawn().expect("runs");
            while files() < 2 && running.try_wait().expect("waits").is_none() {
                std::thread::sleep(Duration::from_millis(2));
            }
            for signal in signals {
                let _ = Command::new("kill").args([&format!("-{signal}"), &running.id().to_string()]).status();
            }
            let code = running.wait().expect("ends").code();
            let is_done = code == Some(0);
            if is_done {
                fs::remove_file(&out).expect("written");
            }
            (!is_done).then_some(code)
        });
        assert_eq!(ended, Some(Some(status)), "{signals:?} after {before}");
        assert_eq!(files(), 1, "only the profile is left");
    }
}

/// A full disk: what could not be written leaves no folder either.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_no_folder() {
    let folder = TempDir::new().expect("a folder");
    let [recording, ..] = recordings("wang");
    let new = folder.path().join("new/results");
    for arguments in [
        ["replay", "--params", "preset:table3-n2", text(&recording), "--out", text(&new)].as_slice(),
        &["demo", "--out", text(&new)],
        &["man", "--out", text(&new)],
    ] {
        // No file may hold a byte; the write fails as it does on a full disk.
        let output = shell("trap '' XFSZ; ulimit -f 0", arguments).output().expect("runs");
        let line = utf8(&output.stderr);
        assert_eq!((output.status.code(), line.lines().count()), (Some(2), 1), "{line}");
        names(&line, &["new/results", "too large"]);
        assert!(!folder.path().join("new").exists(), "{arguments:?}");
    }
    // A folder that was there stays.
    fs::create_dir_all(&new).expect("made");
    let arguments = ["replay", "--params", "preset:table3-n2", text(&recording), "--out", text(&new)];
    assert_eq!(shell("trap '' XFSZ; ulimit -f 0", &arguments).output().expect("runs").status.code(), Some(2));
    assert_eq!(fs::read_dir(&new).expect("it stays").count(), 0);
}

/// Warnings go to standard error: what is piped on is the result alone.
#[test]
fn warnings_are_no_results() {
    let folder = TempDir::new().expect("a folder");
    let [recording, ..] = recordings("wang");
    let film = folder.path().join("film.toml");
    let fit = ["fit", text(&recording), "--branches", "0", "--curve", "none", "--out", text(&film)];
    let replay = ["replay", "--params", text(&film), text(&recording)];
    let export = ["export", "--params", text(&film), "--out", text(&folder.path().join("film.bin"))].map(str::to_owned);
    let export: Vec<&str> = export.iter().map(String::as_str).collect();
    for arguments in [&fit[..], &replay, &export] {
        let output = run(arguments);
        let (results, messages) = (utf8(&output.stdout), utf8(&output.stderr));
        assert!(output.status.success() && !results.contains("warning"), "{results}");
        assert!(
            messages.lines().count() > 0 && messages.lines().all(|line| line.starts_with("warning: ")),
            "{messages}"
        );
        let quiet = run(&[&["-q"][..], arguments].concat());
        assert!(quiet.status.success() && quiet.stderr.is_empty(), "{}", utf8(&quiet.stderr));
        let json = run(&[arguments, &["--json"]].concat());
        assert!(json.stderr.is_empty() && serde_json::from_slice::<Value>(&json.stdout).is_ok());
    }
    // Errors are reported all the same.
    names(&TOOL.fails(&["--quiet", "replay", "--params", text(&film), "none.csv"]), &["none.csv"]);
}

/// Where standard error is no terminal, progress is a line now and then, with share, count and the time that is left; the share
/// does not fall. `-v` reports each stage.
#[test]
fn long_work_reports_how_far_it_is() {
    let folder = TempDir::new().expect("a folder");
    let film = folder.path().join("film.toml");
    let [recording, ..] = recordings("wang");
    let structures = ["--topology", "parallel", "--curve", "none", "--starts", "2"];
    let arguments = [&["fit", "--json", "--out", text(&film), text(&recording)][..], &structures].concat();
    let output = TOOL.with(&arguments).env("HOST_SIM_PROGRESS_S", "0.02").output().expect("runs");
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
    let quiet = [&arguments[..], &["--quiet"]].concat();
    let output = TOOL.with(&quiet).env("HOST_SIM_PROGRESS_S", "0.02").output().expect("runs");
    assert!(output.stderr.is_empty(), "{}", utf8(&output.stderr));

    let verbose = run(&["-v", "fit", "--branches", "0", "--out", text(&film), text(&recording)]);
    names(&utf8(&verbose.stderr), &["host-sim: ", "with n = 0"]);
}

/// `replay` runs a model as the controller does. As `fit` runs it, it gives the errors of the fit.
#[test]
fn fit_and_replay_give_the_same_error() {
    let folder = TempDir::new().expect("a folder");
    let film = folder.path().join("film.toml");
    let [recording, ..] = recordings("hossain");
    let structure = ["--branches", "1", "--topology", "parallel", "--curve", "none"];
    let fit = TOOL.json(&[&["fit", "--out", text(&film), text(&recording)][..], &structure].concat());
    let row = &fit["recordings"][0];
    let rate = row["rate_hz"].to_string();
    let replay = |more: &[&str]| {
        let report = TOOL.json(&[&["replay", "--params", text(&film), text(&recording)][..], more].concat());
        report["recordings"][0]["nrmse_pct"].as_f64().expect("a number")
    };
    let same = replay(&["--rate", &rate, "--memory", "full", "--precision", "f64"]);
    let fitted = row["nrmse_pct"].as_f64().expect("a number");
    let controller = replay(&[]);
    println!("fit {fitted} %, replay likewise {same} %, as on the controller {controller} %");
    assert!((same - fitted).abs() <= 1e-6 * fitted, "{same} {fitted}");
    assert!(controller != fitted);
    let printed = utf8(&run(&["replay", "--params", text(&film), text(&recording)]).stdout);
    names(&printed, &["at 1000 Hz, memory compressed, f32"]);
}

/// Files beside each other that a test writes.
fn sine(folder: &Path, name: &str, low: &str, high: &str) -> String {
    let out = folder.join(name);
    let shape = ["--shape", "sine", "--low", low, "--high", high, "--period", "10s", "--duration", "30s"];
    TOOL.json(&[&["reference"][..], &shape, &["--out", text(&out)]].concat());
    text(&out).to_owned()
}

/// The check answers by its exit status, names what is in the way with what is needed and what is allowed, and its correction holds.
#[test]
fn a_check_answers_and_corrects() {
    let folder = TempDir::new().expect("a folder");
    let check = |reference: &str, more: &[&str]| {
        let base = ["feedforward", "--params", "preset:table3-n2", "--reference", reference, "--check"];
        let arguments = [&base[..], more].concat();
        let (output, json) = (run(&arguments), run(&[&arguments[..], &["--json"]].concat()));
        assert_eq!(output.status.code(), json.status.code());
        let report: Value = serde_json::from_slice(&json.stdout).expect("one document");
        (output.status.code().expect("ends"), utf8(&output.stdout), report["check"].clone())
    };
    let fits = sine(folder.path(), "fits.csv", "0.5mm", "0.6mm");
    let (status, _, report) = check(&fits, &[]);
    assert_eq!((status, &report["feasible"]), (0, &true.into()));
    assert_eq!(report["binding"], Value::Array(Vec::new()));

    // Above a voltage that is too low: needed and allowed are reported, and the needed one is enough.
    let (status, printed, report) = check(&fits, &["--max-voltage", "2kV"]);
    assert_eq!(status, 1);
    names(&printed, &["not feasible", "limit: voltage", "2000 V (--max-voltage) allowed"]);
    let binding = &report["binding"][0];
    assert_eq!((&binding["limit"], binding["allowed"].as_f64()), (&"voltage".into(), Some(2000.0)));
    let needed = binding["needed"].as_f64().expect("V");
    assert!((needed - report["largest_voltage_v"].as_f64().expect("V")).abs() < 1e-6);
    assert_eq!(check(&fits, &["--max-voltage", &format!("{}", 1.0001 * needed)]).0, 0);
    assert_eq!(check(&fits, &["--max-voltage", &format!("{}", 0.9999 * needed)]).0, 1);

    // A field: the same.
    let (status, printed, report) = check(&fits, &["--max-field", "12MV/m"]);
    names(&printed, &["limit: field", "12.00 MV/m (--max-field) allowed"]);
    let needed = report["binding"][0]["needed"].as_f64().expect("V/m");
    assert_eq!((status, check(&fits, &["--max-field", &format!("{}", 1.0001 * needed)]).0), (1, 0));

    // A film whose sizes are assumed has no field that could be in the way, however high the voltage.
    let film = folder.path().join("film.toml");
    let recording = &tests::recordings("wang")[0];
    let fit =
        ["fit", text(recording), "--out", text(&film), "--branches", "1", "--topology", "parallel", "--curve", "none"];
    TOOL.json(&fit);
    let high = sine(folder.path(), "high.csv", "1mm", "50mm");
    let output = run(&["feedforward", "--params", text(&film), "--reference", &high, "--check"]);
    let printed = utf8(&output.stdout);
    assert_eq!(output.status.code(), Some(1));
    names(&printed, &["limit: voltage"]);
    assert!(!printed.contains("limit: field") && !printed.contains('∞'), "{printed}");

    // A stroke that no offset makes feasible: a smaller one is named, with its offset, and is feasible.
    let wide = sine(folder.path(), "wide.csv", "0mm", "2.5mm");
    let (status, printed, report) = check(&wide, &["--max-voltage", "5kV"]);
    println!("{printed}");
    assert_eq!(status, 1);
    names(
        &printed,
        &["limit: force", "0 N or more", "limit: voltage", "no offset makes it feasible", "of it with an offset of"],
    );
    let factor = report["smaller"]["factor"].as_f64().expect("a factor");
    let offset = report["smaller"]["offset_m"].as_f64().expect("m");
    assert!((0.1..1.0).contains(&factor), "{factor}");
    let rows: Vec<String> = fs::read_to_string(&wide)
        .expect("written")
        .lines()
        .skip(1)
        .map(|line| {
            let (time, x) = line.split_once(',').expect("two cells");
            let (t, x): (f64, f64) = (time.parse().expect("s"), x.parse().expect("m"));
            let s = (t / 2.0).min(1.0);
            format!("{time},{}\n", factor * x + offset * s * s * s * (10.0 + s * (6.0 * s - 15.0)))
        })
        .collect();
    let corrected = folder.path().join("corrected.csv");
    fs::write(&corrected, "time_s,displacement_m\n".to_owned() + &rows.concat()).expect("written");
    assert_eq!(check(text(&corrected), &["--max-voltage", "5kV"]).0, 0);
}
