//! The commands of control as scripts call them.

use tests::thinned_recordings;
use tests::tool::{Bench, SIZES, failed, names, number, rows};

use crate::TOOL;

/// A folder with parameters of a film like the first simulated film, and references that it can and cannot follow.
fn bench() -> Bench {
    let bench = Bench::new(TOOL);
    bench.write("soft.toml", include_str!("films/soft.toml"));
    for (name, low) in [("high.csv", "1.5e-3"), ("low.csv", "0.1e-3")] {
        let shape = "reference --shape sine --high 4e-3 --period 10 --duration 45";
        bench.json(&format!("{shape} --low {low} --out {name}"));
    }
    bench
}

/// Writes a reference as a share of another one with an offset (m), which it rises to in 2 s with the least jerk.
pub fn write_raised(bench: &Bench, name: &str, other: &str, (share, offset_m): (f64, f64)) {
    let [time, path] = ["time_s", "displacement_m"].map(|title| bench.column(other, title));
    let row = |(t, x): (&f64, &f64)| {
        let s = (t / 2.0).min(1.0);
        format!("{t},{}", share * x + offset_m * s * s * s * (10.0 + s * (6.0 * s - 15.0)))
    };
    bench.write_table(name, "time_s,displacement_m", time.iter().zip(&path).map(row));
}

/// In all memories and precisions the model, driven by the voltages, is back on the reference.
#[test]
fn feedforward_and_simulate_are_each_others_inverse() {
    let bench = bench();
    let wanted = bench.column("high.csv", "displacement_m");
    for (memory, precision, within) in
        [("compressed", "f32", 1e-5), ("compressed", "f64", 1e-10), ("window:5", "f64", 1e-10), ("full", "f64", 1e-9)]
    {
        let how = format!("--params soft.toml --memory {memory} --precision {precision}");
        let report = bench.json(&format!("feedforward --reference high.csv --out v.csv {how}"));
        assert!(report["samples"] == 45_001 && report["limited_pct"] == 0.0, "{report}");
        assert!(bench.read("v.csv").starts_with("time_s,voltage_v,displacement_m,limited"));
        bench.json(&format!("simulate --profile v.csv --out x.csv {how}"));
        let [reported, simulated] = ["v.csv", "x.csv"].map(|file| {
            let x = bench.column(file, "displacement_m");
            x.iter().zip(&wanted).map(|(x, r)| (x - r).abs()).fold(0.0, f64::max) / 4e-3
        });
        println!("{memory} {precision}: reported {reported:.1e}, simulated {simulated:.1e}");
        assert!(reported < within && simulated < within, "{memory} {precision}: {reported} {simulated}");
    }
}

/// The check needs no voltage output. The offset that it reports is sufficient, and a smaller one is not.
#[test]
fn check_reports_the_feasible_band() {
    let bench = bench();
    let check = |reference: &str| {
        let (report, is_yes) =
            bench.answers(&format!("feedforward --params soft.toml --reference {reference} --check"));
        assert_eq!(report["check"]["feasible"], is_yes);
        report["check"].clone()
    };
    assert_eq!(check("high.csv")["feasible"], true);
    let low = check("low.csv");
    assert_eq!(low["feasible"], false);
    assert!(number(&low["below_zero_pct"]) > 5.0 && number(&low["lowest_force_n"]) < -1.0);
    let (least, most) = (number(&low["least_offset_m"]), number(&low["most_offset_m"]));
    println!("offset {:.4} to {:.4} mm", 1e3 * least, 1e3 * most);
    for (offset, feasible) in [(1.01 * least, true), (0.98 * least, false), (0.99 * most, true), (1.02 * most, false)] {
        write_raised(&bench, "raised.csv", "low.csv", (1.0, offset));
        assert_eq!(check("raised.csv")["feasible"], feasible, "{offset}");
    }
    // A command for it is limited, and marked as limited.
    let report = bench.json("feedforward --params soft.toml --reference low.csv --out v.csv");
    assert_eq!(report["limits_met"][0]["limit"], "below-zero");
    let [volts, limited] = ["voltage_v", "limited"].map(|title| bench.column("v.csv", title));
    assert!(volts.iter().zip(&limited).all(|(v, bits)| *v >= 0.0 && (*bits == 0.0 || *v < 100.0)));
    assert!(limited.contains(&1.0));
}

#[test]
fn observe_estimates_a_recording() {
    let bench = bench();
    bench.recordings("hossain");
    let report = bench.json("observe --params soft.toml hossain-5s.csv --out out.csv");
    assert_eq!(report["samples"], 15_501);
    let rms = number(&report["innovation_rms_m"]);
    println!("innovation {:.2} µm", 1e6 * rms);
    // The sensor's 5 µm, and what the bandwidth leaves of the model's error.
    assert!((5e-6..8e-6).contains(&rms));
    assert!((number(&report["force_scale"]) - 1.0).abs() < 0.03);
    // A row for each of the recording, not for each tick, each with an estimate and a sample.
    for title in ["displacement_m", "sample_m"] {
        let column = bench.column("out.csv", title);
        assert!(column.len() == 15_501 && column.iter().all(|x| x.is_finite()), "{title}");
    }
    bench.json("observe --params soft.toml hossain-5s.csv --out out.csv --every 500");
    assert_eq!(bench.column("out.csv", "time_s")[..3], [0.0, 0.5, 1.0]);
    // Another unit, or another film: the force scale shows it.
    assert!(report["force_scale_note"].is_null(), "{report}");
    let doubled = "observe --params soft.toml hossain-5s.csv --out out.csv --columns voltage=2*2";
    let note = bench.json(doubled)["force_scale_note"].clone();
    names(note.as_str().expect("a note"), &["hossain-5s.csv: the force scale ends at 0.", "soft.toml", "the unit"]);
    names(&String::from_utf8_lossy(&bench.run(doubled).stderr), &["warning", "the force scale ends at 0."]);
}

/// A sensor of 4 Hz is too slow for 0.6 Hz: the default is the most that it allows.
#[test]
fn observe_takes_a_slow_sensor() {
    let bench = bench();
    thinned_recordings("hossain", &bench.path(""), 25);
    let report = bench.json("observe --params soft.toml hossain-5s.csv --out out.csv");
    let hz = number(&report["bandwidth_hz"]);
    assert!((0.1..0.5).contains(&hz) && report["samples"] == 621, "{report}");
    let stated = |hz: f64| format!("observe --params soft.toml hossain-5s.csv --out out.csv --bandwidth {hz}");
    assert!((number(&bench.json(&stated(0.999 * hz))["bandwidth_hz"]) - 0.999 * hz).abs() < 1e-6);
    names(&failed(bench.with(&stated(1.01 * hz))), &["--bandwidth"]);
}

/// The resonance of a model with little damping: the default bandwidth is as large as that allows, a stated one is refused.
#[test]
fn observe_takes_a_model_that_would_ring() {
    let bench = bench();
    bench.recordings("hossain");
    let model = "[model]\ntopology = \"parallel\"\nmain = { c = 120.0, alpha = 0.005 }\nbranches = []\n";
    bench.write("ringing.toml", format!("schema = 1\nname = \"ringing\"\n{SIZES}{model}"));
    let report = bench.json("observe --params ringing.toml hossain-5s.csv --out out.csv");
    let hz = number(&report["bandwidth_hz"]);
    assert!((0.1..0.59).contains(&hz), "{report}");
    let refused = bench.run("observe --params ringing.toml hossain-5s.csv --out out.csv --bandwidth 0.6");
    let text = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(2) && text.contains("--bandwidth: with a bandwidth of 0.600 Hz"), "{text}");
}

#[test]
fn closed_loop_prints_what_scripts_read() {
    let bench = bench();
    let base = "closed-loop --plant hossain --params soft.toml --reference high.csv --controller";
    let errors = ["none", "static", "window", "pi", "feedforward", "tracking"].map(|controller| {
        let report = bench.json(&format!("{base} {controller}"));
        assert!(report["drift_pct"].is_number() && report["infeasible_pct"].is_number(), "{report}");
        number(&report["tracking_rms_pct"])
    });
    println!("{errors:?}");
    // Each is better than none, feedforward than what forgets, tracking than all.
    assert!(errors[4] < 1.0 && errors[5] < 0.25 && errors[2] > errors[4] && errors[3] > errors[5] && errors[0] > 10.0);
    let flags = "--sensor-noise 1e-6 --sensor-rate 200 --sensor-delay 0.005 --sensor-quantum 0 --sensor-lost 20:30 --amplifier-lag 0.002 \
                 --monitor-error -0.01 --stiffness 0.9 --bandwidth 0.7 --max-voltage 5800 --max-slew 40000 --seed 7 --rate 500 \
                 --precision f64 --out run.csv --plot run.svg";
    assert_eq!(bench.json(&format!("{base} tracking {flags}"))["samples"], 22_501);
    assert_eq!(bench.column("run.csv", "displacement_m").len(), 22_501);
    names(&bench.read("run.svg"), &["<svg"]);
}

/// Any parameter file is a plant. Its own law follows it within the discretisation; one that differs is not followed as well, and
/// the summary counts every limit that was met.
#[test]
fn a_parameter_file_is_a_plant() {
    let bench = bench();
    let run = |more: &str| {
        let base = "closed-loop --params soft.toml --plant soft.toml --reference high.csv --controller feedforward";
        bench.json(&format!("{base} {more}"))
    };
    let error = |more: &str| number(&run(more)["tracking_rms_pct"]);
    let same = error("");
    let (stiffer, again) = (error("--plant-mismatch stiffness=1.2"), error("--stiffness 1.2"));
    let creeps = error("--plant-mismatch alpha=0.95");
    println!("the same {same:.4} %, stiffer {stiffer:.2} %, with other orders {creeps:.2} %");
    assert!(same < 0.02 && (10.0..60.0).contains(&stiffer) && creeps > 0.1, "{same} {stiffer} {creeps}");
    assert_eq!(stiffer, again);

    let held = run("--max-field 2e7");
    let field = number(&rows(&held["limits_met"]).iter().find(|met| met["limit"] == "field").expect("met")["pct"]);
    assert!(field > 50.0 && number(&held["limited_pct"]) >= field, "{held}");
    assert!(number(&held["infeasible_pct"]) < 1.0, "{held}");
}
