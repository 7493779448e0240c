//! The demo with simulated recordings and with those of a user. `docs/start.md`, which a test runs, shows what it prints.

use std::fs;
use std::path::Path;

use tempfile::TempDir;
use tests::recordings;
use tests::table::column;
use tests::tool::text;

use crate::TOOL;
use crate::report_page::{check_numbers, check_page, document};

/// The rows of a CSV, without comments.
fn rows(path: &Path) -> Vec<String> {
    let content = fs::read_to_string(path).expect("written");
    content.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
}

#[test]
fn simulated_recordings_are_fitted_replayed_and_followed() {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("new").join("demo");
    let report = TOOL.json(&["demo", "--out", text(&out)]);
    assert!(report["r2_mean"].as_f64().expect("a number") > 0.999, "{report}");
    assert_eq!((report["simulated"].as_bool(), report["interrupted"].as_bool()), (Some(true), Some(false)));

    // The recordings are those that other tests use.
    for (ours, path) in ["recording-5s.csv", "recording-7s.csv", "recording-13s.csv"].iter().zip(recordings("hossain"))
    {
        assert!(rows(&out.join(ours)) == rows(&path), "{ours}");
    }
    let page = fs::read_to_string(out.join("report.html")).expect("written");
    check_page(&page);
    assert_eq!(document(&page), report);
    assert!(check_numbers(&page, &report) > 100);
    assert!(["no compensation", "feedforward", "tracking"].iter().all(|controller| page.contains(controller)));

    // `replay` prints the same with the parameters that were written.
    let files: Vec<String> = report["recordings"]
        .as_array()
        .expect("rows")
        .iter()
        .map(|row| row["file"].as_str().expect("a name").into())
        .collect();
    let film = out.join("film.toml");
    let mut replay = vec!["replay", "--params", text(&film)];
    replay.extend(files.iter().map(String::as_str));
    let replayed = TOOL.json(&replay);
    assert_eq!((&replayed["recordings"], &replayed["r2_mean"]), (&report["recordings"], &report["r2_mean"]));

    // That it runs where QEMU and the image are there is a test of `tests/firmware`.
    let firmware = &report["firmware"];
    let left_out = || firmware["left_out"].as_str().expect("a reason").contains("cargo xtask");
    assert!(firmware.get("ran").is_some() || left_out(), "{firmware}");
    let blob = fs::read(out.join("film.bin")).expect("written");
    let again = folder.path().join("again.bin");
    TOOL.json(&["export", "--params", text(&out.join("film.toml")), "--rate", "1000", "--out", text(&again)]);
    assert!(blob == fs::read(again).expect("written"));

    // The film follows better with every step.
    let errors: Vec<f64> = report["closed_loop"]
        .as_array()
        .expect("loops")
        .iter()
        .map(|row| row["tracking_rms_pct"].as_f64().expect("it moves"))
        .collect();
    let [none, feedforward, tracking] = errors[..] else { panic!("{report}") };
    assert!(none > 10.0 && feedforward < 1.0 && tracking < 0.25, "{errors:?}");

    // The voltage leads the model along the reference.
    let reference = column(&out.join("reference.csv"), "displacement_m");
    let reached = column(&out.join("voltage.csv"), "displacement_m");
    assert_eq!(reference.len(), reached.len());
    assert!(reference.iter().zip(&reached).all(|(r, x)| (r - x).abs() < 1e-7));
}

#[test]
fn recordings_of_a_user_are_fitted_and_get_a_voltage() {
    let folder = TempDir::new().expect("a folder");
    let size = folder.path().join("size.toml");
    let table = "schema = 1\n[actuator]\nrelative_permittivity = 4.7\nlength_m = 0.04\nwidth_m = 0.06\nthickness_m = 160e-6\nmass_kg = 0.316\n";
    fs::write(&size, table).expect("written");
    let out = folder.path().join("demo");
    let given = recordings("wang");
    let mut arguments = vec!["demo", "--out", text(&out), "--actuator", text(&size), "--recordings"];
    arguments.extend(given.iter().map(|path| text(path)));
    let report = TOOL.json(&arguments);
    assert!(report["r2_mean"].as_f64().expect("a number") > 0.999, "{report}");
    assert_eq!(report["reference"]["check"]["feasible"].as_bool(), Some(true));
    // The film behind these recordings is not known to the demo.
    assert_eq!(report["closed_loop"].as_array().map(Vec::len), Some(0));
    let mut written: Vec<_> =
        fs::read_dir(&out).expect("a folder").map(|entry| entry.expect("a file").file_name()).collect();
    written.sort();
    assert_eq!(written, ["film.bin", "film.toml", "reference.csv", "report.html", "voltage.csv"]);
}
