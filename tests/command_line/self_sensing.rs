//! `self-sensing`, and the commands that make and use its files.

use tests::tool::{Bench, names, number};

use crate::TOOL;

/// A bench with the recording of a minute with a tone, by converters of so many bits.
fn bench(bits: u32) -> Bench {
    let bench = Bench::new(TOOL);
    bench.json(&format!(
        "plant --plant hossain --frequency 0.05 --duration 60 --rate 1000 --peak-voltage 5.5kV --tone 50 --bits {bits} --out tone.csv"
    ));
    bench
}

#[test]
fn a_recording_becomes_a_sensor() {
    let bench = bench(16);
    assert!(bench.read("tone.csv").starts_with("time_s,voltage_v,current_a,displacement_m\n0.001,"));
    let report = bench.json("self-sensing tone.csv --cable 100 --out c.toml");
    assert!(report["senses"] == true && number(&report["noise_pct"]) < 0.2, "{report}");
    assert!((number(&report["tone_v"]) - 50.0).abs() < 0.1, "{report}");
    names(&bench.prints("self-sensing tone.csv"), &["a tone of 50.0 V", "pF at rest", "yes: 0."]);
    // A check states the same.
    let output = bench.run("check tone.csv");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    names(&text, &["one frequency", "the film as its own sensor: tone.csv: a tone of 50.0 V", "yes: 0."]);
    assert!(bench.says_no("check tone.csv")["self_sensing"][0]["senses"] == true);
    names(&bench.read("c.toml"), &["[relation]", "rest_f = ", "creep = ", "[options]", "cable_f = 0.0000000001"]);

    bench.json("reduce --params preset:table3-n2 --tolerance 1e-9 --out film.toml");
    bench.json("reference --shape sine --low 1e-3 --high 2.5e-3 --period 10 --duration 40 --out ref.csv");
    let run = "closed-loop --plant hossain --params film.toml --reference ref.csv --controller";
    let tracking = bench.json(&format!("{run} tracking --self-sensing c.toml --out run.csv"));
    let feedforward = bench.json(&format!("{run} feedforward --self-sensing c.toml"));
    // The model is that of another film; the film shows where it is.
    let [sensed, blind] = [tracking, feedforward].map(|report| number(&report["tracking_rms_pct"]));
    assert!(sensed < 0.1 * blind && sensed < 3.0, "{sensed} % with its own capacitance, {blind} % without");
    let refused = |line: &str, words: &[&str]| names(&bench.fails(&format!("{run} tracking {line}")), words);
    refused("--self-sensing c.toml --rate 500", &["--rate", "500.0 Hz is not the rate of the tone, 1000.0 Hz"]);
    refused("--self-sensing c.toml --sensor-rate 100", &["--self-sensing", "--sensor-rate"]);
    refused("--self-sensing film.toml", &["film.toml", "the command self-sensing writes one"]);
    let other = run.replace("hossain", "film.toml");
    names(&bench.fails(&format!("{other} tracking --self-sensing c.toml")), &["use hossain or wang"]);
}

#[test]
fn benches_that_cannot_say_why() {
    let coarse = bench(12);
    let report = coarse.says_no("self-sensing tone.csv");
    assert!(report["senses"] == false && number(&report["noise_pct"]) > 1.0, "{report}");
    let output = coarse.run("self-sensing tone.csv --out c.toml");
    assert!(output.status.code() == Some(1) && !coarse.path("c.toml").exists(), "no sensor is written");
    names(&String::from_utf8_lossy(&output.stdout), &["no: ", "use converters with more bits"]);

    // A tone that is not in the rows.
    let read = coarse.read("tone.csv");
    let every_tenth: Vec<&str> = read.lines().take(1).chain(read.lines().skip(1).step_by(10)).collect();
    coarse.write("slow.csv", every_tenth.join("\n"));
    let report = coarse.says_no("check slow.csv");
    assert!(report["self_sensing"][0]["senses"].is_null(), "{report}");
    names(report["self_sensing"][0]["text"].as_str().expect("a reason"), &["slow.csv", "record every tick"]);

    let good = bench(16);
    good.json("reduce --params preset:table3-n2 --tolerance 1e-9 --out film.toml");
    // The default board's slew limit.
    let report = good.says_no("self-sensing tone.csv --params film.toml");
    names(report["refusals"][0].as_str().expect("a reason"), &["a tone of 50 V slews 79 kV/s", "is 50 kV/s"]);
    let microamperes: String = good
        .read("tone.csv")
        .lines()
        .map(|line| match line.split(',').collect::<Vec<_>>().as_slice() {
            [t, v, i, x] if *i != "current_a" => format!("{t},{v},{i}e6,{x}\n"),
            _ => format!("{line}\n"),
        })
        .collect();
    good.write("microamperes.csv", microamperes);
    names(&good.fails("self-sensing microamperes.csv"), &["microamperes.csv", "is current_a in µA?"]);
    let report = good.says_no("check microamperes.csv");
    names(report["self_sensing"][0]["text"].as_str().expect("a reason"), &["is current_a in µA?"]);
    good.write("commented.csv", format!("# of a Tuesday\n{}", good.read("tone.csv")));
    assert!(good.json("self-sensing commented.csv")["senses"] == true);
}
