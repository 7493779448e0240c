//! Files as instruments and programs write them: each gives the samples from which it was written, or asks, and gives them once it is
//! answered.

use host_io::choice::Choice;
use host_io::files::import::{Decimal, Fill, Hints, RepeatedTimes};
use host_io::files::recording::Recording;

use super::lab_files::{Folder, Sample, difference, has, rows, samples, usual};

/// A file, what its question says if it has one, and the answer.
struct File {
    name: &'static str,
    content: String,
    /// Words of the error without hints; nothing where the file is read at once.
    asks: &'static [&'static str],
    /// `columns=…`, `header=5` and others, between blanks.
    hints: &'static str,
}

fn reads(name: &'static str, content: String) -> File {
    File { name, content, asks: &[], hints: "" }
}

fn asks(name: &'static str, content: String, asks: &'static [&'static str], hints: &'static str) -> File {
    File { name, content, asks, hints }
}

/// The hints of `text`.
pub fn hints(text: &str) -> Hints {
    let mut hints = Hints::default();
    for (key, value) in text.split(' ').filter_map(|part| part.split_once('=')) {
        let number = || value.parse().expect(text);
        match key {
            "columns" => hints.choices = value.parse().expect(text),
            "header" => hints.header_line = Some(number()),
            "segment" => hints.segment = Some(value.parse().expect(text)),
            "rate" => hints.rate_hz = Some(value.parse().expect(text)),
            "decimal" => hints.decimal = Decimal::from_name(value),
            "repeated" => hints.repeated_times = RepeatedTimes::from_name(value),
            "fill" => hints.fill = Fill::from_name(value),
            "words" => hints.words = value.split(',').map(str::to_owned).collect(),
            other => panic!("{other}"),
        }
    }
    hints
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

fn comma(text: &str) -> String {
    text.replace('.', ",")
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

/// Oscilloscopes and acquisition programs: a preamble, a sample interval instead of a unit, repeated headers.
fn acquisition() -> Vec<File> {
    let points = rows(",", '.', usual);
    let tabs = rows("\t", '.', usual);
    let halves = |separator: &str, header: &str| {
        let all = rows(separator, '.', usual);
        let lines: Vec<&str> = all.lines().collect();
        format!("{header}\n{}\n\n{header}\n{}\n", lines[..10].join("\n"), lines[10..].join("\n"))
    };
    let lvm = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tYes\n\
               X_Columns\tOne\nTime_Pref\tRelative\nOperator\tAB\nDate\t2026/11/24\nTime\t10:00:01.5\n***End_of_Header***\t\n\t\n";
    let lvm_head = "Channels\t2\t\t\nSamples\t24\t24\t\nDate\t2026/11/24\t2026/11/24\t\nTime\t10:00:01.5\t10:00:01.5\t\n\
                    Y_Unit_Label\tkV\tmm\t\nX_Dimension\tTime\tTime\t\nX0\t0.0000000000000000E+0\t0.0000000000000000E+0\t\n\
                    Delta_X\t0.125000\t0.125000\t\n***End_of_Header***\t\t\t\nX_Value\tHV\tLaser\tComment";
    let tek = "Model,MSO24\nFirmware Version,2.0.3\n\nPoint Format,Y,\nHorizontal Units,s\nHorizontal Scale,0.4\nSample Interval,0.125\n\
               Record Length,24\nGating,0.0% to 100.0%\nProbe Attenuation,1,1\nVertical Units,V,V\nVertical Offset,0,0\nVertical Scale,1,1\n\
               Vertical Position,0,0\n,\n,\nLabel,HV,Laser\nTIME,CH1,CH2\n";
    let yokogawa = "Header Size,16\nModel Name,DL850\nComment,\nBlockNumber,1\nTraceName,HV,Laser\nBlockSize,24,24\nVUnit,kV,mm\n\
                    SampleRate,8.0000000E+00,8.0000000E+00\nHResolution,1.25E-01,1.25E-01\nHOffset,0.0,0.0\nHUnit,s,s\nDisplayBlockSize,24,24\n\
                    Date,2026/11/24,2026/11/24\nTime,10:00:00.00,10:00:00.00\n\n";
    let tdms = "Root Name\tTitle\tAuthor\tDate/Time\tGroups\tDescription\nfilm3\t\tAB\t24.11.2026 10:00:00\tLog\t\n\nGroup\tChannels\tDescription\n\
                Log\t3\t\n\nLog\nChannel\tDatatype\tUnit\tLength\tMinimum\tMaximum\nTime\tDT_DOUBLE\ts\t24\t0\t2.875\nHV\tDT_DOUBLE\tkV\t24\t0\t6.6\n\
                Laser\tDT_DOUBLE\tmm\t24\t0\t1.6\n\nTime\tHV\tLaser\n";
    let units = "columns=time=1:s,voltage=2:kV,displacement=3:mm";
    vec![
        reads("LabVIEW, one header", format!("{lvm}{lvm_head}\n{tabs}")),
        reads("LabVIEW, a header for each segment", format!("{lvm}{}", halves("\t", lvm_head))),
        reads(
            "LabVIEW, no column of times",
            format!("{lvm}{lvm_head}\n{}", table(|_, s| format!("\t{}\t{}", s.voltage_kv, s.laser_mm))),
        ),
        asks(
            "LabVIEW, two runs that begin at 0",
            format!("{lvm}{lvm_head}\n{tabs}\n{lvm_head}\n{tabs}"),
            &["begins again", "`segment` 1 to 2"],
            "segment=2",
        ),
        asks(
            "Tektronix",
            format!("{tek}{points}"),
            &["\"CH1\"", "`columns`"],
            "columns=voltage=2:kV,displacement=3:mm",
        ),
        asks(
            "Tektronix in milliseconds that the interval says",
            format!("{tek}{}", rows(",", '.', |s| vec![1e3 * s.time_s, s.voltage_kv, s.laser_mm])),
            &["`columns`"],
            "columns=voltage=2:kV,displacement=3:mm",
        ),
        asks(
            "Tektronix, headers beside the numbers",
            table(|k, s| {
                let setting = ["Record Length,24", "Sample Interval,0.125", "Trigger Point,3"].get(k).unwrap_or(&",");
                format!("{setting},,{},{},{}", s.time_s, s.voltage_kv, s.laser_mm)
            }),
            &["time=1:s"],
            "columns=time=4:s,voltage=5:kV,displacement=6:mm",
        ),
        asks("TDMS as text", format!("{tdms}{tabs}"), &["no unit"], units),
        asks(
            "TDMS as text, by its line",
            format!("{tdms}{tabs}"),
            &["no unit"],
            "header=13 columns=time=1:s,voltage=2:kV,displacement=3:mm",
        ),
        asks(
            "Rigol with sequence numbers",
            format!(
                "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,0.000000e+00,1.250000e-01\n{}",
                table(|k, s| format!("{k},{},{},,", s.voltage_kv, s.laser_mm))
            ),
            &["no column voltage_v"],
            "columns=voltage=2*1000,displacement=3*0.001",
        ),
        asks(
            "Rigol with start and increment in its header",
            format!(
                "CH1(V),CH2(V),t0 = 0.000000e+00, tInc = 1.250000e-01,\n{}",
                table(|_, s| format!("{},{},,,", s.voltage_kv, s.laser_mm))
            ),
            &["no column voltage_v"],
            "columns=voltage=1*1000,displacement=2*0.001",
        ),
        reads("Yokogawa", format!("{yokogawa}{}", table(|_, s| format!(",{},{}", s.voltage_kv, s.laser_mm)))),
        reads(
            "a sample rate in the preamble",
            format!(
                "Sample rate: 8 Hz\nHV (kV);Laser (mm)\n{}",
                table(|_, s| format!("{};{}", s.voltage_kv, s.laser_mm))
            ),
        ),
        asks(
            "a sample rate for each channel",
            format!(
                "SampleRate;8;80\nHV (kV);Laser (mm)\n{}",
                table(|_, s| format!("{};{}", s.voltage_kv, s.laser_mm))
            ),
            &["no column time_s", "`rate_hz`"],
            "rate=8",
        ),
        reads(
            "a sample rate in kHz, time without a unit",
            format!("Sampling Rate (kHz);0.008\nTime;HV (kV);Laser (mm)\n{}", rows(";", '.', usual)),
        ),
        reads(
            "a sample interval in milliseconds, decimal commas",
            format!("Abtastintervall;125,0;ms\nZeit;HV (kV);Laser (mm)\n{}", rows(";", ',', usual)),
        ),
        asks(
            "no times at all",
            format!("HV (kV);Laser (mm)\n{}", table(|_, s| format!("{};{}", s.voltage_kv, s.laser_mm))),
            &["no column time_s", "`rate_hz`"],
            "rate=8",
        ),
        asks(
            "an index instead of times",
            format!("Sample;HV (kV);Laser (mm)\n{}", table(|k, s| format!("{k};{};{}", s.voltage_kv, s.laser_mm))),
            &["no column time_s", "`rate_hz`"],
            "rate=8",
        ),
        reads(
            "LabChart",
            format!("Interval=\t0.125 s\nChannelTitle=\tHV\tLaser\nRange=\t10 V\t10 V\nUnitName=\tkV\tmm\n{tabs}"),
        ),
        reads(
            "Keyence",
            format!(
                "Date,2026/11/24\nSampling cycle,125ms\nNo.,OUT1[kV],OUT2[mm]\n{}",
                table(|k, s| format!("{k},{},{}", s.voltage_kv, s.laser_mm))
            ),
        ),
        reads("names over two lines", format!("\"Time\n(s)\",\"HV\r\n(kV)\",\"Laser\n(mm)\"\n{points}")),
        asks(
            "Origin with comments",
            format!("Time\tHV\tLaser\ns\tkV\tmm\nrun 3\tmonitor\tM5L\n{tabs}"),
            &["\"run 3\"", "`header_line`"],
            "header=1",
        ),
        asks(
            "R",
            format!(
                "\"time\" \"hv\" \"laser\"\n{}",
                table(|k, s| format!("\"{}\" {} {} {}", k + 1, s.time_s, s.voltage_kv, s.laser_mm))
            ),
            &["\"time\"", "no unit"],
            "columns=time=2:s,voltage=3:kV,displacement=4:mm",
        ),
        asks(
            "dSPACE",
            format!(
                "format;CSV\ntrace_names;HV;Laser\n{}",
                table(|_, s| format!("trace_values;{};{};{}", s.time_s, s.voltage_kv, s.laser_mm))
            ),
            &["4 cells below a header of 3", "by number"],
            "columns=time=2:s,voltage=3:kV,displacement=4:mm",
        ),
        reads("files that were joined", halves(",", "\u{feff}Time (s),HV (kV),Laser (mm)")),
        reads("a header on every page", halves(",", "Time (s),HV (kV),Laser (mm)")),
        reads("a commented preamble", format!("# rig 3\n# film 7\n#\nTime (s),HV (kV),Laser (mm)\n{points}")),
        reads(
            "statistics below",
            format!("Time (s),HV (kV),Laser (mm)\n{points}\nMean,2.2,0.6\nStd,2.0,0.5\nMax,6.6,1.6\n"),
        ),
        reads(
            "a remark below",
            format!("Zeit (s);HV (kV);Laser (mm)\n{}Messung beendet: 10:05\n", rows(";", ',', usual)),
        ),
        reads("the end sign of DOS", format!("Time (s)\tHV (kV)\tLaser (mm)\n{tabs}\u{1a}")),
        reads("an end mark", format!("Time (s)\tHV (kV)\tLaser (mm)\n{tabs}*** End of data ***\n")),
        reads("rows instead of columns", {
            let row = |name: &str, value: fn(&Sample) -> f64| {
                let values: Vec<String> = samples().iter().map(|s| value(s).to_string()).collect();
                format!("{name};{}\n", values.join(";"))
            };
            row("Time (s)", |s| s.time_s) + &row("HV (kV)", |s| s.voltage_kv) + &row("Laser (mm)", |s| s.laser_mm)
        }),
        reads("rows instead of columns, below a line", {
            let row = |name: &str, value: fn(&Sample) -> f64| {
                let values: Vec<String> = samples().iter().map(|s| comma(&value(s).to_string())).collect();
                format!("{name}\t{}\t\n", values.join("\t"))
            };
            format!(
                "Film 3\n{}",
                row("Zeit [s]", |s| s.time_s) + &row("U [kV]", |s| s.voltage_kv) + &row("Weg [mm]", |s| s.laser_mm)
            )
        }),
        asks(
            "names above three lines of settings",
            format!("Time;HV;Laser\nChannel;1;2\nGain;1000;1\ns;kV;mm\n{}", rows(";", '.', usual)),
            &["\"Channel\"", "no units"],
            "header=1",
        ),
        reads(
            "gains between names and numbers",
            format!("Time (s);HV (kV);Laser (mm)\nGain;1000;0.5\n{}", rows(";", '.', usual)),
        ),
        reads(
            "a row of groups above the names",
            format!("Clock;Amplifier;Sensor\nTime;HV;Laser\ns;kV;mm\n{}", rows(";", '.', usual)),
        ),
    ]
}

/// Times of day, dates, slow timers.
fn times() -> Vec<File> {
    let stamped = |header: &str, stamp: &dyn Fn(f64) -> String| {
        format!(
            "{header};HV (kV);Laser (mm)\n{}",
            table(|_, s| format!("{};{};{}", stamp(s.time_s), s.voltage_kv, s.laser_mm))
        )
    };
    let midnight = 86400.0 - 1.5;
    let date =
        |t: f64, first: &str, second: &str| if midnight + t >= 86400.0 { second.to_owned() } else { first.to_owned() };
    // A timer of 0.5 s below rows of 0.125 s.
    let slow = |t: f64| ((t / 0.5).floor() * 0.5).to_string();
    vec![
        reads("hours, minutes, seconds", stamped("Time", &|t| clock(36000.0 + t))),
        reads("with a decimal comma", stamped("Uhrzeit Zeit", &|t| comma(&clock(36000.0 + t)))),
        reads("milliseconds behind a colon", stamped("Time", &|t| clock(36000.0 + t).replace('.', ":"))),
        reads("across midnight", stamped("Time", &|t| clock(midnight + t))),
        reads("ISO 8601", stamped("Timestamp", &|t| format!("2026-11-24T{}Z", clock(36000.0 + t)))),
        reads("ISO 8601 with a zone", stamped("Timestamp", &|t| format!("2026-11-24T{}+01:00", clock(36000.0 + t)))),
        reads(
            "ISO 8601 across midnight",
            stamped("Timestamp", &|t| format!("{}T{}", date(t, "2026-12-31", "2027-01-01"), clock(midnight + t))),
        ),
        reads("a German date", stamped("Zeit", &|t| format!("24.11.2026 {}", comma(&clock(36000.0 + t))))),
        reads(
            "a German date across the end of a month",
            stamped("Zeit", &|t| format!("{} {}", date(t, "30.11.2026", "01.12.2026"), clock(midnight + t))),
        ),
        reads(
            "an American date across midnight",
            stamped("Time", &|t| format!("{} {}", date(t, "11/04/2026", "11/05/2026"), clock(midnight + t))),
        ),
        reads(
            "an American date with dashes across midnight",
            stamped("Time", &|t| format!("{} {}", date(t, "01-12-2026", "01-13-2026"), clock(midnight + t))),
        ),
        reads(
            "clocks that are put forward, with their zones",
            stamped("Time", &|t| {
                let (hours, zone) = if t < 1.5 { (0.0, "+01:00") } else { (1.0, "+0200") };
                format!("2026-03-29T{}{zone}", clock(3600.0 * (2.0 + hours) - 1.5 + t))
            }),
        ),
        reads("the name of a month", stamped("Time", &|t| format!("24-Nov-2026 {}", clock(36000.0 + t)))),
        reads(
            "a.m. and p.m.",
            stamped("Time", &|t| {
                let half = if 43200.0 - 1.5 + t >= 43200.0 { "PM" } else { "AM" };
                let seconds = clock(43200.0 - 1.5 + t);
                format!("{seconds} {half}")
            }),
        ),
        reads("minutes and seconds", stamped("Time", &|t| clock(58.0 + t)[3..].to_owned())),
        asks(
            "two parts",
            stamped("Time", &|t| format!("{:02}:{:02}", 10 + (t * 8.0) as u32 / 60, (t * 8.0) as u32 % 60)),
            &["hours and minutes, or minutes and seconds"],
            "columns=time=none rate=8",
        ),
        reads(
            "a date beside a time",
            format!(
                "Date;Time;HV (kV);Laser (mm)\n{}",
                table(|_, s| { format!("24.11.2026;{};{};{}", clock(36000.0 + s.time_s), s.voltage_kv, s.laser_mm) })
            ),
        ),
        reads("durations of pandas", stamped("Time", &|t| format!("0 days 00:00:{t:09.6}"))),
        reads("nanoseconds", stamped("timestamp_ns", &|t| format!("{}", 1_764_000_000_000 + (t * 1e9) as i64))),
        reads("days", stamped("Time (days)", &|t| (t / 86400.0).to_string())),
        asks(
            "a timer of half a second",
            stamped("Time (s)", &slow),
            &["does not increase", "`repeated_times` spread"],
            "repeated=spread",
        ),
        asks(
            "each reading three times",
            format!(
                "Time (s);HV (kV);Laser (mm)\n{}",
                table(|_, s| {
                    let laser = |d: f64| format!("{};{};{}", s.time_s, s.voltage_kv, s.laser_mm + d);
                    [laser(0.001), laser(0.0), laser(-0.001)].join("\n")
                })
            ),
            &["does not increase", "`repeated_times` mean"],
            "repeated=mean",
        ),
        reads("seconds since 1970", stamped("Time (s)", &|t| (1_764_000_000.0 + t).to_string())),
    ]
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
        reads(
            "a plus and an exponent",
            format!(
                "Time (s),HV (kV),Laser (mm)\n{}",
                table(|_, s| { format!("{:+.6E},{:+.6E},{:+.6E}", s.time_s, s.voltage_kv, s.laser_mm) })
            ),
        ),
        reads(
            "a true minus",
            format!("Time (s),HV (kV),Laser (mm)\n{}", rows(",", '.', usual).replace("0,0,", "\u{2212}0,0,")),
        ),
    ]
}

#[test]
fn files_of_instruments_give_the_samples() {
    let folder = Folder::new();
    let mut files = acquisition();
    files.extend(times());
    files.extend(numbers());
    assert!(files.len() > 50, "{} files", files.len());
    let mut faults = Vec::new();
    for file in &files {
        let path = folder.file("film.txt", &file.content);
        let read = |hints: &Hints| Recording::read_with(&path, hints);
        if !file.asks.is_empty() {
            match read(&Hints::default()) {
                Ok(recording) => faults.push(format!("{}: not asked: {:?}", file.name, recording.understood())),
                Err(error) => has(&error.to_string(), file.asks),
            }
        }
        match read(&hints(file.hints)) {
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
