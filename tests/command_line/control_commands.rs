//! The commands of control as scripts call them.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use tests::recordings;
use tests::table::column;
use tests::tool::text;

use crate::TOOL;

/// A folder with parameters of a film like the first simulated film, and references that it can and cannot follow.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let bench = Self { folder: TempDir::new().expect("a folder") };
        let toml = r#"
            schema = 1
            name = "soft"
            [actuator]
            relative_permittivity = 4.7
            length_m = 0.04
            width_m = 0.06
            thickness_m = 160e-6
            mass_kg = 0.316
            stretch_coupling = 29.0
            [model]
            topology = "parallel"
            main = { c = 20600.0, alpha = 0.0 }
            branches = [
              [{ c = 10570.0, alpha = 0.0 }, { c = 9070.0, alpha = 1.0 }],
              [{ c = 6570.0, alpha = 0.0 }, { c = 69270.0, alpha = 1.0 }],
              [{ c = 4520.0, alpha = 0.0 }, { c = 2579700.0, alpha = 1.0 }],
              [{ c = 1231.0, alpha = 1.0 }, { c = 9424.0, alpha = 1.0 }],
            ]
        "#;
        fs::write(bench.path("soft.toml"), toml).expect("written");
        for (name, low) in [("high.csv", "1.5e-3"), ("low.csv", "0.1e-3")] {
            let (low, out) = (["--low", low], bench.path(name));
            let shape = ["reference", "--shape", "sine", "--high", "4e-3", "--period", "10", "--duration", "45"];
            TOOL.json(&[&shape[..], &low, &["--out", text(&out)]].concat());
        }
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn params(&self) -> String {
        text(&self.path("soft.toml")).to_owned()
    }
}

/// In all memories and precisions the model, driven by the voltages, is back on the reference.
#[test]
fn feedforward_and_simulate_are_each_others_inverse() {
    let bench = Bench::new();
    let (reference, volts, back) = (bench.path("high.csv"), bench.path("v.csv"), bench.path("x.csv"));
    let wanted = column(&reference, "displacement_m");
    for (memory, precision, within) in
        [("compressed", "f32", 1e-5), ("compressed", "f64", 1e-10), ("window:5", "f64", 1e-10), ("full", "f64", 1e-9)]
    {
        let how = ["--params", &bench.params(), "--memory", memory, "--precision", precision].map(str::to_owned);
        let how: Vec<&str> = how.iter().map(String::as_str).collect();
        let files = ["feedforward", "--reference", text(&reference), "--out", text(&volts)];
        let report = TOOL.json(&[&files, how.as_slice()].concat());
        assert_eq!(report["samples"], 45_001);
        assert_eq!(report["limited_pct"], 0.0);
        let header = fs::read_to_string(&volts).expect("written").lines().next().expect("a header").to_owned();
        assert!(header.starts_with("time_s,voltage_v,displacement_m,limited"), "{header}");
        let files = ["simulate", "--profile", text(&volts), "--out", text(&back)];
        TOOL.json(&[&files, how.as_slice()].concat());
        let worst = |x: &[f64]| x.iter().zip(&wanted).map(|(x, r)| (x - r).abs()).fold(0.0, f64::max) / 4e-3;
        let (reported, simulated) = (worst(&column(&volts, "displacement_m")), worst(&column(&back, "displacement_m")));
        println!("{memory} {precision}: reported {reported:.1e}, simulated {simulated:.1e}");
        assert!(reported < within && simulated < within, "{memory} {precision}: {reported} {simulated}");
    }
}

/// The check needs no voltage output. The offset that it reports is sufficient, and a smaller one is not.
#[test]
fn check_reports_the_feasible_band() {
    let bench = Bench::new();
    let check = |reference: &Path| {
        let arguments =
            ["feedforward", "--params", &bench.params(), "--reference", text(reference), "--check", "--json"];
        let output = TOOL.with(&arguments).output().expect("runs");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one document");
        // The exit status is the answer.
        let feasible = report["check"]["feasible"].as_bool().expect("an answer");
        assert_eq!(output.status.code(), Some(i32::from(!feasible)));
        report["check"].clone()
    };
    assert_eq!(check(&bench.path("high.csv"))["feasible"], true);
    let low = check(&bench.path("low.csv"));
    assert_eq!(low["feasible"], false);
    assert!(
        low["below_zero_pct"].as_f64().expect("a share") > 5.0 && low["lowest_force_n"].as_f64().expect("N") < -1.0
    );
    let least = low["least_offset_m"].as_f64().expect("an offset");
    let most = low["most_offset_m"].as_f64().expect("an offset");
    println!("offset {:.4} to {:.4} mm", 1e3 * least, 1e3 * most);
    let (time, path) = (column(&bench.path("low.csv"), "time_s"), column(&bench.path("low.csv"), "displacement_m"));
    for (offset, feasible) in [(1.01 * least, true), (0.98 * least, false), (0.99 * most, true), (1.02 * most, false)] {
        let mut csv = String::from("time_s,displacement_m\n");
        for (t, x) in time.iter().zip(&path) {
            let s = (t / 2.0).min(1.0);
            csv += &format!("{t},{}\n", x + offset * s * s * s * (10.0 + s * (6.0 * s - 15.0)));
        }
        let raised = bench.path("raised.csv");
        fs::write(&raised, csv).expect("written");
        assert_eq!(check(&raised)["feasible"], feasible, "{offset}");
    }
    // A command for it is limited, and marked as limited.
    let out = bench.path("v.csv");
    let low = bench.path("low.csv");
    let params = bench.params();
    let arguments = ["feedforward", "--params", &params, "--reference", text(&low), "--out", text(&out)];
    let report = TOOL.json(&arguments);
    assert_eq!(report["limits_met"][0]["limit"], "below-zero");
    let (volts, limited) = (column(&out, "voltage_v"), column(&out, "limited"));
    assert!(volts.iter().zip(&limited).all(|(v, bits)| *v >= 0.0 && (*bits == 0.0 || *v < 100.0)));
    assert!(limited.contains(&1.0));
}

#[test]
fn observe_estimates_a_recording() {
    let bench = Bench::new();
    let out = bench.path("out.csv");
    let [recording, ..] = recordings("hossain");
    let params = bench.params();
    let arguments = ["observe", "--params", &params, text(&recording), "--out", text(&out)];
    let report = TOOL.json(&arguments);
    assert_eq!(report["samples"], 15_501);
    let rms = report["innovation_rms_m"].as_f64().expect("m");
    println!("innovation {:.2} µm", 1e6 * rms);
    // The sensor's 5 µm, and what the bandwidth leaves of the model's error.
    assert!((5e-6..8e-6).contains(&rms));
    assert!((report["force_scale"].as_f64().expect("a scale") - 1.0).abs() < 0.03);
    let (estimate, sample) = (column(&out, "displacement_m"), column(&out, "sample_m"));
    let pairs: Vec<f64> = estimate.iter().zip(&sample).map(|(x, y)| x - y).filter(|e| !e.is_nan()).collect();
    assert_eq!(pairs.len(), 15_501);
}

#[test]
fn closed_loop_prints_what_scripts_read() {
    let bench = Bench::new();
    let (params, reference, out, figure) =
        (bench.params(), bench.path("high.csv"), bench.path("run.csv"), bench.path("run.svg"));
    let base = ["closed-loop", "--plant", "hossain", "--params", &params, "--reference", text(&reference)];
    let mut errors = Vec::new();
    for controller in ["none", "static", "window", "pi", "feedforward", "tracking"] {
        let report = TOOL.json(&[&base, ["--controller", controller].as_slice()].concat());
        assert!(report["drift_pct"].is_number() && report["infeasible_pct"].is_number(), "{report}");
        errors.push(report["tracking_rms_pct"].as_f64().expect("a number"));
    }
    println!("{errors:?}");
    // Each is better than none, feedforward than what forgets, tracking than all.
    assert!(errors[4] < 1.0 && errors[5] < 0.25 && errors[2] > errors[4] && errors[3] > errors[5] && errors[0] > 10.0);
    let flags = [
        "--controller",
        "tracking",
        "--sensor-noise",
        "1e-6",
        "--sensor-rate",
        "200",
        "--sensor-delay",
        "0.005",
        "--sensor-quantum",
        "0",
        "--sensor-lost",
        "20:30",
        "--amplifier-lag",
        "0.002",
        "--monitor-error",
        "-0.01",
        "--stiffness",
        "0.9",
        "--bandwidth",
        "0.7",
        "--max-voltage",
        "5800",
        "--max-slew",
        "40000",
        "--seed",
        "7",
        "--rate",
        "500",
        "--precision",
        "f64",
        "--out",
        text(&out),
        "--plot",
        text(&figure),
    ];
    let report = TOOL.json(&[&base[..], &flags].concat());
    assert_eq!(report["samples"], 22_501);
    assert_eq!(column(&out, "displacement_m").len(), 22_501);
    assert!(fs::read_to_string(&figure).expect("written").contains("<svg"));
}

/// Any parameter file is a plant. Its own law follows it within the discretisation; one that differs is not followed as well, and
/// the summary counts every limit that was met.
#[test]
fn a_parameter_file_is_a_plant() {
    let bench = Bench::new();
    let (params, reference) = (bench.params(), bench.path("high.csv"));
    let base = ["closed-loop", "--params", &params, "--reference", text(&reference), "--controller", "feedforward"];
    let error = |more: &[&str]| {
        let report = TOOL.json(&[&base, more].concat());
        (report["tracking_rms_pct"].as_f64().expect("a number"), report)
    };
    let (same, _) = error(&["--plant", &params]);
    let (stiffer, _) = error(&["--plant", &params, "--plant-mismatch", "stiffness=1.2"]);
    let (again, _) = error(&["--plant", &params, "--stiffness", "1.2"]);
    let (creeps, _) = error(&["--plant", &params, "--plant-mismatch", "alpha=0.95"]);
    println!("the same {same:.4} %, stiffer {stiffer:.2} %, with other orders {creeps:.2} %");
    assert!(same < 0.02 && (10.0..60.0).contains(&stiffer) && creeps > 0.1, "{same} {stiffer} {creeps}");
    assert_eq!(stiffer, again);

    let held = error(&["--plant", &params, "--max-field", "2e7"]).1;
    let met = held["limits_met"].as_array().expect("a list");
    let field = met.iter().find(|met| met["limit"] == "field").expect("met")["pct"].as_f64().expect("a share");
    assert!(field > 50.0 && held["limited_pct"].as_f64().expect("a share") >= field, "{held}");
    assert!(held["infeasible_pct"].as_f64().expect("a share") < 1.0, "{held}");
}
