//! `export` writes what the controller runs.

use std::fs;

use dea_driver::chips::{Calibration, CommandRange};
use dea_driver::wire::boards;
use dea_driver::{Blob, BlobError, OnSensorFault};
use host_sim::files::parameters::Parameters;
use springpot::{Law, LawOptions, Preset};
use tests::tool::{Bench, SIZES, names, number};

use crate::TOOL;

const BOARD: &str = include_str!("films/board.toml");

/// Exports `params` at `rate` and gives the blob's bytes, which are those of the constant.
fn exported(bench: &Bench, params: &str, rate: &str) -> Vec<u8> {
    let report = bench.json(&format!("export --params {params} --rate {rate} --out p.bin"));
    let blob = fs::read(bench.path("p.bin")).expect("written");
    assert_eq!(report["bytes"].as_u64(), Some(blob.len() as u64));
    bench.json(&format!("export --params {params} --rate {rate} --emit rust --out blob.rs"));
    let source = bench.read("blob.rs");
    let words = source.split(|c: char| !c.is_ascii_alphanumeric()).filter_map(|word| word.strip_prefix("0x"));
    let constant: Vec<u8> = words.map(|hex| u8::from_str_radix(hex, 16).expect("a byte")).collect();
    assert_eq!(constant, blob);
    blob
}

/// The cost of the compression is that of the law; none for a displacement behind a curve with mass.
#[test]
fn the_bound_of_the_compression_is_reported() {
    let bench = Bench::new(TOOL);
    let preset = "export --params preset:table3-n2 --rate 500 --out p.bin";
    let reported = &bench.json(preset)["compression"];
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
        assert_eq!(number(&reported[name]) as f32, value, "{name}");
    }
    // Its numbers are for those who ask.
    let verbose = bench.run(&format!("{preset} --verbose"));
    let words = ["compression at 500 Hz, over 86400 s from rest", "of the stroke"];
    names(&String::from_utf8_lossy(&verbose.stderr), &words);

    let model = "[model]\ntopology = \"parallel\"\nmain = { c = 62740.0, alpha = 0.2 }\nbranches = []\n[curve]\nelastic = \"free\"\n\
                 displacement_m = [-0.0005, 0.0, 0.002]\nvalue_m = [-0.00045, 0.0, 0.003]\n";
    bench.write("bent.toml", format!("schema = 2\nname = \"bent\"\n{SIZES}{model}"));
    let bent = &bench.json("export --params bent.toml --out p.bin")["compression"];
    assert!(bent["displacement_per_stroke"].is_null() && bent["force_per_stroke"].is_f64(), "{bent}");
}

/// The table in `docs/boards.md`: what these converters cannot keep is refused on the host.
#[test]
fn the_table_of_a_board_with_converters_on_its_chip_goes_into_its_blob() {
    let bench = Bench::new(TOOL);
    let page = include_str!("../../docs/boards.md");
    let table = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a table");
    let toml = Parameters::preset("table3-n2").expect("there").to_toml() + "\n" + table;
    bench.write("p.toml", toml.clone());
    let blob = exported(&bench, "p.toml", "1000");
    assert!(Blob::decode(&blob, boards::STM32F407_DISCOVERY).is_ok());
    assert!(matches!(Blob::decode(&blob, boards::STM32F405), Err(BlobError::Board { found: 0x0407 })));
    // With the number of the other board, as the page says, for the virtual board.
    bench.write("virtual.toml", toml.replace("id = 0x0407", "id = 0x0405"));
    assert!(Blob::decode(&exported(&bench, "virtual.toml", "1000"), boards::STM32F405).is_ok());
    for (good, fine, words) in [
        ("stuck_band = 6e-6", "stuck_band = 2e-6", ["sensor.stuck_band", "widen the limit"]),
        ("gain = 3400.0", "gain = 1000.0", ["reaches 2799", "limits.max_voltage_v"]),
    ] {
        assert!(toml.contains(good));
        bench.write("fine.toml", toml.replace(good, fine));
        names(&bench.fails("export --params fine.toml --rate 1000 --out fine.bin"), &words);
    }
}

#[test]
fn a_board_of_its_own_goes_into_the_blob() {
    let bench = Bench::new(TOOL);
    let mut parameters = Parameters::preset("table3-n2").expect("there");
    parameters.sensor_offset_m = 12e-6;
    let toml = parameters.to_toml() + BOARD;
    let parabola = "amplifier = { offset = 0.0, gain = 1200.0, quadratic = -3.5 }";
    let points = "amplifier = { points = [[0.0, 0.0], [0.6, 15.0], [0.8, 160.0], [5.0, 6000.0]] }";
    for (described, amplifier) in [
        (parabola, Calibration::Parabola { offset: 0.0, gain: 1200.0, quadratic: -3.5 }),
        (points, Calibration::points(&[[0.0, 0.0], [0.6, 15.0], [0.8, 160.0], [5.0, 6000.0]]).expect("rising")),
    ] {
        assert!(toml.contains(parabola));
        bench.write("p.toml", toml.replace(parabola, described));
        let blob = Blob::decode(&exported(&bench, "p.toml", "2000"), 7).expect("for board 7").into_parameters();
        assert_eq!((blob.rate_hz, blob.command_range), (2000.0, CommandRange::FiveVolts));
        assert_eq!(blob.amplifier, amplifier);
        assert_eq!(blob.monitor, Calibration::Parabola { offset: 1.5, gain: 1000.0, quadratic: 0.0 });
        assert_eq!((blob.limits.max_voltage_v, blob.limits.on_sensor_fault), (5500.0, OnSensorFault::OpenLoop));
        assert_eq!((blob.limits.sensor.stuck_ticks, blob.sensor_offset_m), (300, 12e-6));
        // And through other commands, unchanged, with short numbers.
        bench.json("reduce --params p.toml --out r.toml");
        let [before, after] =
            ["p.toml", "r.toml"].map(|name| Parameters::read(&bench.path(name)).expect("readable").board);
        assert_eq!(before, after);
        names(&bench.read("r.toml"), &["settle_s = 0.01\n"]);
    }
}

/// A film with the table in `docs/formats.md`, on a board whose limits leave room for the tone.
pub fn sensed() -> String {
    let page = include_str!("../../docs/formats.md");
    let table = page.split("```toml\n").find(|table| table.starts_with("[board.self_sensing]"));
    let table = table.and_then(|rest| rest.split("```").next()).expect("a table");
    let board = BOARD
        .replace("id = 7", "id = 0x0405")
        .replace("max_slew_v_per_s = 2e4", "max_slew_v_per_s = 1e5")
        .replace("slew_v_per_s = 5e4", "slew_v_per_s = 1e5")
        .replace("jump = 2e-4", "jump = 4e-4");
    let control = include_str!("films/control.toml");
    Parameters::preset("table3-n2").expect("there").to_toml() + &board + control + table
}

/// The table is in the blob, and unchanged through other commands.
#[test]
fn self_sensing_of_the_page_goes_into_the_blob() {
    let (bench, toml) = (Bench::new(TOOL), sensed());
    bench.write("p.toml", toml.clone());
    let blob = Blob::decode(&exported(&bench, "p.toml", "1000"), boards::STM32F405).expect("valid").into_parameters();
    let sensor = blob.self_sensing.expect("in the blob");
    assert_eq!((sensor.options().periods, sensor.tone_v()), (5, 50.0));
    assert_eq!(sensor.relation().max_f as f32, 820e-12);
    assert_eq!(sensor.current(), &Calibration::Parabola { offset: -0.25e-3, gain: 50e-6, quadratic: 0.0 });
    bench.json("reduce --params p.toml --out r.toml");
    let [before, after] = ["p.toml", "r.toml"].map(|name| Parameters::read(&bench.path(name)).expect("readable").board);
    assert_eq!(before, after);
    let refused = |export: &str, words: &[&str]| names(&bench.fails(export), words);
    refused("export --params p.toml --rate 500 --out q.bin", &["rate_hz is 500", "at least 999.9"]);
    for (good, bad, words) in [
        ("max_slew_v_per_s = 1e5", "max_slew_v_per_s = 5e4", ["limits.max_slew_v_per_s is 50000", "at least 7853"]),
        ("rest_f = 700e-12", "rest_f = 900e-12", ["max_f", "larger than rest_f"]),
        ("max_current_a = 0.12e-3", "max_current_a = 0.2e-3", ["its max_current_a is 0.0002", "at most 0.000125"]),
        // Other units.
        ("rest_f = 700e-12", "rest_f = 700.0", ["rest_f", "picofarads"]),
        ("max_f = 820e-12", "max_f = 0.82", ["max_f", "nanofarads"]),
        ("cable_f = 100e-12", "cable_f = 100.0", ["cable_f", "picofarads"]),
        ("stroke_m = [0.0233, -0.0068, 0.004]", "stroke_m = [23.3, -6.8, 4.0]", ["stroke_m", "millimetres"]),
        ("tone_v = 50.0", "tone_v = 0.05", ["tone_v", "kilovolts"]),
        ("current_noise_a = 15e-9", "current_noise_a = 15.0", ["noise", "current_noise_a"]),
        ("voltage_noise_v = 0.18", "voltage_noise_v = 180.0", ["noise", "voltage_noise_v"]),
    ] {
        assert!(toml.contains(good));
        bench.write("bad.toml", toml.replace(good, bad));
        refused("export --params bad.toml --rate 1000 --out q.bin", &words);
    }
    let (above, _) = toml.split_once("[board.self_sensing]").expect("there");
    let line = format!("bad.toml:{}:", above.lines().count() + 1);
    refused("export --params bad.toml --rate 1000 --out q.bin", &[&line]);
}

/// The ending chooses the format; one that is another format's is refused, and nothing is written.
#[test]
fn the_ending_chooses_the_format() {
    let bench = Bench::new(TOOL);
    let export = "export --params preset:table3-n2 --out";
    for (name, begin) in
        [("film.bin", "DEA"), ("film.rs", "///"), ("film.c", "/*"), ("film.fmu", "PK"), ("film", "DEA")]
    {
        bench.json(&format!("{export} {name}"));
        assert!(fs::read(bench.path(name)).expect("written").starts_with(begin.as_bytes()), "{name}");
    }
    assert!(bench.path("springpot.h").exists());
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
        names(&bench.fails(&format!("{export} {name} --emit {emit}")), &["--out", name, "--emit", emit]);
    }
    for name in ["other.h", "other.ino", "other.zip", "other.csv"] {
        names(&bench.fails(&format!("{export} {name}")), &["--out", name, ".bin", ".c"]);
    }
}

/// The blob of the example firmware for other boards is made of the file beside it, as its comment says.
#[test]
fn the_blob_of_the_example_for_other_boards_is_that_of_its_film() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/dea-driver/examples/other-board");
    let bench = Bench::new(TOOL);
    fs::copy(format!("{folder}/film.toml"), bench.path("film.toml")).expect("copied");
    let committed = fs::read(format!("{folder}/film.bin")).expect("committed");
    let made = exported(&bench, "film.toml", "1000");
    assert!(made == committed, "make film.bin again: springpot export --params film.toml --out film.bin in {folder}");
}
