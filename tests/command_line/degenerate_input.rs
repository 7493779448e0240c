//! Recordings with little or wrong information: a clear error, or a usable fit with a warning; never a panic, never NaN in a file.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;
use tests::sweep::full_sweep;

use crate::TOOL;

/// A recording: V (V) and displacement (m, or nothing) at the times k / rate.
fn recording(path: &Path, seconds: f64, rate_hz: f64, row: impl Fn(f64) -> (f64, Option<f64>)) {
    let mut text = "time_s,voltage_v,displacement_m\n".to_owned();
    for k in 0..=(seconds * rate_hz) as usize {
        let time = k as f64 / rate_hz;
        let (voltage, displacement) = row(time);
        let cell = displacement.map_or_else(String::new, |x| format!("{x:e}"));
        let _ = writeln!(text, "{time},{voltage},{cell}");
    }
    fs::write(path, text).expect("written");
}

fn voltage(time: f64) -> f64 {
    3000.0 * (1.0 - (std::f64::consts::TAU * time / 7.0).cos())
}

/// A film with creep and noise, by hand: stroke with V², a share of it late.
fn displacement(time: f64) -> f64 {
    let share = (voltage(time) / 6000.0).powi(2);
    let noise = 5e-6 * (1000.0 * time).sin();
    2e-3 * share + 3e-4 * (1.0 - (-time / 20.0).exp()) + noise
}

fn fit(folder: &Path, files: &[&Path], more: &[&str]) -> Output {
    let mut command = Command::new(TOOL.0);
    command.args(["fit", "--json", "--out"]).arg(folder.join("p.toml")).args(files).args(more);
    command.output().expect("runs")
}

/// The fit's report, after checking that no file holds NaN and that the parameters can be read.
fn sane(folder: &Path, files: &[&Path], more: &[&str]) -> Value {
    let output = fit(folder, files, more);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).expect("one document");
    let parameters = folder.join("p.toml");
    let text = fs::read_to_string(&parameters).expect("written");
    let words = || text.split(|c: char| !c.is_alphanumeric()).map(str::to_lowercase);
    assert!(words().all(|word| word != "nan"), "{text}");
    let replay = Command::new(TOOL.0).args(["replay", "--json", "--params"]).arg(&parameters).args(files).output();
    assert!(replay.expect("runs").status.success());
    report
}

fn warns(report: &Value, words: &str) -> bool {
    report["warnings"].as_array().expect("a list").iter().any(|w| w.as_str().expect("text").contains(words))
}

#[test]
fn creep_under_constant_voltage() {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("step.csv");
    recording(&file, 100.0, 20.0, |t| (5000.0, Some(1e-3 * (t + 0.05).powf(0.1) + 2e-6 * (900.0 * t).sin())));
    let report = sane(folder.path(), &[&file], &[]);
    assert!(report["r2_mean"].as_f64().expect("a number") > 0.99);
    assert!(warns(&report, "constant"), "{report}");
}

#[test]
fn different_lengths_and_rates_and_a_single_cycle() {
    let folder = TempDir::new().expect("a folder");
    let files = ["a.csv", "b.csv", "c.csv"].map(|name| folder.path().join(name));
    for (file, (seconds, rate)) in files.iter().zip([(60.0, 50.0), (7.0, 333.0), (25.0, 20.0)]) {
        // Each has noise of its own: with the same one they would be copies.
        recording(file, seconds, rate, |t| (voltage(t), Some(displacement(t) + 1e-5 * (37.0 * rate * t).sin())));
    }
    let report = sane(folder.path(), &[&files[0], &files[1], &files[2]], &["--branches", "1"]);
    assert!(report["r2_mean"].as_f64().expect("a number") > 0.98, "{report}");
    let alone = sane(folder.path(), &[&files[1]], &[]);
    assert!(alone["r2_mean"].as_f64().expect("a number") > 0.98, "{alone}");
}

#[test]
fn gaps_are_bridged_with_a_warning() {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("gap.csv");
    recording(&file, 60.0, 50.0, |t| (voltage(t), Some(displacement(t))));
    let text = fs::read_to_string(&file).expect("written");
    let cut: String = text
        .lines()
        .filter(|line| {
            let time: Option<f64> = line.split(',').next().and_then(|cell| cell.parse().ok());
            time.is_none_or(|t| !(20.0..22.0).contains(&t))
        })
        .flat_map(|line| [line, "\n"])
        .collect();
    fs::write(&file, cut).expect("written");
    let report = sane(folder.path(), &[&file], &["--branches", "1"]);
    assert!(warns(&report, "gap"), "{report}");
    // Empty cells of the measurement are no gap: the voltage is known there.
    recording(&file, 60.0, 50.0, |t| (voltage(t), (!(20.0..22.0).contains(&t)).then(|| displacement(t))));
    let report = sane(folder.path(), &[&file], &["--branches", "1"]);
    assert!(!warns(&report, "gap") && report["r2_mean"].as_f64().expect("a number") > 0.98, "{report}");
}

#[test]
fn drop_outs_of_the_laser_do_not_pull_a_robust_fit() {
    let folder = TempDir::new().expect("a folder");
    let (clean, dirty) = (folder.path().join("clean.csv"), folder.path().join("dirty.csv"));
    let out = |t: f64| (t * 10.0).fract() < 0.2 && (t as usize).is_multiple_of(3);
    recording(&clean, 60.0, 50.0, |t| (voltage(t), Some(displacement(t))));
    recording(&dirty, 60.0, 50.0, |t| (voltage(t), Some(if out(t) { -0.02 } else { displacement(t) })));
    let error_on_clean = |more: &[&str]| {
        let report = sane(folder.path(), &[&dirty], &[&["--branches", "1"], more].concat());
        let replay = Command::new(TOOL.0)
            .args(["replay", "--json", "--params"])
            .args([&folder.path().join("p.toml"), &clean])
            .output()
            .expect("runs");
        let replay: Value = serde_json::from_slice(&replay.stdout).expect("one document");
        (replay["recordings"][0]["nrmse_pct"].as_f64().expect("a number"), report)
    };
    let (square, report) = error_on_clean(&[]);
    let (huber, _) = error_on_clean(&["--loss", "huber"]);
    println!("NRMSE on the clean recording: squares {square:.2} %, Huber {huber:.2} %");
    assert!(warns(&report, "--loss huber"), "{report}");
    assert!(huber < 5.0 && huber < 0.25 * square, "squares {square} %, Huber {huber} %");
}

/// The structure is chosen by what is left without the drop-outs.
#[test]
fn drop_outs_do_not_choose_the_structure() {
    let folder = TempDir::new().expect("a folder");
    let files = [5.0, 11.0].map(|period| {
        let file = folder.path().join(format!("{period}s.csv"));
        let volts = move |t: f64| 3000.0 * (1.0 - (std::f64::consts::TAU * t / period).cos());
        // A springpot's creep, by hand: stroke with V², and a slow share of it.
        let slow = move |t: f64| 4e-4 * (1.0 - (-t / 15.0).exp()) + 2e-4 * (1.0 - (-t / 2.0).exp());
        let share = move |t: f64| (volts(t) / 6000.0f64).powi(2);
        let out = |t: f64| (t * 7.3).fract() < 0.01;
        let film = move |t: f64| 2e-3 * share(t) + slow(t) + 5e-6 * (1000.0 * t).sin();
        recording(&file, 60.0, 20.0, move |t| (volts(t), Some(if out(t) { -0.02 } else { film(t) })));
        file
    });
    let report = sane(folder.path(), &[&files[0], &files[1]], &["--loss", "huber", "--topology", "parallel"]);
    let rows = report["structures"].as_array().expect("a list");
    let left_out = |row: &Value| row["left_out_nrmse_pct"].as_f64().expect("a number");
    for row in rows {
        println!("n = {}: left out {:.3} %, chosen {}", row["branches"], left_out(row), row["chosen"]);
    }
    assert!(report["branches"].as_u64() > Some(0), "a single springpot is not enough");
    assert!(rows.iter().filter(|row| row["chosen"] == true).all(|row| left_out(row) < 2.0), "{report}");
}

/// Bursts with long pauses: few rows that span a long time at a high rate.
#[test]
fn bursts_do_not_exhaust_the_memory() {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("bursts.csv");
    let mut text = "time_s,voltage_v,displacement_m\n".to_owned();
    for burst in 0..4 {
        for k in 0..10 {
            let time = 300.0 * f64::from(burst) + 1e-5 * f64::from(k);
            let _ = writeln!(text, "{time},{},{}", 1000 * burst, 1e-4 * f64::from(burst) + 1e-6 * f64::from(k));
        }
    }
    fs::write(&file, text).expect("written");
    sane(folder.path(), &[&file], &["--branches", "0"]);
}

#[test]
fn wrong_units_give_a_warning() {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("rec.csv");
    let branches = ["--branches", "0"];
    recording(&file, 30.0, 50.0, |t| (voltage(t), Some(1e3 * displacement(t))));
    assert!(warns(&sane(folder.path(), &[&file], &branches), "check the units"), "millimetres");
    recording(&file, 30.0, 50.0, |t| (1e3 * voltage(t), Some(displacement(t))));
    assert!(warns(&sane(folder.path(), &[&file], &branches), "check the units"), "kilovolts");
    recording(&file, 30.0, 50.0, |t| (voltage(t), Some(-displacement(t))));
    assert!(warns(&sane(folder.path(), &[&file], &branches), "displacement grows with voltage"), "the other way");
}

#[test]
fn a_saturated_sensor_gives_a_warning() {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("saturated.csv");
    recording(&file, 60.0, 50.0, |t| (voltage(t), Some(displacement(t).min(1.6e-3))));
    let report = sane(folder.path(), &[&file], &["--branches", "1"]);
    assert!(warns(&report, "saturated"), "{report}");
}

/// Hours at 10 Hz: ten in a full sweep.
#[test]
fn hours_of_samples() {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("long.csv");
    let hours = if full_sweep() { 10.0 } else { 1.0 };
    recording(&file, 3600.0 * hours, 10.0, |t| (voltage(t), Some(displacement(t) + 1e-4 * (t / 3600.0).ln_1p())));
    let report = sane(folder.path(), &[&file], &["--branches", "1", "--topology", "parallel"]);
    assert!(report["r2_mean"].as_f64().expect("a number") > 0.98, "{report}");
}

/// Time that the processor has spent in process `id`, s.
#[cfg(target_os = "linux")]
fn processor_time_s(id: u32) -> f64 {
    let stat = fs::read_to_string(format!("/proc/{id}/stat")).expect("it runs");
    // Fields 14 and 15, the name in field 2 left out, in hundredths of a second.
    let (_, after_name) = stat.rsplit_once(')').expect("a name");
    after_name.split_whitespace().skip(11).take(2).map(|ticks| ticks.parse::<f64>().expect("a number") / 100.0).sum()
}

/// Ctrl-C ends a search with the best result so far, in a file that is marked as interrupted.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_search_keeps_the_best_so_far() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("p.toml");
    let mut command = Command::new(TOOL.0);
    command.args(["fit", "--starts", "500", "--out"]).arg(&out).args(tests::recordings("hossain"));
    let mut running = command.stdout(std::process::Stdio::null()).spawn().expect("runs");
    // It has a first result after two seconds of the processor's time, however long a busy machine takes for that.
    while processor_time_s(running.id()) < 2.0 {
        assert!(running.try_wait().expect("waits").is_none(), "500 starts are done in 2 s");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let kill = Command::new("kill").args(["-INT", &running.id().to_string()]).status().expect("kills");
    assert!(kill.success());
    assert_eq!(running.wait().expect("ends").code(), Some(130), "scripts notice");
    let text = fs::read_to_string(&out).expect("the best so far");
    assert!(text.contains("interrupted = true"), "{text}");
    // Results that were not computed are not in the file.
    assert!(!text.contains("free: other values") && !text.contains("intervals_95_pct"), "{text}");
    let [recording, ..] = tests::recordings("hossain");
    let replay = Command::new(TOOL.0).args(["replay", "--json", "--params"]).args([&out, &recording]).output();
    let report: Value = serde_json::from_slice(&replay.expect("runs").stdout).expect("one document");
    assert!(report["r2_mean"].as_f64().expect("a number") > 0.9, "{report}");
}
