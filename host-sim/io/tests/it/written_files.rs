//! Files of random dialects, written here: each is read as it was written, or is asked about where its numbers can be read in two ways.

use std::path::Path;

use host_io::files::import::Hints;
use host_io::files::recording::Recording;
use proptest::prelude::*;
use proptest::sample::select;

use super::lab_files::{latin_1, save, utf_16};

/// How a file is written.
#[derive(Clone, Debug)]
struct Dialect {
    separator: &'static str,
    comma: bool,
    /// Between groups of three digits.
    group: &'static str,
    minus: &'static str,
    /// Around each number.
    quotes: (&'static str, &'static str),
    /// Digits behind the decimal sign of each column.
    digits: [usize; 3],
    preamble: &'static str,
    line_end: &'static str,
    encoding: usize,
    /// Where the unit is: in the name, or in a row below.
    unit_row: bool,
    style: fn(&str, &str) -> String,
    /// Which of time, voltage and displacement each column is; the fourth is another.
    order: Vec<usize>,
    /// Names and units with their factors to SI.
    titles: [(&'static str, (&'static str, f64)); 3],
}

fn dialect() -> impl Strategy<Value = Dialect> {
    let styles: Vec<fn(&str, &str) -> String> = vec![
        |name, unit| format!("{name} ({unit})"),
        |name, unit| format!("{name} [{unit}]"),
        |name, unit| format!("{name}/{unit}"),
        |name, unit| format!("{name}_{unit}"),
        |name, unit| format!("{name} in {unit}"),
        |name, unit| format!("\"{name}, {unit}\""),
    ];
    let time = (
        select(vec!["Time", "t", "Zeit", "Elapsed time", "Temps", "timestamp"]),
        select(vec![("s", 1.0), ("ms", 1e-3), ("min", 60.0)]),
    );
    let voltage = (
        select(vec!["Voltage", "U", "HV", "HV monitor", "Spannung", "Tension"]),
        select(vec![("V", 1.0), ("kV", 1e3)]),
    );
    let displacement = (
        select(vec!["Laser", "x", "Displacement", "Weg", "Stroke", "Measured position"]),
        select(vec![("mm", 1e-3), ("µm", 1e-6), ("m", 1.0)]),
    );
    let titles = (time, voltage, displacement).prop_map(|(time, voltage, displacement)| [time, voltage, displacement]);
    let text = (
        select(vec!["", "Film 3\n", "Operator;AB\nRate;8;Hz\n\n", "# warm\n", "Date: 24.11.2026\n\n"]),
        select(vec!["\n", "\r\n", "\r"]),
        0..4_usize,
        any::<bool>(),
        select(styles),
    );
    let numbers = (
        select(vec![";", ",", "\t", " ; ", "|", " | "]),
        any::<bool>(),
        select(vec!["", " ", "'", "\u{a0}"]),
        [0..7_usize, 0..7, 0..7],
        select(vec!["-", "\u{2212}", "\u{2013}"]),
        select(vec![("", ""), ("", ""), ("\"", "\""), ("'", "'"), ("=\"", "\"")]),
    );
    (numbers, text, titles, Just(vec![0, 1, 2, 3]).prop_shuffle()).prop_map(|(numbers, text, titles, order)| Dialect {
        separator: numbers.0,
        // Commas separate the cells of such a file.
        comma: numbers.1 && numbers.0 != ",",
        group: if numbers.0 == "," && numbers.2 == " " { "" } else { numbers.2 },
        digits: numbers.3,
        // Latin-1 has one minus.
        minus: if text.2 == 2 { "-" } else { numbers.4 },
        quotes: numbers.5,
        preamble: text.0,
        line_end: text.1,
        encoding: text.2,
        unit_row: text.3,
        style: text.4,
        order,
        titles,
    })
}

impl Dialect {
    /// The whole number `value` with the decimal sign before the last `digits` of it.
    fn number(&self, value: i64, digits: usize) -> String {
        let text = format!("{:0width$}", value.abs(), width = digits + 1);
        let (whole, broken) = text.split_at(text.len() - digits);
        let mut grouped = String::new();
        for (k, digit) in whole.chars().enumerate() {
            if k > 0 && (whole.len() - k) % 3 == 0 {
                grouped += self.group;
            }
            grouped.push(digit);
        }
        let sign = if value < 0 { self.minus } else { "" };
        let decimal = match (digits, self.comma) {
            (0, _) => "",
            (_, true) => ",",
            (_, false) => ".",
        };
        let (before, behind) = self.quotes;
        format!("{before}{sign}{grouped}{decimal}{broken}{behind}")
    }

    fn file(&self, rows: &[[i64; 3]]) -> Vec<u8> {
        let line = |cell: &dyn Fn(usize) -> String| {
            self.order.iter().map(|&column| cell(column)).collect::<Vec<_>>().join(self.separator) + "\n"
        };
        let mut text = self.preamble.to_owned();
        text += &line(&|column| match self.titles.get(column) {
            None => "Room (°C)".into(),
            Some((name, _)) if self.unit_row => (*name).into(),
            Some((name, (unit, _))) => (self.style)(name, unit),
        });
        if self.unit_row {
            text += &line(&|column| self.titles.get(column).map_or("°C", |(_, (unit, _))| unit).into());
        }
        for row in rows {
            text +=
                &line(&|column| row.get(column).map_or("21".into(), |value| self.number(*value, self.digits[column])));
        }
        let text = text.replace('\n', self.line_end);
        match self.encoding {
            0 => text.into_bytes(),
            1 => [b"\xef\xbb\xbf", text.as_bytes()].concat(),
            2 => latin_1(&text),
            _ => utf_16(&text, true),
        }
    }

    /// Whether the signs of a column's numbers may separate thousands: then a question is right.
    fn may_be_asked(&self) -> bool {
        self.digits.contains(&3)
    }
}

fn read(path: &Path) -> Result<[Vec<f64>; 3], String> {
    let recording = Recording::read_with(path, &Hints::default()).map_err(|error| error.to_string())?;
    let columns = recording.columns();
    let column = |wanted: &str| {
        let found = columns.iter().find(|(name, _)| *name == wanted);
        found.map(|(_, values)| values.clone()).ok_or_else(|| format!("no {wanted}"))
    };
    Ok([recording.time_s().to_vec(), column("voltage_v")?, column("displacement_m")?])
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

    #[test]
    fn random_dialects_are_read_as_they_were_written(
        dialect in dialect(),
        steps in proptest::collection::vec((1..50_000_i64, -9_000_000..9_000_000_i64, -20_000..20_000_i64), 4..30),
    ) {
        let mut time = 0;
        let rows: Vec<[i64; 3]> = steps.iter().map(|(step, volts, laser)| {
            time += step;
            [time, *volts, *laser]
        }).collect();
        let path = save("film.txt", dialect.file(&rows));
        let columns = match read(&path) {
            Ok(columns) => columns,
            Err(error) => {
                prop_assert!(dialect.may_be_asked() && error.contains("two ways"), "{error}");
                return Ok(());
            }
        };
        for (column, values) in columns.iter().enumerate() {
            prop_assert_eq!(values.len(), rows.len());
            let (_, (_, factor)) = dialect.titles[column];
            let scale = factor / 10_f64.powi(i32::try_from(dialect.digits[column]).expect("few"));
            let start = if column == 0 { rows[0][0] } else { 0 };
            for (read, row) in values.iter().zip(&rows) {
                let written = (row[column] - start) as f64 * scale;
                // Rounding of the largest value, from which the first time is taken.
                let tolerance = 1e-14 * scale * 9e6_f64.max(row[column].abs() as f64);
                prop_assert!((read - written).abs() <= tolerance, "column {column}: {read} instead of {written}");
            }
        }
    }
}
