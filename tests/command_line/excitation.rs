//! `profile` and `check`: voltages that identify a film, and whether recordings do.

use tests::tool::{Bench, names, number, rows};

use crate::TOOL;

/// A folder with the board of a film that is not fitted yet. 4.2e7 V/m on 100 µm are 4200 V, below the 6000 V of the amplifier.
fn bench() -> Bench {
    let bench = Bench::new(TOOL);
    bench.write("board.toml", include_str!("cases/profile.in/board.toml"));
    bench
}

#[test]
fn a_profile_keeps_the_limits_of_its_board() {
    let bench = bench();
    let report = bench.json("profile --board board.toml --out profile.csv");
    assert_eq!((&report["limit"], &report["peak_v"]), (&"max_field_v_per_m".into(), &3780.0.into()));
    let [time, voltage] = ["time_s", "voltage_v"].map(|title| bench.column("profile.csv", title));
    assert!(voltage.iter().all(|volts| (0.0..=3780.0).contains(volts)));
    let slew = voltage.windows(2).map(|pair| (pair[1] - pair[0]).abs() * 100.0).fold(0.0, f64::max);
    assert!(slew <= 5000.0 && slew > 1000.0, "{slew}");
    // 5 s of rest, then V/2 (1 - cos 2 pi f t) of 0.2 Hz.
    let at = |t: f64| voltage[time.iter().position(|time| (time - t).abs() < 1e-9).expect("a row")];
    assert!(voltage[..=500].iter().all(|volts| *volts == 0.0));
    assert!((at(6.25) - 1890.0).abs() < 1e-6 && (at(7.5) - 3780.0).abs() < 1e-6 && at(10.0).abs() < 1e-6);
    // A hold of a minute at one voltage, and rest at the end.
    let held = voltage.iter().filter(|volts| (**volts - 0.8 * 3780.0).abs() < 1e-9).count();
    assert!((6000..=6200).contains(&held), "{held}");
    assert_eq!(voltage.last(), Some(&0.0));
}

/// The file that the page shows to copy makes a profile, within its own limit: 3.5e7 V/m on 100 µm.
#[test]
fn the_bench_file_of_the_page_makes_a_profile() {
    let page = include_str!("../../docs/matlab.md");
    let (_, toml) = page.split_once("```toml\n# bench.toml\n").expect("the page shows it");
    let (toml, _) = toml.split_once("```").expect("the block ends");
    let bench = bench();
    bench.write("bench.toml", toml);
    let report = bench.json("profile --board bench.toml --out profile.csv");
    assert_eq!((&report["limit"], &report["peak_v"]), (&"max_field_v_per_m".into(), &3150.0.into()), "{report}");
    assert!(report.get("notes").is_none(), "{report}");
    // Without the limits they are those of the paper's bench, which is reported.
    let (film, _) = toml.split_once("[board.limits]").expect("limits");
    bench.write("film.toml", film);
    let report = bench.json("profile --board film.toml --out profile.csv");
    names(&report["notes"].to_string(), &["no [board.limits]", "the paper's bench", "4200 V"]);
}

/// The whole way: a profile, played to a film, identifies it: the fit predicts another voltage of another frequency.
#[test]
fn what_a_profile_excites_identifies_a_film() {
    let bench = bench();
    bench.prints("profile --board board.toml --out profile.csv");
    let simulate = "simulate --params preset:table3-n2 --rate 100";
    bench.prints(&format!("{simulate} --profile profile.csv --out recording.csv"));
    let (report, identifies) = bench.answers("check recording.csv");
    assert!(report["identifies"] == true && identifies && rows(&report["findings"]).is_empty(), "{report}");
    let drive = &report["recordings"][0]["drive"];
    let frequencies: Vec<f64> = rows(&drive["frequencies_hz"]).iter().map(number).collect();
    assert_eq!(frequencies.len(), 3, "{drive}");
    for (found, made) in frequencies.iter().zip([0.077, 0.14, 0.2]) {
        assert!((found / made - 1.0).abs() < 0.02, "{found} {made}");
    }
    assert!((number(&drive["rest_s"]) - 5.0).abs() < 0.3, "{drive}");
    assert!((number(&drive["hold_s"]) - 61.0).abs() < 2.0, "{drive}");
    let words = ["these recordings identify a film", "cycles of 0.0770, 0.1400, 0.2000 Hz"];
    names(&bench.prints("check recording.csv"), &words);

    let structure = "--topology eq11 --branches 2 --curve none";
    bench.json(&format!("fit recording.csv --out film.toml --actuator preset:table3-n2 {structure}"));
    let volts = |t: f64| if t < 1.0 { 0.0 } else { 1250.0 * (1.0 - (std::f64::consts::TAU * 0.1 * (t - 1.0)).cos()) };
    let times = (0..=6000).map(|k| 0.01 * f64::from(k));
    bench.write_table("voltage.csv", "time_s,voltage_v", times.map(|t| format!("{t},{}", volts(t))));
    bench.json(&format!("{simulate} --memory full --precision f64 --profile voltage.csv --out other.csv"));
    let report = bench.json("replay --params film.toml --rate 100 other.csv");
    let nrmse_pct = number(&report["recordings"][0]["nrmse_pct"]);
    assert!(nrmse_pct < 0.5, "{nrmse_pct} %");
}

/// The committed recordings: three frequencies of one amplitude together, one frequency alone.
#[test]
fn recordings_are_judged_together() {
    let bench = bench();
    let files = bench.recordings("wang");
    let report = bench.json(&format!("check {files}"));
    assert_eq!(report["identifies"], true, "{report}");
    names(&report["findings"].to_string(), &["one amplitude only"]);
    let report = bench.says_no("check wang-5s.csv");
    assert_eq!(report["identifies"], false, "{report}");
}
