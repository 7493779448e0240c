//! `fit`, `study`, `compare`, `reduce` and `convert` as scripts call them.

use host_sim::files::parameters::Parameters;
use serde_json::Value;
use tests::sweep::full_sweep;
use tests::thinned_recordings;
use tests::tool::{Bench, SIZES, names, number, rows, warns};

use crate::TOOL;

/// A folder with the recordings of `plant`, every `step`th row of them without a full sweep.
fn bench(plant: &str, step: usize) -> (Bench, String) {
    let bench = Bench::new(TOOL);
    let files = bench.recordings(plant);
    if step > 1 {
        thinned_recordings(plant, &bench.path(""), step);
    }
    (bench, files)
}

fn step(sampled: usize) -> usize {
    if full_sweep() { 1 } else { sampled }
}

fn parameters(bench: &Bench, name: &str) -> Parameters {
    Parameters::read(&bench.path(name)).expect("readable")
}

/// The row of a list whose `key` is `name`.
fn row<'a>(list: &'a Value, key: &str, name: &str) -> &'a Value {
    rows(list).iter().find(|row| row[key] == name).unwrap_or_else(|| panic!("no {name}: {list}"))
}

#[test]
fn replay_on_the_controller_agrees_with_the_fit() {
    let (bench, files) = bench("wang", 1);
    let fit = bench.json(&format!("fit --branches 2 --topology parallel --out p.toml --report p.html {files}"));
    assert_eq!((&fit["topology"], &fit["branches"]), (&"parallel".into(), &2.into()));
    assert!(fit["parameters_file"] == "p.toml" && number(&fit["seconds"]) > 0.0 && number(&fit["evaluations"]) > 10.0);
    let replay = bench.json(&format!("replay --params p.toml {files}"));
    for (fitted, replayed) in rows(&fit["recordings"]).iter().zip(rows(&replay["recordings"])) {
        let (fitted, replayed) = (number(&fitted["r2"]), number(&replayed["r2"]));
        println!("R² of the fit {fitted:.7}, of the controller's arithmetic at 1 kHz {replayed:.7}");
        assert!((fitted - replayed).abs() < 5e-5);
    }
    // The file says where it comes from.
    let provenance = parameters(&bench, "p.toml").provenance.expect("a table");
    let digest = provenance["recordings"][0]["sha256"].as_str().expect("text");
    assert!(digest.len() == 64 && digest.chars().all(|c| c.is_ascii_hexdigit()));
    assert!(provenance["method"].as_str().expect("text").contains("seed 1"));
    assert!(provenance["intervals_95_pct"]["main.c"].as_array().is_some_and(|ends| ends.len() == 2));
    names(&bench.read("p.html"), &["<!DOCTYPE html>", "wang-7s.csv"]);
}

#[test]
fn auto_compares_structures_and_marks_its_choice() {
    let (bench, files) = bench("wang", step(20));
    let fit = bench.json(&format!("fit --out p.toml {files}"));
    let structures = rows(&fit["structures"]);
    // n = 0 and 1 are the same model in both topologies. Films that are not linear come after them.
    let linear = |row: &&Value| row["curve"] == "linear" && row["saturates"] == false;
    assert!(structures.iter().filter(linear).count() >= 4);
    let chosen: Vec<&Value> = structures.iter().filter(|row| row["chosen"] == true).collect();
    assert_eq!(chosen.len(), 1);
    let left_out = |row: &Value| number(&row["left_out_nrmse_pct"]);
    let best = structures.iter().map(left_out).fold(f64::INFINITY, f64::min);
    // Smaller ones that are as good in most blocks win over the best.
    assert!(left_out(chosen[0]) <= 1.3 * best);
    // The plant is a network of springs and dashpots in parallel: the harmonic mean cannot follow it.
    assert_eq!(chosen[0]["topology"], "parallel");
}

/// Each recording has a file beside `--out`, whose name keeps its dots.
#[test]
fn each_recording_alone() {
    let (bench, _) = bench("wang", 1);
    std::fs::copy(bench.path("wang-5s.csv"), bench.path("film-0.2Hz.csv")).expect("copied");
    let fits = bench.json("fit --each --branches 1 --out p.toml wang-5s.csv wang-7s.csv");
    assert_eq!(rows(&fits).len(), 2);
    bench.json("fit --each --branches 0 --out o.v2.toml film-0.2Hz.csv");
    for name in ["o.v2-film-0.2Hz.toml", "p-wang-5s.toml", "p-wang-7s.toml"] {
        parameters(&bench, name);
    }
    assert!(!bench.path("p.toml").exists());
}

#[test]
fn starts_holds_and_frees() {
    let (bench, _) = bench("wang", 1);
    // A film of another size: its geometry alone, without a model.
    bench.write("own.toml", format!("schema = 1\n{}", SIZES.replace("0.04", "0.02").replace("160e-6", "100e-6")));
    bench.json("fit --branches 0 --actuator own.toml --out a.toml wang-5s.csv");
    assert_eq!(parameters(&bench, "a.toml").actuator.length_m, 0.02);
    bench.json("fit --branches 1 --hold stretch_coupling --hold offset_m --out a.toml wang-5s.csv");
    let before = parameters(&bench, "a.toml");
    assert_eq!((before.actuator.stretch_coupling, before.sensor_offset_m), (0.0, 0.0));
    let more = "--hold main.alpha --free relative_permittivity --hold main.c";
    bench.json(&format!("fit --start a.toml --out b.toml wang-5s.csv {more}"));
    let after = parameters(&bench, "b.toml");
    assert_eq!(before.model.main(), after.model.main());
    assert_ne!(before.actuator.relative_permittivity, after.actuator.relative_permittivity);
    assert!(after.actuator.stretch_coupling > 0.0);
}

/// c x t^-α / Γ(1 − α) for c = 2000, α = 0.2 and x = 10 mm, N.
fn relaxation(t: f64) -> f64 {
    20.0 * t.powf(-0.2) / 1.164_229_713_725_303_4
}

fn write_relaxation(bench: &Bench, times: impl Iterator<Item = f64>, force: impl Fn(f64) -> f64) {
    let rows = times.map(|t| format!("{t:?},0.01,{:?}", force(t)));
    bench.write_table("relaxation.csv", "time_s,displacement_m,force_n", rows);
}

/// A relaxation test whose first seconds and whose end are of no use: the rest is fitted, and what the film remembers stays.
#[test]
fn a_window_leaves_out_values_and_keeps_the_memory() {
    let bench = Bench::new(TOOL);
    let times = (1..=1000).map(|k| 0.1 * f64::from(k));
    write_relaxation(&bench, times, |t| if (2.0..=80.0).contains(&t) { relaxation(t) } else { 5.0 });
    let fit = |more: &str| {
        let fit = bench.json(&format!("fit --drive displacement --branches 0 --out p.toml relaxation.csv {more}"));
        (number(&fit["recordings"][0]["r2"]), number(&fit["recordings"][0]["samples"]))
    };
    assert!(fit("").0 < 0.9);
    let (r2, samples) = fit("--from 2 --to 80");
    assert!(r2 >= 0.9999 && (780.0..=781.0).contains(&samples), "{r2}, {samples}");
    let main = parameters(&bench, "p.toml").model.main();
    assert!((main.c - 2000.0).abs() < 20.0 && (main.alpha - 0.2).abs() < 0.002, "{main:?}");
}

/// Without its own sizes a film's field is not known: the fit says so, its file carries it, and no check claims it.
#[test]
fn assumed_sizes_are_reported_and_no_field_is_claimed() {
    let (bench, _) = bench("wang", 1);
    bench.write("own.toml", format!("schema = 1\n{}", SIZES.replace("160e-6", "100e-6")));
    let warned = |more: &str| warns(&bench.json(&format!("fit --branches 1 wang-5s.csv {more}")), "sizes are assumed");
    assert!(warned("--out assumed.toml") && !warned("--actuator own.toml --out sized.toml"));
    // What was assumed stays assumed.
    assert!(warns(&bench.json("fit --start assumed.toml --out again.toml wang-5s.csv"), "sizes are assumed"));
    assert!(parameters(&bench, "again.toml").assumed_sizes && !parameters(&bench, "sized.toml").assumed_sizes);

    bench.json("reference --shape sine --low 0.4e-3 --high 1e-3 --period 10 --duration 30 --out ref.csv");
    // 1 MV/m would be exceeded: it is found where the sizes are known, and not claimed where they are not.
    let check = "feedforward --check --reference ref.csv --max-field 1e6 --params";
    let (known, unknown) =
        (bench.says_no(&format!("{check} sized.toml")), bench.json(&format!("{check} assumed.toml")));
    assert!(known["check"]["feasible"] == false && known["check"]["field_checked"] == true, "{known}");
    assert!(known["field_note"].is_null());
    assert!(unknown["check"]["field_checked"] == false && unknown["field_note"].as_str().is_some(), "{unknown}");
    let replay = bench.json("replay --params assumed.toml wang-5s.csv");
    assert!(replay["field_note"].as_str().is_some_and(|note| note.contains("assumed (160 µm")), "{replay}");
    assert!(bench.json("replay --params sized.toml wang-5s.csv")["field_note"].is_null());
}

#[test]
fn gaps_and_signs() {
    let bench = Bench::new(TOOL);
    // A unipolar sine, whose displacement is a multiple of the squared voltage's share.
    let record = |times: &mut dyn Iterator<Item = f64>, stroke_m: f64| {
        let row = |t: f64| {
            let share = 0.5 * (1.0 - (0.9 * t).cos());
            format!("{t:.3},{:.3},{:.9}", 5000.0 * share, stroke_m * share * share)
        };
        bench.write_table("rec.csv", "time_s,voltage_v,displacement_m", times.map(row));
    };
    let fit = |more: &str| bench.json(&format!("fit --branches 0 --out p.toml rec.csv {more}"));
    let samples = |report: &Value| number(&report["recordings"][0]["samples"]);

    let mut times = (0..1000).map(|k| 0.05 * f64::from(k));
    record(&mut times.clone().filter(|t| !(20.0..26.0).contains(t)), 1e-3);
    let whole = fit("");
    assert!(warns(&whole, "a gap of 6.050 s at 19.950 s"), "{whole}");
    assert!(samples(&whole) == 880.0 && (number(&whole["recordings"][0]["rate_hz"]) - 20.0).abs() < 1e-6);
    let ended = fit("--gap 3");
    assert!(warns(&ended, "ends there") && samples(&ended) == 400.0, "{ended}");
    assert!(number(&ended["r2_mean"]) > 0.999 && number(&whole["r2_mean"]) < number(&ended["r2_mean"]));
    let skipped = fit("--gap 3 --at-gap skip");
    assert!(warns(&skipped, "are not compared") && (755.0..=765.0).contains(&samples(&skipped)), "{skipped}");
    assert!(number(&skipped["r2_mean"]) > number(&whole["r2_mean"]));
    // Shorter ones are not counted.
    assert!(!warns(&fit("--gap 10"), "gap of"));

    record(&mut times, -1e-3);
    assert!(warns(&fit(""), "--invert turns its sign"));
    let right = fit("--invert");
    assert!(number(&right["r2_mean"]) > 0.999 && !warns(&right, "--invert"), "{right}");
}

/// Other models and the paper's study on material tests: force from displacement.
#[test]
fn compare_and_study_of_material_tests() {
    let bench = Bench::new(TOOL);
    // 8 N beside the springpot. Pattern search takes tens of thousands of steps: few rows keep it short.
    write_relaxation(&bench, (1..=60).map(f64::from), |t| 8.0 + relaxation(t));
    let compare = |more: &str| bench.json(&format!("compare --drive displacement --starts 2 {more} relaxation.csv"));
    let of = |report: &Value, name: &str, key: &str| number(&row(&report["models"], "model", name)[key]);
    let (fractional, solid) = ("fractional Maxwell, n = 1", "standard linear solid");
    let report = compare("");
    println!("{report}");
    assert!(of(&report, fractional, "r2_mean") > 0.9999 && of(&report, solid, "r2_mean") < 0.99);
    assert!(report["models"][0]["beyond_pct"].is_null(), "nothing is beyond all of it");
    // From the first third the springpot predicts the rest; a relaxation time does not.
    let foretold = compare("--to 20");
    println!("{foretold}");
    assert!(of(&foretold, fractional, "beyond_pct") < 0.5 && of(&foretold, solid, "beyond_pct") > 2.0);
    let study = bench.json("study --drive displacement --out study relaxation.csv");
    let fits = rows(&study["fits"]);
    assert_eq!(fits.len(), (5 + 1) * 2 * 2);
    assert!(fits.iter().filter(|fit| fit["method"] == "lm").all(|fit| number(&fit["r2_mean"]) > 0.999));
    names(&bench.read("study/study.html"), &["Forces from the recorded displacements", "force (N)"]);
}

#[test]
fn compare_prints_every_baseline() {
    let (bench, _) = bench("wang", step(4));
    let report = bench.json("compare --starts 2 wang-5s.csv wang-7s.csv");
    let models = rows(&report["models"]);
    let nrmse = |name: &str| number(&row(&report["models"], "model", name)["nrmse_pct"]);
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
    // Pattern search takes tens of thousands of steps: few samples keep it short.
    let (bench, files) = bench("hossain", if full_sweep() { 10 } else { 100 });
    let report = bench.json(&format!("study --out study {files}"));
    let fits = rows(&report["fits"]);
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
        assert!(bench.path("study").join(name).metadata().is_ok_and(|file| file.len() > 1000), "{name}");
    }
    names(&bench.read("study/study.md"), &["Table 2", "Table 3", "Table 4"]);
}

/// Fig. 8: Table 3, n = 5, is a spring-like springpot and a dashpot in series.
#[test]
fn reduce_merges_the_paper_s_dashpots() {
    let bench = Bench::new(TOOL);
    let report = bench.json("reduce --params preset:table3-n5 --out r.toml");
    assert_eq!((&report["branches_before"], &report["branches"]), (&5.into(), &1.into()));
    let [spring, dashpot] = parameters(&bench, "r.toml").model.branches()[0];
    // 5 / Σ 1/c over the published coefficients, × 1000.
    let merged = |c: &[f64]| 5e3 / c.iter().map(|c| 1.0 / c).sum::<f64>();
    assert!((spring.c / merged(&[0.097, 0.097, 0.095]) - 1.0).abs() < 1e-12 && spring.alpha == 0.002);
    let dashpots = [0.315, 0.036, 0.356, 0.036, 0.036, 0.036, 0.285];
    assert!((dashpot.c / merged(&dashpots) - 1.0).abs() < 1e-12 && dashpot.alpha == 1.0);
}

/// Eqs. 12–13: stretch and stress of a material become displacement and force of a body. Strains agree where they are small; files of
/// testing machines are taken as they are.
#[test]
fn strains_and_testing_machines() {
    let bench = Bench::new(TOOL);
    let last_row = |more: &str| -> [f64; 2] {
        bench.json(&format!("convert --out body.csv test.csv {more}"));
        ["displacement_m", "force_n"].map(|title| *bench.column("body.csv", title).last().expect("a row"))
    };
    bench.write("test.csv", "time_s,stretch,nominal_stress_kpa\n0,1,0\n1,1.5,20\n2,2,30\n");
    let [x, force] = last_row("--length 0.06 --area 7.84e-6");
    assert!((x - 0.06).abs() < 1e-12 && (force - 30e3 * 7.84e-6).abs() < 1e-12, "{x}, {force}");
    bench.write("test.csv", "Time (s),Extension (mm),Load (N)\n0,0,0\n1,20,1.5\n");
    let [x, force] = last_row("");
    assert!((x - 0.02).abs() < 1e-15 && force == 1.5, "{x}, {force}");
    let strains = ["engineering", "neo-hookean", "hencky"];
    for (strain, expected) in strains.into_iter().zip([0.02, 0.02 * (1.5 - 1.0 / 2.25) / 1.5, 0.04 * 1.5f64.ln()]) {
        let [x, force] = last_row(&format!("--length 0.04 --strain {strain}"));
        assert!((x - expected).abs() < 1e-12 && force == 1.5, "{strain}: {x}, {force}");
    }
    bench.write("test.csv", "time_s,stretch,nominal_stress_mpa\n0,1,0\n1,1.001,0.03\n");
    let displacements = strains.map(|strain| last_row(&format!("--length 0.04 --area 1e-5 --strain {strain}"))[0]);
    assert!(displacements.iter().all(|x| (x / 4e-5 - 1.0).abs() < 2e-3), "{displacements:?}");
}
