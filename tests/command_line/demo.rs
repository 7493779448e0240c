//! The demo with simulated recordings and with those of a user. `docs/start.md`, which a test runs, shows what it prints.

use std::fs;

use serde_json::Value;
use tests::recordings;
use tests::tool::{Bench, SIZES, number, rows};

use crate::TOOL;
use crate::report_page::{check_numbers, check_page, document};

#[test]
fn simulated_recordings_are_fitted_replayed_and_followed() {
    let bench = Bench::new(TOOL);
    let report = bench.json("demo --out new/demo");
    assert!(number(&report["r2_mean"]) > 0.999, "{report}");
    assert_eq!((&report["simulated"], &report["interrupted"]), (&true.into(), &false.into()));

    // The recordings are those that other tests use.
    for (ours, path) in ["recording-5s.csv", "recording-7s.csv", "recording-13s.csv"].iter().zip(recordings("hossain"))
    {
        let without_comments =
            |text: String| text.lines().filter(|line| !line.starts_with('#')).collect::<Vec<_>>().join("\n");
        let committed = fs::read_to_string(&path).expect("committed");
        assert!(without_comments(bench.read(&format!("new/demo/{ours}"))) == without_comments(committed), "{ours}");
    }
    let page = bench.read("new/demo/report.html");
    check_page(&page);
    assert_eq!(document(&page), report);
    assert!(check_numbers(&page, &report) > 100);
    assert!(["no compensation", "feedforward", "tracking"].iter().all(|controller| page.contains(controller)));

    // `replay` prints the same with the parameters that were written.
    let files: Vec<&str> = rows(&report["recordings"]).iter().filter_map(|row| row["file"].as_str()).collect();
    let replayed = bench.json(&format!("replay --params new/demo/film.toml {}", files.join(" ")));
    assert_eq!((&replayed["recordings"], &replayed["r2_mean"]), (&report["recordings"], &report["r2_mean"]));

    // That it runs where QEMU and the image are there is a test of `tests/firmware`.
    let firmware = &report["firmware"];
    let left_out = || firmware["left_out"].as_str().expect("a reason").contains("cargo xtask");
    assert!(firmware.get("ran").is_some() || left_out(), "{firmware}");
    bench.json("export --params new/demo/film.toml --rate 1000 --out again.bin");
    let [blob, again] = ["new/demo/film.bin", "again.bin"].map(|name| fs::read(bench.path(name)).expect("written"));
    assert!(blob == again);

    begins_with_what_follows(&page, &report);

    // The voltage leads the model along the reference.
    let [reference, reached] =
        ["reference.csv", "voltage.csv"].map(|name| bench.column(&format!("new/demo/{name}"), "displacement_m"));
    assert_eq!(reference.len(), reached.len());
    assert!(reference.iter().zip(&reached).all(|(r, x)| (r - x).abs() < 1e-7));
}

/// The film follows better with every step, and the page begins with it.
fn begins_with_what_follows(page: &str, report: &Value) {
    let errors: Vec<f64> = rows(&report["closed_loop"]).iter().map(|row| number(&row["tracking_rms_pct"])).collect();
    let [none, feedforward, tracking] = errors[..] else { panic!("{report}") };
    assert!(none > 10.0 && feedforward < 1.0 && tracking < 0.25, "{errors:?}");
    let verdict = report["verdict"].as_str().expect("a sentence");
    assert!(verdict.contains(&format!("{none:.1} % without compensation")), "{verdict}");
    assert!(page.find(verdict).expect("in the page") < page.find("<h2").expect("a part"));
    let part = |id: &str| page.find(&format!("<section id=\"{id}\"")).unwrap_or_else(|| panic!("no {id}"));
    assert!(part("following") < part("warnings"), "the picture without and with compensation is the first");
}

/// On the film as it is fitted to a part of the recordings: that is neither the model nor unlike it.
#[test]
fn the_page_of_a_fit_begins_with_a_sine_that_is_followed() {
    let bench = Bench::new(TOOL);
    bench.write("size.toml", format!("schema = 1\n{SIZES}"));
    let files = bench.recordings("wang");
    let structure = "--branches 2 --topology parallel --curve none";
    let report =
        bench.json(&format!("fit {files} --actuator size.toml {structure} --out film.toml --report film.html"));
    let page = bench.read("film.html");
    check_page(&page);
    assert_eq!(document(&page), report);
    assert!(check_numbers(&page, &report) > 80);
    begins_with_what_follows(&page, &report);
    let feedforward = number(&report["closed_loop"][1]["tracking_rms_pct"]);
    let [low, high] =
        [0, 1].map(|end| number(&report["reference"]["check"]["expectation"]["feedforward_error_pct"][end]));
    assert!((low..=high).contains(&feedforward), "{feedforward} % where {low} to {high} % are expected");
}

#[test]
fn recordings_of_a_user_are_fitted_and_get_a_voltage() {
    let bench = Bench::new(TOOL);
    bench.write("size.toml", format!("schema = 1\n{SIZES}"));
    let files = bench.recordings("wang");
    let report = bench.json(&format!("demo --out demo --actuator size.toml --recordings {files}"));
    assert!(number(&report["r2_mean"]) > 0.999, "{report}");
    assert_eq!(report["reference"]["check"]["feasible"], true);
    begins_with_what_follows(&bench.read("demo/report.html"), &report);
    let written = fs::read_dir(bench.path("demo")).expect("a folder");
    let mut written: Vec<_> = written.map(|entry| entry.expect("a file").file_name()).collect();
    written.sort();
    assert_eq!(written, ["film.bin", "film.toml", "reference.csv", "report.html", "voltage.csv"]);
}
