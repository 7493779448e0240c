//! Rows without a column of times: their rate is what the preamble states beyond doubt, or a question.

use host_io::files::import::Hints;
use host_io::files::recording::Recording;

use super::cut_files::Noise;
use super::lab_files::{Folder, Sample, below, difference, has, hints, rows, samples, usual};

/// The rows of the samples, at 8 Hz, below a `preamble` and names.
fn file(preamble: &str, separator: &str, decimal: char) -> String {
    let names = ["HV (kV)", "Laser (mm)"].join(separator);
    format!("{preamble}\n{names}\n{}", rows(separator, decimal, |s| vec![s.voltage_kv, s.laser_mm]))
}

/// Preambles with the rates that their question offers.
#[test]
fn a_rate_that_is_not_certain_is_a_question() {
    let folder = Folder::new();
    let cases = [
        ("Sampling cycle,25 ms\nStorage cycle,5 times", " 40", "8"),
        ("Sampling cycle,25 ms\nStorage cycle,x5", " 40", "8"),
        ("Sample rate: 40 Hz\nDecimation: 5", " 40", "8"),
        ("Sample rate: 40 Hz\nSave every: 5 samples", " 40", "8"),
        ("Sample rate: 40 Hz\nSave every 5th sample", " 40", "8"),
        ("Sample rate: 40 Hz\nAveraging,5", " 40", "8"),
        ("Sample rate: 40 Hz\nLogging interval: 125 ms", " 40", "8"),
        ("Sample rate: 10 Hz\nActual sample rate: 8 Hz", " 10", "8"),
        ("Sample rate: 10 Hz\nSampling interval,125 parts", " 10", "unknown unit"),
        ("SampleRate,8,80", " 8", "80"),
        ("SampleRate,8 Hz,80 Hz", "", "several numbers"),
        ("Sampling period: 0.125", " 8", "8000"),
        ("dt,0.125", " 8", "without a unit"),
        ("Time step: 0.125 s\nSteps: 12", " 8", "not certain"),
        ("Increment: 0.125", " 8", "without a unit"),
        ("Sampling rate: 8 Hz (actual 7.5 Hz)", "", "unknown unit"),
        ("Sampling rate: 1,000 Hz", "", "several numbers"),
    ];
    for (preamble, rate, other) in cases {
        let text = file(preamble, ",", '.');
        let error = folder.refused(&text, "");
        has(&error, &["film.txt:1:", "the rate of the rows is not certain", &format!("`rate_hz`{rate}"), other]);
        let read = folder.read_with(text, "rate=8").expect(preamble);
        assert_eq!(difference(&read), None, "{preamble}");
    }
    // Whole numbers do not show whether the point separates thousands.
    let whole = "Abtastrate: 1.000 Hz\nHV (V);Laser (µm)\n1;2\n3;4\n5;6\n";
    has(&folder.refused(whole, ""), &["`rate_hz` 1 or `rate_hz` 1000"]);
}

#[test]
fn a_rate_that_is_certain_is_read() {
    let folder = Folder::new();
    let cases = [
        ("Sample rate: 8 Hz", ';', '.'),
        ("Sample rate: 8 Hz\nDecimation: 1\nAveraging: off", ';', '.'),
        ("Sample rate: 8 Hz\nSampling interval: 0.125 s\nActual sample rate: 8.00 Hz\nIncrement: 0.1 kV", ';', '.'),
        ("Sample rate: 8 Hz\nAverage voltage: 3 kV\nVoltage divider: 1000", ';', '.'),
        ("Sampling rate: 0.125 s", ';', '.'),
        ("Sample Rate,0.125,s", ',', '.'),
        ("Sample Interval,0.125\nHorizontal Units,s", ',', '.'),
        ("Abtastrate: 0,008 kHz", ';', ','),
        ("Abtastintervall;125,000;ms", ';', ','),
        ("Abtastintervall: 125.000 µs", ';', ','),
        ("Sampling interval: 125,000 µs", ';', '.'),
        ("# Sample rate 8 samples/s", ';', '.'),
    ];
    for (preamble, separator, decimal) in cases {
        let read = folder.read(file(preamble, &separator.to_string(), decimal), "");
        let recording = read.unwrap_or_else(|error| panic!("{preamble}: {error}"));
        assert_eq!(difference(&recording), None, "{preamble}");
    }
    // A column of times with a unit leaves no question.
    let timed = format!("Time step: 3 s\nDecimation: 5\nTime (s),HV (kV),Laser (mm)\n{}", rows(",", '.', usual));
    assert_eq!(difference(&folder.read(timed, "").expect("times")), None);
}

/// Runs that an empty line or a new count separates are not one run.
#[test]
fn runs_without_times_are_a_question() {
    let folder = Folder::new();
    let numbers = |columns: &str, from: usize, to: usize| -> String {
        let row = |(k, s): (usize, &Sample)| match columns {
            "" => format!("{};{}\n", s.voltage_kv, s.laser_mm),
            _ => format!("{};{};{}\n", k + 1, s.voltage_kv, s.laser_mm),
        };
        samples()[from..to].iter().enumerate().map(row).collect()
    };
    for (columns, between) in [("", "\n"), ("", "\n\n"), ("No;", ""), ("No;", "\n")] {
        for head in ["Sample rate: 8 Hz\n", ""] {
            let runs = [numbers(columns, 0, 5), numbers(columns, 5, 9), numbers(columns, 0, 24)];
            let text = format!("{head}{columns}HV (kV);Laser (mm)\n{}", runs.join(between));
            let path = folder.file("film.txt", text);
            let read = |more: &str| {
                let rate = if head.is_empty() { "rate=8" } else { "" };
                Recording::read_with(&path, &hints(&format!("{rate}{more}")))
            };
            has(&read("").expect_err("three runs").to_string(), &["3 runs of rows", "`segment` 1 to 3"]);
            assert_eq!(read(" segment=2").expect("chosen").time_s().len(), 4);
            assert_eq!(difference(&read(" segment=3").expect("chosen")), None, "{columns:?} {between:?}");
        }
    }
    // Empty lines between all rows, and rows with times, are one run.
    let wide = file("Sample rate: 8 Hz", ";", '.').replace('\n', "\n\n");
    assert_eq!(difference(&folder.read(wide, "").expect("one run")), None);
    let timed = rows(";", '.', usual).replacen('\n', "\n\n", 1);
    let timed = folder.read(format!("Time (s);HV (kV);Laser (mm)\n{timed}"), "").expect("one run");
    assert_eq!(difference(&timed), None);
}

/// Rows of one time get none of their own where all have that one, or where another column has the rest of it.
#[test]
fn one_time_of_all_rows_gives_no_rate() {
    let folder = Folder::new();
    let text =
        |head: &str, columns: &dyn Fn(&Sample) -> Vec<f64>| below(&format!("{head};HV (kV);Laser (mm)"), columns);
    let all = text("Time (s)", &|s| vec![7.0, s.voltage_kv, s.laser_mm]);
    let refused = |text: String, answer: &str| folder.read_with(text, answer).expect_err("refused").to_string();
    has(&refused(all, "repeated=spread"), &["all rows have one time", "`rate_hz`"]);
    for part in ["Fractional Seconds", "stamp.nsecs", "Milliseconds (part)", "msec"] {
        let head = format!("Time (s);{part}");
        let apart = text(&head, &|s| vec![s.time_s.floor(), s.time_s.fract(), s.voltage_kv, s.laser_mm]);
        has(&refused(apart, "columns=time=1 repeated=spread"), &["the rest of it in column 2", part]);
    }
}

/// A rate that contradicts the times or the numbers of the rows, and times that no film is recorded at, are noted or refused.
#[test]
fn a_rate_that_cannot_be_right_is_noted() {
    let folder = Folder::new();
    let noted = |text: String, words: &[&str]| {
        let read = folder.read(text.clone(), "").expect(&text);
        let notes = read.understood().expect("a file").notes.join("; ");
        has(&notes, words);
    };
    let timed = |head: &str, time: &dyn Fn(f64) -> f64| {
        format!("{head}\n{}", rows(",", '.', |s| vec![time(s.time_s), s.voltage_kv, s.laser_mm]))
    };
    let names = "Time (s),HV (kV),Laser (mm)";
    noted(timed(&format!("Sample interval: 125 ms\n{names}"), &|t| 1e3 * t), &["0.008 Hz", "state 8 Hz"]);
    noted(
        timed(&format!("Sample rate: 8 Hz\nNo,{}", &names[9..]), &|t| 1.0 + 160.0 * t),
        &["\"No\" goes from 1 to 21"],
    );
    noted(timed(names, &|t| t / 86400.0 / 1e3), &["unusual"]);
    noted(timed(names, &|t| 1e6 * t), &["unusual"]);
    let sound = folder.read(timed(&format!("Sample rate: 8 Hz\n{names}"), &|t| t), "").expect("sound");
    assert_eq!(sound.understood().expect("a file").notes, Vec::<String>::new());
    has(&folder.refused(timed(names, &|t| 1.7e12 + 1e3 * t), ""), &["beyond the year 5000", "`columns`"]);
}

/// Rows of empty cells are no rows where each row has its time, and a question where it has not.
#[test]
fn rows_of_empty_cells_are_left_out_where_rows_have_times() {
    let folder = Folder::new();
    let mut noise = Noise(3);
    for case in 0..60 {
        let separator = [',', ';', '\t'][case % 3];
        let line = |cells: [String; 3]| cells.join(&separator.to_string()) + "\n";
        let every = 1 + (10.0 * (noise.next() + 1.0)) as usize;
        let mut texts = ["", ""].map(|_| line(["Time (s)", "HV (V)", "Laser (mm)"].map(Into::into)));
        let mut empty = 0;
        for k in 0..60 {
            let row = line([0.1 * k as f64, 50.0 * k as f64, 0.01 * k as f64].map(|value| format!("{value:.3}")));
            texts.iter_mut().for_each(|text| *text += &row);
            if k % every == every - 1 {
                texts[1] += &line(["", " ", ""].map(Into::into));
                empty += usize::from(k < 59);
            }
        }
        let [whole, with_empty] = texts.map(|text| folder.read(text, "").expect("read"));
        assert_eq!(whole.columns(), with_empty.columns(), "{separator:?} {every}");
        let notes = with_empty.notes().join("; ");
        assert_eq!(notes.contains(&format!("empty rows are left out: {empty},")), empty > 0, "{notes}");
    }
    // In tool's own names as well; a rate alone does not show what is missing.
    let own = "time_s,voltage_v,displacement_m\n0,0,0\n,,\n0.1,100,1e-5\n0.2,200,2e-5\n";
    assert_eq!(folder.read(own, "").expect("read").time_s(), [0.0, 0.1, 0.2]);
    let path = folder.file("film.txt", "HV (V),Laser (mm)\n0,0\n100,0.01\n,\n200,0.02\n300,0.03\n,\n");
    let hints = Hints { rate_hz: Some(10.0), ..Hints::default() };
    let error = Recording::read_with(&path, &hints).expect_err("refused").to_string();
    has(&error, &["film.txt:4", "an empty row", "was a reading missed"]);
    has(&folder.refused(b"\xff\xfe\0\0t\0\0\0", ""), &["UTF-32 text; save it as UTF-8"]);
}
