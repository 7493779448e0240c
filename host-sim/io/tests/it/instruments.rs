//! Files as instruments and programs write them: each gives the samples from which it was written, or asks, and gives them once it is
//! answered.

use host_io::files::import::Hints;
use host_io::files::recording::Recording;

use super::lab_files::{Folder, Sample, difference, has, hints, rows, samples, usual};

/// A file, words of its question, if there is one, and the answer: see `files/README.md`.
struct File {
    name: String,
    content: String,
    asks: Vec<String>,
    hints: String,
}

fn reads(name: &str, content: String) -> File {
    File { name: name.into(), content, asks: Vec::new(), hints: String::new() }
}

/// The files of `text`, which is one of `files`.
fn files(text: &str) -> Vec<File> {
    let file = |block: &str| {
        let (head, content) = block.split_once("\n--\n").expect("a file");
        let (name, head) = head.split_once('\n').unwrap_or((head, ""));
        let line = |sign: &str| head.lines().find_map(|line| line.strip_prefix(sign)).unwrap_or_default();
        let asks = line("? ").split(" | ").filter(|words| !words.is_empty()).map(str::to_owned).collect();
        let content = written(content, head.contains("decimal comma"));
        File { name: name.into(), content, asks, hints: line("= ").into() }
    };
    text.split("== ").skip(1).map(file).collect()
}

/// `content` with a row for each sample in place of each line with `{…}`.
fn written(content: &str, has_commas: bool) -> String {
    let content = content.replace("\\u{feff}", "\u{feff}").replace("\\u{1a}", "\u{1a}");
    let has_ranges = content.lines().any(|line| line.starts_with('['));
    let mut text = String::new();
    for line in content.lines() {
        let range = line.strip_prefix('[').and_then(|rest| rest.split_once(']'));
        let (from, to, row) = match range.and_then(|(range, row)| Some((range.split_once("..")?, row))) {
            Some(((from, to), row)) => (from.parse().expect(line), to.parse().unwrap_or(usize::MAX), row),
            None if line.contains('{') && !has_ranges => (0, usize::MAX, line),
            None => {
                text += &format!("{line}\n");
                continue;
            }
        };
        for (k, sample) in samples().iter().enumerate().filter(|(k, _)| (from..to).contains(k)) {
            text += &format!("{}\n", filled(row, k, sample, has_commas));
        }
    }
    let text = text.replace("\\t", "\t").replace("\\r", "\r").replace("\\n", "\n").replace("\\0", "\0");
    // Nothing is behind the end sign of DOS, or zero bytes.
    text.replace("\u{1a}\n", "\u{1a}").replace("\0\n", "\0")
}

/// `row` with the numbers of a sample.
fn filled(row: &str, k: usize, sample: &Sample, has_commas: bool) -> String {
    let mut parts = row.split('{');
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (name, behind) = part.split_once('}').expect(row);
        let number = value(name, k, sample);
        text += &if has_commas { number.replace('.', ",") } else { number };
        text += behind;
    }
    text
}

fn value(name: &str, k: usize, sample: &Sample) -> String {
    if let Some(clock) = name.strip_prefix("clock") {
        let (sign, from) = clock.split_once(' ').expect(name);
        let text = self::clock(from.parse::<f64>().expect(name) + sample.time_s);
        return if sign.is_empty() { text } else { text.replace('.', sign) };
    }
    if let Some(from) = name.strip_prefix("minutes ") {
        return clock(from.parse::<f64>().expect(name) + sample.time_s)[3..].to_owned();
    }
    let (name, more) = name.split_at(name.find(['+', '-']).unwrap_or(name.len()));
    let value = match name {
        "t" => sample.time_s,
        "kV" => sample.voltage_kv,
        "mm" => sample.laser_mm,
        "k" => k as f64,
        "ms" => 1e3 * sample.time_s,
        "ns" => 1e9 * sample.time_s,
        "min" => sample.time_s / 60.0,
        "days" => sample.time_s / 86400.0,
        "half" => (sample.time_s / 0.5).floor() * 0.5,
        "V" => 1e3 * sample.voltage_kv,
        "cm" => sample.laser_mm / 10.0,
        "µm" => 1e3 * sample.laser_mm,
        "nm" => 1e6 * sample.laser_mm,
        other => panic!("{other}"),
    };
    (value + more.parse().unwrap_or(0.0)).to_string()
}

/// Rows of the samples, each written by `row` with its number.
fn table(row: impl Fn(usize, &Sample) -> String) -> String {
    samples().iter().enumerate().map(|(k, sample)| row(k, sample) + "\n").collect()
}

/// Hours, minutes and seconds of `seconds` since midnight.
fn clock(seconds: f64) -> String {
    let (hours, rest) = ((seconds / 3600.0).floor(), seconds % 3600.0);
    format!("{:02}:{:02}:{:06.3}", hours as u32 % 24, (rest / 60.0).floor() as u32, rest % 60.0)
}

/// Digits in groups of three before the `decimal` sign.
fn grouped(value: f64, group: &str, decimal: &str) -> String {
    let text = format!("{value:.3}");
    let (whole, broken) = text.split_once('.').expect("three digits");
    let mut out = String::new();
    for (k, digit) in whole.chars().enumerate() {
        if k > 0 && (whole.len() - k) % 3 == 0 {
            out += group;
        }
        out.push(digit);
    }
    out + decimal + broken
}

/// Numbers in all the ways of writing them, and cells without one.
fn numbers() -> Vec<File> {
    let volts = |group: &'static str, decimal: &'static str| {
        format!(
            "Time (s);HV (V);Laser (mm)\n{}",
            table(|_, s| {
                let number = |value: f64| value.to_string().replace('.', decimal);
                format!("{};{};{}", number(s.time_s), grouped(1e3 * s.voltage_kv, group, decimal), number(s.laser_mm))
            })
        )
    };
    let whole = |group: &'static str, other: &'static str| {
        format!(
            "Time (s);HV (V);Laser (mm)\n{}",
            table(|_, s| {
                let number = |value: f64| value.to_string().replace('.', other);
                let volts = grouped(1e3 * s.voltage_kv, group, other);
                // Whole numbers have no sign.
                let volts = volts.strip_suffix(&format!("{other}000")).map_or(volts.clone(), str::to_owned);
                format!("{};{};{}", number(s.time_s), volts, number(s.laser_mm))
            })
        )
    };
    vec![
        reads("thousands with a blank", volts(" ", ",")),
        reads("thousands with a hard blank", volts("\u{a0}", ",")),
        reads("thousands with a narrow blank", volts("\u{202f}", ",")),
        reads("thousands with an apostrophe", volts("'", ".")),
        reads("thousands with a curly apostrophe", volts("\u{2019}", ".")),
        reads("thousands with points", volts(".", ",")),
        reads("thousands with commas", volts(",", ".")),
        reads("thousands with points in some cells", whole(".", ",")),
    ]
}

/// Rows instead of columns, below a `preamble`.
fn turned(preamble: &str, between: &str, end: &str) -> String {
    let row = |name: &str, value: fn(&Sample) -> f64| {
        let values: Vec<String> = samples().iter().map(|s| value(s).to_string()).collect();
        format!("{name}{between}{}{end}\n", values.join(between))
    };
    let rows = [row("Time (s)", |s| s.time_s), row("HV (kV)", |s| s.voltage_kv), row("Laser (mm)", |s| s.laser_mm)];
    preamble.to_owned() + &rows.concat()
}

#[test]
fn files_of_instruments_give_the_samples() {
    let folder = Folder::new();
    let texts =
        [include_str!("files/dialects.txt"), include_str!("files/acquisition.txt"), include_str!("files/times.txt")];
    let mut files: Vec<File> = texts.into_iter().flat_map(files).collect();
    files.extend(numbers());
    files.push(reads("rows instead of columns", turned("", ";", "")));
    files.push(reads("rows instead of columns, below a line", turned("Film 3\n", "\t", "\t")));
    let mac = format!("Time (s),U (kV),Laser (mm)\n{}", rows(",", '.', usual)).replace('\n', "\r");
    files.push(reads("lines of an old Mac", mac));
    assert!(files.len() > 100, "{} files", files.len());
    let mut faults = Vec::new();
    for file in &files {
        let path = folder.file("film.txt", &file.content);
        let read = |hints: &Hints| Recording::read_with(&path, hints);
        if !file.asks.is_empty() {
            match read(&Hints::default()) {
                Ok(recording) => faults.push(format!("{}: not asked: {:?}", file.name, recording.understood())),
                Err(error) => {
                    let words: Vec<&str> = file.asks.iter().map(String::as_str).collect();
                    has(&error.to_string(), &words);
                }
            }
        }
        match read(&hints(&file.hints)) {
            Err(error) => faults.push(format!("{}: {error}", file.name)),
            Ok(recording) => {
                if let Some(fault) = difference(&recording) {
                    faults.push(format!("{}: {fault}; {:?}", file.name, recording.understood()));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
