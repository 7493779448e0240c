//! Rows without a column of times: their rate is what the preamble states beyond doubt, or a question.

use super::cut_files::Noise;
use super::lab_files::{Sample, below, gives_the_samples, has, read, refuses, rows, samples, usual};

/// The rows of the samples, at 8 Hz, below a `preamble` and names.
fn file(preamble: &str, separator: &str, decimal: char) -> String {
    let names = ["HV (kV)", "Laser (mm)"].join(separator);
    format!("{preamble}\n{names}\n{}", rows(separator, decimal, |s| vec![s.voltage_kv, s.laser_mm]))
}

/// Preambles with the rates that their question offers.
#[test]
fn a_rate_that_is_not_certain_is_a_question() {
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
        let rate = format!("`rate_hz`{rate}");
        refuses(&text, "", &["film.txt:1:", "the rate of the rows is not certain", &rate, other]);
        gives_the_samples(text, "rate=8");
    }
    // Whole numbers do not show whether the point separates thousands.
    let whole = "Abtastrate: 1.000 Hz\nHV (V);Laser (µm)\n1;2\n3;4\n5;6\n";
    refuses(whole, "", &["`rate_hz` 1 or `rate_hz` 1000"]);
}

#[test]
fn a_rate_that_is_certain_is_read() {
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
        gives_the_samples(file(preamble, &separator.to_string(), decimal), "");
    }
    // A column of times with a unit leaves no question.
    let timed = below("Time step: 3 s\nDecimation: 5\nTime (s),HV (kV),Laser (mm)", usual);
    gives_the_samples(timed, "");
}

/// Runs that an empty line or a new count separates are not one run.
#[test]
fn runs_without_times_are_a_question() {
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
            let answer = |more: &str| if head.is_empty() { format!("rate=8{more}") } else { more.to_owned() };
            refuses(&text, &answer(""), &["3 runs of rows", "`segment` 1 to 3"]);
            assert_eq!(read(&text, &answer(" segment=2")).expect("chosen").time_s().len(), 4);
            gives_the_samples(&text, &answer(" segment=3"));
        }
    }
    // Empty lines between all rows, and rows with times, are one run.
    let wide = file("Sample rate: 8 Hz", ";", '.').replace('\n', "\n\n");
    gives_the_samples(wide, "");
    let timed = rows(";", '.', usual).replacen('\n', "\n\n", 1);
    gives_the_samples(format!("Time (s);HV (kV);Laser (mm)\n{timed}"), "");
}

/// Rows of one time get none of their own where all have that one, or where another column has the rest of it.
#[test]
fn one_time_of_all_rows_gives_no_rate() {
    let all = below("Time (s);HV (kV);Laser (mm)", |s| vec![7.0, s.voltage_kv, s.laser_mm]);
    refuses(all, "repeated=spread", &["all rows have one time", "`rate_hz`"]);
    for part in ["Fractional Seconds", "stamp.nsecs", "Milliseconds (part)", "msec"] {
        let columns = |s: &Sample| vec![s.time_s.floor(), s.time_s.fract(), s.voltage_kv, s.laser_mm];
        let apart = below(&format!("Time (s);{part};HV (kV);Laser (mm)"), columns);
        refuses(apart, "columns=time=1 repeated=spread", &["the rest of it in column 2", part]);
    }
}

/// A rate that contradicts the times or the numbers of the rows, and times that no film is recorded at, are noted or refused.
#[test]
fn a_rate_that_cannot_be_right_is_noted() {
    let timed = |head: &str, time: fn(f64) -> f64| {
        below(&format!("{head},HV (kV),Laser (mm)"), |s| vec![time(s.time_s), s.voltage_kv, s.laser_mm])
    };
    let notes = |head: &str, time: fn(f64) -> f64| {
        read(timed(head, time), "").expect(head).understood().expect("a file").notes.join("; ")
    };
    has(&notes("Sample interval: 125 ms\nTime (s)", |t| 1e3 * t), &["0.008 Hz", "state 8 Hz"]);
    has(&notes("Sample rate: 8 Hz\nNo", |t| 1.0 + 160.0 * t), &["\"No\" goes from 1 to 21"]);
    has(&notes("Time (s)", |t| t / 86400.0 / 1e3), &["unusual"]);
    has(&notes("Time (s)", |t| 1e6 * t), &["unusual"]);
    assert_eq!(notes("Sample rate: 8 Hz\nTime (s)", |t| t), "");
    refuses(timed("Time (s)", |t| 1.7e12 + 1e3 * t), "", &["beyond the year 5000", "`columns`"]);
}

/// Rows of empty cells are no rows where each row has its time, and a question where it has not.
#[test]
fn rows_of_empty_cells_are_left_out_where_rows_have_times() {
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
        let [whole, with_empty] = texts.map(|text| read(text, "").expect("read"));
        assert_eq!(whole.columns(), with_empty.columns(), "{separator:?} {every}");
        let notes = with_empty.notes().join("; ");
        assert_eq!(notes.contains(&format!("empty rows are left out: {empty},")), empty > 0, "{notes}");
    }
    // In tool's own names as well; a rate alone does not show what is missing.
    let own = "time_s,voltage_v,displacement_m\n0,0,0\n,,\n0.1,100,1e-5\n0.2,200,2e-5\n";
    assert_eq!(read(own, "").expect("read").time_s(), [0.0, 0.1, 0.2]);
    let without_times = "HV (V),Laser (mm)\n0,0\n100,0.01\n,\n200,0.02\n300,0.03\n,\n";
    refuses(without_times, "rate=10", &["film.txt:4", "an empty row", "was a reading missed"]);
    refuses(b"\xff\xfe\0\0t\0\0\0", "", &["UTF-32 text; save it as UTF-8"]);
}
