//! `import`: files of other programs as recordings, and the same reader in the commands that take recordings.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;
use tests::tool::{names, text};

use crate::TOOL;

const LAB: &str = "Film 3\nZeit [s];U [kV];Laser (mm);Raum [C]\n0;0;0,5;21\n0,5;1,5;0,75;21\n1;2,5;-9999;21\n1,5;3,5;1,25;21\n\
                   2;4;1,5;21\n2,5;4,25;1,75;21\n";

fn bench() -> (TempDir, String) {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("film.txt");
    fs::write(&file, LAB).expect("written");
    let file = text(&file).to_owned();
    (folder, file)
}

/// The rows of an imported file, without comments; empty cells are NaN.
fn rows(path: &Path) -> (String, Vec<Vec<f64>>) {
    let written = fs::read_to_string(path).expect("written");
    let mut lines = written.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().expect("a header").to_owned();
    let number = |cell: &str| if cell.is_empty() { f64::NAN } else { cell.parse().expect("a number") };
    (header, lines.map(|line| line.split(',').map(number).collect()).collect())
}

fn close(read: &[f64], written: &[f64]) {
    assert_eq!(read.len(), written.len());
    for (read, written) in read.iter().zip(written) {
        let both_empty = read.is_nan() && written.is_nan();
        assert!(both_empty || (read - written).abs() <= 1e-12 * written.abs(), "{read} {written}");
    }
}

#[test]
fn what_was_understood_is_reported_and_written() {
    let (folder, file) = bench();
    let out = folder.path().join("recordings");
    let report = TOOL.json(&["import", &file, "--blank", "displacement=-9999", "--out", text(&out)]);
    let film = &report["files"][0];
    assert_eq!(film["header_line"], 2);
    assert_eq!(film["preamble_lines"], 1);
    assert_eq!(film["format"], "text (UTF-8), separated by semicolons, decimal comma");
    assert_eq!((&film["rows"], &film["blanked"], &film["gaps"]), (&6.into(), &1.into(), &0.into()));
    assert_eq!(film["rate_hz"], 2.0);
    assert_eq!(film["duration_s"], 2.5);
    assert_eq!(film["ignored"], serde_json::json!(["Raum [C]"]));
    let voltage = &film["columns"][1];
    assert_eq!(voltage["name"], "U [kV]");
    assert_eq!((&voltage["column"], &voltage["unit"], &voltage["factor"]), (&2.into(), &"kV".into(), &1000.0.into()));
    let (header, rows) = rows(&out.join("film.csv"));
    assert_eq!(header, "time_s,voltage_v,displacement_m");
    let nothing = f64::NAN;
    close(
        &rows.concat(),
        &[
            0.0, 0.0, 0.5e-3, 0.5, 1500.0, 0.75e-3, 1.0, 2500.0, nothing, 1.5, 3500.0, 1.25e-3, 2.0, 4000.0, 1.5e-3,
            2.5, 4250.0, 1.75e-3,
        ],
    );
    // For people: the same.
    let output = TOOL.with(&["import", &file, "--out", text(&out)]).assert().success().get_output().stdout.clone();
    let printed = String::from_utf8(output).expect("UTF-8");
    names(&printed, &["semicolons", "\"U [kV]\" in kV, × 1000: 0 to 4250 V", "ignored", "Raum", "film.csv"]);
    // The drop-out that was not blanked.
    names(&printed, &["warning: a displacement of -9.999 m", "--blank"]);
}

#[test]
fn rows_are_cut_blanked_and_averaged() {
    let (folder, file) = bench();
    let out = folder.path().join("recordings");
    let imported = |more: &[&str]| {
        let report = TOOL.json(&[&["import", &file, "--out", text(&out)], more].concat());
        (report["files"][0].clone(), rows(&out.join("film.csv")).1)
    };
    let (report, kept) = imported(&["--from", "0.5", "--to", "2"]);
    close(&kept.iter().map(|row| row[0]).collect::<Vec<_>>(), &[0.0, 0.5, 1.0, 1.5]);
    close(&kept.iter().map(|row| row[1]).collect::<Vec<_>>(), &[1500.0, 2500.0, 3500.0, 4000.0]);
    names(&report["warnings"].to_string(), &["what the film remembers"]);
    // Means of two rows at the mean of their times; of what was measured.
    let (_, means) = imported(&["--decimate", "2", "--blank", "displacement<0"]);
    close(&means.concat(), &[0.0, 750.0, 0.625e-3, 1.0, 3000.0, 1.25e-3, 2.0, 4125.0, 1.625e-3]);
    let blanked = |what: &str| {
        let (report, rows) = imported(&["--blank", what]);
        let empty: Vec<usize> = (0..rows.len()).filter(|k| rows[*k][2].is_nan()).collect();
        assert_eq!(report["blanked"], empty.len());
        empty
    };
    assert_eq!(blanked("displacement>1.25"), [4, 5]);
    assert_eq!(blanked("displacement<0.75"), [0, 2]);
    assert_eq!(blanked("displacement=0.75"), [1]);
    assert_eq!(blanked("0.5..1.5"), [1, 2, 3]);
}

#[test]
fn every_command_reads_what_import_reads() {
    let (folder, file) = bench();
    let path = |name: &str| text(&folder.path().join(name)).to_owned();
    TOOL.with(&["import", &file, "--out", &path("recordings")]).assert().success();
    let imported = path("recordings/film.csv");
    let simulated = |profile: &str, out: &str| {
        let arguments = ["simulate", "--params", "preset:table3-n2", "--profile", profile, "--out", out];
        let stderr = TOOL.with(&arguments).assert().success().get_output().stderr.clone();
        (fs::read(out).expect("written"), String::from_utf8(stderr).expect("UTF-8"))
    };
    let (of_lab, told) = simulated(&file, &path("lab.csv"));
    let (of_imported, nothing) = simulated(&imported, &path("imported.csv"));
    assert_eq!(of_lab, of_imported);
    names(&told, &["film.txt", "voltage = \"U [kV]\" (kV)"]);
    assert_eq!(nothing, "", "a recording needs no message");
    // Chosen columns work there as well, and a response is CSV whatever the recording was.
    let mat = format!("{}/lab_files/bare-names.mat", env!("CARGO_MANIFEST_DIR"));
    let columns = ["--columns", "time=t:s,voltage=V:V,displacement=x:mm"];
    let replay = ["replay", "--params", "preset:table3-n2", &mat, "--out", &path("responses")];
    let report: Value = TOOL.json(&[&replay, columns.as_slice()].concat());
    assert_eq!(report["recordings"][0]["samples"], 24);
    let written = fs::read_to_string(path("responses/bare-names.csv")).expect("written");
    assert!(written.contains("time_s,voltage_v,force_n,displacement_m,measured_displacement_m"));
}
