//! Files as laboratories have them: every dialect gives the samples from which it was written.
//!
//! Text is written here; `tests/lab_files` has files of SciPy and openpyxl, with the script that wrote them.

use std::fs;
use std::path::{Path, PathBuf};

use host_io::Error;
use host_io::choice::Choice;
use host_io::files::import::{Choices, Decimal, Fill, Hints, Quantity, RepeatedTimes};
use host_io::files::recording::Recording;

/// The hints of `text`: columns as a person chooses them, or options with blanks between them.
pub fn hints(text: &str) -> Hints {
    let mut hints = Hints::default();
    if text.split_once('=').is_some_and(|(key, _)| Quantity::from_name(key).is_some()) {
        return Hints { choices: text.parse().expect(text), ..hints };
    }
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

/// A row of the samples.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    pub time_s: f64,
    pub voltage_kv: f64,
    pub laser_mm: f64,
}

pub fn samples() -> Vec<Sample> {
    let sample = |k: f64| Sample { time_s: k / 8.0, voltage_kv: 0.0125 * k * k, laser_mm: 0.05 + 0.003 * k * k };
    (0..24).map(f64::from).map(sample).collect()
}

/// Writes the rows: the numbers of `columns` between `separator`, with the `decimal` sign.
pub fn rows(separator: &str, decimal: char, columns: impl Fn(&Sample) -> Vec<f64>) -> String {
    let mut text = String::new();
    for sample in samples() {
        let cells: Vec<String> =
            columns(&sample).iter().map(|value| value.to_string().replace('.', &decimal.to_string())).collect();
        text += &cells.join(separator);
        text += "\n";
    }
    text
}

/// A file of the samples: the `header`, and below it the numbers of `columns`, separated as the names are.
pub fn below(header: &str, columns: impl Fn(&Sample) -> Vec<f64>) -> String {
    let names = header.lines().last().unwrap_or_default();
    let separator = [";", "\t"].into_iter().find(|sign| names.contains(sign)).unwrap_or(",");
    format!("{header}\n{}", rows(separator, '.', columns))
}

/// s, kV, mm.
pub fn usual(sample: &Sample) -> Vec<f64> {
    vec![sample.time_s, sample.voltage_kv, sample.laser_mm]
}

pub fn utf_16(text: &str, little: bool) -> Vec<u8> {
    text.encode_utf16().flat_map(|unit| if little { unit.to_le_bytes() } else { unit.to_be_bytes() }).collect()
}

pub fn latin_1(text: &str) -> Vec<u8> {
    text.chars().map(|c| u8::try_from(u32::from(c)).expect("Latin-1")).collect()
}

/// First difference from the samples, if there is one.
pub fn difference(recording: &Recording) -> Option<String> {
    let close = |read: f64, written: f64| (read - written).abs() <= 1e-12 * written.abs();
    let samples = samples();
    let columns = recording.columns();
    let column = |wanted: &str| columns.iter().find(|(name, _)| *name == wanted).map(|(_, values)| values);
    if recording.time_s().len() != samples.len() {
        return Some(format!("{} rows", recording.time_s().len()));
    }
    let (Some(voltage), Some(displacement)) = (column("voltage_v"), column("displacement_m")) else {
        return Some("no voltage, or no displacement".into());
    };
    let differs = |(k, sample): (usize, &Sample)| {
        let read = [recording.time_s()[k], voltage[k], displacement[k]];
        let written = [sample.time_s, 1e3 * sample.voltage_kv, 1e-3 * sample.laser_mm];
        let is_same = read.iter().zip(written).all(|(read, written)| close(*read, written));
        (!is_same).then(|| format!("row {k}: {read:?} instead of {written:?}"))
    };
    samples.iter().enumerate().find_map(differs)
}

thread_local! {
    /// Where the files of a test are.
    static FOLDER: tempfile::TempDir = tempfile::tempdir().expect("a folder");
}

/// Writes a file.
pub fn save(name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = FOLDER.with(|folder| folder.path().join(name));
    fs::write(&path, content).expect("written");
    path
}

/// Reads a file with an answer, which [`hints`] understands.
pub fn read(content: impl AsRef<[u8]>, answer: &str) -> Result<Recording, Error> {
    Recording::read_with(&save("film.txt", content), &hints(answer))
}

/// Asserts that a file is read as the samples.
pub fn gives_the_samples(content: impl AsRef<[u8]>, answer: &str) {
    let begin: String = String::from_utf8_lossy(content.as_ref()).chars().take(200).collect();
    let recording = read(content, answer).unwrap_or_else(|error| panic!("{error}: {begin}"));
    assert_eq!(difference(&recording), None, "{begin}");
}

/// The error of a file that must be refused, on one line that names the file.
pub fn refused(content: impl AsRef<[u8]>, answer: &str) -> String {
    let error = read(content, answer).expect_err("refused").to_string();
    assert!(error.contains("film.txt") && error.lines().count() == 1 && error.len() < 600, "{error}");
    println!("{error}");
    error
}

/// Asserts that a file is refused so, in these `words`.
pub fn refuses(content: impl AsRef<[u8]>, answer: &str, words: &[&str]) {
    has(&refused(content, answer), words);
}

pub fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/lab_files").join(name)
}

/// Reads a file of `tests/lab_files`.
pub fn read_fixture(name: &str, answer: &str) -> Result<Recording, Error> {
    Recording::read_with(&fixture(name), &hints(answer))
}

pub fn has(error: &str, words: &[&str]) {
    for word in words {
        assert!(error.contains(word), "{word:?} is missing in: {error}");
    }
}

/// A comment between the rows may say that they change: it is no part of what is read.
#[test]
fn comments_between_the_rows_are_noted() {
    let table = below("# rig 7\nTime (s),U (kV),Laser (mm)", usual);
    let (above, below) = table.split_at(table.match_indices('\n').nth(20).expect("rows").0 + 1);
    let notes = |text: String| read(text, "").expect("read").notes().join("; ");
    has(
        &notes(format!("{above}# now in V\n{below}")),
        &["left out: the comment \"# now in V\" between the rows, in line 22"],
    );
    has(
        &notes(format!("{above}# a\n% b\n{below}")),
        &["left out: the comment \"# a\" between the rows, in line 22, and 1 more"],
    );
    for none in [table.clone(), format!("{table}# end\n")] {
        assert_eq!(notes(none), "");
    }
}

/// Inches are in brackets or written out: the word `in` names no unit.
#[test]
fn in_is_an_inch_in_brackets_alone() {
    let table = |header: &str| {
        format!("Time (s),U (kV),{header}\n{}", rows(",", '.', |s| vec![s.time_s, s.voltage_kv, s.laser_mm / 25.4]))
    };
    for header in ["Laser (in)", "Laser inch", "Laser [inches]"] {
        gives_the_samples(table(header), "");
    }
    refuses(table("Laser in"), "", &["\"Laser in\" has no unit"]);
    let read = read(table("Channel in"), "").expect("read");
    assert_eq!(read.understood().expect("a file").ignored, ["Channel in"]);
}

/// Every encoding of text.
#[test]
fn text_of_every_encoding_gives_the_samples() {
    let german = format!(
        "Zeit [s];Spannung [kV];Länge µ;Laser [mm]\n{}",
        rows(";", ',', |s| vec![s.time_s, s.voltage_kv, 3.5, s.laser_mm])
    );
    let micrometres = |s: &Sample| vec![s.time_s, s.voltage_kv, s.laser_mm * 1e3];
    let gbk = b"\xca\xb1\xbc\xe4(s),\xb5\xe7\xd1\xb9(kV),\xce\xbb\xd2\xc6(mm)\n";
    let shift_jis = b"\x8e\x9e\x8a\xd4(s),\x93\x64\x88\xb3(kV),\x95\xcf\x88\xca(\x83\xcam)\n";
    let own_unit = format!("Zeit (s)\tU (kV)\tLaser (µm)\n{}", rows("\t", ',', micrometres));
    // As the cells of a spreadsheet are handed on.
    let of_day = |s: &Sample| format!("@0 {};{};{}\n", (86398.5 + s.time_s) % 86400.0, s.voltage_kv, s.laser_mm);
    let of_days: String = samples().iter().map(of_day).collect();
    for (name, content) in [
        ("times of day across midnight", format!("Time;HV (kV);Laser (mm)\n{of_days}").into_bytes()),
        ("UTF-8 with a mark", [b"\xef\xbb\xbf".as_slice(), german.as_bytes()].concat()),
        ("UTF-16 LE with a mark", [b"\xff\xfe".as_slice(), &utf_16(&german, true)].concat()),
        ("UTF-16 BE with a mark", [b"\xfe\xff".as_slice(), &utf_16(&german, false)].concat()),
        ("UTF-16 LE", utf_16(&german, true)),
        ("UTF-16 BE", utf_16(&german, false)),
        ("Latin-1", latin_1(&german)),
        ("Latin-1 with a unit of its own", latin_1(&own_unit)),
        ("GBK", [gbk, rows(",", '.', usual).as_bytes()].concat()),
        ("Shift_JIS", [shift_jis, rows(",", '.', micrometres).as_bytes()].concat()),
    ] {
        println!("{name}");
        gives_the_samples(content, "");
    }
}

/// Files of other programs: SciPy, compressed or not, and openpyxl.
#[test]
fn files_of_matlab_and_spreadsheets_give_the_samples() {
    for (name, columns) in [
        ("vectors.mat", ""),
        ("compressed.mat", ""),
        ("version-4.mat", ""),
        ("version-7.3.mat", ""),
        ("integers-7.3.mat", ""),
        ("matrix-7.3.mat", "time=1:s,voltage=2:kV,displacement=3:mm"),
        ("dates.xlsx", ""),
        ("structure.mat", ""),
        ("bare-names.mat", "time=t:s,voltage=V:V,displacement=x:mm"),
        ("matrix.mat", "time=1:s,voltage=2:kV,displacement=3:mm"),
        ("rows.mat", "time=1:s,voltage=2:kV,displacement=3:mm"),
        ("two-voltages.mat", "voltage=voltage_kV"),
    ] {
        assert_eq!(difference(&read_fixture(name, columns).expect(name)), None, "{name}");
    }
    let rows = read_fixture("rows.mat", "time=1:s,voltage=2:kV,displacement=3:mm").expect("read");
    assert_eq!(rows.notes(), ["phase is complex or sparse and is not read"]);
    has(&read_fixture("rows.mat", "displacement=4:mm").expect_err("complex").to_string(), &["phase is complex"]);
    // Single precision is what this file has.
    let recording = read_fixture("integers.mat", "").expect("read");
    let voltage = &recording.columns()[0].1;
    for (read, sample) in voltage.iter().zip(samples()) {
        assert_eq!(*read, f64::from((1e3 * sample.voltage_kv) as f32));
    }
    // One reading is missing in the sheet.
    let recording = read_fixture("workbook.xlsx", "").expect("read");
    let displacement = recording.displacement().expect("a laser");
    assert_eq!((displacement.value.len(), recording.time_s().len()), (23, 24));
    for (time, value) in displacement.time_s.iter().zip(&displacement.value) {
        let sample = samples().into_iter().find(|sample| sample.time_s == *time).expect("a row");
        assert!((value - 1e-3 * sample.laser_mm).abs() <= 1e-12 * value);
    }
    let sheet = |name: &str| Hints { sheet: Some(name.into()), ..Hints::default() };
    let chosen = Recording::read_with(&fixture("two-runs.xlsx"), &sheet("Run 4")).expect("chosen");
    assert_eq!(chosen.displacement().expect("a laser"), displacement);
    let error = Recording::read_with(&fixture("two-runs.xlsx"), &sheet("Run 5")).expect_err("not there").to_string();
    has(&error, &["Run 5", "Run 3, Notes, Run 4"]);
}

/// A file that may be read in two ways is an error that shows both.
#[test]
fn two_readings_are_an_error_that_shows_both() {
    let voltages = |s: &Sample| vec![s.time_s, s.voltage_kv, s.voltage_kv, s.laser_mm];
    let two = below("Time (s),HV set (kV),HV mon (kV),Laser (mm)", voltages);
    refuses(&two, "", &["film.txt:1:", "HV set (kV)", "HV mon (kV)", "`columns` voltage="]);
    gives_the_samples(&two, "voltage=3");
    gives_the_samples(&two, "voltage=HV mon");
    let thousands = "Time (s);Voltage (V);Laser (mm)\n1,000;1,234;2,500\n2,000;2,345;2,600\n3,000;3,456;2,700\n";
    refuses(thousands, "", &["1.234", "1234", "two ways"]);
    let bare = below("Time,Voltage,Laser", usual);
    refuses(&bare, "", &["\"Time\" has no unit", "s, ms", "`columns` time=1:s"]);
    gives_the_samples(&bare, "time=Time:s,voltage=2*1000,displacement=Laser:mm");
    refuses(bare.replace("Time,Voltage", "Time (s),U (MV)"), "", &["milli or mega"]);
    for (name, words) in [
        ("two-voltages.mat", &["voltage_kV", "hv_set_kV", "voltage="][..]),
        ("bare-names.mat", &["\"t\" has no unit"]),
        ("two-runs.xlsx", &["Run 3", "Run 4", "`sheet`"]),
        ("texts.xlsx", &["\"Laser (mm)\"", "two ways", "`decimal`"]),
    ] {
        has(&read_fixture(name, "").expect_err(name).to_string(), words);
    }
    // French in Latin-1 and Chinese in GBK: each encoding knows another column.
    let mut both = b"Time (s),U (kV),D\xe9placement (mm),\xce\xbb\xd2\xc6(mm)\n".to_vec();
    both.extend(rows(",", '.', |s| vec![s.time_s, s.voltage_kv, s.laser_mm, 7.0]).bytes());
    refuses(&both, "", &["2 columns may be the displacement", "displacement=3 or", "displacement=4"]);
    gives_the_samples(&both, "displacement=3");
    // The micro sign of Latin-1 is half a letter in GBK, where the force is not known.
    let mut both = b"Time (s),U (kV),Laser (mm),Kraft (\xb5N)\n".to_vec();
    both.extend(rows(",", '.', |s| vec![s.time_s, s.voltage_kv, s.laser_mm, 7.0]).bytes());
    let recording = read(&both, "").expect("one encoding knows more");
    assert_eq!(recording.force().expect("a force").value, [7e-6; 24]);
}

/// Chosen columns: names, numbers, units, factors, quantities left out.
#[test]
fn columns_are_chosen_by_name_number_unit_and_factor() {
    let file = format!(
        "Zeit;HV mon;Laser (V);F [mN]\n{}",
        rows(";", ',', |s| vec![s.time_s, s.voltage_kv, s.laser_mm, 250.0])
    );
    let chosen = "time=Zeit:s,voltage=\"HV mon\"*1000,displacement=3*0.001";
    let recording = read(&file, chosen).expect("chosen");
    assert_eq!(difference(&recording), None);
    assert_eq!(recording.force().expect("by its name").value, vec![0.25; 24]);
    assert!(read(&file, &format!("{chosen},force=none")).expect("chosen").force().is_none());
    let headless = rows("\t", '.', usual);
    gives_the_samples(&headless, "time=1:s,voltage=2:kV,displacement=3:mm");
    refuses(&headless, "", &["no header", "`columns` time=1:s"]);
    refuses(&file, "voltage=9:V", &["voltage=9", "4 columns"]);
    refuses(&file, "voltage=Monitor", &["\"Monitor\"", "HV mon"]);
    refuses(&file, "time=Zeit", &["Zeit", "no unit"]);
    refuses(&file, "time=Zeit:s,voltage=2*1000", &["Laser (V)", "not one of m", "displacement=3*0.001"]);
    // What contradicts the header.
    let plain = below("Time (s);HV (kV);Laser_temp (°C);Weg (mm)", |s| vec![s.time_s, s.voltage_kv, 20.0, s.laser_mm]);
    refuses(&plain, "displacement=Laser:mm", &["no column \"Laser\"", "3 \"Laser_temp (°C)\""]);
    refuses(&plain, "voltage=2,displacement=2:mm*1", &["2 \"HV (kV)\" is both voltage and displacement"]);
    refuses(&plain, "voltage=4:kV", &["4 \"Weg (mm)\"", "not one of V, kV or mV", "voltage=4:kV*1"]);
    gives_the_samples(&plain, "time=time,voltage=hv,displacement=Weg");
    let notes = |answer: &str| read(&plain, answer).expect("read").notes().join("; ");
    has(&notes("rate=8 columns=voltage=2"), &["the times in \"Time (s)\" are not used", "`rate_hz`"]);
    assert_eq!(notes("rate=8 columns=time=none"), "");
    for (columns, word) in [
        ("volts=1", "not one of time, voltage"),
        ("voltage", "quantity=column"),
        ("voltage=2:mm", "not a unit of voltage"),
        ("voltage=2*much", "not a factor"),
        ("voltage=0", "from 1"),
        ("voltage=1,voltage=2", "twice"),
        ("voltage=\"HV", "quote"),
    ] {
        has(&columns.parse::<Choices>().expect_err(columns), &[word]);
    }
}

/// The same values as `0,5,1,5` in a file separated by commas shift every value: refused, whatever the names are.
#[test]
fn rows_with_more_cells_than_the_header_are_refused() {
    let shifted = rows(",", ',', usual);
    for header in ["time_s,voltage_kv,displacement_mm", "Time (s),U (kV),Laser (mm)"] {
        let words = ["film.txt:", "header of 3", "decimal comma", "semicolons"];
        refuses(format!("{header}\n{shifted}"), "", &words);
    }
    // So do commas between thousands where the last column is empty elsewhere.
    let header = "Time (s),HV (V),Laser (µm),Temp (°C),Note";
    let thousands = format!("{header}\n0.0,900.0,10.1,22.1,\n0.1,1,036.5,14.2,22.1\n0.2,950.0,11.0,22.1,\n");
    refuses(&thousands, "", &["film.txt: line 3: ", "thousands", "quotes"]);
    let numbers = format!("{header}\n0,900,10.1,22.1,\n1,100,14.2,22.1,7\n2,950,11.0,22.1,\n3,300,11.0,22.1,\n");
    assert_eq!(read(numbers, "").expect("no thousands").time_s(), [0.0, 1.0, 2.0, 3.0]);
    // An empty cell between blanks shifts the cells behind it, and the last column is of no use here.
    let fixed = rows("  ", '.', |s| vec![s.time_s, s.voltage_kv, s.laser_mm, 7.0]);
    let missing = format!("Time_s HV_kV Laser_mm Note\n{}", fixed.replacen("  0.0125  ", "          ", 1));
    refuses(missing, "", &["film.txt:3:", "3 cells below 4 columns", "NaN"]);
    // A separator at the end of a row shifts nothing.
    let recording = read("time_s,voltage_v,displacement_m\n0,0,0,\n1,5,2e-3,\n", "").expect("as ever");
    assert_eq!(recording.displacement().expect("there").value, [0.0, 2e-3]);
}

/// A recording whose displacement has a name of its own: it is ignored, and the error says what to do.
#[test]
fn a_recording_with_another_displacement_says_how_to_name_it() {
    let text = below("time_s,voltage_kv,Laser (mm)", usual);
    let error = read(&text, "").expect("a drive").displacement().expect_err("ignored").to_string();
    has(&error, &["film.txt", "displacement_mm", "`columns` displacement=3:mm"]);
    gives_the_samples(&text, "displacement=3:mm");
}

/// Columns with the names of recordings are read to the bit as by the reader of recordings, and others are ignored.
#[test]
fn names_of_recordings_are_read_unchanged() {
    let text = below("time_s,voltage_kv,displacement_mm,Laser (mm),HV (kV)", |s| {
        vec![s.time_s, s.voltage_kv, s.laser_mm, 99.0, 99.0]
    });
    let recording = read(&text, "").expect("read");
    assert!(recording.understood().is_none());
    let again = Recording::from_csv(recording.path(), text.as_bytes()).expect("read");
    assert_eq!(recording, again);
    for ((read, sample), voltage) in
        recording.displacement().expect("there").value.iter().zip(samples()).zip(&recording.columns()[0].1)
    {
        assert_eq!(*read, sample.laser_mm.to_string().parse::<f64>().expect("a number") * 1e-3);
        assert_eq!(*voltage, sample.voltage_kv.to_string().parse::<f64>().expect("a number") * 1e3);
    }
}
