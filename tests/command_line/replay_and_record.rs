//! `simulate`, `replay`, `frequency-response` and `plant` as scripts call them.

use std::fs;
use std::path::Path;

use host_sim::files::recording::{Input, Recording};
use host_sim::grid::Samples;
use serde_json::Value;
use tempfile::TempDir;
use tests::recordings;
use tests::tool::text;

use crate::TOOL;

fn json(arguments: &[&str]) -> Value {
    TOOL.json(arguments)
}

/// Columns of a CSV file, comments left out.
fn columns(path: &Path) -> (String, Vec<Vec<String>>) {
    let content = fs::read_to_string(path).expect("written");
    let mut lines = content.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().expect("a header").to_owned();
    (header, lines.map(|line| line.split(',').map(str::to_owned).collect()).collect())
}

fn number(cell: &str) -> f64 {
    cell.parse().expect("a number")
}

#[test]
fn replay_prints_r2_per_recording_and_the_mean() {
    let files: Vec<_> = recordings("hossain").into_iter().chain(recordings("wang")).collect();
    let names: Vec<&str> = files.iter().map(|path| text(path)).collect();
    let arguments = [&["replay", "--params", "preset:table3-n2"], names.as_slice()].concat();
    let controller = json(&arguments);
    let reference = json(&[arguments.as_slice(), &["--precision", "f64", "--memory", "full"]].concat());
    let rows = controller["recordings"].as_array().expect("rows");
    assert_eq!(rows.len(), 6);
    let mut sum = 0.0;
    for (row, exact) in rows.iter().zip(reference["recordings"].as_array().expect("rows")) {
        let (r2, exact_r2) = (row["r2"].as_f64().expect("r2"), exact["r2"].as_f64().expect("r2"));
        println!("{}: R² {r2:.6}, with full memory in f64 {exact_r2:.6}", row["file"]);
        assert_eq!(format!("{r2:.4}"), format!("{exact_r2:.4}"));
        assert_eq!(row["samples"], 15_501);
        assert!(row["nrmse_pct"].as_f64().expect("nrmse") > 0.0 && row["rmse_m"].as_f64().expect("rmse") > 0.0);
        sum += r2;
    }
    let mean = controller["r2_mean"].as_f64().expect("mean");
    assert!((mean - sum / 6.0).abs() < 1e-12);
    // Without --json: a table with the same numbers.
    let output = TOOL.with(&arguments).assert().success().get_output().stdout.clone();
    let table = String::from_utf8(output).expect("UTF-8");
    assert!(table.contains("R²") && table.contains("mean") && table.contains(&format!("{mean:.5}")), "{table}");
}

#[test]
fn simulate_and_replay_agree() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("response.csv");
    let [recording, ..] = recordings("wang");
    for memory in ["compressed", "full", "window:5"] {
        let arguments =
            ["simulate", "--params", "preset:table3-n1", "--profile", text(&recording), "--out", text(&out)];
        let report = json(&[&arguments, ["--memory", memory].as_slice()].concat());
        assert_eq!(report["samples"], 155_001);
        let (header, rows) = columns(&out);
        assert_eq!(header, "time_s,voltage_v,force_n,displacement_m");
        assert_eq!(rows.len(), 155_001);
        assert_eq!(number(&rows[1000][0]), 1.0, "sample k is at k / rate");
        // What was simulated, replayed against itself, agrees with itself.
        let again = ["replay", "--params", "preset:table3-n1", text(&out), "--memory", memory];
        let r2 = json(&again)["r2_mean"].as_f64().expect("r2");
        assert!(r2 > 0.999_999_999, "{memory}: {r2}");
    }
}

#[test]
fn force_driven_runs_and_both_directions() {
    let folder = TempDir::new().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    let profile = file("force.csv");
    let rows: String =
        (0..2000).map(|k| format!("{},{}\n", k as f64 * 0.01, 50.0 * (1.0 - (0.005 * k as f64).cos()))).collect();
    fs::write(&profile, format!("time_s,force_n\n{rows}")).expect("written");
    let out = file("response.csv");
    json(&["simulate", "--params", "preset:table4-f7", "--profile", text(&profile), "--out", text(&out)]);
    let (_, rows) = columns(&out);
    assert!(rows.iter().all(|row| row[1].is_empty()), "no voltage in a force-driven run");
    for drive in ["force", "displacement"] {
        let report = json(&["replay", "--params", "preset:table4-f7", "--drive", drive, text(&out)]);
        let r2 = report["recordings"][0]["r2"].as_f64().expect("r2");
        assert!(r2 > 0.999_999, "{drive}: {r2}");
        assert_eq!(report["recordings"][0]["rmse_m"].is_number(), drive == "force");
        assert_eq!(report["recordings"][0]["rmse_n"].is_number(), drive == "displacement");
    }
}

#[test]
fn the_weight_shows_in_the_force_if_it_acts_from_the_start() {
    let folder = TempDir::new().expect("a folder");
    let parameters = folder.path().join("p.toml");
    let profile = folder.path().join("v.csv");
    let out = folder.path().join("out.csv");
    fs::write(&profile, "time_s,voltage_kv\n0,0\n1,0\n2,6\n").expect("written");
    for (preload, weight) in [("from-start", 0.316 * 9.806_65), ("settled", 0.0)] {
        fs::write(&parameters, parameter_text(preload)).expect("written");
        json(&[
            "simulate",
            "--params",
            text(&parameters),
            "--profile",
            text(&profile),
            "--out",
            text(&out),
            "--precision",
            "f64",
        ]);
        let (_, rows) = columns(&out);
        assert!((number(&rows[500][2]) - weight).abs() < 1e-12, "{preload}");
        assert!((number(&rows[2000][2]) - weight - 140.449_554).abs() < 1e-5, "6 kV were given in kV");
    }
}

fn parameter_text(preload: &str) -> String {
    format!(
        "schema = 1\nname = \"test\"\n\n[actuator]\nrelative_permittivity = 4.7\nlength_m = 0.04\nwidth_m = 0.06\n\
         thickness_m = 160e-6\nmass_kg = 0.316\npreload = \"{preload}\"\nstretch_coupling = 0.0\n\n\
         [model]\ntopology = \"eq11\"\nmain = {{ c = 62740.0, alpha = 0.2 }}\nbranches = [\n\
         \u{20} [{{ c = 47958.0, alpha = 1.0 }}, {{ c = 173210.0, alpha = 1.0 }}],\n]\n"
    )
}

#[test]
fn replay_writes_a_response_beside_each_measurement() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("deep/er");
    let files = recordings("wang");
    json(&["replay", "--params", "preset:table3-n2", "--out", text(&out), text(&files[0]), text(&files[1])]);
    for file in &files[..2] {
        let (header, rows) = columns(&out.join(file.file_name().expect("a name")));
        assert_eq!(header, "time_s,voltage_v,force_n,displacement_m,measured_displacement_m");
        assert_eq!(rows.len(), 155_001);
    }
}

#[test]
fn frequency_responses_are_tabulated() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("fr.csv");
    let table = |more: &[&str]| {
        let arguments =
            ["frequency-response", "--params", "preset:table3-n2", "--from", "0.01", "--to", "10", "--points", "31"];
        json(&[&arguments, ["--out", text(&out)].as_slice(), more].concat());
        let (header, rows) = columns(&out);
        assert_eq!(header, "frequency_hz,magnitude_m_per_n,phase_rad");
        assert_eq!(rows.len(), 31);
        rows.into_iter().map(|row| [number(&row[0]), number(&row[1]), number(&row[2])]).collect::<Vec<_>>()
    };
    let (continuous, discrete) = (table(&[]), table(&["--discrete"]));
    assert!((continuous[0][0] - 0.01).abs() < 1e-12 && (continuous[30][0] - 10.0).abs() < 1e-9);
    for (a, b) in continuous.iter().zip(&discrete) {
        assert!((a[1] / b[1] - 1.0).abs() < 0.01 && (a[2] - b[2]).abs() < 0.01, "{a:?} {b:?}");
        assert!((-std::f64::consts::PI..0.0).contains(&a[2]), "displacement lags");
    }
    // Of a springpot of order 0.2 nearly: magnitude falls as f^−0.2.
    let slope = (continuous[10][1] / continuous[0][1]).log10();
    assert!((slope + 0.2).abs() < 0.01, "{slope}");
}

#[test]
fn plant_records_with_seeded_noise() {
    let folder = TempDir::new().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    let record = |name: &str, more: &[&str]| {
        let path = file(name);
        let arguments = ["twin", "--plant", "wang", "--frequency", "0.2", "--duration", "20", "--rate", "100"];
        json(&[&arguments, ["--out", text(&path)].as_slice(), more].concat());
        let (header, rows) = columns(&path);
        assert_eq!(header, "time_s,voltage_v,displacement_m");
        rows.iter().map(|row| number(&row[2])).collect::<Vec<f64>>()
    };
    let (a, again, other) = (record("a.csv", &[]), record("b.csv", &[]), record("c.csv", &["--seed", "2"]));
    assert_eq!(a, again);
    assert_ne!(a, other);
    assert!(a.iter().all(|x| (x * 1e6 - (x * 1e6).round()).abs() < 1e-3), "quantised to 1 µm");
    let clean = record("d.csv", &["--noise", "0", "--quantum", "0", "--monitor-noise", "0"]);
    let rms = (a.iter().zip(&clean).map(|(x, y)| (x - y).powi(2)).sum::<f64>() / a.len() as f64).sqrt();
    assert!((4.5e-6..5.5e-6).contains(&rms), "5 µm rms of noise: {rms}");
    let half = record("e.csv", &["--peak-voltage", "3000", "--frequency", "0.05"]);
    assert!(half.iter().copied().fold(0.0, f64::max) < 0.5e-3);
}

/// README or docs show what `replay` prints of the committed recordings: the numbers are the same within 1e-3, which leaves room
/// for another machine's sines.
#[test]
fn documents_show_what_replay_prints() {
    let mut files: Vec<String> = ["hossain", "wang"]
        .into_iter()
        .flat_map(recordings)
        .map(|path| format!("tests/recordings/{}", path.file_name().expect("a name").display()))
        .collect();
    files.sort();
    let mut command = TOOL.with(&["replay", "--params", "preset:table3-n2"]);
    let printed = command.args(files).current_dir(documents::root()).assert().success().get_output().stdout.clone();
    let printed = String::from_utf8(printed).expect("UTF-8");
    assert_eq!(printed.lines().count(), 9);
    assert_eq!(printed.lines().last(), Some("at 1000 Hz, memory compressed, f32"));
    let texts: Vec<String> =
        documents::files().expect("readable").iter().map(|path| fs::read_to_string(path).expect("readable")).collect();
    let shown = |name: &str| -> Vec<&str> {
        texts.iter().flat_map(|text| text.lines()).filter(|line| line.starts_with(name)).collect()
    };
    let numbers = |line: &str| line.split_whitespace().skip(1).map(number).collect::<Vec<f64>>();
    for line in printed.lines().filter(|line| line.starts_with("tests/recordings/")) {
        let name = line.split_whitespace().next().expect("a file");
        assert!(!shown(name).is_empty(), "no document shows what replay prints: {line}");
        for other in shown(name) {
            let (here, there) = (numbers(line), numbers(other));
            let close = here.iter().zip(&there).all(|(a, b)| (a - b).abs() <= 1e-3 * a.abs());
            assert!(here.len() == there.len() && close, "printed: {line}\nshown:   {other}");
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn results_that_cannot_be_printed_are_an_error() {
    let [recording, ..] = recordings("wang");
    for more in [[].as_slice(), &["--json"]] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("a device");
        let mut command = std::process::Command::new(TOOL.0);
        command.args(["replay", "--params", "preset:table3-n2", text(&recording)]).args(more).stdout(full);
        let output = command.output().expect("runs");
        assert_eq!(output.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&output.stderr).starts_with("host-sim: standard output: "));
    }
}

#[test]
fn help_and_version_are_no_errors() {
    for arguments in [["--help"].as_slice(), &["--version"], &["replay", "--help"]] {
        let output = TOOL.with(arguments).assert().success().get_output().clone();
        assert!(!output.stdout.is_empty() && output.stderr.is_empty());
    }
}

fn voltage(recording: &Recording) -> Samples {
    match recording.drive() {
        Ok(Input::Voltage(voltage)) => voltage,
        other => panic!("no voltage: {other:?}"),
    }
}

/// The committed recordings are what the commands in their headers record, up to the sensor's last digit.
#[test]
fn recordings_are_reproducible() {
    let folder = TempDir::new().expect("a folder");
    for path in ["hossain", "wang"].into_iter().flat_map(recordings) {
        let committed = fs::read_to_string(&path).expect("committed");
        let command = committed.lines().nth(1).and_then(|line| line.strip_prefix("# host-sim ")).expect("the command");
        let again = folder.path().join("again.csv");
        let arguments: Vec<&str> = command.split(' ').map_while(|word| (word != "--out").then_some(word)).collect();
        TOOL.with(&arguments).arg("--out").arg(&again).assert().success();
        let (old, new) = (Recording::read(&path).expect("committed"), Recording::read(&again).expect("written"));
        for (old, new, quantum) in [
            (old.displacement().expect("measured"), new.displacement().expect("measured"), 1e-6),
            (voltage(&old), voltage(&new), 0.01),
        ] {
            assert_eq!(old.time_s, new.time_s);
            let pairs = old.value.iter().zip(&new.value);
            let differ = pairs.filter(|(old, new)| (*old - *new).abs() > 0.01 * quantum).count();
            // Another machine's sines may round a cell the other way.
            assert!(differ * 1000 <= old.value.len(), "{}: {differ} cells differ", path.display());
        }
    }
}
