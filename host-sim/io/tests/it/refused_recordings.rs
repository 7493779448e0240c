//! Recordings that cannot be used: the first fault is named, at its line.

use std::path::Path;

use host_io::Error;
use host_io::files::recording::Recording;

fn line_of_the_fault(csv: &str) -> (u64, String) {
    match Recording::from_csv(Path::new("film.csv"), csv.as_bytes()) {
        Err(Error::Line { line, cause, .. }) => (line, cause),
        other => panic!("{other:?}"),
    }
}

/// Lines are read ahead in blocks: a quote that is open in a later line hid the fault before it.
#[test]
fn the_first_fault_is_named() {
    let (line, cause) = line_of_the_fault("time_s,volts\n0,1\n1,\"2\n");
    assert!(line == 1 && cause.contains("voltage_v"), "{line}: {cause}");
    let (line, cause) = line_of_the_fault("time_s,voltage_v\n0,1\n1,x\n2,\"2\n");
    assert!(line == 3 && cause.contains("not a number"), "{line}: {cause}");
    let (line, cause) = line_of_the_fault("time_s,voltage_v\n0,1\n1,\"2\n");
    assert!(line == 3 && cause.contains("quote"), "{line}: {cause}");
}

/// A quote inside a field is a letter; one that begins a field opens it. Counting quotes alone, this open field took the rows
/// below it, and no fault was found.
#[test]
fn no_open_field_takes_the_rows_below() {
    let (line, cause) = line_of_the_fault("time_s,voltage_v,note\n0,1,5\" film\" a,\n1,2,5\" x,\"y\n2,3,\"z\"\n3,4,\n");
    assert!(line == 3 && cause.contains("quote"), "{line}: {cause}");
    let whole = "time_s,voltage_v,note,of\n0,1,\"a, \"\"b\"\"\",\n1,2,c\"d\"e,\"\"\n2,3,\"\"\"\",x\n";
    let recording = Recording::from_csv(Path::new("film.csv"), whole.as_bytes()).expect("every quote is closed");
    assert_eq!(recording.duration_s(), 2.0);
    assert_eq!(recording.drive().expect("a voltage").samples().value, [1.0, 2.0, 3.0]);
}

/// Programs that join files leave a byte order mark in front of another: the second one was counted as a row.
#[test]
fn byte_order_marks_are_no_line() {
    let (line, cause) = line_of_the_fault("\u{feff}\u{feff}\ntime_s,voltage_v\n0,1\n1,x\n");
    assert!(line == 4 && cause.contains("not a number"), "{line}: {cause}");
    // An open quote at the end of a line, and at the end of the file.
    for csv in ["time_s,voltage_v,note\n0,0,\n1,1,\"5 mm\n2,1,\n", "time_s,voltage_v,note\n0,0,\n1,1,\"5 mm"] {
        let (line, cause) = line_of_the_fault(csv);
        assert!(line == 3 && cause.contains("quote"), "{line}: {cause}");
    }
}
