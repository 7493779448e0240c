//! A film that changes, or is at another temperature, by order.

use host_sim::files::parameters::Parameters;
use serde_json::Value;
use tests::tool::{names, number};
use tests::virtual_board::Scene;

use crate::Linked;

/// The law follows a film that changes by order, which the board shows.
#[test]
fn adaptation_is_ordered_and_shown() {
    let board = Linked::ready(Scene::CALM);
    let off = board.json("adaptation");
    assert_eq!((&off["adapting"], &off["ageing"], &off["trip_at"]), (&"off".into(), &0.0.into(), &Value::Null));
    names(&board.fails("adaptation learn --trip-at 0"), &["--trip-at"]);
    names(&board.fails("adaptation hold --trip-at 2"), &["--trip-at", "adaptation learn"]);
    let learns = board.json("adaptation learn --trip-at 2.5");
    assert_eq!((&learns["adapting"], &learns["trip_at"]), (&"learn".into(), &2.5.into()));
    assert_eq!(number(&learns["order_factor"]), 1.0);
    for (order, adapting) in [("hold", "hold"), ("forget", "hold"), ("learn", "learn"), ("off", "off")] {
        assert_eq!(board.json(&format!("adaptation {order}"))["adapting"], adapting, "{order}");
    }
    // Nothing was learned that a board could start with.
    board.json("adaptation learn");
    board.json("adaptation keep");
    board.json("reload");
    assert_eq!(board.json("adaptation")["adapting"], "off");
}

/// The temperature of the film is ordered with the parameters that the board runs, and no others.
#[test]
fn a_temperature_is_ordered_and_shown() {
    let board = Linked::ready(Scene::CALM);
    let plain = Parameters::preset("table3-n2").expect("there").to_toml().replace("schema = 1", "schema = 5");
    let film =
        format!("{plain}[temperature]\nreference_c = 20.0\nstiffness_per_k = -0.01\nactivation_kj_per_mol = 50.0\n");
    board.bench.write("warm.toml", &film);
    board.bench.write("other.toml", film.replace("-0.01", "-0.02").replace("62740", "62741"));
    let order = |at: &str, params: &str| format!("adaptation temperature {at} --params {params} --bench");
    board.json("upload --params warm.toml --bench");
    names(&board.fails(&order("--at 30", "other.toml")), &["checksum", "upload"]);
    let ordered = board.json(&order("--at 30C", "warm.toml"));
    // k = 1 − 0.01 · 10, a = exp(E/R (1/T − 1/T₀)).
    let (stiffness, times) = (&ordered["stiffness_at_temperature"], &ordered["times_at_temperature"]);
    let is_near = |value: &Value, wanted: f64| (number(value) / wanted - 1.0).abs() < 1e-3;
    assert!(is_near(stiffness, 0.9) && is_near(times, 0.508_298), "{ordered}");
    assert_eq!((&ordered["adapting"], &ordered["ageing"]), (&"hold".into(), &0.0.into()));
    for (at, params, cause) in [
        ("--at 60", "warm.toml", "run its parameters at that temperature"),
        ("--at 300", "warm.toml", "K or °F?"),
        ("--at 30", "preset:table3-n2", "no [temperature] table"),
        ("", "warm.toml", "--at C --params P"),
    ] {
        names(&board.fails(&order(at, params)), &[cause]);
    }
    for option in ["--at 30", "--params warm.toml"] {
        names(&board.fails(&format!("adaptation hold {option}")), &["--at", "adaptation temperature"]);
    }
    for (verb, other) in
        [("adaptation hold", "--params"), ("play profile.csv --out o.csv", "--params"), ("upload --blob b", "--blob")]
    {
        names(&board.fails(&format!("{verb} --temperature 30")), &[other]);
    }
    assert_eq!(&board.json("adaptation")["stiffness_at_temperature"], stiffness);
    // What is kept leaves the parameters those of the file.
    board.json("adaptation keep");
    board.json("reload");
    board.json(&order("--at 25", "warm.toml"));
    assert_eq!(board.json("adaptation off")["stiffness_at_temperature"], 1.0);
}

/// A run whose film is softer than the parameters says so at its end, where the law follows it.
#[test]
fn a_film_that_has_changed_is_reported() {
    let board = Linked::ready(Scene::CALM);
    let film = Parameters::preset("table3-n2").expect("there").to_toml();
    let stiffer = |line: &str| match line.split_once("c = ") {
        Some((before, rest)) => {
            let (c, after) = rest.split_once(',').expect("an order follows");
            format!("{before}c = {}, {after}", 1.25 * c.parse::<f64>().expect("a number"))
        }
        None => line.to_owned(),
    };
    let film: Vec<String> = film.lines().map(stiffer).collect();
    board.bench.write("stiffer.toml", film.join("\n"));
    board.json("upload --params stiffer.toml --bench");
    let reference: String =
        (0..150).map(|k| format!("{},{}\n", 0.1 * f64::from(k), 2e-4 * (1.0 - (f64::from(k) * 0.1).cos()))).collect();
    board.bench.write("sine.csv", format!("time_s,displacement_m\n{reference}"));
    let play = "play sine.csv --mode tracking --out out.csv";
    assert_eq!(board.json(&format!("{play} --duration 1"))["adaptation"], Value::Null);
    board.json("adaptation learn");
    let played = board.json(play);
    let change = number(&played["adaptation"]["stiffness_change"]);
    assert!((change + 0.2).abs() < 0.05, "{played}");
    names(&board.prints("adaptation"), &["% softer than its parameters", "its load"]);
    // What was kept is in use where the board starts again with what it has stored; not after it was kept that nothing was learned.
    board.json("adaptation keep");
    board.json("reload");
    let restarted = board.json("adaptation");
    let scale = |film: &Value| number(&film["force_scale"]);
    assert_eq!(restarted["adapting"], "hold");
    assert!((scale(&restarted) / scale(&played["adaptation"]) - 1.0).abs() < 1e-3, "{restarted}");
    for order in ["off", "keep"] {
        board.json(&format!("adaptation {order}"));
    }
    board.json("reload");
    assert_eq!(board.json("adaptation")["adapting"], "off");
}
