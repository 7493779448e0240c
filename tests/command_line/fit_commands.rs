//! `fit`, `study`, `compare`, `reduce` and `convert` as scripts call them.

use std::fs;
use std::path::Path;

use host_sim::files::parameters::Parameters;
use serde_json::Value;
use tempfile::TempDir;
use tests::sweep::full_sweep;
use tests::tool::text;
use tests::{recordings, thinned_recordings};

use crate::TOOL;

fn json(arguments: &[&str]) -> Value {
    TOOL.json(arguments)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

#[test]
fn replay_on_the_controller_agrees_with_the_fit() {
    let folder = TempDir::new().expect("a folder");
    let (out, page) = (folder.path().join("p.toml"), folder.path().join("p.html"));
    let [a, b, c] = recordings("wang");
    let files = [text(&a), text(&b), text(&c)];
    let arguments = ["fit", "--branches", "2", "--topology", "parallel", "--out", text(&out), "--report", text(&page)];
    let fit = json(&[&arguments, files.as_slice()].concat());
    assert_eq!(fit["parameters_file"], text(&out));
    assert_eq!((&fit["topology"], &fit["branches"]), (&"parallel".into(), &2.into()));
    assert!(number(&fit["seconds"]) > 0.0 && number(&fit["evaluations"]) > 10.0);
    let replay = json(&[["replay", "--params", text(&out)].as_slice(), &files].concat());
    for (fitted, replayed) in
        std::iter::zip(fit["recordings"].as_array().expect("a list"), replay["recordings"].as_array().expect("a list"))
    {
        let (fitted, replayed) = (number(&fitted["r2"]), number(&replayed["r2"]));
        println!("R² of the fit {fitted:.7}, of the controller's arithmetic at 1 kHz {replayed:.7}");
        assert!((fitted - replayed).abs() < 5e-5);
    }
    // The file says where it comes from.
    let provenance = Parameters::read(&out).expect("readable").provenance.expect("a table");
    let digest = provenance["recordings"][0]["sha256"].as_str().expect("text");
    assert!(digest.len() == 64 && digest.chars().all(|c| c.is_ascii_hexdigit()));
    assert!(provenance["method"].as_str().expect("text").contains("seed 1"));
    assert!(provenance["intervals_95_pct"]["main.c"].as_array().is_some_and(|ends| ends.len() == 2));
    let page = fs::read_to_string(&page).expect("written");
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("wang-7s.csv"));
}

#[test]
fn auto_compares_structures_and_marks_its_choice() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("p.toml");
    let [a, b, c] = if full_sweep() { recordings("wang") } else { thinned_recordings("wang", folder.path(), 20) };
    let fit = json(&["fit", "--out", text(&out), text(&a), text(&b), text(&c)]);
    let structures = fit["structures"].as_array().expect("a list");
    // n = 0 and 1 are the same model in both topologies. Films that are not linear come after them.
    let linear = |row: &&Value| row["curve"] == "linear" && row["saturates"] == false;
    assert_eq!(structures.iter().filter(linear).count(), 10);
    let chosen: Vec<&Value> = structures.iter().filter(|row| row["chosen"] == true).collect();
    assert_eq!(chosen.len(), 1);
    let left_out = |row: &Value| number(&row["left_out_nrmse_pct"]);
    let best = structures.iter().map(left_out).fold(f64::INFINITY, f64::min);
    assert!(left_out(chosen[0]) <= 1.05 * best);
    for row in structures {
        let smaller = number(&row["variables"]) < number(&chosen[0]["variables"]);
        assert!(!smaller || left_out(row) > 1.05 * best, "{row} is smaller and not worse");
    }
    // The plant is a network of springs and dashpots in parallel: the harmonic mean cannot follow it.
    assert_eq!(chosen[0]["topology"], "parallel");
}

#[test]
fn each_recording_alone() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("p.toml");
    let [a, b, _] = recordings("wang");
    let fits = json(&["fit", "--each", "--branches", "1", "--out", text(&out), text(&a), text(&b)]);
    assert_eq!(fits.as_array().expect("a list").len(), 2);
    // Names with dots keep them.
    let dotted = folder.path().join("film-0.2Hz.csv");
    fs::copy(&a, &dotted).expect("copied");
    json(&["fit", "--each", "--branches", "0", "--out", text(&folder.path().join("o.v2.toml")), text(&dotted)]);
    Parameters::read(&folder.path().join("o.v2-film-0.2Hz.toml")).expect("a file beside --out");
    for name in ["p-wang-5s.toml", "p-wang-7s.toml"] {
        Parameters::read(&folder.path().join(name)).expect("a file beside --out");
    }
    assert!(!out.exists());
}

#[test]
fn starts_holds_and_frees() {
    let folder = TempDir::new().expect("a folder");
    let (first, second) = (folder.path().join("a.toml"), folder.path().join("b.toml"));
    let [a, ..] = recordings("wang");
    // A film of another size: its geometry alone, without a model.
    let own = folder.path().join("own.toml");
    let table = "schema = 1\n[actuator]\nrelative_permittivity = 4.7\nlength_m = 0.02\nwidth_m = 0.03\n\
                 thickness_m = 100e-6\nmass_kg = 0.1\n";
    fs::write(&own, table).expect("written");
    json(&["fit", "--branches", "0", "--actuator", text(&own), "--out", text(&first), text(&a)]);
    assert_eq!(Parameters::read(&first).expect("readable").actuator.length_m, 0.02);
    json(&[
        "fit",
        "--branches",
        "1",
        "--hold",
        "stretch_coupling",
        "--hold",
        "offset_m",
        "--out",
        text(&first),
        text(&a),
    ]);
    let before = Parameters::read(&first).expect("readable");
    assert_eq!((before.actuator.stretch_coupling, before.sensor_offset_m), (0.0, 0.0));
    let more = ["--hold", "main.alpha", "--free", "relative_permittivity", "--hold", "main.c"];
    json(&[["fit", "--start", text(&first), "--out", text(&second), text(&a)].as_slice(), &more].concat());
    let after = Parameters::read(&second).expect("readable");
    assert_eq!(before.model.main(), after.model.main());
    assert_ne!(before.actuator.relative_permittivity, after.actuator.relative_permittivity);
    assert!(after.actuator.stretch_coupling > 0.0);
}

/// A relaxation test whose first seconds and whose end are of no use: the rest is fitted, and what the film remembers stays.
#[test]
fn a_window_leaves_out_values_and_keeps_the_memory() {
    let folder = TempDir::new().expect("a folder");
    let (file, out) = (folder.path().join("relaxation.csv"), folder.path().join("p.toml"));
    // c x t^-α / Γ(1 − α) for c = 2000, α = 0.2 and x = 10 mm.
    let force = |t: f64| 2000.0 * 0.01 * t.powf(-0.2) / 1.164_229_713_725_303_4;
    let mut csv = "time_s,displacement_m,force_n\n".to_owned();
    for k in 1..=1000 {
        let t = 0.1 * f64::from(k);
        let measured = if (2.0..=80.0).contains(&t) { force(t) } else { 5.0 };
        csv += &format!("{t:?},0.01,{measured:?}\n");
    }
    fs::write(&file, csv).expect("written");
    let fit = |more: &[&str]| {
        let fixed = ["fit", "--drive", "displacement", "--branches", "0", "--out", text(&out), text(&file)];
        let fit = json(&[fixed.as_slice(), more].concat());
        (number(&fit["recordings"][0]["r2"]), number(&fit["recordings"][0]["samples"]))
    };
    assert!(fit(&[]).0 < 0.9);
    let (r2, samples) = fit(&["--from", "2", "--to", "80"]);
    assert!(r2 >= 0.9999 && (780.0..=781.0).contains(&samples), "{r2}, {samples}");
    let main = Parameters::read(&out).expect("readable").model.main();
    assert!((main.c - 2000.0).abs() < 20.0 && (main.alpha - 0.2).abs() < 0.002, "{main:?}");
}

/// Without its own sizes a film's field is not known: the fit says so, its file carries it, and no check claims it.
#[test]
fn assumed_sizes_are_reported_and_no_field_is_claimed() {
    let folder = TempDir::new().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let (own, assumed, sized, again, reference) =
        (path("own.toml"), path("assumed.toml"), path("sized.toml"), path("again.toml"), path("ref.csv"));
    let table = "schema = 1\n[actuator]\nrelative_permittivity = 4.7\nlength_m = 0.04\nwidth_m = 0.06\n\
                 thickness_m = 100e-6\nmass_kg = 0.316\n";
    fs::write(&own, table).expect("written");
    let [a, ..] = recordings("wang");
    let fit = |more: &[&str]| {
        let fit = json(&[["fit", "--branches", "1", text(&a)].as_slice(), more].concat());
        fit["warnings"]
            .as_array()
            .expect("a list")
            .iter()
            .any(|w| w.as_str().expect("text").contains("sizes are assumed"))
    };
    assert!(fit(&["--out", text(&assumed)]));
    assert!(!fit(&["--actuator", text(&own), "--out", text(&sized)]));
    // What was assumed stays assumed.
    let start = json(&["fit", "--start", text(&assumed), "--out", text(&again), text(&a)]);
    assert!(start["warnings"].to_string().contains("sizes are assumed"), "{start}");
    assert!(Parameters::read(&again).expect("readable").assumed_sizes);
    assert!(!Parameters::read(&sized).expect("readable").assumed_sizes);

    let shape =
        ["reference", "--shape", "sine", "--low", "0.4e-3", "--high", "1e-3", "--period", "10", "--duration", "30"];
    json(&[shape.as_slice(), &["--out", text(&reference)]].concat());
    let check = |params: &Path| {
        let options = ["--params", text(params), "--reference", text(&reference), "--max-field", "1e6"];
        TOOL.with(&[&["feedforward", "--check", "--json"], options.as_slice()].concat())
    };
    let report = |output: &std::process::Output| -> Value { serde_json::from_slice(&output.stdout).expect("JSON") };
    // 1 MV/m would be exceeded: it is found where the sizes are known, and not claimed where they are not.
    let known = report(check(&sized).assert().code(1).get_output());
    assert!(known["check"]["feasible"] == false && known["check"]["field_checked"] == true, "{known}");
    assert!(known["field_note"].is_null());
    let unknown = report(check(&assumed).assert().get_output());
    assert!(unknown["check"]["field_checked"] == false && unknown["field_note"].as_str().is_some(), "{unknown}");
    let replay = json(&["replay", "--params", text(&assumed), text(&a)]);
    assert!(replay["field_note"].as_str().is_some_and(|note| note.contains("assumed (160 µm")), "{replay}");
    assert!(json(&["replay", "--params", text(&sized), text(&a)])["field_note"].is_null());
}

/// A recording of a unipolar sine with rows from `times`, whose displacement is `of` the squared voltage's share.
fn sine_recording(file: &Path, times: impl Iterator<Item = f64>, of: impl Fn(f64) -> f64) {
    let mut csv = "time_s,voltage_v,displacement_m\n".to_owned();
    for t in times {
        let share = 0.5 * (1.0 - (0.9 * t).cos());
        csv += &format!("{t:.3},{:.3},{:.9}\n", 5000.0 * share, of(share * share));
    }
    fs::write(file, csv).expect("written");
}

#[test]
fn gaps_and_signs() {
    let folder = TempDir::new().expect("a folder");
    let (file, out) = (folder.path().join("rec.csv"), folder.path().join("p.toml"));
    let fit =
        |more: &[&str]| json(&[["fit", "--branches", "0", "--out", text(&out), text(&file)].as_slice(), more].concat());
    let warns = |report: &Value, words: &str| report["warnings"].to_string().contains(words);
    let samples = |report: &Value| number(&report["recordings"][0]["samples"]);

    let times = || (0..1000).map(|k| 0.05 * f64::from(k)).filter(|t| !(20.0..26.0).contains(t));
    sine_recording(&file, times(), |share| 1e-3 * share);
    let whole = fit(&[]);
    assert!(warns(&whole, "a gap of 6.050 s at 19.950 s"), "{whole}");
    assert!(samples(&whole) == 880.0 && (number(&whole["recordings"][0]["rate_hz"]) - 20.0).abs() < 1e-6);
    let ended = fit(&["--gap", "3"]);
    assert!(warns(&ended, "ends there") && samples(&ended) == 400.0, "{ended}");
    assert!(number(&ended["r2_mean"]) > 0.999 && number(&whole["r2_mean"]) < number(&ended["r2_mean"]));
    let skipped = fit(&["--gap", "3", "--at-gap", "skip"]);
    assert!(warns(&skipped, "are not compared") && (755.0..=765.0).contains(&samples(&skipped)), "{skipped}");
    assert!(number(&skipped["r2_mean"]) > number(&whole["r2_mean"]));
    // Shorter ones are not counted.
    assert!(!warns(&fit(&["--gap", "10"]), "gap of"));

    sine_recording(&file, (0..1000).map(|k| 0.05 * f64::from(k)), |share| -1e-3 * share);
    let turned = fit(&[]);
    assert!(warns(&turned, "--invert turns its sign"), "{turned}");
    let right = fit(&["--invert"]);
    assert!(number(&right["r2_mean"]) > 0.999 && !warns(&right, "--invert"), "{right}");
}

/// Other models and the paper's study on material tests: force from displacement.
#[test]
fn compare_and_study_of_material_tests() {
    let folder = TempDir::new().expect("a folder");
    let (file, out) = (folder.path().join("relaxation.csv"), folder.path().join("study"));
    // c x t^-α / Γ(1 − α) for c = 2000, α = 0.2 and x = 10 mm, and 8 N beside it.
    let mut csv = "time_s,displacement_m,force_n\n".to_owned();
    // Pattern search takes tens of thousands of steps: few rows keep it short.
    for k in 1..=60 {
        let t = f64::from(k);
        csv += &format!("{t:?},0.01,{:?}\n", 8.0 + 20.0 * t.powf(-0.2) / 1.164_229_713_725_303_4);
    }
    fs::write(&file, csv).expect("written");
    let report = json(&["compare", "--drive", "displacement", "--starts", "2", text(&file)]);
    let r2 = |name: &str| {
        let row = report["models"].as_array().expect("a list").iter().find(|row| row["model"] == name);
        number(&row.unwrap_or_else(|| panic!("no {name}"))["r2_mean"])
    };
    println!("{report}");
    assert!(r2("fractional Maxwell, n = 1") > 0.9999 && r2("standard linear solid") < 0.99);
    // From the first third the springpot predicts the rest; a relaxation time does not.
    let foretold = json(&["compare", "--drive", "displacement", "--starts", "2", "--to", "20", text(&file)]);
    let beyond = |name: &str| {
        let row = foretold["models"].as_array().expect("a list").iter().find(|row| row["model"] == name);
        number(&row.unwrap_or_else(|| panic!("no {name}"))["beyond_pct"])
    };
    println!("{foretold}");
    assert!(beyond("fractional Maxwell, n = 1") < 0.5 && beyond("standard linear solid") > 2.0);
    assert!(report["models"][0]["beyond_pct"].is_null(), "nothing is beyond all of it");
    let study = json(&["study", "--drive", "displacement", "--out", text(&out), text(&file)]);
    let fits = study["fits"].as_array().expect("a list");
    assert_eq!(fits.len(), (5 + 1) * 2 * 2);
    assert!(fits.iter().filter(|fit| fit["method"] == "lm").all(|fit| number(&fit["r2_mean"]) > 0.999));
    let page = fs::read_to_string(out.join("study.html")).expect("written");
    assert!(page.contains("Forces from the recorded displacements") && page.contains("force (N)"));
}

#[test]
fn compare_prints_every_baseline() {
    let folder = TempDir::new().expect("a folder");
    let [a, b, _] = if full_sweep() { recordings("wang") } else { thinned_recordings("wang", folder.path(), 4) };
    let report = json(&["compare", "--starts", "2", text(&a), text(&b)]);
    let models = report["models"].as_array().expect("a list");
    let row = |name: &str| models.iter().find(|row| row["model"] == name).unwrap_or_else(|| panic!("no {name}"));
    let nrmse = |name: &str| number(&row(name)["nrmse_pct"]);
    assert!(models.iter().all(|row| number(&row["left_out_nrmse_pct"]) > 0.0 && number(&row["step_ns"]) > 0.0));
    assert_eq!(models.len(), 11);
    // More branches never fit worse, springpots beat springs and dashpots of as many branches, and what has no creep is worst.
    assert!(nrmse("Prony series, 2 branches") < nrmse("standard linear solid"));
    assert!(nrmse("fractional Maxwell, n = 1") < nrmse("standard linear solid"));
    assert!(nrmse("fractional Maxwell, n = 2") < nrmse("Prony series, 2 branches"));
    let worst = models.iter().map(|row| number(&row["nrmse_pct"])).fold(0.0, f64::max);
    assert!(nrmse("Prandtl–Ishlinskii, rate-dependent") == worst && worst < 6.0, "{worst}");
}

#[test]
fn study_repeats_the_paper() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("study");
    // Pattern search takes tens of thousands of steps: few samples keep it short.
    let files = thinned_recordings("hossain", folder.path(), if full_sweep() { 10 } else { 60 });
    let arguments: Vec<&str> =
        ["study", "--out", text(&out)].into_iter().chain(files.iter().map(|f| text(f))).collect();
    let report = json(&arguments);
    let fits = report["fits"].as_array().expect("a list");
    // (n = 1…5 together, and each of three alone) × two methods × two topologies.
    assert_eq!(fits.len(), (5 + 3) * 2 * 2);
    let r2 = |method: &str, topology: &str, branches: u64| {
        let wanted = |fit: &&Value| {
            fit["method"] == method
                && fit["topology"] == topology
                && fit["branches"] == branches
                && fit["recording"].is_null()
        };
        number(&fits.iter().find(wanted).expect("a fit")["r2_mean"])
    };
    for branches in 1..=5 {
        assert!(r2("lm", "parallel", branches) >= r2("pattern-search", "parallel", branches) - 1e-6);
    }
    let gain = |topology: &str| r2("lm", topology, 5) - r2("lm", topology, 2);
    println!("gain of R² from n = 2 to 5: eq11 {:.1e}, parallel {:.1e}", gain("eq11"), gain("parallel"));
    assert!(gain("eq11") < 0.1 * gain("parallel") && gain("parallel") > 5e-5, "Eq. 9 does not gain");
    assert!(report["why_eq9_stops"].as_str().expect("a line").contains("harmonic mean"));
    for name in ["figure-6.svg", "figure-6.png", "figure-7.svg", "figure-7.png", "study.html", "study.md"] {
        assert!(fs::metadata(out.join(name)).is_ok_and(|file| file.len() > 1000), "{name}");
    }
    let tables = fs::read_to_string(out.join("study.md")).expect("written");
    assert!(["Table 2", "Table 3", "Table 4"].iter().all(|title| tables.contains(title)));
}

/// Fig. 8: Table 3, n = 5, is a spring-like springpot and a dashpot in series.
#[test]
fn reduce_merges_the_paper_s_dashpots() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("r.toml");
    let report = json(&["reduce", "--params", "preset:table3-n5", "--out", text(&out)]);
    assert_eq!((&report["branches_before"], &report["branches"]), (&5.into(), &1.into()));
    let reduced = Parameters::read(&out).expect("readable").model;
    let [spring, dashpot] = reduced.branches()[0];
    // 5 / Σ 1/c over the published coefficients, × 1000.
    let merged = |c: &[f64]| 5e3 / c.iter().map(|c| 1.0 / c).sum::<f64>();
    assert!((spring.c / merged(&[0.097, 0.097, 0.095]) - 1.0).abs() < 1e-12 && spring.alpha == 0.002);
    let dashpots = [0.315, 0.036, 0.356, 0.036, 0.036, 0.036, 0.285];
    assert!((dashpot.c / merged(&dashpots) - 1.0).abs() < 1e-12 && dashpot.alpha == 1.0);
}

/// Eqs. 12–13: stretch and stress of a material become displacement and force of a body, and fits of either agree.
#[test]
fn converted_material_tests() {
    let folder = TempDir::new().expect("a folder");
    let (test, out) = (folder.path().join("test.csv"), folder.path().join("body.csv"));
    fs::write(&test, "time_s,stretch,nominal_stress_kpa\n0,1,0\n1,1.5,20\n2,2,30\n").expect("written");
    json(&["convert", "--length", "0.06", "--area", "7.84e-6", "--out", text(&out), text(&test)]);
    let body = fs::read_to_string(&out).expect("written");
    let last: Vec<f64> =
        body.lines().last().expect("a row").split(',').map(|cell| cell.parse().expect("a number")).collect();
    assert!((last[1] - 0.06).abs() < 1e-12 && (last[2] - 30e3 * 7.84e-6).abs() < 1e-12, "{last:?}");
}

/// Strains agree where they are small; files of testing machines are taken as they are.
#[test]
fn strains_and_testing_machines() {
    let folder = TempDir::new().expect("a folder");
    let (test, out) = (folder.path().join("test.csv"), folder.path().join("body.csv"));
    let last_row = |more: &[&str]| -> Vec<f64> {
        json(&[["convert", "--out", text(&out), text(&test)].as_slice(), more].concat());
        let body = fs::read_to_string(&out).expect("written");
        body.lines().last().expect("a row").split(',').map(|cell| cell.parse().expect("a number")).collect()
    };
    fs::write(&test, "Time (s),Extension (mm),Load (N)\n0,0,0\n1,20,1.5\n").expect("written");
    let row = last_row(&[]);
    assert!((row[1] - 0.02).abs() < 1e-15 && row[2] == 1.5, "{row:?}");
    for (strain, expected) in
        [("engineering", 0.02), ("neo-hookean", 0.02 * (1.5 - 1.0 / 2.25) / 1.5), ("hencky", 0.04 * 1.5f64.ln())]
    {
        let row = last_row(&["--length", "0.04", "--strain", strain]);
        assert!((row[1] - expected).abs() < 1e-12 && row[2] == 1.5, "{strain}: {row:?}");
    }
    fs::write(&test, "time_s,stretch,nominal_stress_mpa\n0,1,0\n1,1.001,0.03\n").expect("written");
    let displacements = ["engineering", "neo-hookean", "hencky"]
        .map(|strain| last_row(&["--length", "0.04", "--area", "1e-5", "--strain", strain])[1]);
    assert!(displacements.iter().all(|x| (x / 4e-5 - 1.0).abs() < 2e-3), "{displacements:?}");
}
