//! The host's bits: steps, ticks and every law of control in the image.

use documents::Tolerance;
use host_sim::files::parameters::{Board, ElasticCurve, Parameters};
use host_sim::link::{Client, Emulator};
use serde_json::Value;
use springpot::Curve;
use tests::sweep::full_sweep;
use tests::tool::{Bench, number, rows};

use crate::{TOOL, image, stated};

const SINE: &str = "reference --shape sine --low 1.5e-3 --high 4e-3 --period 10 --out sine.csv";

/// Runs the image along `line`: `steps` steps have the host's bits.
fn pil(bench: &Bench, line: &str, steps: u64) -> Value {
    // A line has no blanks in its words, which the folder of the project may have.
    std::fs::copy(image("qemu"), bench.path("qemu")).expect("copied");
    let report = bench.json(&format!("pil --image qemu {line}"));
    println!("{line}: {report}");
    assert_eq!((&report["steps"], &report["mismatches"]), (&steps.into(), &0.into()), "{line}");
    report
}

/// Three recordings at 1 kHz, 8 s of each or all 155 s in a full sweep: displacement, state and voltage of every step are the host's, bit for bit;
/// of whole ticks, codes of the converters in and out, command, state and estimate, and the run is still on at its end.
#[test]
fn every_step_and_tick_of_three_recordings_has_the_hosts_bits() {
    let bench = Bench::new(TOOL);
    let files = bench.recordings("hossain");
    let (seconds, steps) = if full_sweep() { (155, 465_003) } else { (8, 24_003) };
    let line = format!("--params preset:table3-n2 --duration {seconds} {files}");
    let counted = number(&pil(&bench, &line, steps)["instructions_per_step"]);
    let stated = stated("pil", "Cortex-M4F");
    assert!(Tolerance::COUNT.holds(counted, stated), "{stated} instructions are stated, counted {counted}");
    for recording in rows(&pil(&bench, &format!("--law tick {line}"), steps)["recordings"]) {
        assert_eq!(recording["state"], "running", "{recording}");
    }
}

/// The demo runs the image where it is: all steps have the host's bits.
#[test]
fn the_demo_runs_the_image() {
    let report = Bench::new(TOOL).json("demo --out demo");
    let ran = &report["firmware"]["ran"];
    assert_eq!((&ran["steps"], &ran["mismatches"]), (&10_001.into(), &0.into()), "{}", report["firmware"]);
}

/// The three laws of control: feedforward and tracking with their loop closed around the firmware, the simulated film as
/// plant, and the observer along a recording. Every voltage, estimate and disturbance has the host's bits, and the film
/// follows.
#[test]
fn the_laws_of_control_have_the_hosts_bits() {
    let bench = Bench::new(TOOL);
    let files = bench.recordings("hossain");
    bench.json(&format!("fit {files} --out film.toml --topology parallel --branches 2"));
    bench.json(SINE);
    let tracking_pct = |law: &str| {
        let report = pil(&bench, &format!("--params film.toml --duration 10 --law {law}"), 10_001);
        report["recordings"][0]["tracking_rms_pct"].as_f64()
    };
    let [feedforward, tracking] = ["feedforward", "tracking"]
        .map(|law| tracking_pct(&format!("{law} --plant hossain sine.csv")).expect("a closed loop"));
    assert!(feedforward < 1.0 && tracking < 0.25, "{feedforward} %, {tracking} %");
    assert_eq!(tracking_pct("observer hossain-5s.csv"), None);
}

/// A film behind a curve of sixteen pieces, on an actuator that saturates, of either order: the model's step, every law of control, and
/// whole ticks.
#[test]
fn a_film_behind_a_curve_has_the_hosts_bits() {
    let bench = Bench::new(TOOL);
    bench.recordings("hossain");
    bench.json(SINE);
    // A quarter stiffer at 1 mm and three times as stiff at 3 mm; the strokes here are 1 to 4 mm.
    let points = std::array::from_fn::<_, 17, _>(|k| {
        let x = 2.5e-4 * (k as f64 - 2.0);
        (x, x * (1.0 + x * (8e4 * x - 30.0)))
    });
    let mut parameters = Parameters::preset("table3-n2").expect("a preset");
    parameters.curve = Some(ElasticCurve::free(Curve::through(&points).expect("rises")));
    parameters.actuator.saturation_v = Some(9000.0);
    bench.write("film.toml", parameters.to_toml());
    for run in [
        "gl --law step hossain-5s.csv",
        "bdf2 --law step hossain-5s.csv",
        "gl --law tick hossain-5s.csv",
        "bdf2 --law tick hossain-5s.csv",
        "gl --law observer hossain-5s.csv",
        "gl --law feedforward --plant hossain sine.csv",
        "gl --law tracking --plant hossain sine.csv",
    ] {
        let report = pil(&bench, &format!("--params film.toml --duration 3 --method {run}"), 3001);
        assert!(!run.contains("tick") || report["recordings"][0]["state"] == "running", "{report}");
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
