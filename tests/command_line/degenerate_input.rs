//! Recordings with little or wrong information: a clear error, or a usable fit with a warning; never a panic, never NaN in a file.

use serde_json::Value;
use tests::sweep::full_sweep;
use tests::tool::{Bench, names, number, rows, warns};

use crate::TOOL;

/// A recording: V (V) and displacement (m, or nothing) at the times k / rate.
fn record(bench: &Bench, file: &str, seconds: f64, rate_hz: f64, row: impl Fn(f64) -> (f64, Option<f64>)) {
    let line = |time: f64| {
        let (voltage, displacement) = row(time);
        format!("{time},{voltage},{}", displacement.map_or_else(String::new, |x| format!("{x:e}")))
    };
    let times = (0..=(seconds * rate_hz) as usize).map(|k| k as f64 / rate_hz);
    bench.write_table(file, "time_s,voltage_v,displacement_m", times.map(line));
}

/// V = 3 kV (1 − cos 2πt / period).
fn cycles(time: f64, period: f64) -> f64 {
    3000.0 * (1.0 - (std::f64::consts::TAU * time / period).cos())
}

fn voltage(time: f64) -> f64 {
    cycles(time, 7.0)
}

/// A film with creep and noise, by hand: stroke with V², a share of it late.
fn displacement(time: f64) -> f64 {
    let share = (voltage(time) / 6000.0).powi(2);
    let noise = 5e-6 * (1000.0 * time).sin();
    2e-3 * share + 3e-4 * (1.0 - (-time / 20.0).exp()) + noise
}

/// The fit's report, after checking that no file holds NaN and that the parameters can be read.
fn sane(bench: &Bench, files: &str, more: &str) -> Value {
    let report = bench.json(&format!("fit --out p.toml {files} {more}"));
    let text = bench.read("p.toml");
    let mut words = text.split(|c: char| !c.is_alphanumeric()).map(str::to_lowercase);
    assert!(words.all(|word| word != "nan"), "{text}");
    bench.json(&format!("replay --params p.toml {files}"));
    report
}

/// A row of a recording whose only file is fitted with `options`, and what one of the fit's warnings holds.
type Case = (&'static str, [f64; 2], &'static dyn Fn(f64) -> (f64, Option<f64>), &'static str, &'static str);

#[test]
fn a_usable_fit_has_a_warning() {
    let cases: [Case; 6] = [
        (
            "creep under a constant voltage",
            [100.0, 20.0],
            &|t| (5000.0, Some(1e-3 * (t + 0.05).powf(0.1) + 2e-6 * (900.0 * t).sin())),
            "",
            "constant",
        ),
        ("millimetres", [30.0, 50.0], &|t| (voltage(t), Some(1e3 * displacement(t))), "0", "check the units"),
        ("kilovolts", [30.0, 50.0], &|t| (1e3 * voltage(t), Some(displacement(t))), "0", "check the units"),
        (
            "the other way",
            [30.0, 50.0],
            &|t| (voltage(t), Some(-displacement(t))),
            "0",
            "displacement grows with voltage",
        ),
        ("saturated", [60.0, 50.0], &|t| (voltage(t), Some(displacement(t).min(1.6e-3))), "1", "saturates there"),
        // A row without its voltage is left out.
        (
            "a gap",
            [60.0, 50.0],
            &|t| (if (20.0..22.0).contains(&t) { f64::NAN } else { voltage(t) }, Some(displacement(t))),
            "1",
            "gap",
        ),
    ];
    for (name, [seconds, rate_hz], row, branches, words) in cases {
        let bench = Bench::new(TOOL);
        record(&bench, "rec.csv", seconds, rate_hz, row);
        let rows: Vec<String> =
            bench.read("rec.csv").lines().filter(|line| !line.contains("NaN")).map(str::to_owned).collect();
        bench.write("rec.csv", rows.join("\n"));
        let options = if branches.is_empty() { String::new() } else { format!("--branches {branches}") };
        let report = sane(&bench, "rec.csv", &options);
        assert!(warns(&report, words), "{name}: {report}");
        assert!(!branches.is_empty() || number(&report["r2_mean"]) > 0.99, "{name}: {report}");
    }
}

#[test]
fn different_lengths_and_rates_and_a_single_cycle() {
    let bench = Bench::new(TOOL);
    for (file, seconds, rate) in [("a.csv", 60.0, 50.0), ("b.csv", 7.0, 333.0), ("c.csv", 25.0, 20.0)] {
        // Each has noise of its own: with the same one they would be copies.
        let noise = |t: f64| 1e-5 * (37.0 * rate * t).sin();
        record(&bench, file, seconds, rate, |t| (voltage(t), Some(displacement(t) + noise(t))));
    }
    for (files, more) in [("a.csv b.csv c.csv", "--branches 1"), ("b.csv", "")] {
        let report = sane(&bench, files, more);
        assert!(number(&report["r2_mean"]) > 0.98, "{report}");
    }
    // Empty cells of the measurement are no gap: the voltage is known there.
    record(&bench, "a.csv", 60.0, 50.0, |t| (voltage(t), (!(20.0..22.0).contains(&t)).then(|| displacement(t))));
    let report = sane(&bench, "a.csv", "--branches 1");
    assert!(!warns(&report, "gap") && number(&report["r2_mean"]) > 0.98, "{report}");
}

/// A copy is no second measurement: what a model left out would be what it was fitted to.
#[test]
fn copies_are_refused_wherever_recordings_are_left_out() {
    let bench = Bench::new(TOOL);
    let noise = |t: f64| 1e-5 * (371.0 * t).sin();
    record(&bench, "a.csv", 60.0, 50.0, |t| (voltage(t), Some(displacement(t) + noise(t))));
    record(&bench, "b.csv", 60.0, 50.0, |t| (voltage(t), Some(displacement(t) + noise(t))));
    for line in ["fit a.csv ./b.csv --out p.toml", "compare a.csv ./b.csv", "study a.csv ./b.csv --out st"] {
        // With their folders, which may be all that differs.
        names(&bench.fails(line), &["./b.csv: is a copy of a.csv", "leave it out"]);
    }
}

#[test]
fn drop_outs_of_the_laser_do_not_pull_a_robust_fit() {
    let bench = Bench::new(TOOL);
    let out = |t: f64| (t * 10.0).fract() < 0.2 && (t as usize).is_multiple_of(3);
    record(&bench, "clean.csv", 60.0, 50.0, |t| (voltage(t), Some(displacement(t))));
    record(&bench, "dirty.csv", 60.0, 50.0, |t| (voltage(t), Some(if out(t) { -0.02 } else { displacement(t) })));
    let error_on_clean = |more: &str| {
        let report = sane(&bench, "dirty.csv", &format!("--branches 1 {more}"));
        let replay = bench.json("replay --params p.toml clean.csv");
        (number(&replay["recordings"][0]["nrmse_pct"]), report)
    };
    let (square, report) = error_on_clean("");
    let (huber, _) = error_on_clean("--loss huber");
    println!("NRMSE on the clean recording: squares {square:.2} %, Huber {huber:.2} %");
    assert!(warns(&report, "--loss huber"), "{report}");
    assert!(huber < 5.0 && huber < 0.25 * square, "squares {square} %, Huber {huber} %");
}

/// The structure is chosen by what is left without the drop-outs.
#[test]
fn drop_outs_do_not_choose_the_structure() {
    let bench = Bench::new(TOOL);
    for (file, period) in [("a.csv", 5.0), ("b.csv", 11.0)] {
        // A springpot's creep, by hand: stroke with V², and a slow share of it.
        let slow = |t: f64| 4e-4 * (1.0 - (-t / 15.0).exp()) + 2e-4 * (1.0 - (-t / 2.0).exp());
        let film = |t: f64| 2e-3 * (cycles(t, period) / 6000.0).powi(2) + slow(t) + 5e-6 * (1000.0 * t).sin();
        let out = |t: f64| (t * 7.3).fract() < 0.01;
        record(&bench, file, 60.0, 20.0, |t| (cycles(t, period), Some(if out(t) { -0.02 } else { film(t) })));
    }
    let report = sane(&bench, "a.csv b.csv", "--loss huber --topology parallel --curve none");
    assert!(report["branches"].as_u64() > Some(0), "a single springpot is not enough");
    let mut chosen = rows(&report["structures"]).iter().filter(|row| row["chosen"] == true);
    assert!(chosen.all(|row| number(&row["left_out_nrmse_pct"]) < 2.0), "{report}");
}

/// Bursts with long pauses: few rows that span a long time at a high rate.
#[test]
fn bursts_do_not_exhaust_the_memory() {
    let bench = Bench::new(TOOL);
    let row = |(burst, k): (i32, i32)| {
        let time = 300.0 * f64::from(burst) + 1e-5 * f64::from(k);
        format!("{time},{},{}", 1000 * burst, 1e-4 * f64::from(burst) + 1e-6 * f64::from(k))
    };
    let rows = (0..4).flat_map(|burst| (0..10).map(move |k| (burst, k))).map(row);
    bench.write_table("bursts.csv", "time_s,voltage_v,displacement_m", rows);
    sane(&bench, "bursts.csv", "--branches 0");
}

/// Hours at 10 Hz: ten in a full sweep.
#[test]
fn hours_of_samples() {
    let bench = Bench::new(TOOL);
    let hours = if full_sweep() { 10.0 } else { 1.0 };
    let creep = |t: f64| 1e-4 * (t / 3600.0).ln_1p();
    record(&bench, "long.csv", 3600.0 * hours, 10.0, |t| (voltage(t), Some(displacement(t) + creep(t))));
    let report = sane(&bench, "long.csv", "--branches 1 --topology parallel --curve none");
    assert!(number(&report["r2_mean"]) > 0.98, "{report}");
}

/// Time that the processor has spent in process `id`, s.
#[cfg(target_os = "linux")]
fn processor_time_s(id: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).expect("it runs");
    // Fields 14 and 15, the name in field 2 left out, in hundredths of a second.
    let (_, after_name) = stat.rsplit_once(')').expect("a name");
    after_name.split_whitespace().skip(11).take(2).map(|ticks| ticks.parse::<f64>().expect("a number") / 100.0).sum()
}

/// Ctrl-C ends a search with the best result so far, in a file that is marked as interrupted.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_search_keeps_the_best_so_far() {
    use std::process::{Command, Stdio};
    let bench = Bench::new(TOOL);
    let files = bench.recordings("hossain");
    let mut command = Command::new(TOOL.0);
    command.args(["fit", "--starts", "500", "--out", "p.toml"]).args(files.split(' '));
    let mut running = command.current_dir(bench.path("")).stdout(Stdio::null()).spawn().expect("runs");
    // It has a first result after two seconds of the processor's time, however long a busy machine takes for that.
    while processor_time_s(running.id()) < 2.0 {
        assert!(running.try_wait().expect("waits").is_none(), "500 starts are done in 2 s");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let kill = Command::new("kill").args(["-INT", &running.id().to_string()]).status().expect("kills");
    assert!(kill.success());
    assert_eq!(running.wait().expect("ends").code(), Some(130), "scripts notice");
    let text = bench.read("p.toml");
    assert!(text.contains("interrupted = true"), "{text}");
    // Results that were not computed are not in the file.
    assert!(!text.contains("free: other values") && !text.contains("intervals_95_pct"), "{text}");
    let report = bench.json("replay --params p.toml hossain-5s.csv");
    assert!(number(&report["r2_mean"]) > 0.9, "{report}");
}
