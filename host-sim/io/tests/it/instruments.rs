//! Files as instruments and programs write them: each gives the samples from which it was written, or asks, and gives them once it is
//! answered.

use super::lab_files::{Sample, below, gives_the_samples, refuses, samples, usual};

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

/// Numbers in all the ways of writing them.
fn numbers() -> Vec<File> {
    // A whole number may have no sign.
    let text = |group: &str, decimal: &str, is_short: bool| {
        let row = |s: &Sample| {
            let number = |value: f64| value.to_string().replace('.', decimal);
            let volts = grouped(1e3 * s.voltage_kv, group, decimal);
            let whole = volts.strip_suffix(&format!("{decimal}000")).filter(|_| is_short);
            format!("{};{};{}\n", number(s.time_s), whole.unwrap_or(&volts), number(s.laser_mm))
        };
        format!("Time (s);HV (V);Laser (mm)\n{}", samples().iter().map(row).collect::<String>())
    };
    let files = [
        ("a blank", text(" ", ",", false)),
        ("a hard blank", text("\u{a0}", ",", false)),
        ("a narrow blank", text("\u{202f}", ",", false)),
        ("an apostrophe", text("'", ".", false)),
        ("a curly apostrophe", text("\u{2019}", ".", false)),
        ("points", text(".", ",", false)),
        ("commas", text(",", ".", false)),
        ("points in some cells", text(".", ",", true)),
    ];
    files.map(|(sign, text)| reads(&format!("thousands with {sign}"), text)).into()
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
    let texts =
        [include_str!("files/dialects.txt"), include_str!("files/acquisition.txt"), include_str!("files/times.txt")];
    let mut files: Vec<File> = texts.into_iter().flat_map(files).collect();
    files.extend(numbers());
    files.push(reads("rows instead of columns", turned("", ";", "")));
    files.push(reads("rows instead of columns, below a line", turned("Film 3\n", "\t", "\t")));
    let mac = below("Time (s),U (kV),Laser (mm)", usual).replace('\n', "\r");
    files.push(reads("lines of an old Mac", mac));
    assert!(files.len() > 100, "{} files", files.len());
    for file in &files {
        println!("{}", file.name);
        if !file.asks.is_empty() {
            refuses(&file.content, "", &file.asks.iter().map(String::as_str).collect::<Vec<_>>());
        }
        gives_the_samples(&file.content, &file.hints);
    }
}
