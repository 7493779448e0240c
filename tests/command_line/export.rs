//! `export` writes what the controller runs.

use std::fs;

use dea_driver::chips::{Calibration, CommandRange};
use dea_driver::wire::boards;
use dea_driver::{Blob, Controller, OnSensorFault};
use host_sim::files::parameters::Parameters;
use springpot::{Law, LawOptions, Preset, VoltageDrive};
use tempfile::TempDir;
use tests::tool::{names, text};

use crate::TOOL;

fn board_table() -> String {
    "\n[board]\nid = 7\ncommand_range = \"five-volts\"\namplifier = { offset = 0.0, gain = 1200.0, quadratic = -3.5 }\n\
     monitor = { offset = 1.5, gain = 1000.0, quadratic = 0.0 }\nsensor = { offset = -0.001, gain = 0.001, quadratic = 0.0 }\n\
     [board.limits]\nmax_voltage_v = 5500.0\nmax_field_v_per_m = 4e7\nthickness_m = 160e-6\nmax_slew_v_per_s = 2e4\n\
     max_displacement_m = 6e-3\non_sensor_fault = \"open-loop\"\nheartbeat_s = 0.25\n\
     monitor = { slew_v_per_s = 5e4, band_v = 50.0, band_share = 0.02, settle_s = 0.01 }\n\
     sensor = { low = -0.9e-3, high = 8e-3, jump = 2e-4, stuck_ticks = 300 }\n"
        .into()
}

/// Exports `params` at `rate` and gives the blob's bytes.
fn exported(params: &str, rate: &str) -> Vec<u8> {
    let folder = TempDir::new().expect("a folder");
    let out = folder.path().join("p.bin");
    let report = TOOL.json(&["export", "--params", params, "--rate", rate, "--out", text(&out)]);
    let blob = fs::read(&out).expect("written");
    assert_eq!(report["bytes"].as_u64(), Some(blob.len() as u64));
    // The same as a constant.
    let source = folder.path().join("blob.rs");
    TOOL.json(&["export", "--params", params, "--rate", rate, "--emit", "rust", "--out", text(&source)]);
    let source = fs::read_to_string(&source).expect("written");
    let constant: Vec<u8> = source
        .split(|c: char| !c.is_ascii_alphanumeric())
        .filter_map(|word| word.strip_prefix("0x"))
        .map(|hex| u8::from_str_radix(hex, 16).expect("a byte"))
        .collect();
    assert_eq!(constant, blob);
    blob
}

/// The cost of the compression is that of the law; none for a displacement behind a curve with mass.
#[test]
fn the_bound_of_the_compression_is_reported() {
    let folder = TempDir::new().expect("a folder");
    let (file, out) = (folder.path().join("p.toml"), folder.path().join("p.bin"));
    let preset = ["export", "--params", "preset:table3-n2", "--rate", "500", "--out", text(&out)];
    let reported = &TOOL.json(&preset)["compression"];
    let model = Preset::TABLE3_N2.model().expect("valid");
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1.0 / 500.0)).expect("valid");
    let bound = law.compression_bound(&model, LawOptions::DEFAULT_HORIZON_S);
    assert_eq!(reported["rate_hz"], 500.0);
    for (name, value) in [
        ("horizon_s", bound.horizon_s),
        ("force_per_increment", bound.force_per_increment),
        ("force_per_stroke", bound.force_per_stroke),
        ("displacement_per_increment", bound.displacement_per_increment),
        ("displacement_per_stroke", bound.displacement_per_stroke),
    ] {
        assert_eq!(reported[name].as_f64().map(|reported| reported as f32), Some(value), "{name}");
    }
    // Its numbers are for those who ask.
    let line = TOOL.with(&preset).arg("--verbose").output().expect("runs");
    names(&String::from_utf8_lossy(&line.stderr), &["compression at 500 Hz, over 86400 s from rest", "of the stroke"]);

    let curve = "schema = 2\nname = \"bent\"\n[actuator]\nrelative_permittivity = 4.7\nlength_m = 0.04\nwidth_m = 0.06\n\
                 thickness_m = 160e-6\nmass_kg = 0.316\n[model]\ntopology = \"parallel\"\nmain = { c = 62740.0, alpha = 0.2 }\n\
                 branches = []\n[curve]\nelastic = \"free\"\ndisplacement_m = [-0.0005, 0.0, 0.002]\nvalue_m = [-0.00045, 0.0, 0.003]\n";
    fs::write(&file, curve).expect("writable");
    let bent = &TOOL.json(&["export", "--params", text(&file), "--out", text(&out)])["compression"];
    assert!(bent["displacement_per_stroke"].is_null() && bent["force_per_stroke"].is_f64(), "{bent}");
}

/// Every preset, at several rates: the controller's steps are the host's, bit for bit.
#[test]
fn the_controller_runs_what_the_host_runs() {
    for preset in springpot::Preset::ALL {
        for rate in [200.0, 1000.0, 5000.0] {
            let blob = exported(&format!("preset:{}", preset.name()), &rate.to_string());
            let blob = Blob::decode(&blob, boards::STM32F405).expect("valid");
            let mut controller = Controller::new(blob);
            let parameters = Parameters::preset(preset.name()).expect("there");
            let law: Law<f32> = Law::compressed(&parameters.model, LawOptions::at_step(1.0 / rate)).expect("valid");
            let drive = VoltageDrive::new(&parameters.actuator, 6000.0, law.stiffness()).expect("valid");
            let mut film = law.state();
            for k in 0..2000u16 {
                let volts = 6.0 * f32::from(k % 1000);
                let x = law.displacement_under(&mut film, drive.load(volts));
                let step = controller.step(volts);
                assert_eq!(step.displacement_m.to_bits(), x.to_bits(), "{} at {rate} Hz, step {k}", preset.name());
                assert_eq!(step.force_n.to_bits(), film.base_force().to_bits());
            }
        }
    }
}

#[test]
fn a_board_of_its_own_goes_into_the_blob() {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("p.toml");
    let mut parameters = Parameters::preset("table3-n2").expect("there");
    parameters.sensor_offset_m = 12e-6;
    fs::write(&file, parameters.to_toml() + &board_table()).expect("written");
    let blob = Blob::decode(&exported(text(&file), "2000"), 7).expect("for board 7").into_parameters();
    assert_eq!((blob.rate_hz, blob.command_range), (2000.0, CommandRange::FiveVolts));
    assert_eq!(blob.amplifier, Calibration::Parabola { offset: 0.0, gain: 1200.0, quadratic: -3.5 });
    assert_eq!(blob.monitor, Calibration::Parabola { offset: 1.5, gain: 1000.0, quadratic: 0.0 });
    assert_eq!((blob.limits.max_voltage_v, blob.limits.on_sensor_fault), (5500.0, OnSensorFault::OpenLoop));
    assert_eq!((blob.limits.sensor.stuck_ticks, blob.sensor_offset_m), (300, 12e-6));
    // And through other commands, unchanged.
    let reduced = folder.path().join("r.toml");
    TOOL.json(&["reduce", "--params", text(&file), "--out", text(&reduced)]);
    let (before, after) = (Parameters::read(&file).expect("readable"), Parameters::read(&reduced).expect("readable"));
    assert_eq!(before.board, after.board);
    assert!(fs::read_to_string(&reduced).expect("written").contains("settle_s = 0.01\n"), "short numbers");
}

#[test]
fn an_amplifier_is_described_by_points_as_well() {
    let folder = TempDir::new().expect("a folder");
    let file = folder.path().join("p.toml");
    let parabola = "amplifier = { offset = 0.0, gain = 1200.0, quadratic = -3.5 }";
    let points = "amplifier = { points = [[0.0, 0.0], [0.6, 15.0], [0.8, 160.0], [5.0, 6000.0]] }";
    let good = Parameters::preset("table3-n2").expect("there").to_toml() + &board_table();
    assert!(good.contains(parabola));
    fs::write(&file, good.replace(parabola, points)).expect("written");
    let blob = Blob::decode(&exported(text(&file), "1000"), 7).expect("for board 7").into_parameters();
    let expected = Calibration::points(&[[0.0, 0.0], [0.6, 15.0], [0.8, 160.0], [5.0, 6000.0]]).expect("rising");
    assert_eq!(blob.amplifier, expected);
    // Through other commands, with short numbers.
    let reduced = folder.path().join("r.toml");
    TOOL.json(&["reduce", "--params", text(&file), "--out", text(&reduced)]);
    let (before, after) = (Parameters::read(&file).expect("readable"), Parameters::read(&reduced).expect("readable"));
    assert_eq!(before.board, after.board);
    assert!(fs::read_to_string(&reduced).expect("written").contains("0.6"), "short numbers");
}

/// The ending chooses the format; one that is another format's is refused, and nothing is written.
#[test]
fn the_ending_chooses_the_format() {
    let folder = TempDir::new().expect("a folder");
    let out = |name: &str| folder.path().join(name);
    let export = ["export", "--params", "preset:table3-n2", "--out"];
    let read = |name: &str| fs::read(out(name)).unwrap_or_default();
    for name in ["film.bin", "film.rs", "film.c", "film.fmu", "film"] {
        TOOL.json(&[&export[..], &[text(&out(name))]].concat());
    }
    assert!(read("film.bin").starts_with(b"DEA") && read("film") == read("film.bin"));
    assert!(read("film.rs").starts_with(b"///") && read("film.fmu").starts_with(b"PK"));
    assert!(read("film.c").starts_with(b"/*") && out("springpot.h").exists());
    for (name, emit) in [
        ("other.c", "blob"),
        ("other.c", "rust"),
        ("other.rs", "c"),
        ("other.bin", "rust"),
        ("other.fmu", "blob"),
        ("other.bin", "fmu2"),
        ("other.h", "c"),
        ("other.c", "arduino"),
    ] {
        let refusal = TOOL.fails(&[&export[..], &[text(&out(name)), "--emit", emit]].concat());
        names(&refusal, &["--out", name, "--emit", emit]);
        assert!(!out(name).exists(), "{name} {emit}");
    }
    for name in ["other.h", "other.ino", "other.zip", "other.csv"] {
        names(&TOOL.fails(&[&export[..], &[text(&out(name))]].concat()), &["--out", name, ".bin", ".c"]);
        assert!(!out(name).exists(), "{name}");
    }
}

/// The blob of the example firmware for other boards is made of the file beside it, as its comment says.
#[test]
fn the_blob_of_the_example_for_other_boards_is_that_of_its_film() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/dea-driver/examples/other-board");
    let committed = fs::read(format!("{folder}/film.bin")).expect("committed");
    let made = exported(&format!("{folder}/film.toml"), "1000");
    assert!(made == committed, "make film.bin again: host-sim export --params film.toml --out film.bin in {folder}");
}
