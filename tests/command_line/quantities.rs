//! Quantities as a person types them: units beside plain SI numbers, and what is refused before any work.

use std::fs;
use std::path::Path;

use tempfile::TempDir;
use tests::tool::text;

use crate::TOOL;

/// The reference of these options, as bytes.
fn reference(folder: &Path, low: &str, high: &str, times: [&str; 3], rate: &str) -> Vec<u8> {
    let out = folder.join("ref.csv");
    let [period, rise, duration] = times;
    let arguments = ["--low", low, "--high", high, "--period", period, "--rise", rise, "--duration", duration];
    let shape = ["reference", "--shape", "sine", "--rate", rate, "--out", text(&out)];
    TOOL.json(&[&shape[..], &arguments].concat());
    fs::read(&out).expect("written")
}

/// A unit is the same as its power of ten, bit by bit.
#[test]
fn units_are_powers_of_ten() {
    let folder = TempDir::new().expect("a folder");
    let plain = reference(folder.path(), "-1e-3", "0.0025", ["10", "0.5", "60"], "50");
    for (low, high) in [("-1mm", "2.5mm"), ("-1000um", "2.5 mm"), ("-1000µm", "0.25cm"), ("-1e-3m", "2500000nm")] {
        for times in [["10s", "500ms", "1min"], ["1e4 ms", "0.5 s", "60s"]] {
            assert!(reference(folder.path(), low, high, times, "50Hz") == plain, "{low} {high} {times:?}");
        }
    }
    assert!(reference(folder.path(), "-1mm", "2.5mm", ["10s", "500ms", "1min"], "0.05kHz") == plain);
    assert!(reference(folder.path(), "-1mm", "2.5mm", ["10s", "500ms", "1min"], "51Hz") != plain);
}

/// Limits in kilovolts and megavolts per metre are those in volts.
#[test]
fn limits_take_units() {
    let folder = TempDir::new().expect("a folder");
    let (sine, volts) = (folder.path().join("ref.csv"), folder.path().join("v.csv"));
    fs::write(&sine, reference(folder.path(), "1.5mm", "2mm", ["5s", "2s", "20s"], "100Hz")).expect("written");
    let plan = |limits: [&str; 5], rate: &str| {
        let [voltage, field, slew, speed, acceleration] = limits;
        let limits = [
            ["--max-voltage", voltage],
            ["--max-field", field],
            ["--max-slew", slew],
            ["--max-velocity", speed],
            ["--max-acceleration", acceleration],
        ];
        let base = ["feedforward", "--params", "preset:table3-n1", "--reference", text(&sine), "--out", text(&volts)];
        TOOL.json(&[&base[..], limits.as_flattened(), &["--rate", rate]].concat());
        fs::read(&volts).expect("written")
    };
    let plain = plan(["2000", "1.5e7", "2000", "1e-3", "0.01"], "1000");
    assert!(plan(["2kV", "15MV/m", "2kV/s", "1mm/s", "10mm/s2"], "1kHz") == plain);
    assert!(plan(["2e3V", "15 V/um", "2V/ms", "1000um/s", "1cm/s²"], "1000 Hz") == plain);
    assert!(plan(["2.1kV", "15V/µm", "2kV/s", "1mm/s", "10mm/s^2"], "1kHz") != plain, "the limit of voltage is met");
}
