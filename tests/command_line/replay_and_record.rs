//! `simulate`, `replay`, `frequency-response` and `plant` as scripts call them.

use std::fs;

use host_sim::files::parameters::Parameters;
use host_sim::files::recording::{Input, Recording};
use host_sim::grid::Samples;
use tests::recordings;
use tests::tool::{Bench, SIZES, names, number, rows};

use crate::TOOL;

/// The header of a table.
fn header(bench: &Bench, name: &str) -> String {
    bench.read(name).lines().find(|line| !line.starts_with('#')).expect("a header").to_owned()
}

#[test]
fn replay_prints_r2_per_recording_and_the_mean() {
    let bench = Bench::new(TOOL);
    let files = bench.recordings("hossain") + " " + &bench.recordings("wang");
    let line = format!("replay --params preset:table3-n2 {files}");
    let controller = bench.json(&line);
    let reference = bench.json(&format!("{line} --precision f64 --memory full"));
    assert_eq!(rows(&controller["recordings"]).len(), 6);
    let mut sum = 0.0;
    for (row, exact) in rows(&controller["recordings"]).iter().zip(rows(&reference["recordings"])) {
        let (r2, exact_r2) = (number(&row["r2"]), number(&exact["r2"]));
        println!("{}: R² {r2:.6}, with full memory in f64 {exact_r2:.6}", row["file"]);
        assert_eq!(format!("{r2:.4}"), format!("{exact_r2:.4}"));
        assert!(row["samples"] == 15_501 && number(&row["nrmse_pct"]) > 0.0 && number(&row["rmse_m"]) > 0.0);
        sum += r2;
    }
    let mean = number(&controller["r2_mean"]);
    assert!((mean - sum / 6.0).abs() < 1e-12);
    // Without --json: a table with the same numbers.
    names(&bench.prints(&line), &["R²", "mean", &format!("{mean:.5}")]);
}

#[test]
fn simulate_and_replay_agree() {
    let bench = Bench::new(TOOL);
    bench.recordings("wang");
    for memory in ["compressed", "full", "window:5"] {
        let how = format!("--params preset:table3-n1 --memory {memory}");
        let report = bench.json(&format!("simulate --profile wang-5s.csv --out response.csv {how}"));
        assert_eq!(report["samples"], 155_001);
        assert_eq!(header(&bench, "response.csv"), "time_s,voltage_v,force_n,displacement_m");
        let time_s = bench.column("response.csv", "time_s");
        assert!(time_s.len() == 155_001 && time_s[1000] == 1.0, "sample k is at k / rate");
        // What was simulated, replayed against itself, agrees with itself.
        let r2 = number(&bench.json(&format!("replay response.csv {how}"))["r2_mean"]);
        assert!(r2 > 0.999_999_999, "{memory}: {r2}");
    }
}

#[test]
fn force_driven_runs_and_both_directions() {
    let bench = Bench::new(TOOL);
    let row = |k: u32| format!("{},{}", f64::from(k) * 0.01, 50.0 * (1.0 - (0.005 * f64::from(k)).cos()));
    bench.write_table("force.csv", "time_s,force_n", (0..2000).map(row));
    bench.json("simulate --params preset:table4-f7 --profile force.csv --out response.csv");
    assert!(bench.column("response.csv", "voltage_v").iter().all(|volts| volts.is_nan()), "no voltage");
    for drive in ["force", "displacement"] {
        let report = bench.json(&format!("replay --params preset:table4-f7 --drive {drive} response.csv"));
        let row = &report["recordings"][0];
        assert!(number(&row["r2"]) > 0.999_999, "{drive}: {row}");
        assert_eq!((row["rmse_m"].is_number(), row["rmse_n"].is_number()), (drive == "force", drive != "force"));
    }
}

#[test]
fn the_weight_shows_in_the_force_if_it_acts_from_the_start() {
    let bench = Bench::new(TOOL);
    bench.write("v.csv", "time_s,voltage_kv\n0,0\n1,0\n2,6\n");
    let model = "[model]\ntopology = \"eq11\"\nmain = { c = 62740.0, alpha = 0.2 }\nbranches = []\n";
    for (preload, weight) in [("from-start", 0.316 * 9.806_65), ("settled", 0.0)] {
        bench.write("p.toml", format!("schema = 1\nname = \"test\"\n{SIZES}preload = \"{preload}\"\n{model}"));
        bench.json("simulate --params p.toml --profile v.csv --out out.csv --precision f64");
        let force_n = bench.column("out.csv", "force_n");
        assert!((force_n[500] - weight).abs() < 1e-12, "{preload}");
        assert!((force_n[2000] - weight - 140.449_554).abs() < 1e-5, "6 kV were given in kV");
    }
}

#[test]
fn replay_writes_a_response_beside_each_measurement() {
    let bench = Bench::new(TOOL);
    bench.recordings("wang");
    bench.json("replay --params preset:table3-n2 --out deep/er wang-5s.csv wang-7s.csv");
    for file in ["deep/er/wang-5s.csv", "deep/er/wang-7s.csv"] {
        assert_eq!(header(&bench, file), "time_s,voltage_v,force_n,displacement_m,measured_displacement_m");
        assert_eq!(bench.column(file, "displacement_m").len(), 155_001);
    }
}

#[test]
fn frequency_responses_are_tabulated() {
    let bench = Bench::new(TOOL);
    let table = |more: &str| {
        let range = "--from 0.01 --to 10 --points 31 --out fr.csv";
        bench.json(&format!("frequency-response --params preset:table3-n2 {range} {more}"));
        ["frequency_hz", "magnitude_m_per_n", "phase_rad"].map(|title| bench.column("fr.csv", title))
    };
    let ([hz, magnitude, phase], [_, discrete, discrete_phase]) = (table(""), table("--discrete"));
    assert_eq!(hz.len(), 31);
    assert!((hz[0] - 0.01).abs() < 1e-12 && (hz[30] - 10.0).abs() < 1e-9);
    for k in 0..31 {
        assert!((magnitude[k] / discrete[k] - 1.0).abs() < 0.01 && (phase[k] - discrete_phase[k]).abs() < 0.01, "{k}");
        assert!((-std::f64::consts::PI..0.0).contains(&phase[k]), "displacement lags");
    }
    // Of a springpot of order 0.2 nearly: magnitude falls as f^−0.2.
    let slope = (magnitude[10] / magnitude[0]).log10();
    assert!((slope + 0.2).abs() < 0.01, "{slope}");
}

#[test]
fn plant_records_with_seeded_noise() {
    let bench = Bench::new(TOOL);
    let record = |more: &str| {
        bench.json(&format!("twin --plant wang --duration 20 --rate 100 --out a.csv {more}"));
        assert_eq!(header(&bench, "a.csv"), "time_s,voltage_v,displacement_m");
        bench.column("a.csv", "displacement_m")
    };
    let a = record("--frequency 0.2");
    assert_eq!(a, record("--frequency 0.2"));
    assert_ne!(a, record("--frequency 0.2 --seed 2"));
    assert!(a.iter().all(|x| (x * 1e6 - (x * 1e6).round()).abs() < 1e-3), "quantised to 1 µm");
    let clean = record("--frequency 0.2 --noise 0 --quantum 0 --monitor-noise 0");
    let rms = (a.iter().zip(&clean).map(|(x, y)| (x - y).powi(2)).sum::<f64>() / a.len() as f64).sqrt();
    assert!((4.5e-6..5.5e-6).contains(&rms), "5 µm rms of noise: {rms}");
    let half = record("--peak-voltage 3000 --frequency 0.05");
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
    let numbers = |line: &str| -> Vec<f64> {
        line.split_whitespace().skip(1).map(|word| word.parse().expect("a number")).collect()
    };
    for line in printed.lines().filter(|line| line.starts_with("tests/recordings/")) {
        let name = line.split_whitespace().next().expect("a file");
        let shown: Vec<&str> =
            texts.iter().flat_map(|text| text.lines()).filter(|line| line.starts_with(name)).collect();
        assert!(!shown.is_empty(), "no document shows what replay prints: {line}");
        for other in shown {
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
        command.args(["replay", "--params", "preset:table3-n2"]).arg(&recording).args(more).stdout(full);
        let output = command.output().expect("runs");
        assert_eq!(output.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&output.stderr).starts_with("springpot: standard output: "));
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
    let bench = Bench::new(TOOL);
    for path in ["hossain", "wang"].into_iter().flat_map(recordings) {
        let committed = fs::read_to_string(&path).expect("committed");
        // They were recorded under the former name of the tool.
        let command = committed.lines().nth(1).and_then(|line| line.strip_prefix("# host-sim ")).expect("the command");
        let (command, _) = command.split_once(" --out").unwrap_or((command, ""));
        bench.prints(&format!("{command} --out again.csv"));
        let [old, new] =
            [&path, &bench.path("again.csv")].map(|path| Recording::read(path).expect("committed or written"));
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

/// A recording at a temperature that the film's dependence does not reach is left out beside others, and refused alone.
#[test]
fn a_temperature_out_of_reach_is_left_out() {
    let bench = Bench::new(TOOL);
    let film = Parameters::preset("table3-n2").expect("there").to_toml().replace("schema = 1", "schema = 5");
    let table = "[temperature]\nreference_c = 20.0\nstiffness_per_k = -0.01\nactivation_kj_per_mol = 50.0\n";
    bench.write("film.toml", format!("{film}{table}"));
    for (file, temperature_c) in [("cool.csv", 22.0), ("hot.csv", 140.0)] {
        let row = |k: u32| format!("{k},{},{},{temperature_c}", 10 * k, 1e-6 * f64::from(k));
        bench.write_table(file, "time_s,voltage_v,displacement_m,temperature_c", (0..100).map(row));
    }
    let report = bench.json("replay --params film.toml cool.csv hot.csv");
    assert_eq!((rows(&report["recordings"]).len(), &report["without_response"][0]["file"]), (1, &"hot.csv".into()));
    names(&bench.fails("replay --params film.toml hot.csv"), &["hot.csv", "at 140 °C"]);
}
