//! Advice does what it says: numbers that are found again, drop-outs without the rests, sensors and units that are asked for.

use std::fmt::Write;

use host_io::files::import::{Blank, Edits};
use host_io::files::recording::Recording;

use super::lab_files::{has, read, refuses, save};

/// A film of 3 kV for 30 s at 20 Hz between rests, with the readings that `displacement` writes.
fn table(header: &str, displacement: impl Fn(usize) -> String) -> String {
    let mut text = format!("{header}\n");
    for k in 0..600 {
        let volts = if (k / 100) % 2 == 1 { 3000.0 } else { 0.0 };
        writeln!(text, "{:.2},{volts},{}", 0.05 * k as f64, displacement(k)).expect("written");
    }
    text
}

/// Codes of any digits are emptied by what is advised, of single precision as well.
#[test]
fn a_code_is_advised_as_it_is_read() {
    let mut codes =
        [-999.999_9, -99.999_98, 9_999.999_9, 21.474_836_47, -1.0].map(|code: f64| code.to_string()).to_vec();
    codes.push(f64::from(-99.999_9_f32).to_string());
    for code in codes {
        let film = |k: usize| 0.5 + 0.2 * (0.02 * k as f64).sin() + if k.is_multiple_of(2) { 1e-3 } else { 0.0 };
        let text =
            table(
                "Time (s),HV (V),Laser (mm)",
                |k| if k % 150 == 77 { code.clone() } else { format!("{:.4}", film(k)) },
            );
        let recording = read(&text, "").expect("read");
        let advice = recording.drop_outs().expect("drop-outs").to_string();
        let blank: Blank = advice.split("`blank` ").nth(1).expect("advice").parse().expect("a number");
        let (series, emptied) =
            recording.into_series().edited(&Edits { blanks: vec![blank], ..Edits::NONE }, None).expect("rows");
        assert_eq!(emptied, 4, "{advice}");
        assert!(series.understood.notes.is_empty(), "{:?}", series.understood.notes);
    }
}

/// A number that is not there, and one that a rest has as well, are noted.
#[test]
fn what_blank_empties_too_much_or_not_at_all_is_noted() {
    let text = table("Time (s),HV (V),Laser (mm)", |k| format!("{:.4}", 0.001 * k as f64));
    let noted = |blank: &str| {
        let edits = Edits { blanks: vec![blank.parse().expect("a blank")], ..Edits::NONE };
        let series = read(&text, "").expect("read").into_series();
        series.edited(&edits, None).expect("rows").0.understood.notes.join("; ")
    };
    has(&noted("displacement=-1"), &["displacement empties nothing", "no number is -1"]);
    has(&noted("voltage:100..200"), &["voltage empties nothing", "from 100 to 200 s"]);
    has(&noted("voltage=0"), &["the voltage empties 4.95 s in one piece", "voltage:12.5..13"]);
    assert!(noted("voltage:5..5.2").is_empty() && noted("5..5.2").is_empty(), "{}", noted("voltage:5..5.2"));
    for wrong in ["voltage:5", "voltage:6..5", "strain:1..2", "voltage:a..b"] {
        has(&wrong.parse::<Blank>().expect_err(wrong), &[wrong, "voltage:12.5..13"]);
    }
}

/// A machine's displacement beside a sensor in volts, and a temperature in another unit, are questions.
#[test]
fn another_sensor_and_another_unit_are_questions() {
    let beside = |names: &str| {
        let mut text = format!("Time (s),HV (V),{names}\n");
        for k in 0..60 {
            writeln!(text, "{:.1},{},{:.3},{:.3}", 0.1 * k as f64, 50 * k, 0.01 * k as f64, 25.0 + 0.01 * k as f64)
                .expect("written");
        }
        text
    };
    for names in ["Position (mm),Laser (V)", "Extensometer (mm),Laser (V)", "Travel (mm),Displacement (V)"] {
        refuses(beside(names), "", &["may be the displacement", "displacement=3", "displacement=4:mm*NUMBER"]);
        read(beside(names), "displacement=3").expect("chosen");
    }
    for names in ["Stroke (mm),Laser (V)", "Position (mm),Position raw (V)", "Laser (mm),Laser (V)"] {
        read(beside(names), "").expect(names);
    }
    for unit in ["(°F)", "[K]", "(0.1 °C)", "(V)"] {
        let text = beside(&format!("Laser (mm),Temperature {unit}"));
        refuses(&text, "temperature=4", &["is not in °C", "temperature=4*1"]);
    }
    for title in ["Temperature (°C)", "Temperature (film)", "Temp"] {
        read(beside(&format!("Laser (mm),{title}")), "temperature=4").expect(title);
    }
}

/// Nothing but what was written here is written over; columns without a reading are named.
#[test]
fn raw_files_and_empty_columns_are_recognised() {
    let raw = save("raw.csv", "Time (s),HV (V)\n0,1\n");
    let own = save("own.csv", "time_s,voltage_v\n0,1\n");
    assert!(Recording::is_foreign(&raw) && !Recording::is_foreign(&own));
    assert!(!Recording::is_foreign(&raw.with_file_name("none.csv")) && !Recording::is_foreign(&save("new.csv", "")));
    let text = table("Time (s),HV (V),Laser (mm)", |_| String::new());
    let doubt = read(text, "").expect("read").doubtful_response().expect("a doubt");
    has(&doubt, &["column 3 \"Laser (mm)\" has no reading", "formulas"]);
    let text = "time_s,voltage_v,displacement_m\n0,0,0\n1,0,1e-4\n2,0,0\n";
    has(&read(text, "").expect("read").doubtful_response().expect("a doubt"), &["voltage is 0 in all rows"]);
}
