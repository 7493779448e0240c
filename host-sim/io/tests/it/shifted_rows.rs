//! Rows whose cells are separated in two ways, or are separated by what is in their numbers as well.

use super::lab_files::{gives_the_samples, has, read, refused, refuses, rows, usual};

const NAMES: &str = "Time (s),HV (kV),Laser (mm)";

/// Rows of another separator behind those of the first, few or many, are neither left out nor all that is read.
#[test]
fn two_separators_are_refused() {
    let all = rows(",", '.', usual);
    let lines: Vec<&str> = all.lines().collect();
    for separator in [";", "\t", " "] {
        for from in [4, 12, lines.len() - 3, lines.len() - 2] {
            for again in ["", "\n"] {
                let (first, second) = lines.split_at(from);
                let header =
                    if again.is_empty() { String::new() } else { format!("{}\n", NAMES.replace(',', separator)) };
                let second = second.join("\n").replace(',', separator);
                let text = format!("{NAMES}\n{}\n{header}{second}\n", first.join("\n"));
                refuses(&text, "", &["separate the cells from here on"]);
            }
        }
    }
    // Lines of a preamble are no rows.
    let few = format!("1,2\n3,4\n{}\n{}", NAMES.replace(',', ";"), rows(";", '.', usual));
    gives_the_samples(few, "");
}

/// Decimal commas and thousands, where a column without a value, or without a name, has room for the cell that is too many.
#[test]
fn commas_in_numbers_are_not_shifted_into_a_spare_column() {
    let text = |header: &str, row: &dyn Fn(usize) -> String| {
        let rows: String = (0..20).map(|k| format!("{}\n", row(k))).collect();
        format!("{header}\n{rows}")
    };
    let remark = "Zeit (ms),Spannung (kV),Weg (um),Bemerkung";
    let unnamed = "Zeit (ms),Spannung (kV),Weg (um),";
    let cases = [
        text(remark, &|k| format!("{},1,{},{},", 20 * k, 300 + k, 206 + k)),
        text(remark, &|k| format!("{},1363,{},{},", 20 * k, 4 + k, 206 + k)),
        text(unnamed, &|k| format!("{},1,{},{}", 20 * k, 300 + k, 206 + k)),
        // Thousands in all rows.
        text("Time (s),HV (V),Laser (um),Status", &|k| format!("0.{k:02},1,{}.5,0.{k:02},", 300 + k)),
        // Digits behind a comma begin with 0.
        text("Zeit (ms),Spannung (kV),Weg (um),Status", &|k| format!("{},1,{:03},{}", 20 * k, 50 * k, 206 + k)),
    ];
    for case in cases {
        let error = refused(&case, "");
        assert!(["film.txt:2: ", "film.txt: line 2: "].iter().any(|place| error.contains(place)), "{error}");
        has(&error, &["shifts the values", "semicolons"]);
        // Columns that a person has chosen by their numbers are those.
        read(case, "time=1:ms,voltage=2:V,displacement=3:um").expect("chosen");
    }
    // A comma at the end of each row separates nothing.
    let numbers = rows(",", '.', |s| vec![s.time_s, s.voltage_kv, s.laser_mm, 7.0]).replace('\n', ",\n");
    gives_the_samples(format!("{NAMES},Status\n{numbers}"), "");
}
