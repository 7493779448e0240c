//! `amplifier` as scripts call it.

use tests::tool::{Bench, names, number};

use crate::TOOL;

/// A log from 0 V to 3 kV at 1 s and back at `until_s`, behind 0.1 s up and 0.4 s down: the exponentials, with the monitor's gain and offset.
fn bench(until_s: f64) -> Bench {
    let row = |row: i32| {
        let time_s = f64::from(row) / 100.0;
        let risen = |time_s: f64| 3000.0 * -(-(time_s - 1.0).max(0.0) / 0.1).exp_m1();
        let fallen = (-(time_s - until_s).max(0.0) / 0.4).exp();
        let command = if time_s >= 1.0 && time_s < until_s { 3000.0 } else { 0.0 };
        // ±2 V, so that there is a noise.
        let volts = risen(time_s.min(until_s)) * fallen;
        format!("{time_s},{command},{}", 1.02 * volts + 10.0 + f64::from(row * 7919 % 5) - 2.0)
    };
    let bench = Bench::new(TOOL);
    bench.write_table("log.csv", "time_s,command_v,voltage_v", (0..600).map(row));
    bench
}

#[test]
fn a_log_becomes_parameters_and_a_figure() {
    let bench = bench(3.0);
    let report = bench.json("amplifier log.csv --plot log.svg --params preset:table3-n2 --out new.toml");
    assert!((1.0..2.0).contains(&number(&report["residual_v"])) && report["samples"] == 600, "{report}");
    for (name, truth, within) in
        [("rise_s", 0.1, 0.003), ("fall_s", 0.4, 0.012), ("gain", 1.02, 0.002), ("offset_v", 10.0, 1.0)]
    {
        let (found, ends) = (number(&report[name]), &report["intervals_95_pct"][name]);
        let (low, high) = (number(&ends[0]), number(&ends[1]));
        assert!((found - truth).abs() < within, "{name}: {found}");
        assert!(low < found && found < high && high - low < 0.1 * truth, "{name}: {low} to {high}");
    }
    names(&bench.read("log.svg"), &["<svg", "Residual", "voltage (kV)"]);
    // The file is one that every command reads, with the times in it.
    names(&bench.read("new.toml"), &["[board.amplifier]", "rise_s = 0.", "fall_s = 0."]);
    bench.json("export --params new.toml --rate 1000 --out new.bin");
    let words = ["rise_s 0.", "95 % interval", "monitor: gain 1.02", "[board.amplifier]\nrise_s = 0.", "\nfall_s = 0."];
    names(&bench.prints("amplifier log.csv"), &words);
}

/// The check of a reference with the times that were identified.
#[test]
fn the_check_knows_what_was_identified() {
    let bench = bench(3.0);
    bench.json("amplifier log.csv --params preset:table3-n2 --out lagging.toml");
    bench.json("reference --shape sine --low 0.5e-3 --high 1.5e-3 --period 1 --duration 10 --out reference.csv");
    let base = "feedforward --reference reference.csv --check --params";
    let check = &bench.says_no(&format!("{base} lagging.toml"))["check"];
    assert_eq!(check["feasible"], false);
    assert!(number(&check["amplifier"]["falls_too_fast_pct"]) > 1.0, "{check}");
    let first = format!("first at {:.3} s", number(&check["amplifier"]["falls_too_fast_s"]));
    let printed = bench.run(&format!("{base} lagging.toml"));
    let words = ["not feasible", "must fall faster than the amplifier's bleeder allows", &first];
    names(&String::from_utf8_lossy(&printed.stdout), &words);
    // Without its times it is not reported.
    let ideal = &bench.says_no(&format!("{base} preset:table3-n2"))["check"];
    assert!(ideal.get("amplifier").is_none(), "{ideal}");
}

#[test]
fn what_the_log_does_not_tell_is_not_written() {
    let bench = bench(100.0);
    let report = bench.json("amplifier log.csv");
    assert!(report["fall_s"].is_null() && report["rise_s"].is_number(), "{report}");
    names(report["not_determined"][0].as_str().expect("a sentence"), &["fall_s", "record a step down to 0 V"]);
    let printed = bench.prints("amplifier log.csv");
    assert!(printed.contains("fall_s is not determined by this log") && !printed.contains("fall_s = "), "{printed}");
    let line = bench.fails("amplifier log.csv --params preset:table3-n2 --out new.toml");
    names(&line, &["log.csv", "fall_s", "record a step down to 0 V"]);
}
