//! Files that are no recordings, or damaged ones.

use std::fs;

use crate::lab_files::{fixture, has, latin_1, read, read_fixture, refuses, rows, usual, utf_16};

/// One line with the cause, no panic.
#[test]
fn hostile_files_are_refused_with_their_cause() {
    refuses("", "", &["is empty", "time_s"]);
    refuses("Film 3\nOperator;AB\n\n", "", &["no rows of numbers", "Film 3"]);
    refuses("Time (s);U (kV)\n0;0\n", "", &["1 data row;"]);
    refuses("Time (s);U (kV)\n0;0\n1;2\n1;3\n", "", &["film.txt:4:", "does not increase"]);
    refuses("Time (s);U (kV)\n0;0\n1;2\n0,5;3\n", "", &["film.txt:4:", "backwards"]);
    refuses("Time (s);U (kV)\n0;0\n1;2\nNaN;3\n", "", &["film.txt:4:", "every row needs its time"]);
    refuses("Time (s);U (kV)\n0;0\n1;2\n2;high\n", "", &["film.txt:4:", "high", "not a number"]);
    refuses("Time (s);U (kV)\n0;0\n1;2\n2;1e200\n", "", &["film.txt:4:", "no instrument"]);
    refuses("Time (s);U (kV)\n0;0\n1;2\n2;3\n3\n", "", &["film.txt:5:", "ends before U (kV)"]);
    refuses("Time (s);U (kV)\n0.5;1\n1;2,5\n2;3\n", "", &["decimal points and decimal commas"]);
    refuses("frequency;gain\n1;2\n3;4\n", "", &["film.txt:1:", "time_s", "frequency", "gain"]);
    refuses(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1old", "", &["spreadsheet", ".xlsx"]);
    refuses(b"%PDF-1.7", "", &["PDF"]);
    refuses(b"\x1f\x8b\x08", "", &["gzip"]);
    refuses("{\"time\":[0,1]}", "", &["JSON"]);
    refuses("# Created by Octave 7.3.0\n# name: t\n", "", &["Octave", "save -v7"]);
    refuses("<?xml version=\"1.0\"?>", "", &["XML"]);
    refuses([7, 0, 3, 1].repeat(100), "", &["not text"]);
    has(&read_fixture("archive.zip", "").expect_err("no book").to_string(), &["ZIP", ".xlsx"]);
    has(&read_fixture("lengths.mat", "").expect_err("lengths").to_string(), &["24 numbers", "20"]);
    let single = format!(
        "Sampling Period (s),0.125,\nWaveform Data,\n{}",
        rows(",\n", '.', |s| vec![s.voltage_kv]).replace('\n', ",\n")
    );
    let recording = read(single, "voltage=1:kV").expect("one column and the ends of its rows");
    assert_eq!(recording.duration_s(), 23.0 / 8.0);
    // A gap in what is measured is a gap; in what drives it is an error.
    let gap = read("Time (s);U (kV);x (mm)\n0;0;1\n1;1;NaN\n2;2;\n3;3;4\n", "").expect("read");
    assert_eq!(gap.displacement().expect("two").time_s, [0.0, 3.0]);
    let error = read("Time (s);U (kV);x (mm)\n0;0;1\n1;;2\n2;NaN;3\n", "").expect("read").drive();
    has(&error.expect_err("a gap").to_string(), &["film.txt:3:", "U (kV) is empty"]);
}

/// Lines of nothing but quotes or a sign of comments, anywhere above the rows.
#[test]
fn lines_without_a_cell_above_the_rows_are_passed_over() {
    let numbers = rows(" ", '.', |s| vec![s.time_s, s.voltage_kv, s.laser_mm]);
    for line in ["\"\"", "\"\" \"\"", "#", "''", "\t", "\"\"\n\"\""] {
        for text in [
            format!("{line}\nTime_s HV_kV laser_mm\n{numbers}"),
            format!("Time_s HV_kV laser_mm\n{line}\n{numbers}"),
            format!("Time_s HV_kV laser_mm\n{numbers}{line}\nTime_s HV_kV laser_mm\n{numbers}"),
            format!("{line}\n{numbers}"),
        ] {
            // Read or refused, in one line.
            if let Err(error) = read(text, "") {
                assert_eq!(error.to_string().lines().count(), 1, "{error}");
            }
        }
        let text = format!("{line}\nTime_s HV_kV laser_mm\n{numbers}");
        assert!(read(text, "").is_ok_and(|read| read.duration_s() > 2.0) || line.starts_with('\''), "{line}");
    }
}

/// Every beginning of a file of MATLAB and of a workbook, and every byte changed: an answer, never a panic.
#[test]
fn damaged_binary_files_never_panic() {
    let mut refused = 0;
    let names = "vectors.mat compressed.mat version-4.mat structure.mat matrix.mat matrix-7.3.mat workbook.xlsx";
    for name in names.split(' ') {
        let whole = fs::read(fixture(name)).expect("committed");
        for end in (0..whole.len()).step_by(29) {
            refused += usize::from(read(&whole[..end], "").is_err());
        }
        for at in (0..whole.len()).step_by(17) {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x81;
            refused += usize::from(read(&damaged, "").is_err());
        }
    }
    assert!(refused > 200, "{refused}");
}

/// Text with any byte changed, or cut anywhere: an answer, never a panic, and what is read has times that rise.
#[test]
fn damaged_text_never_panics() {
    let german = format!("Film 3\nZeit [s];U [kV];\"Laser, µ\" (mm)\n{}", rows(";", ',', usual));
    let texts =
        [german.clone().into_bytes(), latin_1(&german), utf_16(&german, true), rows(" ", '.', usual).into_bytes()];
    let (mut sound, mut refused) = (0, 0);
    for text in &texts {
        for (k, change) in
            (0..text.len()).step_by(5).zip([b';', b',', b'"', b'\n', b'\r', b'-', 0xff, 0, b'.', 0xb5].iter().cycle())
        {
            let mut damaged = text.clone();
            damaged[k] = *change;
            for content in [&damaged[..], &text[..k]] {
                match read(content, "") {
                    Ok(recording) => {
                        assert!(recording.time_s().windows(2).all(|pair| pair[0] < pair[1]));
                        sound += 1;
                    }
                    Err(error) => {
                        assert_eq!(error.to_string().lines().count(), 1, "{error}");
                        refused += 1;
                    }
                }
            }
        }
    }
    assert!(sound > 50 && refused > 50, "{sound} {refused}");
}
