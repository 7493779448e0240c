//! Files that can be misread: each is asked about, refused or warned of, and is never wrong in silence.

use std::fmt::Write;

use super::lab_files::{
    Sample, below, difference, gives_the_samples, has, read, read_fixture, refused, refuses, rows, samples, usual,
};

/// Headers above time, voltage and displacement, and one column more: what the question says, and the answer.
#[test]
fn rival_columns_are_a_question() {
    let ask = |header: &str, answer: &str, columns: &dyn Fn(&Sample) -> Vec<f64>| {
        let text = below(header, columns);
        refuses(&text, "", &[&format!("`columns` {answer}")]);
        // The line of the question is an answer.
        gives_the_samples(text, answer);
    };
    // `?` is behind the quantity of a name that is asked about where it is the only one.
    let rivals = include_str!("files/rivals.txt").lines().filter(|line| !line.starts_with("other"));
    for (kind, name) in rivals.filter_map(|line| line.split_once(": ")) {
        let alone = kind.ends_with('?');
        if kind.starts_with("displacement") {
            let other = |s: &Sample| vec![s.time_s, s.voltage_kv, 7.0, s.laser_mm];
            ask(&format!("Time (s);HV (kV);{name};Laser (mm)"), "displacement=4", &other);
            if alone {
                ask(&format!("Time (s);HV (kV);{name}"), "displacement=3", &usual);
            }
        } else if kind.starts_with("time") {
            ask(&format!("{name};HV (kV);Laser (mm)"), "time=1", &usual);
        } else {
            let other = |s: &Sample| vec![s.time_s, 7.0, s.voltage_kv, s.laser_mm];
            ask(&format!("Time (s);{name};Voltage (kV);Laser (mm)"), "voltage=3", &other);
            if alone && !name.contains("(V)") {
                ask(&format!("Time (s);{name};Laser (mm)"), "voltage=2", &usual);
            }
        }
    }
}

/// A force beside volts with an unknown name, or a voltage in an unknown unit: which of them drives the film is a question.
#[test]
fn a_force_does_not_replace_a_voltage() {
    let numbers = rows(";", '.', |s| vec![s.time_s, 1e3 * s.voltage_kv, 0.25, s.laser_mm]);
    for (voltage, force, answer) in [
        ("Monitor (V)", "Force (N)", "voltage=2"),
        ("CH1 (V)", "Force (N)", "voltage=2"),
        ("Amplifier (V)", "Load cell (N)", "voltage=2"),
        ("HV (V~)", "Force (N)", "voltage=2*1"),
        ("HV mon (V/kV)", "Force (N)", "voltage=2*1"),
        ("Zmierzone (V)", "Siła (N)", "voltage=2"),
    ] {
        let text = format!("Time (s);{voltage};{force};Laser (mm)\n{numbers}");
        refuses(&text, "", &[voltage, "`columns` voltage=2", "voltage=none"]);
        gives_the_samples(&text, answer);
        let recording = read(&text, "voltage=none").expect("answered");
        assert_eq!(recording.drive().expect("a force").samples().value, [0.25; 24], "{voltage}");
    }
    // What is in kV is the voltage.
    let text = below("Time (s);CH1 (kV);Force (N);Laser (mm)", |s| vec![s.time_s, s.voltage_kv, 0.25, s.laser_mm]);
    gives_the_samples(&text, "");
}

/// A channel with times of its own beside the others: which column is the time is a question.
#[test]
fn times_of_each_channel_are_a_question() {
    let late = |s: &Sample| vec![s.time_s, s.voltage_kv, 0.02 + 1.5 * s.time_s, s.laser_mm];
    for (one, other) in [
        ("Time (s)", "t_laser (s)"),
        ("X (s)", "X2 (s)"),
        ("Time (s)", "Laser clock (s)"),
        ("Time (s)", "Sensor (s)"),
        ("time_s", "t2_s"),
    ] {
        let text = below(&format!("{one};HV (kV);{other};Laser (mm)"), late);
        refuses(&text, "", &[one, other, "2 columns may be the time"]);
        let read = read(text, "time=1").expect("answered");
        assert_eq!(difference(&read), None, "{one}");
        has(&read.notes().join("; "), &["are not used", "at wrong times", other]);
    }
    // The same times in another unit, by another clock, or twice.
    for same in [|t: f64| 1e3 * t, |t: f64| 1.7e9 + t, |t: f64| t] {
        let columns = |s: &Sample| vec![s.time_s, s.voltage_kv, same(s.time_s), s.laser_mm];
        let text = below("Time (s);HV (kV);Laser time (s);Laser (mm)", columns);
        let read = read(text, "time=1").expect("read");
        assert!(!read.notes().join("; ").contains("at wrong times"), "{:?}", read.notes());
    }
    // What does not increase is no time.
    let text = below("Time (s);HV (kV);Delay (ms);Laser (mm)", |s| vec![s.time_s, s.voltage_kv, 3.0, s.laser_mm]);
    gives_the_samples(text, "");
}

/// Units that change within a file.
#[test]
fn units_that_change_are_refused() {
    let numbers = rows(";", '.', usual);
    let at = numbers.match_indices('\n').nth(11).expect("rows").0 + 1;
    let (first, second) = numbers.split_at(at);
    let header = "Time;HV;Laser\ns;kV;mm\n";
    for (other, words) in [
        ("Time;HV;Laser\ns;V;mm\n", ["\"HV\" V here is \"HV\" kV in line 1", "cut the file"]),
        ("Time;HV;Laser\ns;kV;µm\n", ["\"Laser\" µm here is \"Laser\" mm in line 1", "cut the file"]),
        ("Time;Laser;HV\ns;mm;kV\n", ["\"Laser\" mm here is \"HV\" kV in line 1", "cut the file"]),
    ] {
        let text = format!("{header}{first}{other}{second}");
        refuses(&text, "", &words);
        assert_eq!(read(&text, "segment=1").expect("one part").time_s().len(), 12);
        refused(&text, "segment=2");
    }
    let with_unit = |s: &Sample| match s.voltage_kv {
        kv if kv < 1.0 => format!("{};{};V;{}\n", s.time_s, 1e3 * kv, s.laser_mm),
        kv => format!("{};{kv};kV;{}\n", s.time_s, s.laser_mm),
    };
    let text: String = samples().iter().map(with_unit).collect();
    refuses(
        format!("Time (s);HV (V);Range;Laser (mm)\n{text}"),
        "",
        &["film.txt:11:", "the unit kV here and V before"],
    );
}

/// Units that are not what they look like, or that disagree.
#[test]
fn units_are_read_with_their_case() {
    let numbers = rows(";", '.', usual);
    let refused = |header: &str, words: &[&str]| refuses(format!("{header}\n{numbers}"), "", words);
    refused("Time (ms);HV (kV);Laser (mm)\ns;kV;mm", &["\"Time (ms)\"", "one unit in its name and another below it"]);
    refused("Time (s);HV (kV);Laser (mm)\ns;V;mm", &["\"HV (kV)\"", "one unit in its name and another"]);
    refused("Time (Ms);HV (kV);Laser (mm)", &["\"Time (Ms)\"", "not one of s, ms"]);
    refused("Time (s);HV (MV);Laser (mm)", &["milli or mega"]);
    refused("Time (s);HV (kV);Laser (Nm)", &["\"Laser (Nm)\"", "not one of m, cm, mm"]);
    refused("TIME (S);HV (KV);LASER (NM)", &["\"LASER (NM)\"", "not one of m, cm, mm"]);
    refused("Time (s);HV (kV);Laser (Mm)", &["\"Laser (Mm)\"", "not one of m, cm, mm"]);
    refused("Time (s);HV (mm);Laser (mm)", &["HV (mm)"]);
    refused("Time (V);HV (kV);Laser (mm)", &["\"Time (V)\""]);
    refused("Time (s);HV (s);Laser (mm)", &["\"HV (s)\""]);
    refused("Time (s);HV (kV);Laser (V)", &["\"Laser (V)\""]);
    // Counts of a unit.
    for counted in ["Laser 0.01 mm", "Laser 1/100 mm", "Laser in 10 µm", "Laser in 5 mm"] {
        refused(&format!("Time (s);HV (kV);{counted}"), &[counted, "its unit is not one of m, cm, mm"]);
    }
    refused("Time in 10 ms;HV (kV);Laser (mm)", &["\"Time in 10 ms\"", "not one of s, ms"]);
    refused("Time (s);HV in 100 V;Laser (mm)", &["\"HV in 100 V\"", "not one of V, kV"]);
    // Compound units are not their last part.
    let five = |s: &Sample| vec![s.time_s, s.voltage_kv, 7.0 + s.time_s, s.laser_mm];
    for compound in
        ["E kV/mm", "E_kV/mm", "E kV per mm", "V/mm", "Strain mm/mm", "N/m", "Torque N m", "Counts/mm", "°C/m"]
    {
        let text = below(&format!("Time (s);HV (kV);{compound};Laser (mm)"), five);
        gives_the_samples(&text, "");
        let text = below(&format!("Time (s);HV (kV);{compound};Laser (V)"), five);
        refuses(&text, "", &["\"Laser (V)\"", "not one of m, cm, mm"]);
    }
    for rate in ["Speed mm/s", "Counts/s", "1/s", "N per s", "Flow_l/min"] {
        let text = below(&format!("No;HV (kV);{rate};Laser (mm)"), five);
        refuses(&text, "", &["no column time_s"]);
    }
    for (time, voltage, laser) in [("t/s", "V/kV", "s/mm"), ("Time/s", "U/kV", "CH 2/mm")] {
        let text = format!("{time};{voltage};{laser}\n{numbers}");
        gives_the_samples(&text, "");
    }
    // A torque is no displacement, and what hangs on the film is no weight of a row.
    let beside = |name: &str| {
        below(&format!("Time (s);HV (kV);Laser (mm);{name}"), |s| vec![s.time_s, s.voltage_kv, s.laser_mm, 100.0])
    };
    let ignored =
        "Sensor output (V)|Current monitor (V)|Torque (Nm)|Weight (g)|Mass (kg)|Load (g)|Temp (C)|Current (mA)";
    for ignored in ignored.split('|') {
        let recording = read(beside(ignored), "").expect(ignored);
        assert_eq!(difference(&recording), None, "{ignored}");
        assert!(recording.weights().is_none() && recording.force().is_none(), "{ignored}");
        assert_eq!(recording.understood().expect("a file").ignored, [ignored]);
    }
    refuses(beside("Laser status"), "", &["2 columns may be"]);
    for (name, answer) in [("Weight", "weight=none"), ("Force (mm)", "force=none")] {
        refuses(beside(name), "", &[name, "`columns`", "=none"]);
        gives_the_samples(beside(name), answer);
    }
}

/// Whole numbers whose thousands have the sign that elsewhere is decimal.
#[test]
fn numbers_that_can_be_read_in_two_ways_are_a_question() {
    let volts = [0, 850, 1234, 2345, 3456, 850];
    for (group, time) in [(".", ""), (".", "."), (",", ""), (",", ",")] {
        let mut text = "Time (s);HV (V);Laser (mm)\n".to_owned();
        for (k, volts) in volts.iter().enumerate() {
            let volts =
                if *volts < 1000 { volts.to_string() } else { format!("{}{group}{:03}", volts / 1000, volts % 1000) };
            let half = if time.is_empty() { k.to_string() } else { format!("{k}{time}5") };
            writeln!(text, "{half};{volts};{k}").expect("written");
        }
        let words = ["\"HV (V)\"", "two ways", "1.234", "1234", "`decimal` point", "`decimal` comma"];
        refuses(&text, "", &words);
        let read = |decimal: &str| read(&text, &format!("decimal={decimal}")).expect("answered").columns()[0].1.clone();
        let (grouped, broken) = if group == "." { ("comma", "point") } else { ("point", "comma") };
        // With the other sign in the times there is one reading left.
        if time.is_empty() || time != group {
            assert_eq!(read(grouped), volts.map(f64::from), "{text}");
        }
        assert_eq!(read(broken)[..4], [0.0, 850.0, 1.234, 2.345], "{text}");
    }
}

/// Cells without a reading.
#[test]
fn readings_out_of_range_are_missing_and_counted() {
    let words = "∞|-∞|OL|-OL|O.L|Overload|OVER|-FFFFFFF|+FFFFFFF|1.#QNAN|-1.#IND|1.#INF|9.9E37|9.91E+37|-9.9e+37|Inf|-inf|Infinity|#DIV/0!|NaN||--|\
                 n/a|#N/A|null|-nan|-nan(ind)|OFL|Out of range|>10|< 0.5|********|---.---|-------|BAD";
    // Also in the first row, which shows the columns.
    for (word, first) in words.split('|').flat_map(|word| [(word, 7), (word, 1)]) {
        let mut lines: Vec<String> = below("Time (s);HV (kV);Laser (mm)", usual).lines().map(str::to_owned).collect();
        for line in [first, first + 2] {
            lines[line] = format!("{};{word}", lines[line].rsplit_once(';').expect("cells").0);
        }
        let text = lines.join("\n");
        let given = if word == "BAD" { "words=BAD" } else { "" };
        let recording = read(&text, given).unwrap_or_else(|error| panic!("{word}: {error}"));
        let displacement = recording.displacement().expect("a laser");
        assert_eq!((displacement.value.len(), recording.time_s().len()), (22, 24), "{word}");
        let counted = recording.notes().iter().any(|note| note.contains("2 readings of \"Laser (mm)\""));
        let is_plain =
            ["NaN", "", "--", "n/a", "#N/A", "null", "-nan", "-nan(ind)", "---.---", "-------"].contains(&word);
        assert_eq!(counted, !is_plain, "{word}: {:?}", recording.notes());
        // In the voltage they are a fault.
        let turned = text.replace("HV (kV);Laser (mm)", "Laser (mm);HV (kV)");
        let drive = read(turned, given).expect("read").drive();
        has(&drive.expect_err("a gap").to_string(), &[&format!("film.txt:{}:", first + 1), "is empty", "`fill`"]);
    }
    // Behind the values of a row, `#` begins a remark.
    let by_number = "time=1:s,voltage=2:kV,displacement=3:mm";
    let text = rows(";", '.', usual).replacen(";0.05\n", ";#N/A\n", 1);
    let read = read(text, by_number).expect("read");
    assert_eq!(read.displacement().expect("a laser").value.len(), 23);
    // Names that number the columns, as of a table without names.
    for names in ["0;1;2", "1;2;3"] {
        let counted = below(names, usual).replacen("0;0;", "5;0;", 1);
        let words = ["film.txt:1:", "the numbers of the columns or the first sample", "`header_line` 1"];
        refuses(counted, by_number, &words);
    }
    // Milliseconds without the zeros before them: 5, 12, 19, 40 ms.
    let unpadded = "10:00:00.5;0;1\n10:00:01.12;1;1\n10:00:02.19;2;1\n10:00:03.40;3;1\n10:00:04.271;4;1\n";
    let text = format!("Time;HV (kV);Laser (mm)\n{unpadded}");
    refuses(text, "", &["without leading zeros", "5 or 500 ms", "`rate_hz`"]);
    // What a terminal puts before each row is no zone of the time behind it.
    let logged = |s: &Sample| format!("10:00:00.{:03} -> {};{};{}\n", 1, s.time_s, s.voltage_kv, s.laser_mm);
    let logged: String = samples().iter().map(logged).collect();
    refuses(format!("Time (s);HV (kV);Laser (mm)\n{logged}"), "", &["film.txt"]);
    let units = |s: &Sample| format!("{} s;{} kV;{} mm\n", s.time_s, s.voltage_kv, s.laser_mm);
    let units: String = samples().iter().map(units).collect();
    refuses(format!("Time;HV;Laser\n{units}"), "", &["is a number with its unit", "in the header"]);
    let text = below("Time (s);HV (kV);Laser (mm)", usual).replace(";0.05\n", ";broken\n");
    refuses(text, "", &["film.txt:2:", "\"broken\"", "not a number"]);
}

/// Rows of one time that belong to different channels are not averaged or spread; a remark in some of them is no channel.
#[test]
fn channels_in_rows_are_refused() {
    let mut text = "time_s,channel,value\n".to_owned();
    for sample in samples() {
        write!(text, "{0},HV_kV,{1}\n{0},laser_mm,{2}\n", sample.time_s, sample.voltage_kv, sample.laser_mm)
            .expect("written");
    }
    let numbered = text.replace("HV_kV", "1").replace("laser_mm", "2");
    for repeated in ["mean", "spread"] {
        let answer = format!("columns=voltage=3:kV repeated={repeated}");
        let words = ["film.txt:", "\"channel\" changes within the rows of one time", "HV_kV", "laser_mm"];
        refuses(&text, &answer, &words);
        refuses(&numbered, &answer, &["\"channel\" changes within the rows of one time (\"1\", \"2\")"]);
        let ports = numbered.replace("channel", "Port");
        refuses(ports, &answer, &["\"Port\" changes within the rows of one time"]);
    }
    // A channel of an oscilloscope that is not used, in volts or in counts.
    for name in ["Channel C", "CH 3", "Ch (V)", "Signal"] {
        let whole = |k: usize| format!("{};{k};{k};{}\n", 0.1 * k as f64, k % 3);
        let rows: String = (0..24).map(whole).collect();
        read(format!("Time (s);HV (V);Laser (mm);{name}\n{rows}"), "").expect(name);
    }
    // Each at times of its own, one by one or one behind another.
    let late = |k: usize, channel: usize| format!("{};{channel};{k};{k}\n", 0.1 * k as f64);
    for order in [|k: usize| k % 2 + 1, |k: usize| k / 12 + 1] {
        let rows: String = (0..24).map(|k| late(k, order(k))).collect();
        let words = ["film.txt:", "\"Channel\" changes (\"1\", \"2\")", "a column of its own"];
        refuses(format!("Time (s);Channel;HV (V);Laser (mm)\n{rows}"), "", &words);
    }
    let noted = "Time (s);HV (kV);Note\n0;1;start\n0;3;ok\n1;4;ok\n1;6;ok\n2;5;\n2;7;ok\n";
    let recording = read(noted, "repeated=mean").expect("read");
    assert_eq!(recording.columns()[0].1, [2e3, 5e3, 6e3]);
}

/// A voltage that was logged in every fourth row.
#[test]
fn a_drive_that_is_logged_slowly_is_a_question() {
    let mut text = "Time (s);HV (V);Laser (mm)\n".to_owned();
    for k in 0..17 {
        let volts = if k % 4 == 0 { (100 * k).to_string() } else { String::new() };
        writeln!(text, "{};{volts};{k}", 0.5 * f64::from(k)).expect("written");
    }
    let error = read(&text, "").expect("read").drive().expect_err("gaps").to_string();
    has(&error, &["film.txt:3:", "`fill` hold", "`fill` linear"]);
    let filled = |how: &str| {
        let recording = read(&text, &format!("fill={how}")).expect("read");
        has(&recording.notes().join("; "), &["12 empty cells"]);
        recording.drive().expect("complete").samples().value.clone()
    };
    assert_eq!(filled("hold")[..9], [0.0, 0.0, 0.0, 0.0, 400.0, 400.0, 400.0, 400.0, 800.0]);
    assert_eq!(filled("linear"), (0..17).map(|k| f64::from(100 * k)).collect::<Vec<_>>());
    // What no way of filling knows is left out.
    for (row, empty, words) in [
        ("0;0;0", "0;;0", ["film.txt:2: HV (V) is empty", "`from` 2 and `to` 8"]),
        ("8;1600;16", "8;;16", ["film.txt: HV (V) is empty at 6.5 s", "`from` 0 and `to` 6"]),
    ] {
        let text = text.replace(&format!("\n{row}\n"), &format!("\n{empty}\n"));
        let drive = read(text, "fill=linear").expect("read").drive();
        has(&drive.expect_err("an end").to_string(), &words);
    }
}

/// Lines that are left out of a file are noted.
#[test]
fn what_is_left_out_is_noted() {
    let header = "Time (s);HV (kV);Laser (mm)";
    let numbers = rows(";", '.', usual);
    let read = |text: String, answer: &str| read(text, answer).expect("read").notes().join("; ");
    let notes = |text: String| {
        gives_the_samples(&text, "");
        read(text, "")
    };
    has(&notes(format!("{header}\n{numbers}Mean;1;2\nStd;3;4\n")), &["2 lines below the rows", "Mean;1;2"]);
    has(&notes(format!("{header}\nGain;1000;1\n{numbers}")), &["line 2", "not applied"]);
    assert_eq!(notes(format!("{header}\n{numbers}")), "");
    // A damaged row is not one of statistics.
    refuses(format!("{header}\n{numbers}3.x;1;2\n"), "", &["film.txt:26:", "\"3.x\""]);
    refuses(format!("{header}\n{numbers}4;Mean;2\n"), "", &["film.txt:26:", "\"Mean\""]);
    refuses(format!("{header}\nx;0;0\n{numbers}"), "", &["film.txt:2:", "\"x\""]);
    refuses(format!("{header}\n{numbers}Pause;;\n4;1;2\n5;1;2\n"), "", &["film.txt:26:", "\"Pause\""]);
    // A first row of gains has a time that does not fit.
    let later = rows(";", '.', |s| vec![20.0 + s.time_s, s.voltage_kv, s.laser_mm]);
    let gains = read(format!("{header}\n1;1000;0.5\n{later}"), "");
    has(&gains, &["the first row is 19 s from the next", "gains"]);
    refuses(format!("{header}\n1;1000;0.5\n{numbers}"), "", &["film.txt:3:", "goes backwards"]);
    // And so has a last row of statistics.
    let count = read(format!("{header}\n{numbers}\n24;2.2;0.6\n"), "");
    has(&count, &["the last row is 21.125 s from the next, the others are 0.125 s apart", "statistics"]);
    let book = read_fixture("split.xlsx", "").expect("read");
    has(&book.notes().join("; "), &["in the spreadsheets \"Laser\" are not read"]);
    let back = rows(";", '.', |s| vec![9.0 - s.time_s, s.voltage_kv, s.laser_mm]);
    has(&read(format!("{header}\n{back}"), "rate=8"), &["the times in \"Time (s)\" are not used"]);
}

/// A displacement that was ignored, or a size in its place, is not silent.
#[test]
fn a_response_that_is_missing_or_constant_is_reported() {
    for name in ["u (mm)", "u_mm", "u/mm", "v [mm]"] {
        let text = below(&format!("Time (s);HV (kV);{name}"), usual);
        let recording = read(&text, "").expect("read");
        assert_eq!(difference(&recording), None, "{name}");
        assert_eq!(recording.doubtful_response(), None, "{name}");
    }
    let with_laser = below("Time (s);HV (kV);u (mm);Laser (mm)", |s| vec![s.time_s, s.voltage_kv, 7.0, s.laser_mm]);
    refuses(with_laser, "", &["2 columns may be the displacement"]);
    // A displacement in letters of another encoding, or beside names of this tool.
    let mut russian = b"Time (s),HV (kV),\xd5\xee\xe4(\xec\xea\xec)\n".to_vec();
    russian.extend(rows(",", '.', usual).bytes());
    let own = below("time_s,voltage_kv,laser_mm", usual);
    for (text, name) in [(russian, ""), (own.into_bytes(), "\"laser_mm\"")] {
        let remark = read(text, "").expect("a drive").doubtful_response().expect("a remark");
        has(&remark, &["no displacement was read", name, "`columns` displacement=NUMBER:UNIT"]);
    }
    let drive = below("time_s,voltage_kv", |s| vec![s.time_s, s.voltage_kv]);
    assert_eq!(read(drive, "").expect("a drive").doubtful_response(), None);
    let size = below("Time (s);HV (kV);CH2 (mm)", |s| vec![s.time_s, s.voltage_kv, 0.5]);
    let remark = read(size, "").expect("read").doubtful_response().expect("a remark");
    has(&remark, &["the displacement is 0.0005 m in all rows", "`columns` displacement=NUMBER:UNIT"]);
    // Relaxation.
    let held = "time_s,force_n,displacement_m\n0,1,1e-3\n1,0.8,1e-3\n2,0.7,1e-3\n";
    assert_eq!(read(held, "").expect("read").doubtful_response(), None);
}

/// Numbers that fit no film, with the unit that was likely meant; in files of this tool as in others.
#[test]
fn implausible_numbers_are_reported_with_the_likely_unit() {
    let (own, lab) = ("time_s,voltage_v,displacement_m", "Time (s),HV (kV),Laser (mm)");
    let kilovolts = "time_s,voltage_kv,displacement_m";
    let millimetres = "time_s,voltage_v,displacement_mm";
    // Time in s, voltage in V, displacement in m, factor of each, and the finding.
    let cases: [(&str, [f64; 3], &[&str]); 13] = [
        (own, [1.0, 1.0, 1.0], &[]),
        (kilovolts, [1.0, 1.0, 1.0], &["6000000 V", "V in a column of kV", "`columns` voltage=2:V"]),
        (own, [1000.0, 1.0, 1.0], &["10 s apart", "ms in a column of s", "`columns` time=1:ms"]),
        (millimetres, [1.0, 1.0, 1e6], &["the stroke is", "µm in a column of mm", "`columns` displacement=3:µm"]),
        (own, [1.0, 1.0, 1e3], &["mm in a column of m?", "`columns` displacement=3:mm"]),
        (millimetres, [1.0, 1.0, 1.0], &["m in a column of mm?", "displacement=3:m"]),
        (own, [1.0, 1e-3, 1.0], &["6 V", "`columns` voltage=2*1000"]),
        (lab, [1.0, 1.0, 1e3], &["V in a column of kV", "`columns` voltage=2:V"]),
        (lab, [1e3, 1e-3, 1e3], &["ms in a column of s"]),
        (lab, [1.0, 1e-3, 1e6], &["µm in a column of mm"]),
        ("Time (s),HV (V),Laser (µm)", [1.0, 1.0, 1e3], &["mm in a column of µm?", "displacement=3:mm"]),
        ("Time (ms),HV (V),Laser (m)", [3.0, 1.0, 1.0], &["0.08997 s in all: seconds in a column of ms"]),
        ("time_ms,voltage_v,displacement_m", [1e-3, 1.0, 1.0], &["seconds in a column of ms", "`columns` time=1:s"]),
    ];
    for (header, [time, voltage, displacement], words) in cases {
        let mut text = format!("{header}\n");
        for k in 0..3000 {
            let t = 0.01 * f64::from(k);
            let phase = 1.0 - (0.5 * t).cos();
            writeln!(text, "{},{},{}", time * t, voltage * 3000.0 * phase, displacement * 0.4e-3 * phase)
                .expect("written");
        }
        let found = read(text, "").expect("read").implausible();
        assert_eq!(found.len(), usize::from(!words.is_empty()), "{header}: {found:?}");
        has(&found.join("; "), words);
    }
}
