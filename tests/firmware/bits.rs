//! The host's bits: steps, ticks and every law of control in the image.

use documents::Tolerance;
use host_sim::files::parameters::{Board, ElasticCurve, Parameters};
use host_sim::link::{Client, Emulator};
use springpot::Curve;
use tests::recordings;
use tests::sweep::full_sweep;
use tests::tool::text;

use crate::{TOOL, image, stated};

/// Length of the part of each recording that is compared, 8 s, or all 155 s in a full sweep, and the steps of three recordings.
fn span() -> (&'static str, u64) {
    if full_sweep() { ("155", 465_003) } else { ("8", 24_003) }
}

/// Three recordings at 1 kHz: displacement, state and voltage of every step are the host's, bit for bit.
#[test]
fn every_step_of_three_recordings_has_the_hosts_bits() {
    let image = image("qemu");
    let recordings = recordings("hossain");
    let [fast, middle, slow] = recordings.each_ref().map(|path| text(path));
    let (seconds, steps) = span();
    let report = TOOL.json(&[
        "pil",
        "--params",
        "preset:table3-n2",
        "--image",
        text(&image),
        "--duration",
        seconds,
        fast,
        middle,
        slow,
    ]);
    println!("{report}");
    assert_eq!((report["steps"].as_u64(), report["mismatches"].as_u64()), (Some(steps), Some(0)));
    let counted = report["instructions_per_step"].as_f64().expect("counted");
    let stated = stated("pil", "Cortex-M4F");
    assert!(Tolerance::COUNT.holds(counted, stated), "{stated} instructions are stated, counted {counted}");
}

/// The demo runs the image where it is: all steps have the host's bits.
#[test]
fn the_demo_runs_the_image() {
    let folder = tempfile::TempDir::new().expect("a folder");
    let report = TOOL.json(&["demo", "--out", text(folder.path())]);
    let ran = &report["firmware"]["ran"];
    assert_eq!((&ran["steps"], &ran["mismatches"]), (&10_001.into(), &0.into()), "{}", report["firmware"]);
}

/// Whole ticks, codes of the converters in and out, along three recordings: command, state and estimate are the host's, bit for bit, and
/// the run is still on at its end.
#[test]
fn whole_ticks_of_three_recordings_have_the_hosts_bits() {
    let image = image("qemu");
    let recordings = recordings("hossain");
    let [fast, middle, slow] = recordings.each_ref().map(|path| text(path));
    let (seconds, steps) = span();
    let options = ["--params", "preset:table3-n2", "--law", "tick", "--image", text(&image), "--duration", seconds];
    let report = TOOL.json(&[["pil"].as_slice(), &options, &[fast, middle, slow]].concat());
    println!("{report}");
    assert_eq!((report["steps"].as_u64(), report["mismatches"].as_u64()), (Some(steps), Some(0)));
    for recording in report["recordings"].as_array().expect("three") {
        assert_eq!(recording["state"], "running", "{recording}");
    }
}

/// The three laws of control: feedforward and tracking with their loop closed around the firmware, the simulated film as
/// plant, and the observer along a recording. Every voltage, estimate and disturbance has the host's bits, and the film
/// follows.
#[test]
fn the_laws_of_control_have_the_hosts_bits() {
    let folder = tempfile::TempDir::new().expect("a folder");
    let (image, film, sine) = (image("qemu"), folder.path().join("film.toml"), folder.path().join("sine.csv"));
    let recordings = recordings("hossain");
    let [fast, middle, slow] = recordings.each_ref().map(|path| text(path));
    let structure = ["--topology", "parallel", "--branches", "2"];
    TOOL.json(&[&["fit", fast, middle, slow, "--out", text(&film)], structure.as_slice()].concat());
    let shape = ["--shape", "sine", "--low", "1.5e-3", "--high", "4e-3", "--period", "10", "--out", text(&sine)];
    TOOL.json(&[["reference"].as_slice(), &shape].concat());
    let pil = |more: &[&str]| {
        let all = ["pil", "--params", text(&film), "--image", text(&image), "--duration", "10"];
        let report = TOOL.json(&[all.as_slice(), more].concat());
        println!("{report}");
        assert_eq!((report["steps"].as_u64(), report["mismatches"].as_u64()), (Some(10_001), Some(0)));
        report["recordings"][0]["tracking_rms_pct"].as_f64()
    };
    let closed = ["--plant", "hossain", text(&sine)];
    let feedforward = pil(&[["--law", "feedforward"].as_slice(), &closed].concat()).expect("a closed loop");
    let tracking = pil(&[["--law", "tracking"].as_slice(), &closed].concat()).expect("a closed loop");
    assert!(feedforward < 1.0 && tracking < 0.25, "{feedforward} %, {tracking} %");
    assert_eq!(pil(&["--law", "observer", fast]), None);
}

/// A film behind a curve of sixteen pieces, on an actuator that saturates, of either order: the model's step, every law of control, and
/// whole ticks.
#[test]
fn a_film_behind_a_curve_has_the_hosts_bits() {
    let folder = tempfile::TempDir::new().expect("a folder");
    let (film, sine) = (folder.path().join("film.toml"), folder.path().join("sine.csv"));
    // A quarter stiffer at 1 mm and three times as stiff at 3 mm; the strokes here are 1 to 4 mm.
    let points = std::array::from_fn::<_, 17, _>(|k| {
        let x = 2.5e-4 * (k as f64 - 2.0);
        (x, x * (1.0 + x * (8e4 * x - 30.0)))
    });
    let mut parameters = Parameters::preset("table3-n2").expect("a preset");
    parameters.curve = Some(ElasticCurve::free(Curve::through(&points).expect("rises")));
    parameters.actuator.saturation_v = Some(9000.0);
    std::fs::write(&film, parameters.to_toml()).expect("written");
    let shape = ["--shape", "sine", "--low", "1.5e-3", "--high", "4e-3", "--period", "10", "--out", text(&sine)];
    TOOL.json(&[["reference"].as_slice(), &shape].concat());
    let image = image("qemu");
    let [fast, ..] = &recordings("hossain");
    for (law, file, method) in [
        ("step", fast, "gl"),
        ("step", fast, "bdf2"),
        ("tick", fast, "gl"),
        ("tick", fast, "bdf2"),
        ("observer", fast, "gl"),
        ("feedforward", &sine, "gl"),
        ("tracking", &sine, "gl"),
    ] {
        let plant = if file == &sine { ["--plant", "hossain"].as_slice() } else { &[] };
        let options = ["pil", "--params", text(&film), "--image", text(&image), "--duration", "3", "--method", method];
        let report = TOOL.json(&[options.as_slice(), &["--law", law], plant, &[text(file)]].concat());
        println!("{law}, {method}: {report}");
        assert_eq!((report["steps"].as_u64(), report["mismatches"].as_u64()), (Some(3001), Some(0)), "{law}, {method}");
        if law == "tick" {
            assert_eq!(report["recordings"][0]["state"], "running", "{report}");
        }
    }
}

/// Bits are compared, not merely printed: with other parameters on the chip than on the host, the test fails.
#[test]
fn another_model_is_noticed() {
    let (_emulator, port) = Emulator::start(&image("qemu")).expect("starts");
    let (mut client, _) = Client::new(port).expect("answers");
    for (preset, same) in [("table3-n2", true), ("table3-n3", false)] {
        let parameters = Parameters::preset(preset).expect("a preset");
        let blob = parameters.to_blob(&Board::bench(&parameters.actuator), 1000.0).expect("valid");
        client.upload(&blob, false).expect("taken");
        let (steps, cycles) = client.step(&[3000.0; 24]).expect("steps");
        let host = Parameters::preset("table3-n2").expect("a preset");
        let law = host.film().compressed_law::<f32>(1000.0).expect("valid");
        let drive = springpot::VoltageDrive::new(&host.actuator, 6000.0, law.stiffness()).expect("valid");
        let mut film = law.state();
        let here: Vec<u32> = (0..24).map(|_| law.displacement_under(&mut film, drive.load(3000.0)).to_bits()).collect();
        let there: Vec<u32> = steps.iter().map(|step| step.displacement_m.to_bits()).collect();
        assert_eq!(here == there, same, "{preset}");
        assert!(cycles > 0);
    }
}
