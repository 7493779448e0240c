//! Rows that could be read wrong without a warning, and sound ones of the same kinds.

use std::f64::consts::TAU;

use super::lab_files::{has, read, refuses};

const ROWS: usize = 60;

/// Volts and millimetres of row `k` of a film.
fn film(k: usize, scale: f64) -> String {
    let phase = 1.0 - (TAU * k as f64 / ROWS as f64).cos();
    format!("{:.1};{:.4}", 1500.0 * phase, 0.01 + scale * phase)
}

/// Seconds of row `k`.
fn at(k: usize) -> String {
    format!("{:.2}", 0.01 * k as f64)
}

fn text(header: &str, row: impl Fn(usize) -> String) -> String {
    let rows: String = (0..ROWS).map(|k| format!("{}\n", row(k))).collect();
    format!("{header}\n{rows}")
}

/// A row of the usual columns, and what is behind them.
fn with(k: usize, end: &str) -> String {
    format!("{};{}{end}", at(k), film(k, 0.3))
}

const USUAL: &str = "Time (s);HV (V);Laser (mm)";
const FILM: &str = "Time (s);Film;HV (V);Laser (mm)";

/// Two films in the rows, the second of which has another stroke.
fn two(k: usize, names: [&str; 2]) -> String {
    format!("{};{};{}", at(k), names[k % 2], film(k, [0.3, 0.1][k % 2]))
}

#[test]
fn rows_of_fewer_cells_are_refused() {
    let four = format!("{USUAL};T (°C)");
    let lost = |k: usize| match k {
        30 => format!("{};1.5;22.5", at(k)),
        _ => with(k, ";22.5"),
    };
    // Two numbers become one.
    let merged = |k: usize| if k == 30 { with(k, "22") } else { with(k, ";22") };
    let slow_laser = |k: usize| {
        if k.is_multiple_of(4) { with(k, ";22.5") } else { format!("{};{:.1};22.5", at(k), 10.0 * k as f64) }
    };
    for text in [text(&four, lost), text(&four, merged)] {
        for separator in [";", ",", "\t"] {
            let words = ["film.txt: line 32: ", "3 cells, and most rows have 4", "between its separators"];
            refuses(text.replace(';', separator), "", &words);
        }
    }
    let glued = text(&four, |k| if k == 30 { with(k, "22.5") } else { with(k, ";22.5") });
    refuses(glued, "", &["film.txt:32: ", "not a number"]);
    let own = text("time_s;voltage_v;displacement_mm;temp_c", lost).replace(';', ",");
    refuses(own, "", &["film.txt: line 32: ", "3 cells"]);
    refuses(text(&four, slow_laser), "", &["film.txt: line 3: ", "as those in column 4"]);
}

#[test]
fn rows_of_several_films_are_refused() {
    for (name, names) in [
        ("Film", ["A", "B"]),
        ("Film", ["1", "2"]),
        ("Sensor ID", ["1", "2"]),
        ("Type", ["SET", "ACT"]),
        ("Probe", ["left", "right"]),
        ("Wert", ["7", "3"]),
    ] {
        let words = ["film.txt: line 3: ", name, names[0], names[1], "alternates", "remove this column"];
        refuses(text(&FILM.replace("Film", name), |k| two(k, names)), "", &words);
    }
    let one = |k: usize| format!("{};{};{}", at(k), ["HV", "Laser"][k % 2], [1500.0, 0.01][k % 2]);
    refuses(text("Time (s);Variable;Voltage (V)", one), "", &["\"Variable\" alternates"]);
}

#[test]
fn dates_beside_times_are_not_ignored() {
    let jump = |days: [&'static str; 2]| move |k: usize| format!("{};{}", days[k / 30], with(k, ""));
    let on_clock =
        |days: [&'static str; 2]| move |k: usize| format!("{};10:00:{:02};{}", days[k / 30], k, film(k, 0.3));
    let dates = ["24.11.2026", "25.11.2026"];
    for (name, text) in [
        ("Day", text(&format!("Day;{USUAL}"), jump(["1", "2"]))),
        ("Datum", text(&format!("Datum;{USUAL}"), jump(dates))),
        ("Date", text("Date;Time;HV (V);Laser (mm)", on_clock(dates))),
        ("日期", text("日期;Time;HV (V);Laser (mm)", on_clock(dates))),
    ] {
        refuses(&text, "", &["film.txt: line 32: ", name, "midnight", "2026-11-24 10:00:01", "time=2"]);
        assert!(read(&text, "time=2").is_ok(), "{name}");
    }
}

#[test]
fn times_and_names_that_are_doubtful_are_questions() {
    let counted = text(&format!("{USUAL};"), |k| format!("{};{}", k + 1, with(k, "")));
    refuses(counted, "", &["film.txt: line 2: ", "counts the rows", "`columns`"]);
    let hours = text("Time (h:min);HV (V);Laser (mm)", |k| format!("10:00.{:06};{}", 167 * k, film(k, 0.3)));
    refuses(hours, "", &["film.txt: line 2: ", "hours and minutes"]);
    let thirds = |k: usize| format!("10:00:{:02}.{};{}", k / 3, ["21", "354", "688"][k % 3], film(k, 0.3));
    refuses(text("Time;HV (V);Laser (mm)", thirds), "", &["milliseconds without leading zeros"]);
    let logged = text("asctime,Laser (µm),HV (V),note", |k| {
        format!("2026-11-24 10:{:02}:00,{},{:.1},{k}.5", k, 100 + k, 13.0 + k as f64)
    });
    refuses(logged, "", &["film.txt: line 2: ", "decimal comma", "`columns`"]);
}

#[test]
fn a_status_of_a_few_rows_and_a_change_of_the_gain_are_noted() {
    for (good, bad) in [("OK", "ERR"), ("OK", "error 12"), ("Good", "Bad"), ("ok", "overrange"), ("gültig", "Fehler 3")]
    {
        let text = text(&format!("{USUAL};Status"), |k| {
            with(k, &format!(";{}", if (40..43).contains(&k) { bad } else { good }))
        });
        let notes = read(text, "").expect("read").notes().join("; ");
        let shown = if ["ERR", "overrange"].contains(&bad) { "an error" } else { bad };
        has(&notes, &["\"Status\"", shown, "3 rows", "line 42", "`blank`"]);
    }
    // A change of the gain.
    for (name, before, after) in [("Gain", "x1", "x10"), ("Sensitivity", "1", "10"), ("Verstärkung", "1", "2")] {
        let text = |first: &'static str| {
            text(&format!("{USUAL};{name}"), |k| with(k, &format!(";{}", if k < 40 { first } else { after })))
        };
        let notes = read(text(before), "").expect("read").notes().join("; ");
        has(&notes, &[&format!("{name:?}"), &format!("from {before} to {after}"), "line 42"]);
        assert_eq!(read(text(after), "").expect("read").notes().join("; ").find("changes"), None);
    }
    // A log of this project: the force scale is of its law.
    let log = text("time_s,voltage_v,displacement_m,force_scale", |k| {
        format!("{},{},{}e-6,{}", 0.1 * k as f64, 13 * k, k, 1.0 - 1e-3 * k as f64)
    });
    assert_eq!(read(log, "").expect("read").notes(), Vec::<String>::new());
}

/// Files of the same kinds in which nothing is doubtful.
#[test]
fn sound_rows_are_read_without_a_question() {
    let pick = |k: usize, every: usize, is: &'static str| if k.is_multiple_of(every) { is } else { "" };
    let midnight = |k: usize, day: &str| {
        let of_day = (86370 + k) % 86400;
        format!("{day};{:02}:{:02}:{:02};{}", of_day / 3600, of_day / 60 % 60, of_day % 60, film(k, 0.3))
    };
    let step = |k: usize| format!("{};{};0.0{}", at(k), 3000 * (k / 10 % 2), k / 10 % 2);
    let cases = [
        // A channel at the end that is logged more slowly, remarks in a few rows or in most, and ends without a separator.
        text(&format!("{USUAL};T (°C)"), |k| with(k, pick(k, 4, ";22.5"))),
        text(&format!("{USUAL};Note"), |k| with(k, pick(k, 20, ";start"))),
        text(&format!("{USUAL};Note"), |k| with(k, if k % 5 == 0 { "" } else { ";ok" })),
        text(&format!("{USUAL};"), |k| with(k, if k == 30 { "" } else { ";" })),
        // Cycles, directions, ranges, flags, a staircase and states of a step.
        text(&format!("{USUAL};Cycle"), |k| with(k, &format!(";{}", k / 8))),
        text(&format!("{USUAL};Direction"), |k| with(k, [";up", ";down"][k / 30])),
        text(&format!("{USUAL};Direction"), |k| with(k, [";up", ";down"][k % 2])),
        text(&format!("{USUAL};Range"), |k| with(k, [";1", ";2", ";1"][k / 20])),
        text(&format!("{USUAL};Alarm"), |k| with(k, if k == 30 { ";1" } else { ";0" })),
        text(&format!("{USUAL};Signal"), |k| with(k, &format!(";{}", k % 3))),
        text(&format!("{USUAL};T (°C)"), |k| with(k, &format!(";{}", 22 + k * k % 7 / 4))),
        text(&format!("{USUAL};Phase"), |k| format!("{};{}", step(k), ["rest", "hold"][k / 10 % 2])),
        text(&format!("{USUAL};Target"), |k| format!("{};{};0.1;{}", at(k), 1000 * (k % 4), 1000 * (k % 4))),
        text(FILM, |k| format!("{};A;{}", at(k), film(k, 0.3))),
        text(USUAL, |k| with(k, "")).replace(';', "|").replacen('\n', "\n---|:--:|---\n", 1),
        // Dates that do not change, or at midnight, alone or with the times.
        text(&format!("Date;{USUAL}"), |k| format!("24.11.2026;{}", with(k, ""))),
        text("Date;Time;HV (V);Laser (mm)", |k| midnight(k, ["24.11.2026", "25.11.2026"][k / 30])),
        text("Day;Time;HV (V);Laser (mm)", |k| midnight(k, ["30", "1"][k / 30])),
        text(&format!("Day;{USUAL}"), |k| format!("{};{};{}", 1 + k / 24, 3600 * k, film(k, 0.3))),
        text(&format!("{USUAL};Data"), |k| with(k, &format!(";{}", 0.5 * (k % 7) as f64))),
        // Rows each second with numbers from 1, times without zeros at their ends, and minutes with seconds.
        text(USUAL, |k| format!("{};{}", k + 1, film(k, 0.3))),
        text("Time;HV (V);Laser (mm)", |k| format!("10:00:{:02}.{};{}", k / 4, [1, 25, 5, 75][k % 4], film(k, 0.3))),
        text("Time;HV (V);Laser (mm)", |k| {
            format!("10:00:{:02}.{};{}", k / 4, [125, 375, 625, 875][k % 4], film(k, 0.3))
        }),
        text("Time (min:s);HV (V);Laser (mm)", |k| format!("10:{:02}.5;{}", k, film(k, 0.3))),
    ];
    for case in cases {
        let recording = read(&case, "").unwrap_or_else(|error| panic!("{error}\n{}", &case[..120]));
        assert_eq!(recording.time_s().len(), ROWS);
        // Rows an hour apart are unusual.
        let notes: Vec<&String> = recording.notes().iter().filter(|note| !note.contains("unusual")).collect();
        assert!(notes.is_empty(), "{notes:?}: {}", &case[..120]);
    }
}
