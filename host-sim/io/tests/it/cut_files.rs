//! Files that end in the middle of their last row, as a log does that was stopped: no wrong number is read without a word.

use std::fmt::Write;

use super::lab_files::read;

/// Numbers between −1 and 1.
pub struct Noise(pub u64);

impl Noise {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// From 0 to 1.
    pub fn share(&mut self) -> f64 {
        0.5 + 0.5 * self.next()
    }

    /// A number below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        (self.share() * count as f64) as usize
    }
}

const ROWS: usize = 60;

/// How a program writes a number.
type Style = fn(f64) -> String;

/// Styles, with a name.
const STYLES: [(&str, Style); 7] = [
    ("three decimals", |x| format!("{x:.3}")),
    ("six decimals", |x| format!("{x:.6}")),
    ("exponents", |x| format!("{x:.5e}")),
    ("exponents of two digits", |x| {
        let (mantissa, exponent) =
            format!("{x:.5e}").split_once('e').map(|(m, e)| (m.to_owned(), e.to_owned())).expect("e");
        let exponent: i32 = exponent.parse().expect("a number");
        format!("{mantissa}E{}{:02}", if exponent < 0 { '-' } else { '+' }, exponent.abs())
    }),
    ("as short as they can be", |x| format!("{x}")),
    ("resolution of a sensor", |x| format!("{}", (x * 1e4).round() / 1e4)),
    ("counts", |x| format!("{:.0}", x * 1e4)),
];

/// The last number of each row, mm, and the text of the file: below names of a laboratory, or those of this tool.
fn file(style: Style, separator: &str, own_names: bool, noise: &mut Noise) -> (Vec<f64>, String) {
    let unit = if own_names { "mm" } else { "µm" };
    let header = if own_names {
        format!("time_s{separator}voltage_v{separator}displacement_{unit}")
    } else {
        format!("Time (s){separator}HV (V){separator}Laser ({unit})")
    };
    let (mut text, mut values) = (header + "\n", Vec::new());
    let (phase, size) = (3.0 * noise.next(), 1.0 + 0.5 * noise.next());
    for k in 0..ROWS {
        let t = k as f64 / 50.0;
        let value = size * (1.5 + (1.3 * t + phase).sin()) + 1e-3 * noise.next();
        values.push(style(value).parse().expect("a number"));
        let _ = writeln!(text, "{t:.2}{separator}{:.1}{separator}{}", 1500.0 + 1e3 * t, style(value));
    }
    (values, text)
}

/// Wherever the last row ends: it is left out with a note, refused, without a reading, or as near to the row before as the others are.
#[test]
fn a_row_that_is_cut_off_is_never_a_wrong_reading() {
    let mut noise = Noise(7);
    let (mut left_out, mut faults) = (0, Vec::new());
    for round in 0..2 {
        for (name, style) in STYLES {
            for (separator, own_names) in [(",", true), (",", false), (";", false), ("\t", false)] {
                let (values, text) = file(style, separator, own_names, &mut noise);
                let scale = if own_names { 1e3 } else { 1e6 };
                let last = text.trim_end().rfind('\n').expect("rows") + 1;
                let step = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
                for end in last + 1..text.len() - 1 {
                    for line_end in ["", "\n"] {
                        // A log of which a program ended the last line is only judged where the digits are fixed.
                        if !line_end.is_empty() && !name.contains("decimals") && !name.contains("exponents") {
                            continue;
                        }
                        let Ok(recording) = read(format!("{}{line_end}", &text[..end]), "") else { continue };
                        let rows = recording.time_s().len();
                        if rows == ROWS - 1 {
                            assert!(recording.notes().iter().any(|note| note.contains("cut off")), "{name}: no note");
                            left_out += 1;
                            continue;
                        }
                        let reading = recording.displacement().expect("readings");
                        let of_last = reading.value[reading.value.len() - 1] * scale;
                        let is_missing = reading.value.len() < ROWS;
                        if !is_missing && (of_last - values[ROWS - 2]).abs() > 4.0 * step {
                            let row = &text[last..end];
                            faults.push(format!("{round} {name} {separator:?}{line_end:?}: {row:?} gives {of_last}"));
                        }
                    }
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}: {}", faults.len(), faults[..faults.len().min(20)].join("\n"));
    assert!(left_out > 1000, "{left_out}");
}

/// Whole files, with a line end behind the last row or without, are read whole.
#[test]
fn whole_files_are_not_taken_for_cut_off_ones() {
    let mut noise = Noise(11);
    let mut faults = Vec::new();
    for round in 0..50 {
        for (name, style) in STYLES {
            let separator = [",", ";", "\t"][round % 3];
            let (_, text) = file(style, separator, separator == "," && round % 2 == 0, &mut noise);
            for text in [text.trim_end(), &text] {
                let recording = read(text, "").expect("whole");
                if recording.time_s().len() != ROWS || !recording.notes().is_empty() {
                    faults.push(format!("{round} {name}: {:?}", recording.notes()));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}
