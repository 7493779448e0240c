//! Recordings: CSV text.

use std::path::Path;

use host_io::Error;
use host_io::files::recording::{Input, Recording};

use crate::place::{PATH, line_of};

/// Reads `data` as a recording. What is read has a row for every line of the text; what is refused names the first line that
/// cannot be used, and the lines before it can. Returns whether
/// it was read.
pub fn run(data: &[u8]) -> bool {
    let lines = lines(data);
    match read(data) {
        Ok(recording) => {
            let rows = lines.iter().filter(|line| is_record(line)).count() - 1;
            // No line is swallowed by another.
            assert_eq!(recording.time_s().len(), rows, "rows and lines");
            is_in_order(&recording);
            true
        }
        Err(error) => {
            if let Some(line) = line_of(&error) {
                let line = usize::try_from(line).expect("a line");
                // The place of a missing header is behind the last line.
                assert!((1..=lines.len() + 1).contains(&line), "{error}, of {} lines", lines.len());
                is_the_first_fault(&lines, line, &error);
            }
            false
        }
    }
}

fn read(csv: &[u8]) -> Result<Recording, Error> {
    Recording::from_csv(Path::new(PATH), csv)
}

/// Lines with their ends: `\n`, `\r` or both.
fn lines(text: &[u8]) -> Vec<&[u8]> {
    let mut lines = Vec::new();
    let mut rest = text;
    while let Some(behind) = rest.strip_prefix(b"\xef\xbb\xbf") {
        rest = behind;
    }
    while !rest.is_empty() {
        let end = rest.iter().position(|byte| b"\r\n".contains(byte)).map_or(rest.len(), |at| at + 1);
        let end = if rest[..end].ends_with(b"\r") && rest.get(end) == Some(&b'\n') { end + 1 } else { end };
        let (line, later) = rest.split_at(end);
        lines.push(line);
        rest = later;
    }
    lines
}

/// Blank lines and comments are not.
fn is_record(line: &[u8]) -> bool {
    !matches!(String::from_utf8_lossy(line).trim().chars().next(), None | Some('#' | '%'))
}

fn is_in_order(recording: &Recording) {
    assert!(recording.time_s().windows(2).all(|pair| pair[0] < pair[1]), "times rise");
    assert!(recording.duration_s() > 0.0 && recording.duration_s().is_finite());
    let drive = recording.drive();
    let drive = match &drive {
        Ok(Input::Voltage(samples) | Input::Force(samples) | Input::Displacement(samples)) => Some(samples),
        Err(error) => {
            line_of(error);
            None
        }
    };
    let displacement = recording.displacement();
    for samples in drive.into_iter().chain(displacement.as_ref().ok()).chain(recording.force().as_ref()) {
        assert_eq!(samples.time_s.len(), samples.value.len());
        // No unit of a column is larger than 1000, no value larger than 1e15.
        assert!(samples.value.iter().all(|value| value.abs() <= 1e18), "numbers that no instrument reads");
    }
}

/// The text up to that line is refused for it as well, and the text before it for nothing but its length.
fn is_the_first_fault(lines: &[&[u8]], line: usize, error: &Error) {
    let before = lines[..line - 1].concat();
    if lines[..line - 1].iter().any(|line| is_record(line)) {
        match read(&before) {
            Ok(_) => {}
            Err(earlier) => assert_eq!(line_of(&earlier), None, "{error}, but without that line {earlier}"),
        }
    }
    let with = lines[..line.min(lines.len())].concat();
    let again = read(&with).expect_err("its last line is refused");
    assert_eq!(again.to_string(), error.to_string());
}
